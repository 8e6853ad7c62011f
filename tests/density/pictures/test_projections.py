"""Projections of the sphere: both ways, areas, angles, where they are cut; and which one suits."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.density import PlotSettings, ProjectivePlane, Sphere, Torus, to_vectors
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
from refusals import refused

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


@given(worlds)
def test_the_whole_sphere_has_its_area(projection: WorldMap) -> None:
    if not isinstance(projection, Stereographic | PlateCarree):
        assert area(projection.outline()) == pytest.approx(4 * math.pi, rel=3e-4)


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
