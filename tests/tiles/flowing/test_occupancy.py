"""The occupancy loss, its samples, and the fit."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.tiles import (
    CLASSES,
    OccupancySamples,
    OccupancySearch,
    Target,
    TileModel,
    fit_occupancy,
    occupancy_loss,
)
from orbiflow.tiles.flowing.occupancy import _distinct
from strategies import seeds

BOOT = [[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2.0, 2.8], [0.8, 2.5], [-0.3, 1.2]]
QUICK = OccupancySearch(
    max_frequency=3, turns=3, finalists=2, iterations=15, affine_iterations=20, points=200
)


def stack(name: str, seed: int, size: int) -> TileModel:
    """Candidates a little away from their starts, with a small flow."""
    rng = np.random.default_rng(seed)
    model = TileModel(
        CLASSES[name],
        torch.tensor(rng.uniform(-3, 3, size)),
        mirrored=torch.tensor(rng.random(size) < 0.5),
        max_frequency=2,
        steps=3,
        method="midpoint",
    )
    with torch.no_grad():
        for parameter in model.parameters():
            parameter.add_(torch.tensor(rng.uniform(-0.06, 0.06, parameter.shape)))
    return model


@settings(max_examples=5)
@given(seeds, st.booleans())
def test_samples_know_what_is_inside(seed: int, y_down: bool) -> None:
    target = Target.from_polygon(BOOT, y_down=y_down)
    samples = OccupancySamples(target, 3000, seed=seed, dtype=torch.float64)
    polygon = shapely.Polygon(target.normal)
    assert samples.points.shape == (3000, 2)
    inside = [polygon.contains(shapely.Point(p)) for p in samples.points[::10].tolist()]
    assert samples.inside[::10].tolist() == [float(value) for value in inside]
    # most lie within two of the widest standard deviations of the outline
    distance = shapely.distance(shapely.points(samples.points.numpy()), polygon.exterior)
    assert np.mean(distance < 0.3) > 0.8
    points, occupied = samples.draw(500)
    assert points.shape == (500, 2)
    rows = dict(zip(map(tuple, samples.points.tolist()), samples.inside.tolist(), strict=True))
    assert all(rows[tuple(p)] == o for p, o in zip(points.tolist(), occupied.tolist(), strict=True))


@pytest.mark.parametrize("name", CLASSES)
def test_the_matching_pose_has_the_least_loss(name: str) -> None:
    kind = CLASSES[name]
    target = Target.from_polygon(kind.template())
    samples = OccupancySamples(target, 6000, seed=0, dtype=torch.float64)
    model = TileModel(kind, torch.tensor([0.0, 0.05, 0.1, 0.2, 0.0, 0.0]), max_frequency=1)
    x, y = target.normal.T
    assert 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) == pytest.approx(1, abs=1e-12)
    with torch.no_grad():
        # a pentagon's mean of corners is not its centroid
        model.offset.copy_(
            torch.tensor(target.normal.mean(axis=0))
            - (model.template() @ model.linear().mT).mean(1)
        )
        model.offset[4] += torch.tensor([0.1, 0.0])
        model.log_scale[5] += 0.1
        loss = occupancy_loss(model, samples.points, samples.inside, 40.0)
        affine = occupancy_loss(model, samples.points, samples.inside, 40.0, affine=True)
        sharp = occupancy_loss(model, samples.points, samples.inside, 4000.0)
    turned = loss[:4].tolist()
    assert turned == sorted(turned)
    assert loss[0].item() < loss[1:].min().item() - 0.003
    # sigmoid(tau phi) tends to the occupancy as tau grows: the loss falls as 1 / tau
    assert sharp[0].item() < 0.02 * loss[0].item()
    # without a flow there is nothing to leave out
    assert torch.allclose(loss, affine, atol=1e-12, rtol=0)


def parameters(model: TileModel) -> torch.Tensor:
    return torch.cat([p.detach().flatten() for p in model.parameters()])


def test_fit_reports_and_depends_on_the_seed_alone() -> None:
    target = Target.from_polygon(BOOT)
    shares: list[float] = []
    losses: list[float] = []

    def progress(share: float, loss: float) -> None:
        shares.append(share)
        losses.append(loss)

    first = fit_occupancy(target, CLASSES["IH6"], QUICK, progress)
    assert first.size == 1  # the better half of two finalists
    assert shares == sorted(set(shares))
    assert len(shares) == QUICK.iterations
    assert shares[-1] == 1.0
    assert all(math.isfinite(loss) for loss in losses)
    assert torch.equal(parameters(first), parameters(fit_occupancy(target, CLASSES["IH6"], QUICK)))
    other = replace(QUICK, seed=1)
    assert not torch.equal(
        parameters(first), parameters(fit_occupancy(target, CLASSES["IH6"], other))
    )


def test_fit_lowers_the_loss() -> None:
    target = Target.from_polygon(BOOT)
    samples = OccupancySamples(target, 4000, seed=9)
    few = replace(QUICK, iterations=1, affine_iterations=0)
    before, after = (
        occupancy_loss(
            fit_occupancy(target, CLASSES["IH4"], own), samples.points, samples.inside, 30.0
        )
        for own in (few, QUICK)
    )
    assert after.min().item() < 0.7 * before.min().item()


@pytest.mark.parametrize(("name", "order"), [("IH1", 6), ("IH3", 2), ("IH7", 3), ("IH21", 1)])
def test_distinct_drops_starts_that_met(name: str, order: int) -> None:
    step = 2 * math.pi / order
    angles = torch.tensor([0.3, 0.3 + step, 0.305, 0.6, 0.3 - step, 0.6 + step / 100])
    model = TileModel(CLASSES[name], angles.double(), max_frequency=1)
    placed = model.place(model.template())
    far = step / 100 * placed[0].norm(dim=-1).max().item() > 0.1
    assert not far
    assert _distinct(model, 6) == [0, 3]
    assert _distinct(model, 1) == [0]
    mirrored = torch.tensor([False, True])
    model = TileModel(CLASSES["IH21"], torch.zeros(2).double(), mirrored=mirrored, max_frequency=1)
    assert _distinct(model, 2) == [0, 1]
