"""Projections of the sphere, and the surfaces on which spaces are drawn."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.density import KleinBottle, PlotSettings, ProjectivePlane, Sphere, Torus, to_vectors
from orbiflow.density.pictures import immersion, viewpoint
from orbiflow.density.pictures.maps import Map, meridian, parallel
from orbiflow.density.pictures.projections import (
    Azimuthal,
    EqualEarth,
    Lambert,
    Mollweide,
    PlateCarree,
    Projection,
    Stereographic,
    WorldMap,
    chosen_map,
    refined,
)
from orbiflow.density.pictures.surfaces import EYE, boy_surface, mesh, normals
from refusals import refused
from strategies import random_orthogonal, seeds

NOTHING = torch.empty(0, 2)
longitudes = st.floats(-180, 180)
latitudes = st.floats(-90, 90)
centers = st.tuples(latitudes, longitudes)
worlds = st.builds(
    lambda kind, lon: kind((0.0, lon)),
    st.sampled_from([EqualEarth, Mollweide, PlateCarree]),
    longitudes,
)
discs = st.builds(
    lambda kind, center, radius, flipped: kind(center, radius, flipped),
    st.sampled_from([Lambert, Stereographic]),
    centers,
    st.floats(1, 90),
    st.booleans(),
)
maps = st.one_of(worlds, discs)


def directions(count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    lat = np.degrees(np.arcsin(rng.uniform(-1, 1, count)))
    return np.stack([lat, rng.uniform(-180, 180, count)], axis=-1)


def area(ring: np.ndarray) -> float:
    x, y = ring.T
    return float(x[:-1] @ y[1:] - x[1:] @ y[:-1]) / 2


@given(maps, st.integers(0, 99))
def test_back_from_the_map(projection: Projection, seed: int) -> None:
    points = directions(200, seed)
    points = np.concatenate([points[projection.contains(points)], [projection.center]])
    back = projection.inverse(projection.forward(points))
    assert np.abs(to_vectors(back) - to_vectors(points)).max() < 1e-9


@given(maps, centers, st.floats(0, 2 * math.pi))
def test_equal_areas_are_equal_and_others_as_they_should_be(
    projection: Projection, at: tuple[float, float], turn: float
) -> None:
    """The Jacobian's determinant by central differences, over the area of the sphere."""
    lat, lon = at
    if abs(lat) > 85:  # longitudes are no coordinates there
        lat = 60.0
    if isinstance(projection, Azimuthal):
        lat = float(
            np.clip(projection.center[0] + 0.3 * projection.radius * math.sin(turn), -85, 85)
        )
        lon = projection.center[1] + 0.3 * projection.radius * math.cos(turn)
    elif abs((lon - projection.center[1] + 180) % 360 - 180) > 179:
        lon = projection.center[1]
    step = 1e-4
    ends = [[lat + step, lon], [lat - step, lon], [lat, lon + step], [lat, lon - step]]
    # the central difference in degrees, in radians of latitude and of longitude
    up, down, right, left = projection.forward(np.array(ends))
    jacobian = np.stack([right - left, up - down]) / (2 * math.radians(step))
    scale = np.linalg.det(jacobian) / math.cos(math.radians(lat))
    wanted = 1.0
    if isinstance(projection, PlateCarree):
        wanted = 1 / math.cos(math.radians(lat))
    elif isinstance(projection, Stereographic):
        cosine = float(to_vectors([[lat, (lon + 180) % 360 - 180]])[0] @ projection.frame[2])
        wanted = (2 / (1 + cosine)) ** 2
    if isinstance(projection, Azimuthal) and projection.flipped:
        wanted = -wanted
    assert scale == pytest.approx(wanted, rel=1e-5)
    if not isinstance(projection, Stereographic | PlateCarree):
        assert abs(wanted) == 1.0


@given(discs)
def test_stereographic_circles_and_equal_area_caps(projection: Azimuthal) -> None:
    cap = 2 * math.pi * (1 - math.cos(math.radians(projection.radius)))
    if not isinstance(projection, Stereographic | PlateCarree):
        assert math.pi * projection.rim**2 == pytest.approx(cap)
    ring = projection.outline()
    assert np.allclose(np.hypot(*ring.T), projection.rim)


@given(worlds, st.lists(centers, min_size=2, max_size=8))
def test_lines_are_cut_at_the_antimeridian(projection: WorldMap, line: Any) -> None:
    """No piece jumps across the map, and each cut ends at both sides at one latitude."""
    pieces = projection.pieces(np.array(line))
    longest = max((np.abs(np.diff(p[:, 0])).max() for p in pieces), default=0.0)
    assert longest < 0.5  # of maps some 5.5 wide
    for one, other in pairwise(pieces):
        assert one[-1, 1] == pytest.approx(other[0, 1], abs=1e-9)
        assert one[-1, 0] == pytest.approx(-other[0, 0], abs=1e-9)


def test_a_parallel_and_a_line_over_the_date_line() -> None:
    (whole,) = PlateCarree().pieces(parallel(10.0))
    assert np.ptp(whole[:, 0]) == pytest.approx(2 * math.pi)
    first, second = PlateCarree().pieces(np.array([[0.0, 170.0], [10.0, -170.0]]))
    np.testing.assert_allclose(np.degrees(first[-1]), (180.0, 5.0))
    np.testing.assert_allclose(np.degrees(second[0]), (-180.0, 5.0))
    assert len(PlateCarree((0.0, 180.0)).pieces(np.array([[0.0, 170.0], [10.0, -170.0]]))) == 1


@given(discs, st.lists(centers, min_size=2, max_size=8))
def test_lines_end_at_the_rim(projection: Azimuthal, line: Any) -> None:
    inside = projection.contains(refined(np.array(line)))
    for piece in projection.pieces(np.array(line)):
        assert np.hypot(*piece.T).max() < projection.rim * (1 + 1e-6)
    if not inside.any():
        assert projection.pieces(np.array(line)) == []


def test_nets_run_clockwise_from_the_top_and_globes_are_seen_from_outside() -> None:
    net = chosen_map(ProjectivePlane(), NOTHING, PlotSettings(projection="schmidt"))
    east = np.array([[0.0, 90.0], [0.0, 0.0], [90.0, 0.0]])
    side = math.sqrt(2)
    np.testing.assert_allclose(net.forward(east), [[side, 0], [0, side], [0, 0]], atol=1e-12)
    pole = Lambert((90.0, 0.0))
    np.testing.assert_allclose(pole.forward(east), [[side, 0], [0, -side], [0, 0]], atol=1e-12)
    south = Lambert((-90.0, 0.0))
    np.testing.assert_allclose(south.forward(east[:2]), [[side, 0], [0, side]], atol=1e-12)


@given(st.integers(0, 99), centers)
@settings(max_examples=10)
def test_both_ends_of_an_axis_are_drawn_at_one_place(seed: int, center: Any) -> None:
    space, points = ProjectivePlane(), directions(50, seed)
    opposite = np.stack([-points[:, 0], (points[:, 1] + 360) % 360 - 180], axis=-1)
    projection = Lambert(center)
    one, other = (Map(space, projection).places(space.to_chart(p)) for p in (points, opposite))
    assert len(one) == len(points)
    np.testing.assert_allclose(one, other, atol=1e-6)


@given(maps)
@settings(max_examples=7)
def test_pixels_cover_the_map_and_measure_the_sphere(projection: Projection) -> None:
    pixels = Map(Sphere(), projection).pixels(4000)
    assert pixels.within.sum() <= len(pixels.points) == pixels.shown.sum()
    ring = projection.outline()
    left, right, below, above = pixels.extent
    assert left < ring[:, 0].min() < ring[:, 0].max() < right
    assert below < ring[:, 1].min() < ring[:, 1].max() < above
    whole = 4 * math.pi
    if isinstance(projection, Azimuthal):
        whole = 2 * math.pi * (1 - math.cos(math.radians(projection.radius)))
    found = pixels.areas[pixels.within].sum() * float(pixels.side(pixels.points)) ** 2  # pyright: ignore[reportOptionalSubscript]
    assert found == pytest.approx(whole, rel=0.02)


def test_lines_of_one_longitude_meet_the_poles() -> None:
    for projection in (Mollweide(), EqualEarth()):
        (line,) = projection.pieces(meridian(30.0))
        assert line[-1, 1] == pytest.approx(projection.outline()[:, 1].max())
    np.testing.assert_allclose(Mollweide().forward(np.array([[90.0, 50.0]])), [[0, math.sqrt(2)]],
                               atol=1e-7)  # fmt: skip


def test_the_equal_earth_is_as_wide_as_its_authors_say() -> None:
    (x, _), (_, y) = EqualEarth().forward(np.array([[0.0, 179.9999], [90.0, 0.0]]))
    assert x / y == pytest.approx(2.05458, abs=1e-5)  # Šavrič, Patterson and Jenny (2019)


def test_the_map_that_suits() -> None:
    space = Sphere()
    here = space.to_chart(40 + 5 * np.random.default_rng(0).uniform(-1, 1, (99, 2)))
    everywhere = space.to_chart(directions(400, 0))
    assert chosen_map(space, everywhere) == EqualEarth()
    assert chosen_map(space, NOTHING) == EqualEarth()
    near = chosen_map(space, here)
    assert isinstance(near, Lambert)
    assert near.radius == 10
    assert near.contains(space.from_chart(here)).all()
    assert chosen_map(space, here, PlotSettings(center=(0, 150))) == EqualEarth((0.0, 150.0))
    assert chosen_map(space, here, PlotSettings(center=(150,))) == EqualEarth((0.0, 150.0))
    assert chosen_map(space, everywhere, PlotSettings(center=(40, 10))) == Lambert((40.0, 10.0))
    assert chosen_map(space, everywhere, PlotSettings(center=(40, 10), radius=25)).radius == 25  # pyright: ignore
    plane = ProjectivePlane()
    assert chosen_map(plane, NOTHING) == Lambert((90.0, 0.0))
    named = PlotSettings(names=("Inc", "Dec"))
    assert chosen_map(plane, NOTHING, named) == Lambert((90.0, 0.0), flipped=True)
    assert isinstance(chosen_map(plane, NOTHING, PlotSettings(projection="wulff")), Stereographic)


@pytest.mark.parametrize(
    ("space", "asked", "message"),
    [
        (Torus(2), {}, "maps sphere"),
        (Sphere(), {"projection": "mercator"}, "projection"),
        (Sphere(), {"projection": "mollweide", "center": (40, 0)}, "meridian"),
        (Sphere(), {"projection": "mollweide", "radius": 40}, "radius"),
        (Sphere(), {"center": (95, 0)}, "latitude -90 90"),
        (Sphere(), {"center": (0, 0, 0)}, "latitude longitude"),
        (Sphere(), {"center": (math.nan,)}, "finite"),
        (Sphere(), {"projection": "lambert", "radius": 120}, "radius"),
        (ProjectivePlane(), {"projection": "mollweide"}, "projective plane"),
        (ProjectivePlane(), {"projection": "schmidt", "center": (10, 20)}, "centre"),
    ],
)
def test_other_maps_are_refused(space: Any, asked: dict[str, Any], message: str) -> None:
    with refused(*message.split()):
        chosen_map(space, NOTHING, PlotSettings(**asked))


TURN = random_orthogonal(np.random.default_rng(5), 3)
SPACES = [Torus(2), KleinBottle(), Sphere(rotation=TURN), ProjectivePlane(rotation=TURN)]
EULER = {"torus": 0, "klein-bottle": 0, "sphere": 2, "projective-plane": 1}

spaces = st.sampled_from(SPACES)


def square(seed, count):
    return torch.tensor(np.random.default_rng(seed).random((count, 2)))


@given(spaces, seeds)
def test_identified_points_are_one_point_of_the_surface(space, seed):
    points = square(seed, 20)
    here = immersion(space)(points)
    middle = np.full(2, 0.5)
    for element in space.group.elements_near(middle, 2.1, source=middle):
        np.testing.assert_allclose(immersion(space)(element(points)), here, atol=1e-9)


@given(spaces, seeds)
def test_points_that_are_not_identified_are_apart_along_short_paths(space, seed):
    points = square(seed, 30) * 0.8 + 0.1
    angle = 2 * np.pi * torch.tensor(np.random.default_rng(seed).random(30))
    step = 1e-3 * torch.stack([angle.cos(), angle.sin()], dim=-1)
    moved = np.linalg.norm(immersion(space)(points + step) - immersion(space)(points), axis=1)
    assert moved.min() > 1e-5
    assert moved.max() < 3e-2


def welded(space, resolution):
    """Number of the vertex of the closed mesh that each point of the square's mesh is."""
    grid = mesh(space, resolution)
    images = space.group.images(grid.points)
    reduced = torch.tensor(np.asarray(space.group.wrap(images.reshape(-1, 2).numpy())))
    steps = (reduced * resolution).round().long() % torch.tensor(
        np.rint(np.diag(space.group.lattice) * resolution), dtype=torch.long
    )
    code = (steps[:, 0] * 10_000 + steps[:, 1]).reshape(images.shape[:-1]).amin(dim=0)
    return grid, np.unique(code.numpy(), return_inverse=True)[1].reshape(-1)


@pytest.mark.parametrize("space", SPACES, ids=lambda s: s.name)
def test_mesh_closes_to_the_right_surface(space):
    grid, number = welded(space, 12)
    triangles = number[grid.triangles]
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    counts = np.unique(edges, axis=0, return_counts=True)[1]
    # two edges beside a cone point may have the same ends, which keeps the counts even
    assert (counts % 2 == 0).all()
    euler = (number.max() + 1) - counts.sum() // 2 + len(triangles)
    assert euler == EULER[space.name]


@pytest.mark.parametrize("space", SPACES, ids=lambda s: s.name)
def test_normals_are_unit_and_perpendicular(space):
    grid = mesh(space, 10)
    found = normals(space, grid.points)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-6)
    inner = ((grid.points > 0.15) & (grid.points < 0.85)).all(dim=1)
    points, step = grid.points[inner], torch.tensor([[1e-5, 2e-5]], dtype=torch.float64)
    along = immersion(space)(points + step) - immersion(space)(points - step)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    assert abs((along * found[inner.numpy()]).sum(axis=1)).max() < 1e-4


def test_boy_surface_is_continuous_over_the_equator_and_finite_at_the_triple_point():
    angle = np.linspace(0, 2 * np.pi, 40)
    above, below = (
        np.stack([np.cos(angle), np.sin(angle), np.full(40, s * 1e-7)], axis=-1) for s in (1, -1)
    )
    np.testing.assert_allclose(boy_surface(above), boy_surface(below), atol=1e-5)
    radius = ((3 - 5**0.5) / 2) ** (1 / 3)  # a root of w^6 + sqrt(5) w^3 - 1
    vector = np.array([[2 * radius, 0, radius**2 - 1]]) / (1 + radius**2)
    assert np.linalg.norm(boy_surface(vector)) < 1e-6


def test_other_dimensions_and_resolutions_are_refused():
    for dim, resolution, word in ((1, 8, "dimensions"), (3, 8, "dimensions"), (2, 1, "resolution"),
                                  (2, 251, "resolution")):  # fmt: skip
        with refused(word):
            mesh(Torus(dim), resolution)


# towards the reader on the outside of the ring, under it, and on the wall of its hole
PLACES = [(0.1, 0.05), (0.7, 0.89), (0.4, 0.5)]


@pytest.mark.parametrize("space", SPACES, ids=lambda s: s.name)
@pytest.mark.parametrize("place", PLACES)
def test_the_first_view_faces_a_place(space, place):
    at = torch.tensor(place, dtype=torch.float64)
    yaw, pitch, cut = viewpoint(space, at)
    toward = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
    cloud = immersion(space)(mesh(space, 60).points)
    center = (cloud.min(axis=0) + cloud.max(axis=0)) / 2
    radius = np.linalg.norm(cloud - center, axis=1).max()
    spot = immersion(space)(at[None])[0]
    sight = center + EYE * radius * toward - spot
    sight /= np.linalg.norm(sight)
    along = (cloud - spot) @ sight
    aside = np.linalg.norm(cloud - spot - along[:, None] * sight, axis=1)
    kept = (cloud - center) @ toward <= (1 - cut / 50) * radius
    assert not (kept & (along > 0.15 * radius) & (aside < 0.04 * radius)).any()
    assert ((spot - center) @ toward < (1 - cut / 50) * radius) or cut == 0
    assert abs(normals(space, at[None])[0] @ sight) > 0.4
