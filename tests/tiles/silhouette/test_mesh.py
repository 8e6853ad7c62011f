"""Triangulations of silhouettes, maps freed of folds, and outlines sampled for a search."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from awkward import NOT_SIMPLE, STRANGE
from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_array
from orbiflow.tiles import LikenessSearch, Target, orient, resampled, ring_length, signed_area
from orbiflow.tiles.search import Goal
from orbiflow.tiles.search.co_deformation import BODIES
from orbiflow.tiles.silhouette import (
    CORNER_DEPTH,
    SilhouetteMesh,
    important_vertices,
    sampled,
    triangulate,
    unfolded,
    with_corners,
)
from orbiflow.tiles.silhouette.bending import _Distortion
from orbiflow.tiles.silhouette.outlines import MAX_POINTS, MIN_POINTS
from outlines import ANIMALS, SHAPES, animal, comb, disc, dumbbell, slit_square, star, unit
from refusals import refused
from strategies import dyadic_rings, seeds

HARD: dict[str, Array] = {
    **SHAPES,
    **{name: np.asarray(animal(name).normal) for name in ANIMALS},
    "hair": unit(dumbbell(1e-3, 2.0)),
    "hair slit": slit_square(1e-3, 0.9),
    "fine comb": resampled(unit(comb(12, 0.03, 0.02, 1.0)), 480),
    "needle star": star(12, 0.1),
    "circle of 20,000, resampled": resampled(disc(20_000), 480),
    "twenty in line": np.concatenate([np.linspace([0, 0], [1, 0], 20), [[0.5, 1.5]]]),
}


def assert_fills(mesh: SilhouetteMesh, ring: Array) -> None:
    """All that a mesh promises."""
    n, outline = len(ring), mesh.size + len(mesh.sides)
    area = signed_area(ring)
    assert mesh.size == n
    assert np.array_equal(mesh.points[:n], ring)
    assert np.array_equal(np.unique(mesh.triangles), np.arange(len(mesh.points)))
    corners = mesh.points[mesh.triangles]
    assert (signed_area(corners) > 0).all()
    assert abs(signed_area(corners).sum() - area) < 1e-12 * max(1, area)
    # points on sides lie there
    start, end = ring[mesh.sides], ring[(mesh.sides + 1) % n]
    assert ((mesh.shares > 0) & (mesh.shares < 1)).all()
    on_side = start + mesh.shares[:, None] * (end - start)
    assert np.abs(mesh.points[n:outline] - on_side).max(initial=0) < 1e-12 * max(1, area)
    # each directed side is one triangle's; those without a partner run round the outline
    t = mesh.triangles
    directed = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    codes = directed[:, 0] * len(mesh.points) + directed[:, 1]
    assert len(np.unique(codes)) == len(codes)
    partners = directed[:, 1] * len(mesh.points) + directed[:, 0]
    free = directed[~np.isin(partners, codes)]
    place = np.concatenate([np.arange(n), mesh.sides + mesh.shares])
    order = np.argsort(place)
    expected = np.stack([order, np.roll(order, -1)], axis=1)
    assert set(map(tuple, free.tolist())) == set(map(tuple, expected.tolist()))
    # every triangle can follow the outline: no chords
    inner = directed[np.isin(partners, codes)]
    assert not (inner < outline).all(axis=1).any()
    assert not (t < outline).all(axis=1).any()


@pytest.mark.parametrize("name", HARD)
def test_triangles_fill_the_polygon(name: str) -> None:
    ring = HARD[name]
    mesh = triangulate(ring)
    assert_fills(mesh, ring)
    pieces = np.asarray(shapely.polygons(mesh.points[mesh.triangles]))
    assert shapely.covers(shapely.Polygon(ring).buffer(1e-9), pieces).all()


@given(dyadic_rings())
def test_finer_inside_where_asked(ring: Array) -> None:
    ring = unit(orient(ring))
    coarse, fine = triangulate(ring, 0.4), triangulate(ring, 0.08)
    assert_fills(coarse, ring)
    assert_fills(fine, ring)
    assert len(fine.points) > len(coarse.points)


@pytest.mark.parametrize("name", sorted(STRANGE))
def test_strange_polygons(name: str) -> None:
    ring = unit(orient(as_array(STRANGE[name], "the ring", ("N", 2))))
    assert_fills(triangulate(ring), ring)


@pytest.mark.parametrize("name", sorted(NOT_SIMPLE))
def test_what_crosses_itself_is_refused(name: str) -> None:
    with refused("polygon"):
        triangulate(np.array(NOT_SIMPLE[name], dtype=np.float64))


@given(dyadic_rings(), st.data())
def test_a_point_twice_is_refused(ring: Array, data: st.DataObject) -> None:
    place = data.draw(st.integers(0, len(ring) - 1))
    with refused("twice"):
        triangulate(np.insert(unit(orient(ring)), place, unit(orient(ring))[place], axis=0))


MESHES: dict[str, SilhouetteMesh] = {
    name: triangulate(ring)
    for name, ring in {
        "disc": disc(48),
        "star": SHAPES["star"],
        "comb": SHAPES["comb"],
        **{name: np.asarray(animal(name).normal) for name in ANIMALS[:2]},
    }.items()
}


def outline(mesh: SilhouetteMesh) -> int:
    return mesh.size + len(mesh.sides)


def shuffled(mesh: SilhouetteMesh, seed: int, share: float) -> Array:
    """Points inside put elsewhere inside the bounding box, the outline left."""
    rng = np.random.default_rng(seed)
    images = mesh.points.copy()
    inner = len(images) - outline(mesh)
    low, high = images.min(axis=0), images.max(axis=0)
    moved = rng.random(inner) < share
    images[outline(mesh) :][moved] = rng.uniform(low, high, (inner, 2))[moved]
    return images


@pytest.mark.parametrize("name", MESHES)
@settings(max_examples=4)
@given(seed=seeds, share=st.floats(0.05, 1.0))
def test_any_placing_of_the_inner_points_is_untangled(name: str, seed: int, share: float) -> None:
    mesh = MESHES[name]
    images = shuffled(mesh, seed, share)
    found = unfolded(mesh, images)
    assert (signed_area(found[mesh.triangles]) > 0).all()
    assert (signed_area(found[mesh.triangles]) > 0).all()
    assert np.array_equal(found[: outline(mesh)], images[: outline(mesh)])
    assert (
        abs(signed_area(found[mesh.triangles]).sum() - signed_area(mesh.points[: mesh.size])) < 1e-9
    )


@pytest.mark.parametrize("name", MESHES)
def test_nothing_moves_where_nothing_is_folded(name: str) -> None:
    mesh = MESHES[name]
    images = mesh.points @ [[1.0, 0.2], [0.5, 2.0]]
    assert unfolded(mesh, images) is images


@given(seeds)
def test_an_outline_that_moves(seed: int) -> None:
    """A disc's outline on a wavy one: the inside follows."""
    mesh = MESHES["disc"]
    rng = np.random.default_rng(seed)
    images = mesh.points.copy()
    turns = np.arctan2(*images[: outline(mesh)].T[::-1])
    a, b = rng.uniform(-0.25, 0.25, 2)
    images[: outline(mesh)] *= (1 + a * np.cos(3 * turns) + b * np.sin(2 * turns))[:, None]
    images[outline(mesh) :] += rng.normal(size=(len(images) - outline(mesh), 2)) * 0.1
    assert (signed_area(unfolded(mesh, images)[mesh.triangles]) > 0).all()


@given(seeds, st.floats(0.02, 1.0))
def test_gradient(seed: int, epsilon: float) -> None:
    mesh = MESHES["star"]
    work = _Distortion(mesh, shuffled(mesh, seed, 0.3))
    work.epsilon = epsilon
    rng = np.random.default_rng(seed)
    x = work.start + 0.01 * rng.normal(size=len(work.start))
    way = rng.normal(size=len(x))
    way /= np.linalg.norm(way)
    step = 1e-6 * epsilon
    slope = (work.value(x + step * way)[0] - work.value(x - step * way)[0]) / (2 * step)
    value, gradient = work.value(x)
    assert gradient @ way == pytest.approx(slope, rel=1e-4, abs=1e-5 * value)


def test_determinants_far_above_and_below_the_bound() -> None:
    mesh = MESHES["disc"]
    work = _Distortion(mesh, shuffled(mesh, 1, 1.0))
    work.epsilon = 1e-12
    value, gradient = work.value(work.start)
    assert np.isfinite(value)
    assert np.isfinite(gradient).all()


def test_an_outline_turned_over_is_refused() -> None:
    mesh = MESHES["disc"]
    with refused("silhouette"):
        unfolded(mesh, mesh.points * (1.0, -1.0))


RINGS: dict[str, Array] = {
    **SHAPES,
    **{name: np.asarray(animal(name).normal) for name in ANIMALS},
    "circle of 20,000": disc(20_000),
}
phases = st.floats(0, 1, exclude_max=True)
THICK = [name for name in RINGS if name not in ("slit", "crescent")]


def spacing(ring: Array, count: int) -> float:
    return ring_length(ring) / count


@pytest.mark.parametrize("name", THICK)
@settings(max_examples=5)
@given(phase=phases)
def test_coarse_and_fine_points_go_together(name: str, phase: float) -> None:
    ring = RINGS[name]
    coarse, middle, fine = sampled(ring, phase)
    assert MIN_POINTS <= len(coarse) <= MAX_POINTS
    assert shapely.Polygon(coarse).is_valid
    for points in (middle, fine):
        multiple = len(points) // len(coarse)
        assert len(points) == multiple * len(coarse)
        assert len(fine) % len(points) == 0
        assert shapely.Polygon(points).is_valid
        apart = np.linalg.norm(points[::multiple] - coarse, axis=1)
        assert apart.max() <= 0.5 * spacing(ring, len(points)) + 1e-9


@pytest.mark.parametrize("name", THICK)
@settings(max_examples=3)
@given(phase=phases)
def test_corners_stay_where_they_are(name: str, phase: float) -> None:
    ring = RINGS[name]
    fine = sampled(ring, phase).fine
    step = spacing(ring, len(fine))
    corners = ring[important_vertices(ring, CORNER_DEPTH)]
    apart = np.linalg.norm(fine[:, None] - corners[None], axis=2).min(axis=0)
    # two corners nearest to one point: the first is kept
    near = np.linalg.norm(np.roll(corners, 1, axis=0) - corners, axis=1) < 1.01 * step
    near |= np.roll(near, -1)
    assert apart[~near].max() < 1e-12
    assert apart.max() < step


@given(seeds, st.integers(3, 40), st.integers(0, 4), phases)
def test_points_stay_within_a_spacing(seed: int, count: int, more: int, phase: float) -> None:
    ring = RINGS["squirrel.dat"]
    rng = np.random.default_rng(seed)
    corners = sorted(rng.choice(len(ring), rng.integers(0, 12), replace=False).tolist())
    points = with_corners(ring, corners, count * (more + 1), phase)
    even = resampled(ring, len(points), phase)
    assert points.shape == even.shape
    assert np.linalg.norm(points - even, axis=1).max() <= spacing(ring, len(points))
    if not corners:
        assert np.array_equal(points, even)


def test_simplification_keeps_what_stands_out() -> None:
    square = resampled(SHAPES["square"], 400)
    assert len(important_vertices(square, CORNER_DEPTH)) == 4
    every = important_vertices(np.asarray(animal("squirrel.dat").normal), 0.0)
    assert every == sorted(set(every))
    assert 50 < len(every) <= 60


@pytest.mark.parametrize("seed", [0, 5])
def test_the_mirror_image_is_read_backwards(seed: int) -> None:
    own, other = LikenessSearch(seed=seed, multiples=(4,)).orientations(
        Goal(animal("squirrel.dat"))
    )
    assert (own.mirrored, other.mirrored) == (False, True)
    for mine, theirs in zip(own.samples, other.samples, strict=True):
        assert np.array_equal(theirs[0], mine[0] * (1, -1))
        assert np.array_equal(theirs[1:], mine[:0:-1] * (1, -1))
        assert shapely.LinearRing(theirs).is_ccw
    coarse, _, fine = other.samples
    apart = np.linalg.norm(fine[:: len(fine) // len(coarse)] - coarse, axis=1)
    assert apart.max() <= spacing(fine, len(fine))


@pytest.mark.parametrize(
    "ring",
    [unit(dumbbell(width, 2.0)) for width in (1e-2, 1e-3, 1e-4, 1e-6)]
    + [slit_square(width, 0.9) for width in (1e-2, 1e-3, 1e-6)]
    + [unit(comb(8, width, 0.2, 2.0)) for width in (1e-2, 1e-3)]
    + [SHAPES["crescent"]],
)
def test_hairs_give_bodies_or_a_reason(ring: Array) -> None:
    said = ""
    try:
        both = LikenessSearch(multiples=(4,)).orientations(Goal(Target.from_polygon(ring)))
    except OrbiflowError as error:
        both, said = (), str(error)
    assert not said or "too thin" in said or "too ragged" in said
    for side in both:
        for points, body in zip(side.samples, side.bodies(BODIES["firm"]), strict=True):
            assert shapely.Polygon(points).is_valid
            assert body.size == len(points)
