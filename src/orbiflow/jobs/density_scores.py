"""Log densities and gradients of many rows, block by block."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density import (
    CHECKED,
    SymmetricDensity,
    Table,
    TabulatedDensity,
    log_density_gradient,
)
from orbiflow.jobs.density_requests import DensityScoreRequest
from orbiflow.jobs.run import Sink
from orbiflow.runtime import Cancel, Note, Progress

BLOCK, BLOCK_GRADIENT = 2**18, 2**16
"""Rows at a time: many cost less each, few leave room and tell how far it is."""


def evaluated(
    density: SymmetricDensity,
    table: Table,
    points: Tensor,
    log_prob: Callable[..., Tensor],
    request: DensityScoreRequest,
    tell: Sink,
    cancel: Cancel,
) -> dict[str, Array]:
    """Columns (N,) to add: "log_prob" and, if asked, its gradient in the data's columns.

    Args:
        points: (N, d), the table's in the chart.
        log_prob: of a density and points; a table's own is taken where that was asked for.
    """
    size = BLOCK_GRADIENT if request.gradient else BLOCK
    source: SymmetricDensity | TabulatedDensity = density
    if request.table:
        source = _tabulated(density, tell)
        log_prob = TabulatedDensity.log_prob
    scores: list[NDArray[np.float64]] = []
    slopes: list[NDArray[np.float64]] = []
    for start in range(0, len(points), size):
        cancel.check()
        with torch.no_grad():
            found = log_prob(source, points[start : start + size], measure=request.measure)
        scores.append(found.double().numpy())
        if request.gradient:
            slopes.append(log_density_gradient(density, table.values[start : start + size])[1])
        tell(Progress(min(1.0, (start + size) / len(points)), "scoring"))
    added = {"log_prob": np.concatenate(scores)}
    if slopes:
        columns = np.concatenate(slopes).T
        added |= {f"log_prob_by_{name}": c for name, c in zip(table.columns, columns, strict=True)}
    return added


def _tabulated(density: SymmetricDensity, tell: Sink) -> TabulatedDensity:
    """The density's table, its error told."""
    tell(Progress(0.0, "making a table"))
    made = TabulatedDensity(density)
    tell(
        Note(
            f"read off a table: the error is {made.error:.1e} nats at the density's own points, "
            f"{made.largest:.1e} at most among {CHECKED} of them and as many anywhere"
        )
    )
    return made
