"""Metrics against closed forms, each other and a dense sampling; gradients of what is kept."""

import json

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import MultiPolygon, Polygon, box

from orbiflow.arrays import Complex
from orbiflow.tiles import Overlap, compare, dice, hausdorff, iou, pixel_accuracy, prepared_region
from orbiflow.tiles.likeness import Measures, mark_gradient
from orbiflow.tiles.likeness.metrics import MAX_REGION_VERTICES, default_window
from refusals import refused
from strategies import seeds

SQUARE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])


@st.composite
def star_shapes(draw: st.DrawFn) -> np.ndarray:
    n = draw(st.integers(3, 24))
    radii = np.array(draw(st.lists(st.floats(0.3, 1.0), min_size=n, max_size=n)))
    angle = 2 * np.pi * (np.arange(n) + 0.5) / n
    return radii[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)


@given(star_shapes(), star_shapes())
def test_overlap_identities(a: np.ndarray, b: np.ndarray) -> None:
    value = iou(a, b)
    assert 0 < value <= 1
    assert value == pytest.approx(iou(b, a), abs=1e-12)
    assert iou(a, a) == pytest.approx(1, abs=1e-12)
    assert dice(a, b) == pytest.approx(2 * value / (1 + value), abs=1e-12)
    assert pixel_accuracy(a, a) == pytest.approx(1, abs=1e-12)


@given(star_shapes(), star_shapes())
@settings(max_examples=20, deadline=None)
def test_hausdorff_is_that_of_the_curves(a: np.ndarray, b: np.ndarray) -> None:
    value = hausdorff(a, b)
    assert value == pytest.approx(hausdorff(b, a), abs=1e-9)
    assert hausdorff(a, a) <= 1e-9
    # Points every 1e-3 along both boundaries: too small by at most half of that.
    rings = [shapely.segmentize(Polygon(ring).exterior, 1e-3) for ring in (a, b)]
    first, second = (shapely.points(shapely.get_coordinates(ring)) for ring in rings)
    sampled = max(
        float(shapely.distance(first, Polygon(b).exterior).max()),
        float(shapely.distance(second, Polygon(a).exterior).max()),
    )
    assert sampled - 1e-3 <= value <= sampled + 5e-4


def test_pixel_accuracy_depends_on_its_window() -> None:
    half = SQUARE * [1, 0.5]
    assert default_window(SQUARE).bounds == pytest.approx((-0.4, -0.4, 4.4, 4.4))
    assert pixel_accuracy(half, SQUARE) == pytest.approx(1 - 8 / 4.8**2)


def test_compare() -> None:
    metrics = compare(SQUARE * [1, 0.5], SQUARE)
    assert metrics.iou == pytest.approx(0.5)
    assert metrics.dice == pytest.approx(2 / 3)
    assert metrics.hausdorff == pytest.approx(2 / 4)
    assert metrics.window == pytest.approx((-0.4, -0.4, 4.4, 4.4))
    assert json.loads(json.dumps(metrics.as_dict()))["window"] == list(metrics.window)
    scaled = compare(SQUARE * [100, 50], SQUARE * 100)
    assert scaled.hausdorff == pytest.approx(metrics.hausdorff)


def test_shapes_with_holes_and_parts() -> None:
    ring = box(0, 0, 3, 3).difference(box(1, 1, 2, 2))
    assert isinstance(ring, Polygon)
    assert iou(ring, box(0, 0, 3, 3)) == pytest.approx(8 / 9)
    assert hausdorff(ring, box(0, 0, 3, 3)) == pytest.approx(1)
    two = MultiPolygon([box(0, 0, 1, 1), box(2, 0, 3, 1)])
    assert dice(two, box(0, 0, 3, 1)) == pytest.approx(4 / 5)
    assert iou(box(0, 0, 1, 1), box(5, 5, 6, 6)) == 0


BOWTIE = [[0, 0], [2, 2], [2, 0], [0, 2]]


@pytest.mark.parametrize(
    "bad",
    [
        *(BOWTIE, Polygon(BOWTIE), [[0, 0], [1, 1]], [[0, 0], [1, 1], [np.nan, 0]], Polygon()),
        *("circle", [[0, 0], [1, 0], [2]]),
    ],
)
@pytest.mark.parametrize("metric", [iou, dice, pixel_accuracy, hausdorff])
def test_the_bad_argument_is_named(metric, bad: object) -> None:
    with refused("a: "):
        metric(bad, SQUARE)
    with refused("b: "):
        metric(SQUARE, bad)


def test_compare_names_its_own_arguments() -> None:
    with refused("tile", "[1 1]"):
        compare(BOWTIE, SQUARE)
    with refused("target", "[1 1]"):
        compare(SQUARE, BOWTIE)


def test_regions_of_many_vertices_are_simplified_for_choosing() -> None:
    t = np.linspace(0, 2 * np.pi, 2 * MAX_REGION_VERTICES, endpoint=False)
    radius = 0.56 + 0.002 * np.random.default_rng(0).normal(size=len(t))
    ring = np.stack([radius * np.cos(t), radius * np.sin(t)], axis=-1)
    simple = prepared_region(ring)
    assert len(simple.exterior.coords) < MAX_REGION_VERTICES
    assert abs(simple.area - shapely.Polygon(ring).area) < 0.01
    assert len(prepared_region(ring[::4]).exterior.coords) == len(ring[::4]) + 1
    assert Overlap(ring[::4]).region.area == shapely.Polygon(ring[::4]).area


COUNT, STEP = 120, 1e-7


def outline(rng: np.random.Generator) -> Complex:
    """A smooth outline without straight sides, whose turning has no kinks."""
    angle = np.linspace(0, 2 * np.pi, COUNT, endpoint=False)
    waves = np.arange(2, 9)[:, None]
    radius = 1 + (rng.normal(0, 0.05, (7, 1)) * np.cos(waves * angle)).sum(axis=0)
    radius = radius + (rng.normal(0, 0.05, (7, 1)) * np.sin(waves * angle)).sum(axis=0)
    return np.maximum(radius, 0.3) * np.exp(1j * angle)


def bent(rest: Complex, rng: np.random.Generator) -> Complex:
    angle = np.linspace(0, 2 * np.pi, COUNT, endpoint=False)
    waves = np.exp(1j * np.arange(-6, 7)[:, None] * angle)
    bends = rng.normal(0, 0.02, (13, 2)) @ np.array([1, 1j])
    return 1.7 * (rest + bends @ waves) + complex(*rng.normal(size=2))


@given(seeds)
def test_gradients_are_the_numerical_ones(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rest = outline(rng)
    measures, z = Measures(rest), bent(rest, rng)
    values, along = measures.gradients(z)
    assert values == pytest.approx(measures.values(z), abs=1e-12)
    way = np.exp(1j * rng.uniform(0, 2 * np.pi, COUNT))
    more, less = (measures.values(z + step * way) for step in (STEP, -STEP))
    change = (along.conj() @ way).real
    size = abs(along).sum(axis=1) + 1e-3  # the largest that the change could be
    assert (abs((more - less) / (2 * STEP) - change) < 2e-3 * size).all()


@given(seeds)
def test_wrinkles_and_the_mark_have_theirs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rest = outline(rng)
    measures, z = Measures(rest), bent(rest, rng)
    way = np.exp(1j * rng.uniform(0, 2 * np.pi, COUNT))
    places = np.arange(COUNT) + rng.uniform(0.1, 0.9, COUNT)  # no point at a vertex, where it kinks
    for found in (lambda z: measures.wrinkles(z, places), lambda z: mark_gradient(measures, z)):
        change = (found(z)[1].conj() @ way).real
        numerical = (found(z + STEP * way)[0] - found(z - STEP * way)[0]) / (2 * STEP)
        assert abs(numerical - change) < 2e-3 * (abs(found(z)[1]).sum() + 1e-3)
    slide, along = rng.uniform(-1, 1, COUNT), measures.wrinkles(z, places)[2]
    more, less = (measures.wrinkles(z, places + step * slide)[0] for step in (STEP, -STEP))
    assert abs((more - less) / (2 * STEP) - along @ slide) < 2e-3 * (abs(along).sum() + 1e-3)


def test_an_outline_at_rest_has_no_wrinkles() -> None:
    rest = outline(np.random.default_rng(1))
    measures, places = Measures(rest), np.arange(COUNT)
    assert measures.wrinkles(rest, places)[0] < 1e-9
    rough = rest + 0.002 * np.random.default_rng(2).normal(size=COUNT)
    assert measures.wrinkles(rough, places)[0] > 1


def test_wrinkles_between_the_points_count() -> None:
    rest = outline(np.random.default_rng(1))
    ring = np.stack([rest, (rest + np.roll(rest, -1)) / 2], axis=1).ravel()
    measures, places = Measures(ring), np.repeat(2.0 * np.arange(COUNT), 2)
    rough = ring * (1 + 0.01 * (np.arange(2 * COUNT) % 2))  # points lie at the other vertices
    assert measures.wrinkles(rough, places)[0] > measures.wrinkles(ring, places)[0] + 1
