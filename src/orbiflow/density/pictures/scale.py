"""Scales that turn values of a density into colours, and the ticks of their colour bars."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.spaces import Space

MAX_DECADES = 5
"""Decades below the largest value that a logarithmic scale spans at most."""

DARK_SHARE = 0.8
"""If the density is below a tenth of its peak on more of the area, "auto" is logarithmic."""

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


class Shade(NamedTuple):
    """A scale of colours from `low` to `high`.

    - `peak`: The largest value. `cut`: Whether some values are above `high`.
    - `log`: Whether it is logarithmic. `faint`: Whether some values are below `low`.
    """

    low: float
    high: float
    peak: float
    cut: bool = False
    log: bool = False
    faint: bool = False

    def places(self, values: Array) -> Array:
        """Return where values of any shape are on the bar: 0 at `low` or below, 1 at `high`."""
        if not self.log:
            return np.maximum(values, 0.0) / self.high
        return np.log(np.maximum(values, self.low) / self.low) / math.log(self.high / self.low)


class Tick(NamedTuple):
    """A place on the colour bar, 0 to 1, and its text."""

    at: float
    text: str


def shading(values: Array, weights: Array | None = None, *, log: bool = False) -> Shade:
    """Return a scale that shows where a density is large, and where it is small.

    A linear scale goes from 0 to the largest value or, if a few are far above the others, to what
    99.8 % are below. A logarithmic one goes from `MAX_DECADES` below the largest value, or from the
    smallest, up to the largest.
    """
    peak = max(float(values.max()), 1e-300)
    if log:
        smallest = float(values.min())
        # nearly even values: a decade at least, so that noise is not drawn as structure
        low = min(max(smallest, 10.0**-MAX_DECADES * peak), peak / 10)
        return Shade(low, peak, peak, log=True, faint=smallest < low)
    high = _quantile(values, weights, 0.998)
    cut = peak > 1.3 * high > 0
    return Shade(0.0, high if cut else peak, peak, cut=cut)


def dark_share(values: Array, weights: Array | None = None) -> float:
    """Return the share of the area that a linear scale leaves dark: below a tenth of the peak."""
    dark = values.ravel() < 0.1 * float(values.max())
    return float(np.average(dark, weights=None if weights is None else weights.ravel()))


def _quantile(values: Array, weights: Array | None, share: float) -> float:
    """Return the value that this share of the area is at or below."""
    flat, order = values.ravel(), values.argsort(axis=None)
    sums = np.cumsum(np.ones_like(flat) if weights is None else weights.ravel()[order])
    return float(flat[order[np.searchsorted(sums, share * sums[-1])]])


def measure_label(space: Space, measure: str, power: int = 0) -> str:
    """Return what a density is measured in, for a colour bar, in units of ten to `power`.

    >>> from orbiflow.density import Torus
    >>> measure_label(Torus(2, unit="degrees"), "natural", -5)
    'density, 10⁻⁵ per degree²'
    """
    times = f"{short_number(10.0**power)} " if power else ""
    if measure == "uniform":
        return f"density, {times}times that of the uniform distribution"
    if measure == "square":
        return f"density, {times}per area of the canonical square"
    unit = (space.unit or "steradian").removesuffix("s")
    raised = {1: "", 2: "²", 3: "³"}.get(space.dim, "ᵈ") if space.unit else ""
    return f"density, {times}per {unit}{raised}"


def bar_label(shade: Shade, space: Space, measure: str) -> str:
    """Return the label beside a colour bar with `bar_ticks`."""
    power = _power(shade)
    peak = f" (peak {shade.peak / 10.0**power:.3g})" if shade.cut else ""
    return measure_label(space, measure, power) + peak


def bar_ticks(shade: Shade, *, ends: bool = False) -> list[Tick]:
    """Return ticks with texts, on a linear scale in units of the power of ten in `bar_label`."""
    from matplotlib.ticker import MaxNLocator

    unit = 10.0 ** _power(shade)
    if shade.log:
        ticks = _log_ticks(shade)
    else:
        values = MaxNLocator(6, steps=[1, 2, 5, 10]).tick_values(0.0, shade.high / unit)
        ticks = [Tick(v * unit / shade.high, f"{v:g}") for v in values if v * unit <= shade.high]
    if ends and shade.cut:
        top = Tick(1.0, f"≥ {short_number(shade.high / unit, 2)}")
        ticks = [*(tick for tick in ticks if tick.at < 0.93), top]
    if ends and shade.faint:
        bottom = Tick(0.0, f"≤ {short_number(shade.low / unit, 2)}")
        ticks = [bottom, *(tick for tick in ticks if tick.at > 0.07)]
    return ticks


def minor_places(shade: Shade) -> list[float]:
    """Return places of ticks without texts: 2 to 9 times the powers of ten of a logarithmic scale."""
    if not shade.log:
        return []
    values = [m * 10.0**k for k in _decades(shade) for m in range(2, 10)]
    return [
        float(shade.places(np.array(v)))
        for v in values
        if shade.low <= v <= shade.high * (1 + 1e-9)
    ]


def short_number(value: float, digits: int = 3) -> str:
    """Return a number in so many digits, very large and small ones with a power of ten.

    >>> short_number(2e-7), short_number(1e5), short_number(0.25)
    ('2 × 10⁻⁷', '10⁵', '0.25')
    """
    power = math.floor(math.log10(abs(value)) + 1e-9) if value else 0
    if -3 <= power <= 3:
        return f"{value:.{digits}g}"
    factor = f"{value / 10.0**power:.{digits}g}"
    raised = f"10{str(power).translate(_SUPERSCRIPTS)}"
    return raised if factor == "1" else f"{factor} × {raised}"


def _log_ticks(shade: Shade) -> list[Tick]:
    within = [10.0**k for k in _decades(shade) if shade.low <= 10.0**k <= shade.high * (1 + 1e-9)]
    factors = (1,) if len(within) > 2 else (1, 2, 5)
    values = [m * 10.0**k for k in _decades(shade) for m in factors]
    return [
        Tick(float(shade.places(np.array(v))), short_number(v))
        for v in values
        if shade.low <= v <= shade.high * (1 + 1e-9)
    ]


def _decades(shade: Shade) -> range:
    return range(math.floor(math.log10(shade.low)), math.floor(math.log10(shade.high)) + 1)


def _power(shade: Shade) -> int:
    """Return the power of ten that is the unit of a linear bar: 0 where plain numbers are short."""
    power = math.floor(math.log10(shade.high))
    return 0 if shade.log or -2 <= power <= 3 else power
