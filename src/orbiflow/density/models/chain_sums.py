"""Sums over the components of von Mises chains at many points: products of matrices, few cosines."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from orbiflow.density.models.sums import LOG2_E
from orbiflow.typed_torch import transformed

SCALES = (1.0, 4.0, 16.0)
"""A component's concentrations are divided by these, each with its own weight: heavy tails.

Each is 4 times the one before: `at_scales` takes powers, which are cheaper than exponentials.
"""

FAINTEST_LOG = {torch.float64: -170.0, torch.float32: -20.0}
"""Logarithm of the least exponential: its 4th power does not underflow, which would be slow."""

FELT_LOG_RATIO = 40.0
"""Logarithm of how much larger sums must be, for such exponentials not to be felt."""


class ChainFits:
    """How well K components of chains fit d angles each, not yet divided by a scale.

    Where angles are regressed on nothing, such as the first of each chain, cosines of residuals are
    linear in `seen_angles`. All other residuals are linear in these themselves.

    Args:
        means: The regressions (K, d, 1 + 2 d).
        concentrations: The concentrations (K, d).
        order: The numbers (K, d) of the angles from the first to the last of each chain.
        regressed: Whether to give residuals of all angles after the first, even if nothing bends them.
    """

    def __init__(
        self, means: Tensor, concentrations: Tensor, order: Tensor, *, regressed: bool = False
    ) -> None:
        count, d = concentrations.shape
        every = torch.arange(count, device=means.device)
        self._linear = means.new_zeros(1 + 3 * d, count)
        self._linear[d] = -concentrations.sum(dim=1)
        self._bent: list[tuple[Tensor, Tensor]] = []
        for place, axis in enumerate(order.mT):
            regression, kappa = means[every, axis], concentrations[every, axis]
            if bool(regression[:, 1:].any()) or (regressed and place):
                rows = torch.zeros_like(self._linear)
                rows[d:] = -regression.mT
                rows[axis, every] = 1
                self._bent.append((rows, kappa))
            else:
                self._linear[1 + d + axis, every] = kappa * regression[:, 0].sin()
                self._linear[1 + 2 * d + axis, every] = kappa * regression[:, 0].cos()

    def at(self, seen: Tensor) -> tuple[Tensor, list[Tensor]]:
        """Return sums (N, K) of kappa (cos - 1) over the angles, and residuals that are regressed.

        `seen` (N, 1 + 3 d) are `seen_angles`. Residuals (N, K) are one table for each place in the
        chains at which means are not constant.
        """
        fit = seen @ self._linear
        residuals = [seen @ rows for rows, _ in self._bent]
        for residual, (_, kappa) in zip(residuals, self._bent, strict=True):
            fit = torch.addcmul(fit, residual.cos(), kappa)
        return fit, residuals


def seen_angles(angle: Tensor) -> Tensor:
    """Return angles (N, d) in radians, then 1, then their sines and cosines: (N, 1 + 3 d)."""
    return torch.cat([angle, torch.ones_like(angle[:, :1]), angle.sin(), angle.cos()], dim=1)


def at_scales(fit: Tensor) -> list[Tensor]:
    """Return exponentials (N, K) of fits (N, K) over 16, 4 and 1, none of which underflows.

    Those below `FAINTEST_LOG` are raised to it, and those of sharper scales to its 4th power.
    """
    faintest = FAINTEST_LOG[fit.dtype]
    wide = fit.mul(LOG2_E / SCALES[-1]).clamp_min_(faintest * LOG2_E).exp2()
    middle = wide.square().square_()
    return [wide, middle, middle.clamp_min(math.exp(faintest)).square_().square_()]


class ChainSum:
    """The sum over all components and scales, at points of a torus.

    Args:
        fits: The components.
        log_peaks: Logarithms (L, K) of the largest values of each, for scales from 1 to 16.
    """

    def __init__(self, fits: ChainFits, log_peaks: Tensor) -> None:
        self._fits, self._log_peaks = fits, log_peaks
        self._top = log_peaks.max()
        self._peaks = (log_peaks - self._top).exp().flip(0)

    def log(self, points: Tensor) -> Tensor:
        """Return the logarithm (N,) of the sum at points (N, d) in turns; differentiable."""
        fit, _ = self._fits.at(seen_angles(2 * math.pi * points))
        if transformed():  # which knows no faint rows: each term by logarithms
            scales = fit.new_tensor(SCALES)[:, None]
            return (fit[:, None] / scales + self._log_peaks).flatten(1).logsumexp(dim=1)
        wide, middle, narrow = at_scales(fit)
        total = wide @ self._peaks[0] + middle @ self._peaks[1] + narrow @ self._peaks[2]
        least = math.exp(FAINTEST_LOG[total.dtype] + FELT_LOG_RATIO) * self._peaks.sum()
        logs_of_sums = total.clamp_min(least).log() + self._top
        faint = (total <= least).nonzero()[:, 0]
        if len(faint):
            scales = fit.new_tensor(SCALES)[:, None]
            logs = (fit[faint, None] / scales + self._log_peaks).flatten(1)
            logs_of_sums = logs_of_sums.index_put((faint,), logs.logsumexp(dim=1))
        return logs_of_sums
