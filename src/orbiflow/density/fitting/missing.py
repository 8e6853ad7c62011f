"""Rows that lack some of their angles: what they say, and what they cannot."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import torch
from torch import Tensor

from orbiflow.density.arguments import check_kind, float_tensor
from orbiflow.density.fitting.rows import Rows
from orbiflow.density.models.bases import Base
from orbiflow.density.models.kernels import AdaptiveKernels
from orbiflow.density.partial import at_observed, log_kernels
from orbiflow.density.partial.axes import check_torus
from orbiflow.density.spaces.space import Space
from orbiflow.errors import OrbiflowError
from orbiflow.typed_torch import listed, unique

MISSING = ("refuse", "marginalise")
"""What is done with rows that lack an angle."""

MARGINAL_PARTS = ("kernels", "mixture")
"""Parts that can be fitted to such rows."""

MOST_SPREAD = 4_000
"""Rows that lack angles whose weights are spread over kernels at most: they stand for the others."""

BLOCK_ENTRIES = 2_000_000
"""Of a table of rows against kernels at a time."""


def check_missing(missing: Any) -> str:
    """
    Raises:
        OrbiflowError: for what is not of `MISSING`.
    """
    if not isinstance(missing, str) or missing not in MISSING:
        raise OrbiflowError(f"missing must be one of {', '.join(MISSING)}, got {missing!r}")
    return missing


def observed_points(space: Space, points: Any) -> tuple[Tensor, Tensor]:
    """Canonical points (N, d) of a torus with what is missing (NaN), and which rows know anything.

    Raises:
        OrbiflowError: for another space or shape, infinite angles, or what is no `Space`.
    """
    check_kind(space, Space, "space", "see `make_space`")
    check_torus(space, "densities of rows that lack angles")
    own = float_tensor(points, "points").detach().double().clone()
    if own.dim() != 2 or own.shape[1] != space.dim:
        raise OrbiflowError(f"expected points (N, {space.dim}), got {tuple(own.shape)}")
    if bool(own.isinf().any()):
        raise OrbiflowError("angles may be missing (NaN), but not infinite")
    known = ~own.isnan().all(dim=1)
    return space.project(own[known]), known


def is_whole(rows: Rows) -> Tensor:
    """Which rows (N,) lack nothing."""
    return ~rows.points.isnan().any(dim=1)


def missing_notes(rows: Rows, empty: int) -> list[str]:
    """What to say of rows that lack angles, and of `empty` ones that were left out."""
    lacking = len(rows) - int(is_whole(rows).sum())
    notes: list[str] = []
    if lacking:
        notes.append(
            f"{lacking} of {len(rows)} rows lack some angles and count by the density of those that "
            "they have; kernels are about the whole rows alone; chains, networks and flows were not "
            "tried, as they need whole rows"
        )
    if empty:
        notes.append(
            "1 row lacks all angles and was left out"
            if empty == 1
            else f"{empty} rows lack all angles and were left out"
        )
    return notes


def log_prob_of_rows(part: Base, points: Tensor) -> Tensor:
    """Log density (N,) of a part at points that may lack angles, of those that they have."""
    if not bool(points.isnan().any()):
        return part.log_prob(points)
    return at_observed(part, points)


def with_incomplete(kernels: AdaptiveKernels, rows: Rows, total: float) -> AdaptiveKernels:
    """Kernels about whole rows whose weights follow the rows that lack angles, too.

    Each such row shares its weight out among the kernels as they explain the angles that it has: one
    step of EM, from kernels of the whole rows' weights.

    Args:
        kernels: about whole rows.
        rows: that lack angles.
        total: weight of the whole rows.
    """
    some = rows[:MOST_SPREAD]
    lacking = float(len(rows)) if rows.weights is None else float(rows.weights.sum())
    gained = torch.zeros_like(kernels.weights)
    logs = kernels.weights.log()
    for observed, part in _patterns(some):
        for block in _blocks(part, len(logs)):
            share = torch.softmax(
                log_kernels(kernels, block.points[:, observed], observed) + logs, 1
            )
            gained += share.sum(dim=0) if block.weights is None else block.weights @ share
    weights = total * kernels.weights + lacking * gained / gained.sum()
    return AdaptiveKernels(
        kernels.space, kernels.centers, kernels.concentrations, weights / weights.sum()
    )


def _patterns(rows: Rows) -> Iterator[tuple[list[int], Rows]]:
    """The angles that rows have, and the rows that have just these."""
    kinds, number = unique(~rows.points.isnan(), dim=0, return_inverse=True)
    for k, kind in enumerate(kinds):
        yield listed(torch.nonzero(kind)[:, 0]), rows[number == k]


def _blocks(rows: Rows, kernels: int) -> Iterator[Rows]:
    size = max(1, BLOCK_ENTRIES // kernels)
    for start in range(0, len(rows), size):
        yield rows[start : start + size]
