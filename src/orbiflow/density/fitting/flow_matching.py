"""Closed-form flow matching: Fourier fields by linear least squares, no descent (design point 14)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import torch
from scipy.optimize import linear_sum_assignment
from torch import Tensor

from orbiflow.density.spaces import Space
from orbiflow.fields import InvariantField

ORDER = 3
"""Of the derivatives that the ridge holds small: the displacements are smooth, their noise is not."""

GROUP = 400
"""Points matched optimally at a time: the cost of an assignment grows with the cube."""


def coupled(
    space: Space, start: Tensor, end: Tensor, *, group: int = GROUP
) -> tuple[Tensor, Tensor]:
    """Pair base points with data points so that their geodesics are short.

    Within groups of `group` points the sum of squared distances over group images is least
    (minibatch optimal transport: Tong et al., 2024; Pooladian et al., 2023).

    Args:
        start, end: canonical points (N, d).

    Returns:
        Starts and shortest displacements, both (N, d), in the order of `end`.
    """
    order: list[Tensor] = []
    for first in range(0, len(end), group):
        cost = space.squared_distances(start[first : first + group], end[first : first + group])
        rows, columns = linear_sum_assignment(cost.cpu().numpy())
        order.append(first + torch.as_tensor(rows[np.argsort(columns)]))
    paired = start[torch.cat(order)]
    return paired, space.displacement(paired, end)


@torch.no_grad()
def match_flow(
    fields: Sequence[InvariantField],
    space: Space,
    start: Tensor,
    move: Tensor,
    *,
    repeats: int = 2,
    ridge: float = 1e-3,
    iterations: int = 15,
    generator: torch.Generator | None = None,
) -> None:
    """Set the parameters of `fields`, the equal segments of a flow, by ridge regression.

    Segment k of K regresses the displacements at points on the geodesics at times in
    [k / K, (k + 1) / K] (Lipman et al., Flow Matching for Generative Modeling, 2023). A segment of
    duration 1 carries what takes time 1 / K, hence the factor.

    Args:
        fields: single fields on one basis.
        space: of the points.
        start, move: (N, d), from `coupled`.
        repeats: times at each geodesic and segment.
        ridge: weight of E|V|^2 + E|grad^3 V|^2, lengths in wavelengths, beside the data's 1.
        iterations: of conjugate gradients at most.
    """
    count = len(fields)
    for k, field in enumerate(fields):
        shape = (repeats, len(start), 1)
        time = torch.rand(shape, dtype=start.dtype, generator=generator)
        points = (start + (k + time) / count * move).reshape(-1, space.dim)
        values = (move / count).expand(repeats, -1, -1).reshape(-1, space.dim)
        field.parameters_.copy_(_least_squares(field, points, values, ridge, iterations))


def _least_squares(
    field: InvariantField, points: Tensor, values: Tensor, ridge: float, iterations: int
) -> Tensor:
    size = len(points)
    magnitude = torch.as_tensor(field.basis.magnitude).to(points)
    weight = ridge * (1 + magnitude ** (2 * ORDER)) * field.scale**2

    def normal(c: Tensor) -> Tensor:
        field.parameters_.copy_(c)
        return field.adjoint(points, field(points)) / size + weight * c

    right = field.adjoint(points, values) / size
    # the columns are orthonormal for even points, so this is nearly the diagonal
    return conjugate_gradients(normal, right, field.scale**2 + weight, iterations)


def conjugate_gradients(
    apply: Callable[[Tensor], Tensor],
    right: Tensor,
    diagonal: Tensor,
    iterations: int,
    tolerance: float = 1e-4,
) -> Tensor:
    """Solve a positive definite system, preconditioned by its approximate diagonal."""
    x, residual = torch.zeros_like(right), right.clone()
    z = residual / diagonal
    direction, old = z.clone(), residual @ z
    stop = tolerance**2 * old
    for _ in range(iterations):
        if old <= stop:
            break
        image = apply(direction)
        step = old / (direction @ image)
        x = x + step * direction
        residual = residual - step * image
        z = residual / diagonal
        new = residual @ z
        direction, old = z + new / old * direction, new
    return x
