"""Signed distance to polygons, differentiable in the points and in the vertices."""

from __future__ import annotations

import torch
from torch import Tensor

from orbiflow.arguments import instance
from orbiflow.errors import OrbiflowError


def signed_distance(points: Tensor, vertices: Tensor) -> Tensor:
    """True distance to the boundary, positive inside (paper, equation of phi).

    Args:
        points: (..., N, 2).
        vertices: (..., K, 2), a simple polygon, convex or not, either orientation; the leading axes
            broadcast with those of the points.

    Returns:
        (..., N). The gradient is a unit vector except on the boundary and the medial axis.

    >>> square = torch.tensor([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    >>> signed_distance(torch.tensor([[1.0, 0.5], [3.0, 3.0]]), square).tolist()
    [0.5, -1.4142135381698608]
    """
    for name, tensor in (("points", points), ("vertices", vertices)):
        instance(tensor, Tensor, name, "torch.as_tensor makes one of an array")
        if not tensor.is_floating_point() or tensor.ndim < 2 or tensor.shape[-1] != 2:
            raise OrbiflowError(
                f"{name} must be floating-point numbers of shape (..., N, 2), got "
                f"{tensor.dtype} of shape {tuple(tensor.shape)}"
            )
    start = vertices.unsqueeze(-3)  # (..., 1, K, 2)
    edge = vertices.roll(-1, dims=-2).unsqueeze(-3) - start
    offset = points.unsqueeze(-2) - start  # (..., N, K, 2)
    length = edge.square().sum(dim=-1).clamp_min(torch.finfo(points.dtype).tiny)
    along = ((offset * edge).sum(dim=-1) / length).clamp(0.0, 1.0)
    squared = (offset - along.unsqueeze(-1) * edge).square().sum(dim=-1).amin(dim=-1)
    # keeps the gradient finite for a point on the boundary
    distance = squared.clamp_min(torch.finfo(points.dtype).eps ** 2).sqrt()
    return torch.where(_inside(offset, edge), distance, -distance)


def _inside(offset: Tensor, edge: Tensor) -> Tensor:
    """Even-odd rule: count the edges that a ray to the right crosses."""
    y, height = offset[..., 1].detach(), edge[..., 1].detach()
    straddles = (y >= 0) != (y >= height)
    cross = edge[..., 0].detach() * y - height * offset[..., 0].detach()
    right = (cross > 0) == (height > 0)
    return ((straddles & right).sum(dim=-1) % 2) == 1
