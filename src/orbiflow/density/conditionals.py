"""Densities of some of a torus' angles: marginal, conditional, and at rows that lack some."""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arguments import as_instance, as_number, as_tensor, as_whole, is_a
from orbiflow.density.models import AdaptiveKernels, Density, Mixture, Split, mixture_of
from orbiflow.density.spaces import CHART, Space, Torus
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import one_thread
from orbiflow.typed_torch import fft, listed, special, unique

MOST_TABULATED = 2
"""The most angles of a density that can be tabulated."""

COSTLY_GRID = {1: 1024, 2: 48}
"""The most points along an angle where each is an integral of its own, by the number of angles."""

MOST_OFF = 0.5
"""Root mean square error, in nats, up to which a density is handed out."""

CHECKED_TWICE = 64
"""Points at which values by quasi-random nodes are compared with those by others."""

LEAST_WEIGHT = 1e-9
"""The least weight of a component."""


def marginal(density: Density, axes: Iterable[int] | int) -> Mixture:
    """Return the density of some of a torus' angles alone, whatever the others are.

    Kernels and the uniform component have a closed form, and so have chains that end in the other
    angles. The rest, of one or two angles, is integrated and tabulated: what comes out is exactly
    normalised, and its `error` says by how many nats (root mean square) it is off the true density.

    Args:
        density: A density of two angles or more.
        axes: The numbers of the angles to keep, from 0, in the order that is wanted.

    Raises:
        OrbiflowError: for other spaces, no such angles, or three and more of them where a component
            has no closed form.

    >>> from orbiflow.density import DensityEstimator
    >>> import numpy as np
    >>> rng = np.random.default_rng(0)
    >>> fit = DensityEstimator("torus", components="kernels").fit(rng.vonmises(0, 4, (60, 2)))
    >>> marginal(fit.density_, [0]).space
    Torus(dim=1, unit='radians')
    """
    space = check_torus(as_instance(density, Density, "density").space, "marginal densities")
    return _restricted(density, Split(space.dim, kept_axes(axes, space.dim)), space)


def conditional(
    density: Density, given: Mapping[int, float], axes: Iterable[int] | int | None = None
) -> Mixture:
    """Return the density of a torus' other angles where some are known.

    As in `marginal`, it is made of the components' conditional densities, each with the weight that
    the known angles leave it.

    Args:
        density: A density of two angles or more.
        given: The values of known angles in turns (points of the chart), by their numbers from 0.
        axes: The numbers of the other angles to keep; default: all.

    Raises:
        OrbiflowError: for other spaces, no such angles, all angles, or three and more that are left
            where a component has no closed form.
    """
    space = check_torus(as_instance(density, Density, "density").space, "conditional densities")
    known, values = given_axes(given, space.dim)
    left = [axis for axis in range(space.dim) if axis not in known]
    kept = kept_axes(left if axes is None else axes, space.dim)
    if set(kept) & set(known):
        raise OrbiflowError(f"axes {sorted(set(kept) & set(known))} are given and cannot be kept")
    return _restricted(density, Split(space.dim, kept, known, values), space)


@one_thread()
@torch.no_grad()
def _restricted(density: Density, split: Split, torus: Torus) -> Mixture:
    space = Torus(len(split.kept), unit=str(torus.unit))
    closed, left = density.restricted(split, space)
    error = 0.0
    if left:
        kernels, log_total, off = _tabulated(left, split, space)
        sums = torch.tensor([log for log, _ in closed], dtype=torch.float64).logsumexp(0).item()
        weight = 1 / (1 + math.exp(sums - log_total))
        error = math.sqrt(weight) * off
        closed.append((log_total, kernels))
    # kernels first, where they are: the order of components is that of the draws of samples
    closed.sort(key=lambda part: part[1].kernel_part is None)
    logs = torch.tensor([log for log, _ in closed], dtype=torch.float64)
    weights: list[float] = listed(torch.softmax(logs, dim=0).clamp_min(LEAST_WEIGHT))
    own = [part for _, part in closed]
    found = mixture_of(list(zip(weights, own, strict=True)))
    found.error = error
    if error > MOST_OFF:
        raise OrbiflowError(
            f"the density of these angles cannot be approximated to better than {error:.1f} nats (root "
            'mean square): keep one angle, or fit with components="kernels,mixture"'
        )
    return found


def _tabulated(
    left: list[tuple[float, Density]], split: Split, space: Torus
) -> tuple[AdaptiveKernels, float, float]:
    """Return kernels on an even grid instead of densities without a closed form.

    Also the logarithm of the densities' integral, and the error of the kernels in nats. Von Mises
    kernels whose deviation is one step interpolate what is smooth over a few steps nearly to rounding:
    their weights are one deconvolution by Fourier transform. The grid is refined until random points
    agree as well.
    """
    if space.dim > MOST_TABULATED:
        kinds = " and ".join(sorted({own.article or own.kind for _, own in left}))
        raise OrbiflowError(
            f"a density of {space.dim} angles has no closed form where {kinds} have a weight: keep one "
            'or two angles, or fit with components="kernels,mixture"'
        )
    observed = list(split.observed)

    def log_function(points: Tensor, seed: int = 0) -> Tensor:
        given = points.new_tensor(split.values).expand(len(points), -1)
        whole = torch.cat([points, given], dim=1)
        logs = [log + own.log_marginal(whole, observed, seed) for log, own in left]
        return torch.stack(logs).logsumexp(dim=0)

    costly = any(own.is_costly(split) for _, own in left)
    count, most = FIRST_GRID[space.dim], (COSTLY_GRID if costly else FINEST_GRID)[space.dim]
    kernels, log_total, error = _on_grid(log_function, space, count)
    while not error < ENOUGH and 2 * count <= most:
        count *= 2
        kernels, log_total, error = _on_grid(log_function, space, count)
    drawn = kernels.sample(CHECKED_TWICE, torch.Generator().manual_seed(1))
    twice = log_function(drawn) - log_function(drawn, seed=1)  # where nodes are quasi-random
    return kernels, log_total, max(error, float(twice.square().mean().sqrt()))


def log_prob_observed(density: Density, points: Tensor, *, measure: str = CHART) -> Tensor:
    """Return log densities (N,) at points (N, d) of a torus some of whose angles are missing (NaN).

    The density of a row is that of the angles that it has, integrated over the others, with respect to
    `measure` of those. Of a row that has none its logarithm is 0.
    """
    space = check_torus(
        as_instance(density, Density, "density").space, "densities at missing angles"
    )
    return at_observed(density, observed_rows(points, "points", space), measure=measure)


def observed_rows(values: Any, name: str, space: Space) -> Tensor:
    """Return a float64 table of angles (N, d), some of which may be missing."""
    rows = as_tensor(values, name).double()
    if rows.dim() != 2 or rows.shape[1] != space.dim:
        raise OrbiflowError(f"expected {name} (N, {space.dim}), got {tuple(rows.shape)}")
    if bool(rows.isinf().any()):
        raise OrbiflowError("angles may be missing (NaN), but not infinite")
    return rows


@one_thread()
@torch.no_grad()
def at_observed(density: Density, points: Tensor, *, measure: str = CHART) -> Tensor:
    """Return what `log_prob_observed` does, at points (N, d) of any space if none lacks anything."""
    if not bool(points.isnan().any()):
        return density.log_prob(points, measure=measure)
    found = torch.zeros(len(points), dtype=torch.float64)
    patterns, number = unique(~points.isnan(), dim=0, return_inverse=True)
    for k, pattern in enumerate(patterns):
        observed: list[int] = listed(torch.nonzero(pattern)[:, 0])
        rows = torch.nonzero(number == k)[:, 0]
        if not observed:
            continue
        some = points[rows][:, observed]
        own = Torus(len(observed), unit=str(density.space.unit))
        whole = len(observed) == density.space.dim
        value = density.log_prob(some) if whole else density.log_marginal(some, observed)
        found[rows] = value + own.log_density_factor(some, measure)
    return found


FIRST_GRID, FINEST_GRID = {1: 256, 2: 48}, {1: 4096, 2: 192}
"""Points of the grid along an angle, at first and at most, by the number of angles."""

ENOUGH = 1e-5
"""Root mean square error of the logarithm, in nats, below which the grid need not be finer."""

CHECKED = 256
"""Random points at which the table is compared with the function."""

DROPPED = 1e-8
"""The weight that the lightest kernels may have together, to be left out."""


def _on_grid(
    log_function: Callable[[Tensor], Tensor], space: Torus, count: int
) -> tuple[AdaptiveKernels, float, float]:
    line = torch.arange(count, dtype=torch.float64) / count
    grid = torch.cartesian_prod(*[line] * space.dim).reshape(-1, space.dim)
    logs = log_function(grid)
    top = float(logs.max())
    values = (logs - top).exp()
    log_total = top + float(values.mean().log())
    kappa = (count / (2 * math.pi)) ** 2
    scaled = special.i0e(torch.tensor(kappa, dtype=torch.float64))
    kernel = (kappa * ((2 * math.pi * line).cos() - 1)).exp() / scaled
    shape = [count] * space.dim
    spectrum = fft.fftn(values.reshape(shape))
    smoothing = fft.fft(kernel).real
    for axis in range(space.dim):
        spectrum = spectrum / smoothing.reshape([-1 if i == axis else 1 for i in range(space.dim)])
    weights = fft.ifftn(spectrum).real.flatten().clamp_min(0)
    weights = weights / weights.sum()
    # all but the lightest
    ordered, order = weights.sort()
    kept = torch.ones_like(weights, dtype=torch.bool)
    kept[order[ordered.cumsum(0) < DROPPED]] = False
    kernels = AdaptiveKernels(
        space,
        grid[kept],
        torch.full((int(kept.sum()), space.dim), kappa, dtype=torch.float64),
        weights[kept] / weights[kept].sum(),
    )
    generator = torch.Generator().manual_seed(0)
    drawn = kernels.sample(CHECKED, generator)
    off = kernels.log_prob(drawn) + log_total - log_function(drawn)
    return kernels, log_total, float(off.square().mean().sqrt())


def check_torus(space: Space, what: str) -> Torus:
    """Return the space if it is a torus."""
    if isinstance(space, Torus):
        return space
    if space.is_round:
        why = "its coordinates are no angles that could be parted from each other"
    else:
        why = (
            "(theta + pi, pi - phi) is the same place as (theta, phi), so that neither angle has a "
            "meaning without the other"
        )
    raise OrbiflowError(f"{what} are of angles on a torus; on the {space.name} {why}")


def kept_axes(axes: Iterable[int] | int, dim: int) -> tuple[int, ...]:
    """Return the numbers of the angles to keep, 0 to dim - 1, each once."""
    given: Any = [axes] if isinstance(axes, numbers.Integral) else axes
    try:
        found = tuple(as_whole(axis, "axes", 0, dim - 1) for axis in given)
    except TypeError:
        raise OrbiflowError(f"axes must be numbers of angles, got {axes!r}") from None
    if not found or len(set(found)) < len(found):
        raise OrbiflowError(f"axes must name one angle or more, each once, got {axes!r}")
    return found


def given_axes(given: Mapping[int, float], dim: int) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Return the numbers of the angles that are known, and their values."""
    if not is_a(given, Mapping) or not given:
        raise OrbiflowError(f"given must hold known angles, such as {{1: 0.25}}, got {given!r}")
    axes = tuple(as_whole(axis, "axes", 0, dim - 1) for axis in given)
    if len(axes) == dim:
        raise OrbiflowError(f"all {dim} angles are given: nothing is left to have a density")
    return axes, tuple(as_number(value, f"angle {axis}") for axis, value in given.items())


def axes_named(wanted: Sequence[str | int], names: Sequence[str]) -> list[int]:
    """Return the numbers, from 0, of angles that are given by column names or by those numbers.

    >>> axes_named(["psi", 0], ["phi", "psi"])
    [1, 0]
    """
    return [_named_axis(one, names) for one in wanted]


def _named_axis(wanted: Any, names: Sequence[str]) -> int:
    if not isinstance(wanted, bool) and isinstance(wanted, numbers.Integral):
        return int(wanted)
    hits = [i for i, name in enumerate(names) if name == wanted]
    if not hits and isinstance(wanted, str):
        hits = [i for i, name in enumerate(names) if name.casefold() == wanted.casefold()]
    if len(hits) == 1:
        return hits[0]
    listed = ", ".join(names)
    if hits:
        raise OrbiflowError(f"several columns are called {wanted!r} ({listed}): say their number")
    raise OrbiflowError(f"no column {wanted!r}; there are {listed}")


def given_named(
    space: Space, given: Iterable[tuple[str | int, float]], names: Sequence[str]
) -> dict[int, float]:
    """Return values in turns by numbers of angles, from values in the space's unit by columns."""
    torus = check_torus(space, "conditional densities")
    found: dict[int, float] = {}
    for key, value in given:
        axis = _named_axis(key, names)
        if axis in found:
            raise OrbiflowError(f"{names[axis]!r} is given twice")
        found[axis] = as_number(value, repr(names[axis])) / torus.period
    return found


def chart_of_observed(space: Space, data: ArrayLike) -> Tensor:
    """Return angles (N, k) in the space's unit, missing ones NaN, as points (N, k) of the torus."""
    torus = check_torus(space, "densities of rows that lack angles")
    values = observed_rows(data, "data", torus)
    return torus.project(torch.as_tensor(values / torus.period))
