"""Values of a density on the pixels of a picture, the scales that colour them, and their ticks."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import Density, Pixel, midpoints
from orbiflow.density.spaces import Space

COLOURS = "viridis"

_COARSE = 120
"""Points along a side by which a scale is chosen."""


def off_cones(points: Tensor, margin: float = 1e-3) -> Tensor:
    """Move chart points (N, 2) within `margin` of a corner inwards: cone points have densities 0/0."""
    inward = 0.5 - points
    near = inward.abs().amin(dim=-1, keepdim=True) > 0.5 - margin
    return torch.where(near, points + margin * inward.sign(), points)


@torch.no_grad()
def density_at(density: Density, points: Tensor, measure: str) -> Array:
    """Return the density (N,) at chart points (N, 2), and next to them at cone points."""
    if density.space.is_round:
        points = off_cones(points)
    moved = points.to(device=density.device, dtype=density.dtype)
    return density.log_prob(moved, measure=measure).double().cpu().exp().numpy()


def density_on_grid(
    density: Density, x: Tensor, y: Tensor, measure: str, *, pixel: float | None = None
) -> Array:
    """Return the density (len(x), len(y)) on a grid of chart coordinates, float64.

    It is averaged over pixels (`Density.averaged_over`), as wide as the step of `x`, if no `pixel` is
    given.
    """
    points = torch.stack(torch.meshgrid(x, y, indexing="ij"), dim=-1).reshape(-1, 2)
    side = square_pixel(density.space, pixel or float(x[1] - x[0]))
    return density_over(density, points, measure, side).reshape(len(x), len(y))


def density_over(density: Density, points: Tensor, measure: str, pixel: Pixel) -> Array:
    """Return the density (N,) at chart points (N, 2), averaged over pixels."""
    return density_at(density.averaged_over(pixel), points, measure)


def square_pixel(space: Space, side: float) -> Pixel:
    """Return how large a pixel is whose side is a share of the chart's square."""
    if not space.is_round:
        sides = 2 * math.pi * side / space.sides
        return lambda _points: sides
    # the chart is conformal: a small square stays a square
    return lambda points: side * (space.log_area(off_cones(points)) / 2).exp()[:, None]


def round_pixel(angle: float) -> Pixel:
    """Return a pixel of a map, as wide as an angle everywhere."""
    return lambda _points: torch.tensor(angle)


def chosen_scale(density: Density, measure: str, scale: str) -> tuple[bool, str]:
    """Return whether colours are by logarithms, the same in all pictures of a density, and why."""
    if scale != "auto":
        log = scale == "log"
        return log, f"colours are {'logarithmic' if log else 'linear'}, as asked for"
    even, pixel = midpoints(density.space, _COARSE), 0.5 / _COARSE
    values = density_over(density, even, measure, square_pixel(density.space, pixel))
    areas = density.space.log_area(even).exp().numpy()
    dark = dark_share(values, areas)
    log = dark > DARK_SHARE
    # never more than what is true: 99.6 % are not all
    share, side = (int(100 * dark), "below") if log else (math.ceil(100 * (1 - dark)), "above")
    reason = f"the density is {side} a tenth of its peak on {share} % of the area"
    return log, f"colours are {'logarithmic' if log else 'linear'}, as {reason}"


def is_sharp(density: Density, pixel: Pixel) -> bool:
    """Return whether peaks of a density may be narrower than the pixels of a picture."""
    return any(part.is_narrower_than(pixel) for _, part in density.parts())


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


def shading(values: Array, weights: Array | None = None, *, log: bool | None = False) -> Shade:
    """Return a scale that shows where a density is large, and where it is small.

    A linear scale goes from 0 to the largest value or, if a few are far above the others, to what
    99.8 % are below. A logarithmic one goes from `MAX_DECADES` below the largest value, or from the
    smallest, up to the largest. `log` None chooses the logarithmic one if much would be dark.
    """
    if log is None:
        log = dark_share(values, weights) > DARK_SHARE
    peak = max(float(values.max()), 1e-300)
    if log:
        smallest = float(values.min())
        # nearly even values: a decade at least, so that noise is not drawn as structure
        low = min(max(smallest, 10.0**-MAX_DECADES * peak), peak / 10)
        return Shade(low, peak, peak, log=True, faint=smallest < low)
    flat, order = values.ravel(), values.argsort(axis=None)
    sums = np.cumsum(np.ones_like(flat) if weights is None else weights.ravel()[order])
    high = float(flat[order[np.searchsorted(sums, 0.998 * sums[-1])]])
    cut = peak > 1.3 * high > 0
    return Shade(0.0, high if cut else peak, peak, cut=cut)


def dark_share(values: Array, weights: Array | None = None) -> float:
    """Return the share of the area that a linear scale leaves dark: below a tenth of the peak."""
    dark = values.ravel() < 0.1 * float(values.max())
    return float(np.average(dark, weights=None if weights is None else weights.ravel()))


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
    if space.axes and not space.is_of_angles:
        return f"density, {times}per unit of each column"
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
        powers = _within(shade, (1,))
        values = powers if len(powers) > 2 else _within(shade, (1, 2, 5))
        ticks = [Tick(float(shade.places(np.array(v))), short_number(v)) for v in values]
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
    return [float(shade.places(np.array(v))) for v in _within(shade, range(2, 10))]


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


def _within(shade: Shade, factors: Iterable[int]) -> list[float]:
    """Return these multiples of the powers of ten that are on a scale."""
    low, high = (math.floor(math.log10(v)) for v in (shade.low, shade.high))
    values = [m * 10.0**k for k in range(low, high + 1) for m in factors]
    return [v for v in values if shade.low <= v <= shade.high * (1 + 1e-9)]


def _power(shade: Shade) -> int:
    """Return the power of ten that is the unit of a linear bar: 0 where plain numbers are short."""
    power = math.floor(math.log10(shade.high))
    return 0 if shade.log or -2 <= power <= 3 else power
