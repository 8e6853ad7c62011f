"""A trend as a picture: the mean as a line or dots, its intervals as bands."""

# matplotlib types no keyword arguments
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from orbiflow.density.inference import Trend
from orbiflow.density.pictures import frames
from orbiflow.density.spaces import Torus
from orbiflow.drawing import Picture, Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BAND, LINE = "#3b528b", "#1a1a1a"
SHAPE = 0.62
"""Height of a single panel, in widths."""

MOST_LETTERS = 60
"""The most letters of words side by side."""

MOST_ACROSS = 5
"""The most panels beside each other."""


def trend_picture(
    found: Mapping[str, Trend],
    space: Torus,
    names: tuple[str, str],
    sheet: Sheet | None = None,
    *,
    words: Sequence[str] = (),
) -> Picture:
    """Draw trends of the column `names[0]` along `names[1]`, a panel for each.

    Args:
        found: The trends, by the title of their panel; a single one needs none.
        space: That of both columns, in this order.
        names: Their names.
        sheet: The sheet; by default one for screens.
        words: What the values are numbers of, if they are words: these have means and bars.
    """
    sheet = sheet or Sheet.screen()
    view = frames.view_of(space, names)
    across = min(len(found), MOST_ACROSS)
    down = math.ceil(len(found) / across)
    left, below, right, above = (7.0, 5.0, 1.5, 2.0) if not sheet.printed else (6.0, 4.0, 1.0, 1.0)
    gap = 0.0 if len(found) == 1 else 1.5
    room = frames.Room(left, below, right, above + gap, 0.0, 0.0)
    aspect, apart = 1 / (SHAPE if across == 1 else 0.9), gap * sheet.em
    page = frames.PanelPage(sheet, room, aspect, (down, across), (apart, apart))
    style: dict[str, Any] = {"fontsize": sheet.text, "color": frames.INK, "parse_math": False}
    for number, (title, curve) in enumerate(found.items()):
        axes = page.axes(number)
        _draw(axes, curve, space, sheet, words)
        if title:
            axes.set_title(frames.cut(title, 24), pad=2, **style)
        lowest = number + across >= len(found)
        if lowest:
            axes.set_xlabel(frames.axis_label(view, 1), **style)
        if number % across:
            axes.set_yticklabels([])
        else:
            axes.set_ylabel(frames.axis_label(view, 0), **style)
        if not lowest:
            axes.set_xticklabels([])
    first = next(iter(found.values()))
    shares = " and ".join(f"{100 * level:g} %" for level in first.levels)
    title = f"{frames.cut(names[0], 40)} along {frames.cut(names[1], 40)}"
    mark = "Dots are means, bars" if words else "The line is the mean, bands"
    return Picture(page.figure, sheet, title, f"{mark} hold {shares}.")


def _draw(axes: Axes, found: Trend, space: Torus, sheet: Sheet, words: Sequence[str]) -> None:
    """Draw a trend in its panel."""
    value, along = space.axes
    turns = value.period
    # a line that goes around goes on beyond the panel, and comes in again as its next copy
    mean = np.unwrap(found.mean, period=turns) if turns and not words else found.mean
    copies = math.ceil(np.abs(mean).max() / turns) + 1 if turns else 0
    for shift in (turns * k for k in range(-copies, copies + 1)):
        low, high = (
            ends + (mean - found.mean + shift)[:, None] for ends in (found.low, found.high)
        )
        for level in range(len(found.levels) - 1, -1, -1):
            bottom, top = low[:, level], high[:, level]
            if words:
                bars: dict[str, Any] = {"color": BAND, "alpha": 0.3, "linewidth": 0, "width": 0.7}
                axes.bar(found.at, top - bottom, bottom=bottom, **bars)
            else:
                bands: dict[str, Any] = {"color": BAND, "alpha": 0.22, "linewidth": 0}
                axes.fill_between(found.at, bottom, top, **bands)
        if words:
            axes.plot(found.at, mean + shift, "o", color=LINE, markersize=sheet.pen(4, 2))
        else:
            pen = sheet.pen(1.6, 0.6)
            axes.plot(found.at, mean + shift, color=LINE, linewidth=pen, zorder=3)
    margin = 0.5 if words else 0.0
    axes.set_xlim(float(found.at.min()) - margin, float(found.at.max()) + margin)
    around = along.period
    if words:
        turned = 90 if sum(map(len, words)) > MOST_LETTERS else 0
        axes.set_xticks(found.at, [frames.cut(word, 12) for word in words], rotation=turned)
    elif around and float(np.ptp(found.at)) > around / 4:
        first, last = float(found.at.min()) / around, float(found.at.max()) / around
        quarters = range(math.ceil(4 * first - 1e-9), math.floor(4 * last + 1e-9) + 1)
        texts = [frames.turn_text(space, 1, k / 4) for k in quarters]
        axes.set_xticks([k / 4 * around for k in quarters], texts)
    if turns:
        ticks = [value.first_turn + k / 4 for k in range(5)]
        axes.set_ylim(ticks[0] * turns, ticks[-1] * turns)
        texts = [frames.turn_text(space, 0, turn) for turn in ticks]
        axes.set_yticks([turn * turns for turn in ticks], texts)
    axes.tick_params(labelsize=sheet.small)
