"""Networks of angles on even grids: marginal densities by eliminating one angle after the other.

The trapezoidal rule over a period converges exponentially (Trefethen and Weideman, 2014), so sums over
grids that resolve the factors are integrals to nearly all digits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import torch
from torch import Tensor

from orbiflow.density.models.chain_sums import SCALES
from orbiflow.density.models.chains import Factor, VonMisesChains, waves
from orbiflow.density.models.density import Split
from orbiflow.density.models.kernels import KERNEL_STEP, sharpest_on
from orbiflow.density.models.sums import FAINT_LOG, LOG2_E, log_sum_exp
from orbiflow.typed_torch import special

STEP_DEVIATIONS = 0.9
"""Deviations of the sharpest bumps between two points of a grid."""

SHARP_SHARE = 0.999
"""Share of a factor's weight that is of bumps up to this sharpness; the rest are as sharp as that."""

GRID_FINENESS = (0.85, 1.0, 1.15, 1.4)
"""How much finer grids are than factors need, level by level."""

MOST_ENTRIES = 2**24
"""The most entries of a table on the way."""

MAX_PAIRED_RATIO = 64
"""How many times more terms a product of two tables may have, which is one of matrices."""

FAINT_SHARE = 1e-6
"""The least share of a component, given the parents, that is seen."""

BLOCK_ENTRIES, BLOCK_ROWS = 2**18, 2**10
"""Entries of a table, and rows of parents, worked on at a time."""

Grids = Mapping[int, Tensor]
"""The points, in turns, at which each angle is seen."""


def grids_for(factors: Sequence[Factor], split: Split, level: int) -> Grids | None:
    """Return grids that resolve all factors, each time finer; None if a product would be too large."""
    fixed = dict(zip(split.given, split.values, strict=True))
    wanted = dict.fromkeys((factor.axes[-1] for factor in factors), 1.0)
    for axes, chains in factors:
        d = len(axes)
        slopes = chains.means[:, :, 1 : 1 + d] ** 2 + chains.means[:, :, 1 + d :] ** 2  # (K, d, d)
        bent = (chains.concentrations[:, :, None] * slopes).amax(dim=1)
        kappa = torch.maximum(chains.concentrations, bent)[..., None] / torch.tensor(SCALES)
        for k, axis in enumerate(axes):
            ordered, order = kappa[:, k].flatten().sort()
            below = chains.log_weights.exp().flatten()[order].cumsum(0)
            sharp = ordered[int((below < SHARP_SHARE * below[-1]).sum())]
            wanted[axis] = max(wanted[axis], float(sharp))
    sizes: dict[int, int] = {}
    for axis, kappa in wanted.items():
        step = KERNEL_STEP if axis in split.kept else STEP_DEVIATIONS
        fine = GRID_FINENESS[level] * 2 * math.pi * math.sqrt(kappa) / step
        sizes[axis] = 1 if axis in fixed else 2 * math.ceil(fine / 2)
    tables = [tuple(axis for axis in axes if sizes[axis] > 1) for axes, _ in factors]
    if elimination_order(tables, sizes, split.kept)[1] > MOST_ENTRIES:
        return None
    return {
        axis: torch.tensor([fixed[axis]], dtype=torch.float64)
        if axis in fixed
        else torch.arange(size, dtype=torch.float64) / size
        for axis, size in sizes.items()
    }


def eliminated(
    factors: Sequence[Factor], grids: Grids, kept: Sequence[int], tick: Callable[[], None]
) -> tuple[float, Tensor]:
    """Return the integral of a product of factors over all angles but those kept.

    Angles with one point are given. The result is on the grid of those kept, relative to its largest
    value, whose logarithm comes first.
    """
    log_scale = 0.0
    sizes = {axis: len(grid) for axis, grid in grids.items() if len(grid) > 1}
    left: list[tuple[tuple[int, ...], Tensor]] = []
    for axes, chains in factors:
        step = KERNEL_STEP if axes[-1] in kept else STEP_DEVIATIONS
        sharpest = sharpest_on(sizes[axes[-1]], step) if axes[-1] in sizes else math.inf
        log, table = conditional_table(chains, [grids[axis] for axis in axes], sharpest, tick)
        free_axes = tuple(axis for axis in axes if axis in sizes)
        left.append((free_axes, table.reshape([sizes[axis] for axis in free_axes])))
        log_scale += log
    for axis in elimination_order([axes for axes, _ in left], sizes, kept)[0]:
        touched = [entry for entry in left if axis in entry[0]]
        axes, table = _product(touched, sizes, [axis])
        top = float(table.max())
        log_scale += math.log(top) - math.log(sizes[axis])
        left = [entry for entry in left if axis not in entry[0]] + [(axes, table / top)]
        tick()
    axes, table = _product(left, sizes, [])
    table = table.permute([axes.index(axis) for axis in kept])
    top = float(table.max())
    return log_scale + math.log(top), table / top


def elimination_order(
    tables: Sequence[tuple[int, ...]], sizes: Mapping[int, int], kept: Sequence[int]
) -> tuple[list[int], int]:
    """Return the hidden angles, cheapest first, and the most entries of a table on the way."""
    left = [frozenset(axes) for axes in tables]
    hidden = set(sizes) - set(kept)
    order: list[int] = []
    most = max((_entries(axes, sizes) for axes in left), default=1)
    while hidden:
        cliques = {axis: frozenset[int]().union(*(t for t in left if axis in t)) for axis in hidden}
        axis = min(sorted(hidden), key=lambda candidate: _entries(cliques[candidate], sizes))
        terms, result = (
            _entries(clique, sizes) for clique in (cliques[axis], cliques[axis] - {axis})
        )
        paired = sum(axis in table for table in left) < 3
        most = max(most, result, terms // MAX_PAIRED_RATIO if paired else terms)
        left = [t for t in left if axis not in t] + [cliques[axis] - {axis}]
        hidden.remove(axis)
        order.append(axis)
    return order, most


def _entries(axes: frozenset[int], sizes: Mapping[int, int]) -> int:
    return math.prod(sizes[axis] for axis in axes)


def _product(
    tables: Sequence[tuple[tuple[int, ...], Tensor]], sizes: Mapping[int, int], over: Sequence[int]
) -> tuple[tuple[int, ...], Tensor]:
    """Return the product of tables of some axes each, summed over axes."""
    tables = sorted(tables, key=lambda entry: entry[1].numel())
    letter = {axis: chr(ord("a") + k) for k, axis in enumerate(sizes)}
    axes = tuple(sorted({axis for table_axes, _ in tables for axis in table_axes} - set(over)))
    terms = ",".join("".join(letter[axis] for axis in table_axes) for table_axes, _ in tables)
    target = "".join(letter[axis] for axis in axes)
    return axes, torch.einsum(f"{terms}->{target}", *(table for _, table in tables))


def conditional_table(
    chains: VonMisesChains, lines: Sequence[Tensor], sharpest: float, tick: Callable[[], None]
) -> tuple[float, Tensor]:
    """Return the density of the last angle given those before it, on a product grid (P, n).

    It is relative to its largest value, whose logarithm comes first. Bumps sharper than the
    concentration `sharpest` are as wide as that, with the same mass.
    """
    parents, angles = lines[:-1], 2 * math.pi * lines[-1]
    rows = (
        torch.cartesian_prod(*parents).reshape(-1, len(parents))
        if parents
        else angles.new_zeros(1, 0)
    )
    kappa = (chains.concentrations[:, -1, None] / angles.new_tensor(SCALES)).flatten()
    kappa = kappa.clamp_max(sharpest)
    peaks = -special.i0e(kappa).log()
    images = torch.stack([angles.cos(), angles.sin(), torch.ones_like(angles)])
    table = angles.new_zeros(len(rows), len(angles))
    log_scale = float(peaks.max())
    for start in range(0, len(rows), BLOCK_ROWS):
        tick()
        logs, mean = _given_parents(chains, rows[start : start + BLOCK_ROWS])
        logs -= log_sum_exp(logs)[:, None]
        seen = logs > math.log(FAINT_SHARE)
        logs -= torch.where(seen, logs.exp(), 0.0).sum(dim=1, keepdim=True).log()
        row, part = seen.nonzero(as_tuple=True)
        top = logs[row, part] + peaks[part] - log_scale - kappa[part]
        angle, sharp = mean[row, part // len(SCALES)], kappa[part]
        bumps = torch.stack([sharp * angle.cos(), sharp * angle.sin(), top], dim=1) * LOG2_E
        for some in torch.split(torch.arange(len(row)), max(1, BLOCK_ENTRIES // len(angles))):
            values = (bumps[some] @ images).clamp_min_(FAINT_LOG * LOG2_E).exp2_()
            table.index_add_(0, start + row[some], values)
    return log_scale, table


def _given_parents(chains: VonMisesChains, parents: Tensor) -> tuple[Tensor, Tensor]:
    """Return logs (N, K * L) of weight times parents' density, and means (N, K) of the last angle."""
    angle = torch.cat([2 * math.pi * parents, parents.new_zeros(len(parents), 1)], dim=1)
    count, d = chains.concentrations.shape
    mean = (waves(angle) @ chains.means.flatten(0, 1).mT).reshape(len(parents), count, d)
    kappa, scale = chains.concentrations[:, :-1], parents.new_tensor(SCALES)[:, None]
    fit = ((angle[:, None, :-1] - mean[..., :-1]).cos_().sub_(1).mul_(kappa)).sum(dim=-1)
    normal = special.i0e(kappa / scale[..., None]).log().sum(dim=-1)  # (L, K)
    logs = fit[:, :, None] / scale[:, 0] + (chains.log_weights.mT - normal).mT
    return logs.flatten(1), mean[..., -1]
