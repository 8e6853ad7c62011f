"""The exact overlap and its gradient; polishing never makes a candidate worse."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.arrays import Array
from orbiflow.tiles import (
    Overlap,
    OverlapSearch,
    Target,
    TileModel,
    certify,
    fit_descent,
    iou,
    isohedral_class,
    trainable,
)
from orbiflow.tiles.flowing.descent import polish
from orbiflow.tiles.flowing.tile_model import extract_tile

BOOT = [[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2.0, 2.8], [0.8, 2.5], [-0.3, 1.2]]
TARGET = Target.from_polygon(BOOT)
ROUGH = OverlapSearch.for_effort(
    "fast", max_frequency=5, candidates=4, stages=((6, 2),), projected=100, measured=20
)


def star(seed: int, count: int) -> Array:
    """A random star-shaped ring, counter-clockwise."""
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, count)) + np.arange(count) * 1e-3
    radius = rng.uniform(0.4, 1.2, count)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10**6), st.integers(5, 14), st.integers(5, 14), st.booleans())
def test_gradient_against_differences(seed: int, n: int, m: int, clockwise: bool) -> None:
    ring, target = star(seed, n), star(seed + 1, m) + 0.1
    ring = ring[::-1].copy() if clockwise else ring
    if not (shapely.Polygon(ring).is_valid and shapely.Polygon(target).is_valid):
        return
    overlap = Overlap(target)
    value, gradient = overlap.iou(ring)
    assert value == pytest.approx(iou(ring, target), abs=1e-12)
    direction = np.random.default_rng(seed).standard_normal(ring.shape)
    h = 1e-6
    ahead, behind = (overlap.iou(ring + s * h * direction)[0] for s in (1, -1))
    # vertices on a corner of the target have two one-sided derivatives: not at random
    assert (gradient * direction).sum() == pytest.approx((ahead - behind) / (2 * h), abs=1e-4)


@pytest.fixture(scope="module", params=["IH4", "IH5", "IH21"])
def rough(request: pytest.FixtureRequest) -> TileModel:
    return trainable(fit_descent(TARGET, isohedral_class(request.param), ROUGH).candidates).take(
        [0]
    )


def test_polish_improves_and_certifies(rough: TileModel) -> None:
    before = iou(extract_tile(rough)[0].polygon, TARGET.normal)
    parameters = [p.detach().clone() for p in rough.parameters()]
    better = polish(rough, TARGET, 30)
    assert better.segments == rough.segments + 1
    tile, _ = extract_tile(better)
    assert certify(tile).valid
    assert iou(tile.polygon, TARGET.normal) > before + 0.002
    # the candidate itself is left as it was
    assert all(bool((p == q).all()) for p, q in zip(rough.parameters(), parameters, strict=True))


def test_polish_never_loses(rough: TileModel) -> None:
    once = polish(rough, TARGET, 40)
    twice = polish(once, TARGET, 40)
    first, second = (iou(extract_tile(m)[0].polygon, TARGET.normal) for m in (once, twice))
    assert second >= first - 2e-4  # sampled boundary against extracted polygon


def test_stacks_are_joined(rough: TileModel) -> None:
    stack = TileModel.joined([rough, rough])
    assert stack.size == 2
    one = extract_tile(stack.take([1]))[0].polygon
    assert np.array_equal(one, extract_tile(rough)[0].polygon)
