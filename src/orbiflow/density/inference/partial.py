"""Marginal and conditional densities of some of a torus' angles."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from itertools import chain
from typing import NamedTuple

import torch
from torch import Tensor

from orbiflow.density.inference.angles import given_axes, kept_axes
from orbiflow.density.models import (
    LEVELS,
    Density,
    Mixture,
    PartialDensity,
    Split,
    Weighted,
    kernels_for,
    mixture_of,
)
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import one_thread
from orbiflow.settings import as_instance, as_number
from orbiflow.typed_torch import listed

ACCURACY = 0.01
"""Root mean square error of the logarithm, in nats, that is asked for."""

MOST_OFF = 0.5
"""Root mean square error, in nats, up to which a density is handed out."""

MOST_TABULATED = 2
"""The most angles of a density that kernels on a grid can stand for."""

CHECKED, CHECKED_TWICE = 512, 16
"""Points at which two levels of accuracy are compared, and two sets of quasi-random nodes."""

LEAST_WEIGHT = 1e-9
"""The least weight of a component."""

Progress = Callable[[float, str], None]
"""Hears the share of the work that is done, and what is being done; it may raise to stop."""


def marginal(
    density: Density,
    axes: Iterable[int] | int,
    *,
    accuracy: float = ACCURACY,
    progress: Progress | None = None,
) -> Mixture:
    """Return the density of some of a torus' angles alone, whatever the others are.

    Kernels and the uniform component have a closed form, and so have chains that end in the other
    angles. The rest, of one or two angles, is integrated and becomes kernels on a grid: what comes out
    is exactly normalised. Its `error` says by how many nats (root mean square) it is off the true
    density where it is dense, and its `largest_error` by how many it is off anywhere, as far as was
    found. The rest of three angles and more is a `PartialDensity`, which
    asks the whole.

    Args:
        density: A density of two angles or more.
        axes: The numbers of the angles to keep, from 0, in the order that is wanted.
        accuracy: The error that is asked for, in nats. If it is not reached, `error` is larger.
        progress: Hears the share of the work that is done, and what is being done.

    Raises:
        OrbiflowError: for other spaces, no such angles, or an error of more than half a nat.

    >>> from orbiflow.density import DensityEstimator
    >>> import numpy as np
    >>> rng = np.random.default_rng(0)
    >>> fit = DensityEstimator("torus", components="kernels").fit(rng.vonmises(0, 4, (60, 2)))
    >>> marginal(fit.density_, [0]).space
    Torus(axes=1, unit='radians')
    """
    space = as_instance(density, Density, "density").space
    split = Split(space.chart_dim, kept_axes(axes, space.chart_dim))
    return _restricted(density, split, space, accuracy, progress)


def conditional(
    density: Density,
    given: Mapping[int, float],
    axes: Iterable[int] | int | None = None,
    *,
    accuracy: float = ACCURACY,
    progress: Progress | None = None,
) -> Mixture:
    """Return the density of a torus' other angles where some are known.

    As in `marginal`, it is made of the components' conditional densities, each with the weight that
    the known angles leave it.

    Args:
        density: A density of two angles or more.
        given: The values of known angles in turns (points of the chart), by their numbers from 0.
        axes: The numbers of the other angles to keep; default: all.
        accuracy: The error that is asked for, in nats. If it is not reached, `error` is larger.
        progress: Hears the share of the work that is done, and what is being done.

    Raises:
        OrbiflowError: for other spaces, no such angles, all angles, or an error of more than half a
            nat.
    """
    space = as_instance(density, Density, "density").space
    fixed, values = given_axes(given, space.chart_dim)
    space.of_axes(fixed)
    left = [axis for axis in range(space.chart_dim) if axis not in fixed]
    kept = kept_axes(left if axes is None else axes, space.chart_dim)
    if set(kept) & set(fixed):
        raise OrbiflowError(f"axes {sorted(set(kept) & set(fixed))} are given and cannot be kept")
    split = Split(space.chart_dim, kept, fixed, values)
    return _restricted(density, split, space, accuracy, progress)


@one_thread()
@torch.no_grad()
def _restricted(
    density: Density, split: Split, everywhere: Space, accuracy: float, progress: Progress | None
) -> Mixture:
    space = everywhere.of_axes(split.kept)
    accuracy = as_number(accuracy, "accuracy")
    if not 0 < accuracy <= MOST_OFF:
        raise OrbiflowError(f"accuracy must be above 0 and at most {MOST_OFF}, got {accuracy}")
    say: Progress = progress or (lambda _share, _what: None)
    closed, left = density.restricted(split, space)
    error = Error(0.0, 0.0)
    if left and space.dim > MOST_TABULATED:
        parts = [(log, PartialDensity(part, how)) for log, part, how in left]
        whole = _mixture([*closed, *((log + part.log_given, part) for log, part in parts)])
        say(0.5, "comparing")
        error = _spread(whole)
    elif left:
        whole, error = _refined(closed, left, space, accuracy, say)
    else:
        whole = _mixture(closed)
    if error.usual > MOST_OFF:
        raise OrbiflowError(
            "the density of these angles cannot be approximated to better than "
            f"{error.usual:.1f} nats (root "
            'mean square): keep one angle, or fit with components="kernels,mixture"'
        )
    whole.error = error.usual + _inherited(density, split)
    # of a ratio of the joint density and that of what is given, both may be off
    whole.largest_error = error.largest + density.largest_error * (2 if split.given else 1)
    return whole


def _inherited(density: Density, split: Split) -> float:
    """Return the error in nats that is left of that of the density that another is derived from.

    An error of the logarithm is a relative one, and a marginal's is the mean of the whole's over what
    is hidden: its root mean square cannot be larger. Where angles are given, it may be all in the rows
    that are like that, which are the fewer the less dense they are.
    """
    if not density.error or not split.given:
        return density.error
    at = torch.tensor([split.values], dtype=torch.float64)
    rare = min(0.0, float(density.log_marginal(at, list(split.given))))
    return density.error * math.exp(-rare / 2)


class Error(NamedTuple):
    """Differences of log densities in nats: root mean square at samples, and the largest anywhere."""

    usual: float
    largest: float


ON_GRID = Error(1e-4, 1e-3)
"""What kernels on a grid may be off however fine the nodes are, which two levels have in common."""


def _refined(
    closed: list[Weighted],
    left: list[tuple[float, Density, Split]],
    space: Space,
    accuracy: float,
    say: Progress,
) -> tuple[Mixture, Error]:
    """Return kernels for what has no closed form, level by level until they settle, and their error.

    After two levels only the component with the largest error is refined again, until the errors are
    small enough together. Errors are changes of the whole, at its own samples, undivided, since two
    levels may be off in the same direction.
    """
    levels, errors = [-1] * len(left), [Error(math.inf, math.inf)] * len(left)
    kernels: list[list[Weighted]] = [[] for _ in left]

    def refine(number: int) -> None:
        share = (sum(levels) + len(left)) / (LEVELS * len(left))
        levels[number] += 1
        tick = partial(say, share, f"integrating, level {levels[number] + 1}")
        log, density, split = left[number]
        more = kernels_for(density, split, space, levels[number], tick)
        kernels[number] = [(log + log_of_kernels, part) for log_of_kernels, part in more]

    def whole() -> Mixture:
        return _mixture([*closed, *chain(*kernels)])

    for number in range(len(left)):
        refine(number)
    now = whole()
    while math.hypot(*(error.usual for error in errors)) > accuracy:
        coarse = [number for number, level in enumerate(levels) if level < LEVELS - 1]
        if not coarse:
            break
        number, before = max(coarse, key=lambda number: errors[number].usual), now
        refine(number)
        now = whole()
        points = _checked_points(now, CHECKED)
        errors[number] = _error_of(before.log_prob(points) - now.log_prob(points))
    usual = math.hypot(*(error.usual for error in errors), ON_GRID.usual)
    return now, Error(usual, sum(error.largest for error in errors) + ON_GRID.largest)


def _checked_points(density: Density, count: int) -> Tensor:
    """Return as many samples of a density as points drawn evenly: (2 count, r)."""
    generator = torch.Generator().manual_seed(1)
    drawn = density.sample(count, generator)
    even = torch.rand(count, drawn.shape[1], dtype=torch.float64, generator=generator)
    return torch.cat([drawn, even])


def _error_of(off: Tensor) -> Error:
    """Return the error of differences (2 N,) at points as of `_checked_points`."""
    usual = off[: len(off) // 2].square().mean().sqrt()
    return Error(float(usual), float(off.abs().max()))


def _mixture(parts: list[Weighted]) -> Mixture:
    logs = torch.tensor([log for log, _ in parts], dtype=torch.float64)
    weights: list[float] = listed(torch.softmax(logs, dim=0).clamp_min(LEAST_WEIGHT))
    densities = [part for _, part in parts]
    return mixture_of(list(zip(weights, densities, strict=True)))


def _spread(density: Density) -> Error:
    """Return how far log densities by other quasi-random nodes are."""
    points = _checked_points(density, CHECKED_TWICE)
    axes = list(range(density.space.dim))
    first, second = (density.log_marginal(points, axes, seed) for seed in (0, 1))
    return _error_of(first - second)
