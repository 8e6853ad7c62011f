"""The exact overlap and its gradient; polishing never makes a candidate worse, at any precision."""

import numpy as np
import pytest
import shapely
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.arrays import Array
from orbiflow.tiles import (
    CLASSES,
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
from orbiflow.tiles.flowing.starts import template_starts
from orbiflow.tiles.flowing.tile_model import extract_tile
from strategies import divided_start, random_tensor, seeds

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


@pytest.fixture(scope="module", params=["IH4", "IH21"])
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
    once = polish(rough, TARGET, 20)
    twice = polish(once, TARGET, 20)
    first, second = (iou(extract_tile(m)[0].polygon, TARGET.normal) for m in (once, twice))
    assert second >= first - 2e-4  # sampled boundary against extracted polygon


def test_stacks_are_joined(rough: TileModel) -> None:
    stack = TileModel.joined([rough, rough])
    assert stack.size == 2
    one = extract_tile(stack.take([1]))[0].polygon
    assert np.array_equal(one, extract_tile(rough)[0].polygon)


CASTS = {
    "float": lambda model: model.float(),
    "half": lambda model: model.half(),
    "bfloat16": lambda model: model.bfloat16(),
    "double": lambda model: model.double(),
    "to float32": lambda model: model.to(torch.float32),
    "to cpu": lambda model: model.to("cpu", torch.float64),
    "type": lambda model: model.type(torch.float32),
}
casts = st.lists(st.sampled_from(list(CASTS)), min_size=1, max_size=3)


def started(name: str, seed: int, *, from_template: bool) -> TileModel:
    """A bent candidate, started from the class's template or from a stretched polygon of it."""
    kind = CLASSES[name]
    starts = None if from_template else template_starts(kind, turns=2, stretch=0.2, vertices=60)
    model = TileModel(
        kind,
        torch.zeros(1) if starts is None else None,
        max_frequency=2,
        prototiles=None if starts is None else starts.take([len(starts) - 1]),
    )
    with torch.no_grad():
        for parameter in model.parameters():
            parameter.add_(0.01 * random_tensor(seed, *parameter.shape, size=1.0))
    return model


@settings(max_examples=10)
@given(st.sampled_from(list(CLASSES)), casts, seeds, st.booleans())
def test_no_cast_loses_the_certificate(name, steps: list[str], seed, from_template) -> None:
    model = started(name, seed, from_template=from_template)
    exact = None if model.vertices is None else model.vertices.clone()
    for step in steps:
        assert CASTS[step](model) is model
    tile, fine = extract_tile(model)
    certificate = certify(tile, tolerance=1e-9)
    assert certificate.valid, certificate.reasons
    assert certificate.edge_mismatch < 1e-12
    assert fine.angle.dtype == torch.float64
    if exact is not None:
        assert model.vertices is not None
        assert torch.equal(model.vertices, exact)


def test_a_rounded_model_still_maps_in_its_own_precision() -> None:
    model = started("IH6", 3, from_template=False).float()
    assert model.prototile()[0].dtype == torch.float32
    assert model(divided_start(model, 2)).dtype == torch.float32
    assert model.take([0]).vertices is not None
    assert model.take([0]).vertices.dtype == torch.float64  # pyright: ignore[reportOptionalMemberAccess]
