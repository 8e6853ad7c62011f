"""The window in which a space is drawn flat, and the texts of angles along its sides."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from torch import Tensor, tensor

from orbiflow.arrays import Array
from orbiflow.density.spaces import Space, whole_turn
from orbiflow.drawing import Sheet
from orbiflow.errors import OrbiflowError, SettingError

INK = "#1a1a1a"
MAX_NAME = 40
"""Letters of a column's name that are shown."""

LETTER = 0.56
"""Mean width of a letter, in ems."""


class View(NamedTuple):
    """A window of side 1 onto the chart of a space, with names for the data's columns.

    - `low`: Its lower corner (d,). It is 0 except on the torus.
    """

    space: Space
    names: tuple[str, ...]
    low: Array

    def to_chart(self, points: Tensor) -> Tensor:
        """Return points (N, d) of the window, in [0, 1]^d, as chart points."""
        return points + tensor(self.low, dtype=points.dtype)

    def places(self, points: Tensor) -> Array:
        """Return where chart points (N, d) lie in the window, in [0, 1]^d."""
        moved = chart_points(self.space, points) - tensor(self.low)
        # a translation commutes with the torus' group, and is 0 elsewhere
        return self.space.project(moved).numpy()


def chart_points(space: Space, points: Tensor) -> Tensor:
    """Return chart points (N, d) as float64."""
    if points.ndim != 2 or points.shape[1] != space.dim:
        raise OrbiflowError(f"expected chart points (N, {space.dim}), got {tuple(points.shape)}")
    return points.detach().double().cpu()


def view_of(
    space: Space, names: Sequence[str] | None = None, center: Sequence[float] | None = None
) -> View:
    """Return the window of a space's flat pictures."""
    names = tuple(space.columns if names is None else names)
    if len(names) != len(space.columns):
        raise OrbiflowError(f"expected {len(space.columns)} names of columns, got {list(names)}")
    if not space.is_torus:
        if center is not None:
            raise SettingError(
                f"{{center}} applies to the torus and to maps, not to the {space.name}"
            )
        return View(space, names, np.zeros(space.dim))
    turns = np.zeros(space.dim)
    if center is not None:
        turns = np.array(center, dtype=float) / whole_turn(space.unit or "")
    if turns.shape != (space.dim,) or not np.isfinite(turns).all():
        raise SettingError(
            f"{{center}} must be {space.dim} angles, one for each column, got {list(center or ())}"
        )
    # 3.14 radians are meant as pi: the ticks would be cut off beside the window's edge
    even = np.round(24 * turns) / 24
    turns = np.where(abs(turns - even) < 1e-3, even, turns)
    return View(space, names, turns - 0.5)


def require_plane(space: Space) -> None:
    """Check that a space has two dimensions."""
    if space.dim != 2:
        raise OrbiflowError(f"a picture needs two dimensions, this {space.name} has {space.dim}")


def space_title(space: Space) -> str:
    """Return the space's name as it stands in a sentence.

    >>> from orbiflow.density import make_space
    >>> space_title(make_space("klein-bottle"))
    'Klein bottle'
    """
    return space.name.replace("-", " ").replace("klein", "Klein")


def column_name(view: View, column: int) -> str:
    """Return a column's name, cut to what fits an axis."""
    name = view.names[column]
    return name if len(name) <= MAX_NAME else f"{name[: MAX_NAME - 1]}…"


def axis_label(view: View, column: int) -> str:
    """Return the name and the unit of an angle."""
    return f"{column_name(view, column)} ({view.space.unit or ''})"


def shortened(label: str, side: float, sheet: Sheet) -> str:
    """Return an axis label, cut in print to what fits along `side` inches.

    >>> shortened("a name that goes on and on (degrees)", 1.5, Sheet.column())
    'a name that g… (degrees)'
    """
    room = int(side / (LETTER * sheet.em))
    if not sheet.printed or len(label) <= room:
        return label
    name, opening, unit = label.rpartition(" (")
    ending = opening + unit if room - len(unit) > 8 else ""
    room -= len(ending)
    return (name if len(name) <= room else f"{name[: room - 1]}…") + ending


def legible(at: list[float], texts: list[str], side: float, sheet: Sheet) -> list[str]:
    """Return the texts of ticks along `side` inches, every second one left out if they would touch."""
    widest = max(map(len, texts)) * LETTER * sheet.small / 72
    if len(at) < 3 or 1.3 * widest < (at[1] - at[0]) * side:
        return texts
    return [text if k % 2 == 0 else "" for k, text in enumerate(texts)]


def angle_axis(view: View, axis: int) -> tuple[str, list[float], list[str]]:
    """Return the label of an axis of a torus or Klein bottle, and the places and texts of its ticks."""
    if view.space.is_torus:
        low = float(view.low[axis])
        quarters = range(math.ceil(4 * low - 1e-9), math.floor(4 * low + 4 + 1e-9) + 1)
        places, turns = [k / 4 - low for k in quarters], [k / 4 for k in quarters]
        label = axis_label(view, axis)
    else:  # the first column, theta, goes up: half a turn; phi starts a quarter before 0
        places = [k / 4 for k in range(5)]
        turns = [k / 4 - 0.25 for k in range(5)] if axis == 0 else [k / 8 for k in range(5)]
        label = axis_label(view, 1 - axis)
    return label, places, [angle_text(t, view.space.unit) for t in turns]


def angle_text(turns: float, unit: str | None) -> str:
    """Return an angle as text in its unit.

    >>> angle_text(0.375, "radians"), angle_text(0.25, "degrees")
    ('3π/4', '90°')
    """
    if unit == "radians":
        part = Fraction(turns) * 2
        over = f"/{part.denominator}" if part.denominator > 1 else ""
        times = "" if abs(part.numerator) == 1 else str(abs(part.numerator))
        text = f"{times}π{over}" if part else "0"
    else:
        text = f"{abs(turns) * 360:g}°" if unit == "degrees" else f"{abs(turns):g}"
    return f"\N{MINUS SIGN}{text}" if turns < 0 else text


def degrees_text(value: float, letters: str) -> str:
    """Return degrees with the letter of their direction, or with a sign if there are no letters.

    >>> degrees_text(-30.0, "NS"), degrees_text(180.0, "EW"), degrees_text(330.0, "")
    ('30° S', '180°', '330°')
    """
    if not letters:
        return f"{value:g}°".replace("-", "\N{MINUS SIGN}")
    letter = "" if value in (0, 180, -180) else f" {letters[int(value < 0)]}"
    return f"{abs(value):g}°{letter}"
