"""Merging points that lie close together: a likelihood whose cost does not grow with the data."""

from __future__ import annotations

import torch
from torch import Tensor

from orbiflow.typed_torch import unique

LEVELS = 5
"""Halvings of the cells at most: a point is then known to 1/32 of a cell."""


def merged(
    points: Tensor, cells: int, crowd: int, row_weights: Tensor | None = None
) -> tuple[Tensor, Tensor]:
    """Means of the points in each cell of a grid that is finer where points crowd, and their shares.

    A smooth log density summed over the points changes by half its curvature times their variance
    within a cell, which is below 1 / (6 cells^2). Where the density is sharp, points crowd: cells of
    more than `crowd` points are quartered, again and again.

    Args:
        points: (N, d) in [0, 1]^d.
        cells: along a side, of the coarsest grid.
        row_weights: of the points (N,); default equal.
        crowd: points in a cell, at most; more only where cells have been halved `LEVELS` times.

    Returns:
        Points (M, d) and weights (M,) of sum 1, M <= N, in the points' dtype.

    >>> merged(torch.tensor([[0.1], [0.2], [0.9]]), 2, crowd=2)[1]
    tensor([0.6667, 0.3333])
    """
    group = torch.zeros(len(points), dtype=torch.long, device=points.device)
    left = torch.arange(len(points), device=points.device)
    groups = 0
    for level in range(LEVELS + 1):
        _, where, counts = unique(
            _labels(points[left], cells << level), return_inverse=True, return_counts=True
        )
        settled = (counts[where] <= crowd) | (level == LEVELS)
        group[left[settled]] = groups + where[settled]
        left, groups = left[~settled], groups + len(counts)
        if not len(left):
            break
    _, where, counts = unique(group, return_inverse=True, return_counts=True)
    if row_weights is not None:
        points = points * row_weights[:, None]
        counts = row_weights.new_zeros(len(counts)).index_add_(0, where, row_weights)
        sums = points.new_zeros(len(counts), points.shape[1]).index_add_(0, where, points)
        return sums / counts[:, None], (counts / counts.sum()).to(points)
    sums = points.new_zeros(len(counts), points.shape[1]).index_add_(0, where, points)
    return sums / counts[:, None], counts.to(points) / len(points)


def _labels(points: Tensor, cells: int) -> Tensor:
    """The number (N,) of each point's cell."""
    cell = (points * cells).floor().clamp(0, cells - 1).long()
    label = cell[:, 0]
    for axis in range(1, points.shape[1]):
        label = label * cells + cell[:, axis]
    return label
