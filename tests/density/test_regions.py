"""Regions of highest density: known caps, edges that are glued, islands, and samples they need."""

import json
import math
from typing import Any

import numpy as np
import pytest
import shapely
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.stats import kstest

import orbiflow.density as od
from density.blends import bump
from known_densities import angle_between, cap_height, kernels_about
from orbiflow.density.regions import boundaries, samples_for, to_geojson
from orbiflow.density.regions import levels as region_levels
from orbiflow.density.regions.grid import Block, filled, refined
from orbiflow.density.regions.settings import (
    GOOD_EXPECTED,
    MAX_DEFAULT_SAMPLES,
    MAX_SAMPLES,
    MIN_EXPECTED,
    SAMPLES,
)
from orbiflow.runtime import to_json
from refusals import refused

SPACES = ("torus", "sphere", "klein-bottle", "projective-plane")
NO_SEEDS = (np.zeros((0, 2)), np.zeros(0))


@given(st.floats(0.2, 0.8), st.floats(0.2, 0.8), st.floats(0.05, 0.19), st.floats(-1.0, 1.0))
@settings(max_examples=10, deadline=None)
def test_a_disc_on_the_grid_is_a_disc(x: float, y: float, radius: float, level: float) -> None:
    def function(points: np.ndarray) -> np.ndarray:
        return level + 4 * (radius - np.hypot(*(points - [x, y]).T))

    levels = np.array([level])
    low, high = np.zeros(2), np.ones(2)
    coarse = Block(np.zeros((17, 17)), low, (high - low) / 16)
    grid, evaluations = refined(function, coarse, levels, NO_SEEDS, 4, 10**6)
    assert evaluations < 6000  # of 66,049 nodes
    shape, off = filled(grid, level, function)
    assert off < 2e-3
    assert shapely.area(shape) == pytest.approx(math.pi * radius**2, rel=2e-3)
    vertices = shapely.get_coordinates(shape)
    assert abs(np.hypot(*(vertices - [x, y]).T) - radius).max() < 5e-4


def test_a_region_is_cut_at_the_border_and_may_have_holes() -> None:
    def function(points: np.ndarray) -> np.ndarray:
        return np.sin(2 * math.pi * points[:, 0])  # half of the window, at its left edge

    low, high = np.zeros(2), np.ones(2)
    coarse = Block(np.zeros((9, 9)), low, (high - low) / 8)
    grid, _ = refined(function, coarse, np.zeros(1), NO_SEEDS, 3, 10**6)
    shape, _ = filled(grid, 0.0, function)
    assert shapely.area(shape) == pytest.approx(0.5, abs=1e-9)
    assert shapely.bounds(shape) == pytest.approx((0, 0, 0.5, 1), abs=1e-9)
    everything, _ = filled(Block(np.ones((4, 4)), low, np.full(2, 1 / 3)), 0.0, function)
    assert shapely.area(everything) == pytest.approx(1.0)
    assert shapely.is_empty(
        filled(Block(-np.ones((4, 4)), low, np.full(2, 1 / 3)), 0.0, function)[0]
    )

    def ring(points: np.ndarray) -> np.ndarray:
        return 0.1 - abs(np.hypot(*(points - 0.5).T) - 0.3)

    coarse = Block(np.zeros((17, 17)), low, (high - low) / 16)
    grid, _ = refined(ring, coarse, np.zeros(1), NO_SEEDS, 3, 10**6)
    shape, _ = filled(grid, 0.0, ring)
    assert isinstance(shape, shapely.Polygon)
    assert len(shape.interiors) == 1
    assert shape.area == pytest.approx(math.pi * (0.4**2 - 0.2**2), rel=1e-3)


PLACES = [(5.0, 179.5), (88.0, 60.0), (-90.0, 0.0)]


@pytest.mark.parametrize(("lat", "lon"), PLACES)
def test_caps_on_the_sphere(lat: float, lon: float) -> None:
    space, kappa, mass = od.make_space("sphere"), 30.0, 0.8
    density = kernels_about(space, [[lat, lon]], [kappa], [1.0])
    levels = od.DensityLevels(density, samples=20_000)
    region = levels.highest(mass)
    (outline,) = od.outlines(levels, [region])
    height = cap_height(mass, kappa)
    slack = 4 * region.error / mass
    assert outline.polygons_size == pytest.approx(2 * math.pi * height, rel=slack)
    assert region.size == pytest.approx(2 * math.pi * height, rel=slack)
    # the polygons themselves are those of the threshold, far closer than the threshold is known
    own = (
        1
        - (region.log_prob - math.log(kappa / (2 * math.pi * -math.expm1(-2 * kappa))) + kappa)
        / kappa
    )
    assert outline.polygons_size == pytest.approx(2 * math.pi * own, rel=2e-3)
    assert outline.polygons_mass == pytest.approx(
        mass, abs=4 * math.hypot(region.error, outline.polygons_mass_error)
    )
    rng = np.random.default_rng(0)
    vectors = rng.normal(size=(8_000, 3)) * 0.4 + make_vectors(lat, lon)
    data = space.from_chart(
        od.make_space("sphere").to_chart(vectors / np.linalg.norm(vectors, axis=1)[:, None])
    )
    inside = shapely.contains_xy(outline.shape, data[:, 1], data[:, 0])
    angle, edge = angle_between(data, lat, lon), math.acos(1 - own)
    clear = abs(angle - edge) > 1e-3
    assert (inside == (angle < edge))[clear].all()
    assert (region.contains(data) == (angle < edge))[clear].all()


def make_vectors(lat: float, lon: float) -> np.ndarray:
    a, b = np.radians([lat, lon])
    return np.array([np.cos(a) * np.cos(b), np.cos(a) * np.sin(b), np.sin(a)])


def test_geojson() -> None:
    space = od.make_space("sphere")
    places = [[10.0, 180.0], [89.0, 0.0], [-30.0, 20.0]]
    density = kernels_about(space, places, [50.0, 50.0, 50.0], [1, 1, 1])
    levels = od.DensityLevels(density)
    drawn = od.outlines(levels, [levels.highest(0.5), levels.highest(0.95)])
    document = json.loads(json.dumps(to_geojson(drawn), allow_nan=False))
    assert document["type"] == "FeatureCollection"
    assert [f["properties"]["mass"] for f in document["features"]] == [0.5, 0.95]
    for feature, outline in zip(document["features"], drawn, strict=True):
        assert feature["geometry"]["type"] == "MultiPolygon"
        polygons = feature["geometry"]["coordinates"]
        assert len(polygons) == 4  # that at the antimeridian is cut in two
        total = 0.0
        for rings in polygons:
            for number, ring in enumerate(rings):
                assert ring[0] == ring[-1]
                assert len(ring) >= 4
                x, y = np.array(ring).T
                assert (abs(x) <= 180).all()
                assert (abs(y) <= 90).all()
                assert shapely.LinearRing(ring).is_ccw == (number == 0)
                # sides are short: none goes round the globe
                assert abs(np.diff(x)).max() <= 4.001
            total += shapely.Polygon(rings[0], rings[1:]).area
        shape = shapely.geometry.shape(feature["geometry"])
        assert shape.is_valid
        assert total == pytest.approx(outline.shape.area, rel=1e-4)
        assert feature["properties"]["area"] == pytest.approx(outline.polygons_size)
        assert {180.0, -180.0} == {round(v, 6) for v in (shape.bounds[0], shape.bounds[2])}
        assert shape.bounds[3] == 90


@pytest.mark.parametrize("name", SPACES)
def test_polygons_hold_what_the_region_holds_and_edges_are_glued(name: str) -> None:
    space = od.make_space(name)
    # about the edges of each window
    if space.is_round:
        centers = [[1.0, 100.0], [-4.0, -179.0], [60.0, 3.0]]
    else:
        centers = [[0.02, 0.7], [3.12, -1.5], [1.5, 1.6]]
    density = kernels_about(space, centers, [8.0, 25.0, 60.0], [3, 2, 1])
    levels = od.DensityLevels(density, samples=5000, seed=2)
    regions = [levels.highest(0.3), levels.highest(0.9), levels.above(-40.0)]
    drawn = od.outlines(levels, regions)
    points = space.uniform(10_000, torch.Generator().manual_seed(1))
    data, flat = space.from_chart(points), drawn[0].window.from_chart(points)
    for outline in drawn:
        assert outline.notes == ()
        inside = shapely.contains_xy(outline.shape, *flat.T)
        assert (inside != outline.contains(data)).mean() < 5e-4
        share = inside.mean() if not space.is_round else None
        if share is not None:
            assert outline.polygons_fraction == pytest.approx(share, abs=0.012)
        assert outline.polygons_size == pytest.approx(
            outline.size, abs=5 * outline.size_error + 1e-4
        )
        assert outline.polygons_mass == pytest.approx(outline.held, abs=0.02)
        assert all(part.is_valid and part.exterior.is_ccw for part in outline.shape.geoms)
    assert drawn[2].polygons_fraction == pytest.approx(1.0, abs=1e-6)
    low, high = drawn[0].window.low, drawn[0].window.high
    assert drawn[1].shape.bounds[0] == low[0]
    assert drawn[1].shape.bounds[2] == high[0]


def test_islands_between_the_nodes_are_found() -> None:
    space = od.make_space("torus", axes=2, unit="degrees")
    rng = np.random.default_rng(3)
    specks = rng.uniform(-180, 180, (40, 2))
    wide = np.concatenate([specks, [[0.0, 0.0]]])
    density = kernels_about(space, wide, [2e5] * 40 + [5.0], [0.5 / 40] * 40 + [0.5])
    levels = od.DensityLevels(density, samples=5000)
    (outline,) = od.outlines(levels, [levels.highest(0.4)])
    near = shapely.buffer(outline.shape, 0.2)
    assert shapely.contains_xy(near, *specks.T).all()
    assert outline.polygons_mass == pytest.approx(outline.held, abs=0.03)
    assert outline.notes == ()
    (rough,) = od.outlines(levels, [levels.highest(0.4)], budget=1)
    assert any("too small to outline" in note for note in rough.notes)


@pytest.fixture(name="few_samples")
def few_samples_fixture(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(boundaries, "CHECKED", 4000)
    monkeypatch.setattr(region_levels, "KERNELS", 2000)


ACROSS = [
    ("torus", [math.pi, math.pi], 4), ("klein-bottle", [0.0, 0.1], 2), ("sphere", [88.0, 180.0], 1),
    ("projective-plane", [0.0, 20.0], 2),
]  # fmt: skip


@pytest.mark.usefixtures("few_samples")
@pytest.mark.parametrize(("name", "center", "pieces"), ACROSS)
def test_an_island_across_an_edge_is_one(name: str, center: list[float], pieces: int) -> None:
    """Each of its pieces holds less than the least mass of an island, and all together more."""
    space = od.make_space(name)
    far = [[45.0, 80.0]] if space.is_round else [[1.5, 1.0]]
    density = kernels_about(space, [center, *far], [60.0, 60.0], [0.7, 0.3])
    levels = od.DensityLevels(density, samples=1000)
    (large,) = od.outlines(levels, [levels.highest(0.9)], budget=1, min_mass=0.55)
    assert len(large.shape.geoms) == pieces
    assert 0.55 < large.polygons_mass < 0.7
    assert "left out 1 island of less than 0.55 of the mass, which held 0." in large.notes[-1]
    assert float(large.notes[-1].split()[-3]) == pytest.approx(0.9 - large.polygons_mass, abs=0.05)
    assert large.polygons_size < 0.85 * large.size


@pytest.mark.usefixtures("few_samples")
@pytest.mark.parametrize("name", ["torus", "sphere"])
def test_regions_of_a_smoothed_density_hold_the_mass_of_the_density(name: str) -> None:
    """Sixty peaks within 6 degrees of a place are as many islands, or one of the smoothed density."""
    space = od.make_space(name, unit="degrees") if name == "torus" else od.make_space(name)
    middle = np.array([20, 178])
    specks = np.random.default_rng(3).uniform(-6, 6, (60, 2)) + middle
    density = kernels_about(space, [*specks, [-30, 0]], [1e5] * 60 + [30.0], [1] * 60 + [20])
    levels = od.DensityLevels(density, samples=2000, smooth=2.0)
    region = levels.highest(0.5)
    (smooth,) = od.outlines(levels, [region], budget=20_000)
    assert len(smooth.shape.geoms) <= 2  # cut at 180 degrees
    assert (region.smooth, region.held) == (2.0, pytest.approx(0.5, abs=1e-3))
    assert smooth.polygons_mass == pytest.approx(
        0.5, abs=4 * math.hypot(region.error, smooth.polygons_mass_error)
    )
    assert smooth.polygons_size == pytest.approx(region.size, abs=4 * region.size_error)
    assert region.size_error < 0.05 * region.size
    sharp = od.DensityLevels(density, samples=2000).highest(0.5)
    assert sharp.size < 0.2 * region.size
    assert region.contains(specks)[np.hypot(*(specks - middle).T) < 3].all()


@pytest.mark.parametrize("dim", [1, 2, 4])
def test_thresholds_in_any_dimension(dim: int) -> None:
    rng = np.random.default_rng(dim)
    data = rng.vonmises(np.zeros(dim), 3.0, (300, dim))
    estimator = od.DensityEstimator(components="mixture").fit(data)
    levels = od.DensityLevels(estimator, samples=4000)
    fresh = estimator.sample(2000, random_state=1)
    assert kstest(levels.hdr(fresh), "uniform").pvalue > 1e-4
    for mass in (0.2, 0.9):
        region = levels.highest(mass)
        assert region.held == pytest.approx(mass, abs=1e-3)
        assert region.contains(fresh).mean() == pytest.approx(mass, abs=5 * region.error + 0.02)
        assert region.log_prob_low <= region.log_prob <= region.log_prob_high
        assert (region.contains(fresh) == (levels.hdr(fresh) < mass)).mean() > 0.998
        again = levels.above(region.log_prob)
        assert again.held == region.held
        assert again.mass is None
    sizes = [levels.highest(mass).size for mass in (0.1, 0.5, 0.9)]
    assert sizes == sorted(sizes)
    json.dumps(to_json(region), allow_nan=False)
    if dim != 2:
        with refused(dim):
            od.outlines(levels, [region])


def test_a_level_that_nothing_reaches() -> None:
    density = kernels_about(od.make_space("torus"), [[0.0, 0.0]], [4.0], [1.0])
    levels = od.DensityLevels(density, samples=1000)
    (outline,) = od.outlines(levels, [levels.above(10.0)])
    assert outline.shape.is_empty
    assert (outline.polygons_size, outline.polygons_mass, outline.held) == (0.0, 0.0, 0.0)
    assert outline.error > 0
    assert od.outlines(levels, []) == []


TORUS = kernels_about(od.make_space("torus"), [[0.0, 0.0]], [4.0], [1.0])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: od.highest_density_region(TORUS, 0.0), "mass"),
        (lambda: od.highest_density_region(TORUS, 0.999999), "told 1"),
        (lambda: od.highest_density_region(TORUS, "0.5%"), "mass"),  # pyright: ignore[reportArgumentType]
        (lambda: od.highest_density_region(od.DensityEstimator(), 0.5), "fitted"),
        (lambda: od.DensityLevels(TORUS, samples=3), "samples"),
        (lambda: od.DensityLevels(TORUS, smooth=1e-5), "smooth 0.00032"),
        (lambda: od.DensityLevels(TORUS).above(math.inf), "level"),
        (lambda: od.highest_density_region(TORUS, 0.5).contains([[1.0, 2.0, 3.0]]), "angles 2"),
        (lambda: to_geojson(od.outlines(*both())), "points torus"),
    ],
)
def test_mistakes(call: Any, message: str) -> None:
    with refused(*message.split()):
        call()


def both() -> tuple[od.DensityLevels, list[Any]]:
    levels = od.DensityLevels(TORUS, samples=1000)
    return levels, [levels.highest(0.5)]


masses = st.floats(2e-5, 1 - 2e-5)


@given(st.lists(masses, max_size=4))
def test_what_suits_the_masses_is_never_too_few(shares: list[float]) -> None:
    count = samples_for(shares)
    assert SAMPLES <= count <= MAX_DEFAULT_SAMPLES
    assert samples_for(shares, count) == count
    rarest = min((min(share, 1 - share) for share in shares), default=0.5)
    assert count in (SAMPLES, MAX_DEFAULT_SAMPLES) or count == pytest.approx(
        GOOD_EXPECTED / rarest, abs=1
    )


@given(masses, st.integers(1000, MAX_SAMPLES))
def test_at_least_ten_are_expected_on_either_side(mass: float, count: int) -> None:
    expected = min(mass, 1 - mass) * count
    assume(abs(expected - MIN_EXPECTED) > 1e-6)
    low, high = od.resolvable_masses(count)
    assert (low <= mass <= high) == (expected > MIN_EXPECTED)
    if expected > MIN_EXPECTED:
        assert samples_for([0.5, mass], count) == count
    else:
        with refused(count):
            samples_for([0.5, mass], count)


def test_far_out_the_mass_and_the_interval_are_right() -> None:
    space = od.make_space("torus", axes=1)
    density = od.Mixture([bump(space, 9.0), od.UniformDensity(space)], [0.999, 0.001])
    region = od.highest_density_region(density, 0.9995)  # half of what lies about in the floor
    fresh = od.DensityLevels(density, samples=400_000, seed=1).log_probs
    outside = float(np.mean(fresh < region.log_prob))
    assert outside == pytest.approx(0.0005, abs=6 * math.sqrt(0.0005 / 200_000))
    assert region.error == pytest.approx(math.sqrt(0.0005 / 200_000), rel=0.01)
    coarse = od.highest_density_region(density, 0.9995, samples=20_000)
    assert coarse.log_prob_low < coarse.log_prob < coarse.log_prob_high


def test_pictures_have_the_same_rule() -> None:
    assert od.PlotSettings(regions=(0.9995,)).regions == (0.9995,)
    with refused("region_samples", "20000"):
        od.PlotSettings(regions=(0.9995,), region_samples=10_000)
    with refused("region_samples"):
        od.PlotSettings(regions=(0.9,), region_samples=MAX_SAMPLES + 1)
