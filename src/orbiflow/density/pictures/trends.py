"""A trend as a picture: the mean as a line or dots, its intervals as bands."""

# matplotlib types no keyword arguments
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.inference import Trend
from orbiflow.density.pictures import frames
from orbiflow.density.spaces import Torus
from orbiflow.drawing import Picture, Sheet

BAND, LINE = "#3b528b", "#1a1a1a"
SHAPE = 0.62
"""Height of the panel, in widths."""


def trend_picture(
    found: Trend, space: Torus, names: tuple[str, str], sheet: Sheet | None = None
) -> Picture:
    """Draw a trend of the column `names[0]` along `names[1]`.

    Args:
        found: The trend.
        space: That of both columns, in this order.
        names: Their names.
        sheet: The sheet; by default one for screens.
    """
    sheet = sheet or Sheet.screen()
    view = frames.view_of(space, names)
    left, below, right, above = (7.0, 5.0, 1.5, 2.0) if not sheet.printed else (6.0, 4.0, 1.0, 1.0)
    width = sheet.width - sheet.em * (left + right)
    figure = sheet.figure(SHAPE * width + sheet.em * (below + above))
    axes = frames.axes_at(figure, sheet.em * left, sheet.em * below, width, SHAPE * width)
    turns = space.period_of(0)
    shifts = (-turns, 0.0, turns) if turns else (0.0,)
    for level in range(len(found.levels) - 1, -1, -1):
        low, high = found.low[:, level], found.high[:, level]
        for shift in shifts:
            axes.fill_between(
                found.at, low + shift, high + shift, color=BAND, alpha=0.22, linewidth=0
            )
    for shift in shifts:
        for piece in _pieces(found.mean, turns):
            axes.plot(
                found.at[piece],
                found.mean[piece] + shift,
                color=LINE,
                linewidth=sheet.pen(1.6, 0.6),
            )
    style: dict[str, Any] = {"fontsize": sheet.text, "color": frames.INK, "parse_math": False}
    axes.set_xlabel(frames.axis_label(view, 1), **style)
    axes.set_ylabel(frames.axis_label(view, 0), **style)
    axes.set_xlim(float(found.at.min()), float(found.at.max()))
    around = space.period_of(1)
    if around and float(np.ptp(found.at)) > around / 4:
        first, last = float(found.at.min()) / around, float(found.at.max()) / around
        turned = [
            k / 4 for k in range(math.ceil(4 * first - 1e-9), math.floor(4 * last + 1e-9) + 1)
        ]
        texts = [frames.turn_text(space, 1, turn) for turn in turned]
        axes.set_xticks([turn * around for turn in turned], texts)
    if turns:
        ticks = [space.first_turn(0) + k / 4 for k in range(5)]
        axes.set_ylim(ticks[0] * turns, ticks[-1] * turns)
        texts = [frames.turn_text(space, 0, turn) for turn in ticks]
        axes.set_yticks([turn * turns for turn in ticks], texts)
    axes.tick_params(labelsize=sheet.small)
    shares = " and ".join(f"{100 * level:g} %" for level in found.levels)
    title = f"{frames.cut(names[0], 40)} along {frames.cut(names[1], 40)}"
    return Picture(figure, sheet, title, f"The line is the mean, bands hold {shares}.")


def _pieces(mean: Array, turn: float) -> list[slice]:
    """Return the parts of a line that do not jump by half a turn and more."""
    jumps = (
        np.flatnonzero(np.abs(np.diff(mean)) > turn / 2) + 1 if turn else np.array([], dtype=int)
    )
    ends = [0, *jumps.tolist(), len(mean)]
    return [slice(a, b) for a, b in pairwise(ends)]
