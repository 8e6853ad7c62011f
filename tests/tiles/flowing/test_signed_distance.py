"""The signed distance against shapely, and its gradients."""

import numpy as np
import pytest
import shapely
import torch
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.tiles import signed_distance
from strategies import random_tensor, seeds


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
