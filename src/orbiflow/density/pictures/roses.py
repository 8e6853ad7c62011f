"""Rose diagrams: circular histograms whose areas are shares, with a density's curve or a mean."""

# matplotlib types no keyword arguments
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import Density
from orbiflow.density.pictures import frames
from orbiflow.density.pictures.colours import density_at
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.drawing import Picture, Sheet

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.projections.polar import PolarAxes

COMPASS = frozenset(
    {
        "azimuth",
        "bearing",
        "course",
        "declination",
        "direction",
        "heading",
        "strike",
        "trend",
        "wind",
    }
)
"""First words of names of angles that run clockwise from north."""

SECTORS = {0: 12, 60: 18, 150: 24, 400: 36}
"""Number of sectors from so many values on."""

ROUNDED = (4, 8, 12, 16, 18, 24, 32, 36, 64, 72, 120, 180, 360, 720)
"""Numbers of directions on a turn to which angles are rounded; finer ones need no own sectors."""

MAX_ROW = 4
"""Number of roses side by side."""

_DATA = "#d95f02"


class Rose(NamedTuple):
    """Angles to be drawn as a rose.

    - `name`: Name of the column. `turns`: Its angles (N,). `weights`: What each counts, (N,), or None.
    - `curve`: Values of a density per turn, at even steps from 0 to 1.
    - `first`: The turn from which they are written, 0 or -1/2.
    - `mean`: Mean direction, resultant length, and half the width of the mean's interval, in turns.
    - `period`: Of a cycle, such as hours of a day: it is drawn as a clock, with its own numbers.
    """

    name: str
    turns: Array
    weights: Array | None = None
    curve: Array | None = None
    mean: tuple[float | None, float, float | None] = (None, 0.0, None)
    first: float = 0.0
    period: float | None = None

    def text(self, turns: float, unit: str) -> str:
        """Return a direction as it is written, angles in a unit."""
        return frames.angle_text(turns, unit) if self.period is None else f"{turns * self.period:g}"


def rose_picture(
    density: Density, points: Tensor, settings: PlotSettings | None = None, *, what: str = "data"
) -> Picture:
    """Draw chart points (N, 1) of one angle as a rose, under the curve of its density."""
    settings = settings or PlotSettings()
    view = frames.view_of(density.space, settings.names, settings.center)
    line = torch.linspace(0, 1, 721, dtype=torch.float64)[:, None]
    curve = density_at(density, line, "square")
    turns = frames.chart_points(density.space, points)[:, 0].numpy()
    space = view.space
    period = None if space.axes[0].is_angle else space.periods[0]
    rose = Rose(view.names[0], turns, None, curve, first=float(view.low[0]), period=period)
    words = f"{len(points)} {what}, and the density as a line"
    return roses_picture([rose], view.space.unit or "", words, settings.sheet)


def roses_picture(roses: Sequence[Rose], unit: str, words: str, sheet: Sheet) -> Picture:
    """Draw roses side by side, at most `MAX_ROW` in a row; the caption begins with `words`."""
    across = min(MAX_ROW, max(2, len(roses)))
    down = -(-len(roses) // across)
    cell = sheet.width / across
    caption = f"{words}. Areas are shares, so that radii are their square roots."
    room = (
        0.0 if sheet.printed else 1.3 * sheet.em * (len(frames.caption_lines(caption, sheet)) + 1)
    )
    figure = sheet.figure(down * (cell + 1.5 * sheet.em) + room)
    for k, rose in enumerate(roses):
        row, column = divmod(k, across)
        alone = (across - len(roses)) / 2 * cell if len(roses) < across else 0.0
        below = room + (down - 1 - row) * (cell + 1.5 * sheet.em)
        _draw(_polar(figure, alone + column * cell, below, cell, sheet), rose, unit, sheet)
    if not sheet.printed:
        frames.write_caption(figure, caption, sheet)
    return Picture(figure, sheet, "Rose diagram" + "s" * (len(roses) > 1), caption)


def sectors_of(turns: Array, count: int) -> tuple[int, float]:
    """Return about so many sectors that suit angles (N,) in turns, and where the first one begins.

    If angles were rounded to a part of the turn, each sector holds as many of the directions that are
    left, and is centred on one of them wherever their number allows.

    >>> count, first = sectors_of(np.array([0, 10, 350, 340, 20, 360]) / 360, 18)
    >>> count, round(360 * first, 9)
    (12, -15.0)
    """
    step = _rounding(turns)
    if step is None:
        return count, 0.0
    divisors = [k for k in range(1, step + 1) if step % k == 0 and count / 2 <= k <= 2 * count]
    if not divisors:
        return count, 0.0
    # an odd number of directions has one in the middle
    best = min(divisors, key=lambda k: (step // k % 2 == 0, abs(math.log(k / count))))
    each = step // best
    return best, -(each // 2 + 0.5) / step if each % 2 else -0.5 / step


def _rounding(turns: Array) -> int | None:
    """Return how many directions there are on the turn to which all angles (N,) were rounded."""
    for directions in ROUNDED:
        away = turns * directions
        if bool((np.abs(away - np.round(away)) < 1e-6 * directions).all()):
            return directions
    return None


def _polar(figure: Figure, left: float, below: float, cell: float, sheet: Sheet) -> PolarAxes:
    margin = 2.6 * sheet.em
    wide, high = figure.get_size_inches()
    side = cell - 2 * margin
    box = ((left + margin) / wide, (below + margin) / high, side / wide, side / high)
    return figure.add_axes(box, projection="polar")  # pyright: ignore[reportReturnType]


def _draw(axes: PolarAxes, rose: Rose, unit: str, sheet: Sheet) -> None:
    count = max(sectors for least, sectors in SECTORS.items() if len(rose.turns) >= least)
    count, first = sectors_of(rose.turns, count)
    shares, edges = np.histogram(
        (rose.turns - first) % 1.0, count, (0.0, 1.0), density=True, weights=rose.weights
    )
    edges = edges + first
    around = 2 * np.pi
    axes.bar(
        around * edges[:-1], np.sqrt(shares), around / count, align="edge", color=_DATA, alpha=0.45,
        edgecolor="#ffffff", linewidth=sheet.pen(0.5),
    )  # fmt: skip
    most = float(shares.max())
    if rose.curve is not None:
        at = np.linspace(0, around, len(rose.curve))
        axes.plot(at, np.sqrt(rose.curve), color=frames.INK, linewidth=sheet.pen(1.6, 0.6))
        most = max(most, float(rose.curve.max()))
    rim = 1.05 * math.sqrt(most)
    _draw_mean(axes, rose, rim, sheet)
    axes.set_ylim(0, rim)
    axes.set_yticks([rim / 2], [""])
    quarters = [0.0, 0.25, 0.5, 0.75]
    written = [t if t <= rose.first + 1 else t - 1 for t in quarters]
    axes.set_xticks([around * t for t in quarters], [rose.text(t, unit) for t in written])
    axes.tick_params(labelsize=sheet.small, pad=0.1 * sheet.text, colors=frames.INK)
    axes.grid(color="#c8c8c4", linewidth=sheet.pen(0.6))
    axes.spines["polar"].set(color="#8a8a86", linewidth=sheet.pen(0.8))
    axes.set_axisbelow(True)
    if rose.period is not None or _is_compass(rose.name):
        axes.set_theta_zero_location("N")
        axes.set_theta_direction(-1)
    name = frames.cut(frames.symbol(rose.name), frames.MAX_NAME)
    axes.set_title(name, fontsize=sheet.text, pad=0.9 * sheet.text, parse_math=False)


def _draw_mean(axes: PolarAxes, rose: Rose, rim: float, sheet: Sheet) -> None:
    """Draw the mean direction, as long as the resultant in radii, and its interval at the rim."""
    mean, resultant, spread = rose.mean
    if mean is None:
        return
    pen: dict[str, Any] = {"color": frames.INK, "solid_capstyle": "butt"}
    axes.plot([2 * np.pi * mean] * 2, [0, resultant * rim], linewidth=sheet.pen(1.5, 0.6), **pen)
    if spread is not None:
        arc = np.linspace(mean - spread, mean + spread, 50)
        axes.plot(2 * np.pi * arc, np.full(50, 0.98 * rim), linewidth=sheet.pen(3.5, 1.0), **pen)


def _is_compass(name: str) -> bool:
    """Return whether angles of a name run clockwise from north.

    >>> _is_compass("wind direction"), _is_compass("phi")
    (True, False)
    """
    word = re.search(r"[^\W\d_]+", name)
    return bool(word) and word[0].casefold() in COMPASS
