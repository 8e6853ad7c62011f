"""Outlines sampled for the search and for the tile."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles import LikenessSearch, Target, resampled, ring_length
from orbiflow.tiles.search import Goal
from orbiflow.tiles.search.co_deformation import BODIES
from orbiflow.tiles.silhouette import CORNER_DEPTH, important_vertices, sampled, with_corners
from orbiflow.tiles.silhouette.outlines import MAX_POINTS, MIN_POINTS
from outlines import ANIMALS, SHAPES, animal, comb, disc, dumbbell, slit_square, unit
from strategies import seeds

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
@settings(max_examples=5)
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
