"""The occupancy loss, its samples, the fit, and the signed distance."""

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
    signed_distance,
)
from orbiflow.tiles.flowing.occupancy import _distinct
from strategies import random_tensor, seeds

BOOT = [[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2.0, 2.8], [0.8, 2.5], [-0.3, 1.2]]
QUICK = OccupancySearch(
    max_frequency=3, turns=2, finalists=2, iterations=10, affine_iterations=20, points=100
)


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


def star_polygon(seed: int, corners: int = 5, *, low: float = 0.25) -> torch.Tensor:
    """A simple polygon (corners, 2), concave more often than not, somewhere near the origin."""
    rng = np.random.default_rng(seed)
    angle = 2 * np.pi * (np.arange(corners) + rng.uniform(-0.35, 0.35, corners)) / corners
    radius = rng.uniform(low, 1.0, corners)
    points = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return torch.tensor(points + rng.uniform(-0.5, 0.5, 2))


def nearest(points: np.ndarray, ring: shapely.LinearRing) -> np.ndarray:
    """The points of the ring that are nearest to `points` (N, 2)."""
    return shapely.get_coordinates(
        shapely.line_interpolate_point(
            ring, shapely.line_locate_point(ring, shapely.points(points))
        )
    )


def smooth_points(seed: int, polygon: shapely.Polygon) -> torch.Tensor:
    """Points (N, 2) off the boundary and off the medial axis, where the distance has a gradient."""
    points = random_tensor(seed, 60, 2, size=1.5).numpy()
    ring = polygon.exterior
    closest = nearest(points, ring)
    keep = np.hypot(*(points - closest).T) > 0.02
    for shift in ([1e-3, 0.0], [-1e-3, 0.0], [0.0, 1e-3], [0.0, -1e-3]):
        keep &= np.hypot(*(nearest(points + shift, ring) - closest).T) < 0.05
    assert keep.sum() > 20
    return torch.tensor(points[keep])


@given(seeds, st.integers(3, 9), st.booleans())
def test_agrees_with_shapely(seed: int, corners: int, clockwise: bool) -> None:
    vertices = star_polygon(seed, corners)
    polygon = shapely.Polygon(vertices.numpy())
    points = random_tensor(seed, 80, 2, size=1.5)
    inside = shapely.contains_xy(polygon, *points.numpy().T)
    distance = shapely.distance(shapely.points(points.numpy()), polygon.exterior)
    phi = signed_distance(points, vertices.flip(0) if clockwise else vertices)
    assert np.abs(phi.numpy() - np.where(inside, distance, -distance)).max() < 1e-12


@given(seeds)
def test_derivatives_match_differences(seed: int) -> None:
    vertices = star_polygon(seed)
    points = smooth_points(seed, shapely.Polygon(vertices.numpy()))[:12]
    assert torch.autograd.gradcheck(
        signed_distance, (points.requires_grad_(), vertices.requires_grad_()), atol=1e-6, rtol=1e-5
    )


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@given(seeds)
def test_gradient_is_finite_on_the_boundary(dtype: torch.dtype, seed: int) -> None:
    vertices = star_polygon(seed).to(dtype).requires_grad_()
    corners = vertices.detach()
    middles = (corners + corners.roll(-1, 0)) / 2
    points = torch.cat([corners, middles]).requires_grad_()
    phi = signed_distance(points, vertices)
    assert phi.detach().abs().max().item() <= 4 * torch.finfo(dtype).eps
    for gradient in torch.autograd.grad(phi.sum(), (points, vertices)):
        assert torch.isfinite(gradient).all()
