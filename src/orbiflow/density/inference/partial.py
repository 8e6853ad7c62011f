"""Marginal and conditional densities of some of a torus' angles."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial

import torch
from torch import Tensor

from orbiflow.arguments import as_instance, as_number
from orbiflow.density.inference.angles import check_torus, given_axes, kept_axes
from orbiflow.density.models import LEVELS, Density, Mixture, PartialDensity, Split, mixture_of
from orbiflow.density.spaces import Torus
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import one_thread
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
    is exactly normalised, and its `error` says by how many nats (root mean square) it is off the true
    density. The rest of three angles and more is a `PartialDensity`, which asks the whole.

    Args:
        density: A density of two angles or more.
        axes: The numbers of the angles to keep, from 0, in the order that is wanted.
        accuracy: The error that is asked for, in nats. If it cannot be had, `error` says so.
        progress: Hears the share of the work that is done, and what is being done.

    Raises:
        OrbiflowError: for other spaces, no such angles, or an error of more than half a nat.

    >>> from orbiflow.density import DensityEstimator
    >>> import numpy as np
    >>> rng = np.random.default_rng(0)
    >>> fit = DensityEstimator("torus", components="kernels").fit(rng.vonmises(0, 4, (60, 2)))
    >>> marginal(fit.density_, [0]).space
    Torus(dim=1, unit='radians')
    """
    space = check_torus(as_instance(density, Density, "density").space, "marginal densities")
    split = Split(space.dim, kept_axes(axes, space.dim))
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
        accuracy: The error that is asked for, in nats. If it cannot be had, `error` says so.
        progress: Hears the share of the work that is done, and what is being done.

    Raises:
        OrbiflowError: for other spaces, no such angles, all angles, or an error of more than half a
            nat.
    """
    space = check_torus(as_instance(density, Density, "density").space, "conditional densities")
    known, values = given_axes(given, space.dim)
    left = [axis for axis in range(space.dim) if axis not in known]
    kept = kept_axes(left if axes is None else axes, space.dim)
    if set(kept) & set(known):
        raise OrbiflowError(f"axes {sorted(set(kept) & set(known))} are given and cannot be kept")
    return _restricted(density, Split(space.dim, kept, known, values), space, accuracy, progress)


@one_thread()
@torch.no_grad()
def _restricted(
    density: Density, split: Split, torus: Torus, accuracy: float, progress: Progress | None
) -> Mixture:
    space = Torus(len(split.kept), unit=str(torus.unit))
    accuracy = as_number(accuracy, "accuracy")
    if not 0 < accuracy <= MOST_OFF:
        raise OrbiflowError(f"accuracy must be above 0 and at most {MOST_OFF}, got {accuracy}")
    say = progress or _silent
    closed, left = density.restricted(split, space)
    error = 0.0
    if left and space.dim > MOST_TABULATED:
        parts = [(log, PartialDensity(own, how)) for log, own, how in left]
        whole = _mixture([*closed, *((log + own.log_given, own) for log, own in parts)])
        say(0.5, "comparing")
        error = _spread(whole)
    elif left:
        whole, error = _refined(closed, [_Left(*one) for one in left], space, accuracy, say)
    else:
        whole = _mixture(closed)
    if error > MOST_OFF:
        raise OrbiflowError(
            f"the density of these angles cannot be approximated to better than {error:.1f} nats (root "
            'mean square): keep one angle, or fit with components="kernels,mixture"'
        )
    whole.error = error + _inherited(density, split)
    return whole


def _silent(share: float, what: str) -> None:
    del share, what


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


@dataclass
class _Left:
    """A component without a closed form: its log weight, how its angles are split, and kernels for it.

    - `found`: Kernels with log weights, of the last of so many `levels`.
    - `logs`: The log densities (N,) of these kernels at the samples where levels are compared.
    - `error`: The root mean square error of the whole that is its own, in nats: its change from the
      level before, undivided, since two levels may be off in the same direction.
    """

    log: float
    density: Density
    split: Split
    levels: int = 0
    found: list[tuple[float, Density]] = field(default_factory=list[tuple[float, Density]])
    logs: Tensor = field(default_factory=lambda: torch.zeros(0))
    error: float = math.inf

    def refine(self, space: Torus, tick: Callable[[], None]) -> list[tuple[float, Density]]:
        """Find kernels of the next level, and return those of the level before."""
        before = self.found
        more = self.density.approximated(self.split, space, self.levels, tick)
        self.found, self.levels = [(self.log + log, own) for log, own in more], self.levels + 1
        return before

    def compare(self, before: Tensor, now: Tensor) -> None:
        """Measure the error from log densities (N,) of the level before, and of the whole."""
        # what the whole would be with the old instead of the new
        ratio = (before - now).exp() - (self.logs - now).exp()
        change = ratio.clamp_min(-1 + 1e-12).log1p()
        self.error = float(change.square().mean().sqrt())


def _refined(
    closed: list[tuple[float, Density]],
    left: list[_Left],
    space: Torus,
    accuracy: float,
    say: Progress,
) -> tuple[Mixture, float]:
    """Return kernels for what has no closed form, level by level until they settle, and their error.

    After two levels only the component with the largest error is refined again, until the errors are
    small enough together. Changes are of the whole, at its own samples.
    """

    def refine(one: _Left) -> list[tuple[float, Density]]:
        share = sum(own.levels for own in left) / (LEVELS * len(left))
        return one.refine(space, partial(say, share, f"integrating, level {one.levels + 1}"))

    def whole() -> Mixture:
        return _mixture([*closed, *(part for one in left for part in one.found)])

    def now() -> Tensor:
        return torch.stack([known, *(one.logs for one in left)]).logsumexp(dim=0)

    for one in left:
        refine(one)
    before = [refine(one) for one in left]
    points = whole().sample(CHECKED, torch.Generator().manual_seed(1))
    known = _log_sum(closed, points) if closed else points.new_full((CHECKED,), -math.inf)
    for one in left:
        one.logs = _log_sum(one.found, points)
    for one, old in zip(left, before, strict=True):
        one.compare(_log_sum(old, points), now())
    while (error := math.hypot(*(one.error for one in left))) > accuracy:
        coarse = [one for one in left if one.levels < LEVELS]
        if not coarse:
            break
        one = max(coarse, key=lambda own: own.error)
        refine(one)
        old, one.logs = one.logs, _log_sum(one.found, points)
        one.compare(old, now())
    return whole(), error


def _log_sum(parts: list[tuple[float, Density]], points: Tensor) -> Tensor:
    return torch.stack([log + own.log_prob(points) for log, own in parts]).logsumexp(dim=0)


def _mixture(parts: list[tuple[float, Density]]) -> Mixture:
    # kernels first, where they are: the order of components is that of the draws of samples
    parts = sorted(parts, key=lambda part: part[1].kernel_part is None)
    logs = torch.tensor([log for log, _ in parts], dtype=torch.float64)
    weights: list[float] = listed(torch.softmax(logs, dim=0).clamp_min(LEAST_WEIGHT))
    own = [part for _, part in parts]
    return mixture_of(list(zip(weights, own, strict=True)))


def _spread(density: Density) -> float:
    """Return how far log densities by other quasi-random nodes are, at samples."""
    points = density.sample(CHECKED_TWICE, torch.Generator().manual_seed(0))
    axes = list(range(density.space.dim))
    first, second = (density.log_marginal(points, axes, seed) for seed in (0, 1))
    return float((first - second).square().mean().sqrt())
