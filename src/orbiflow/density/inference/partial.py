"""Marginal and conditional densities of some of a torus' angles."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
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
        parts = [_Left(*entry) for entry in left]
        whole, error = _refined(closed, parts, space, accuracy, say)
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


@dataclass
class _Left:
    """A component without a closed form: its log weight, how its angles are split, and kernels for it.

    - `found`: Kernels with log weights, of the last of so many `levels`.
    - `logs`: The log densities (N,) of these kernels at the points where levels are compared.
    - `error`: The error of the whole that is its own: its change from the level before, undivided,
      since two levels may be off in the same direction.
    """

    log: float
    density: Density
    split: Split
    levels: int = 0
    found: list[tuple[float, Density]] = field(default_factory=list[tuple[float, Density]])
    logs: Tensor = field(default_factory=lambda: torch.zeros(0))
    error: Error = field(default_factory=lambda: Error(math.inf, math.inf))

    def refine(self, space: Space, tick: Callable[[], None]) -> list[tuple[float, Density]]:
        """Find kernels of the next level, and return those of the level before."""
        before = self.found
        more = kernels_for(self.density, self.split, space, self.levels, tick)
        self.found, self.levels = [(self.log + log, part) for log, part in more], self.levels + 1
        return before

    def compare(self, before: Tensor, now: Tensor) -> None:
        """Measure the error from log densities (N,) of the level before, and of the whole."""
        # what the whole would be with the old instead of the new
        ratio = (before - now).exp() - (self.logs - now).exp()
        change = ratio.clamp_min(-1 + 1e-12).log1p()
        self.error = _error_of(change)


def _refined(
    closed: list[tuple[float, Density]],
    left: list[_Left],
    space: Space,
    accuracy: float,
    say: Progress,
) -> tuple[Mixture, Error]:
    """Return kernels for what has no closed form, level by level until they settle, and their error.

    After two levels only the component with the largest error is refined again, until the errors are
    small enough together. Changes are of the whole, at its own samples.
    """

    def refine(piece: _Left) -> list[tuple[float, Density]]:
        share = sum(each.levels for each in left) / (LEVELS * len(left))
        return piece.refine(space, partial(say, share, f"integrating, level {piece.levels + 1}"))

    def whole() -> Mixture:
        return _mixture([*closed, *(part for each in left for part in each.found)])

    def now() -> Tensor:
        return torch.stack([logs_of_closed, *(each.logs for each in left)]).logsumexp(dim=0)

    for piece in left:
        refine(piece)
    before = [refine(piece) for piece in left]
    points = _checked_points(whole(), CHECKED)
    logs_of_closed = (
        _log_sum(closed, points) if closed else points.new_full((len(points),), -math.inf)
    )
    for piece in left:
        piece.logs = _log_sum(piece.found, points)
    for piece, old in zip(left, before, strict=True):
        piece.compare(_log_sum(old, points), now())
    while math.hypot(*(piece.error.usual for piece in left)) > accuracy:
        coarse = [piece for piece in left if piece.levels < LEVELS]
        if not coarse:
            break
        piece = max(coarse, key=lambda piece: piece.error.usual)
        refine(piece)
        old, piece.logs = piece.logs, _log_sum(piece.found, points)
        piece.compare(old, now())
    usual = math.hypot(*(piece.error.usual for piece in left), ON_GRID.usual)
    return whole(), Error(usual, sum(piece.error.largest for piece in left) + ON_GRID.largest)


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


def _log_sum(parts: list[tuple[float, Density]], points: Tensor) -> Tensor:
    return torch.stack([log + part.log_prob(points) for log, part in parts]).logsumexp(dim=0)


def _mixture(parts: list[tuple[float, Density]]) -> Mixture:
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
