"""What the signs on a density's square mean: a legend on a screen, words for a caption in print."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from orbiflow.density.pictures.axes import (
    EDGE_COLOURS,
    INK,
    LETTER,
    cones,
)
from orbiflow.density.spaces import Space
from orbiflow.drawing import (
    CENTER_COLOURS,
    Sheet,
    center_sign,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TURNS = {2: "half", 4: "quarter"}
SMALLER = "dots are smaller where they crowd"
CROWDED = "dots crowd where the square shrinks areas"


def legend(
    figure: Figure, space: Space, sheet: Sheet, *, dots: bool, notes: Sequence[str] = ()
) -> None:
    """What edges, signs and dots are, in the lower left corner, and further `notes`."""
    from matplotlib.lines import Line2D

    size = sheet.text
    entries = [
        Line2D(
            [], [], color=colour, linewidth=0.28 * size, marker=">",
            label=f"both {name} edges are one edge",
        )
        for colour, name in zip(EDGE_COLOURS, ("orange", "blue"), strict=True)
    ]  # fmt: skip
    for order in _orders(space):
        outline = center_sign(order, 1.0)
        style: dict[str, Any] = {"marker": np.concatenate([outline, outline[:1]])}
        style |= {"color": CENTER_COLOURS[order], "markersize": size, "linestyle": "none"}
        text = f"cone point of a {TURNS[order]} turn: no flow moves it"
        entries.append(Line2D([], [], label=text, **style))
    if dots:
        style = {"markerfacecolor": "#ffffff", "markeredgecolor": INK, "linestyle": "none"}
        entries.append(Line2D([], [], marker="o", label="points", **style))
    words = _sentences(_all_notes(space, dots, notes))
    write_below(figure, words, sheet)
    lines = len(wrapped_words(words, sheet))
    up = (0.6 + 1.25 * lines) * sheet.em / figure.get_size_inches()[1]
    figure.legend(
        handles=entries, loc="lower left", bbox_to_anchor=(0.02, up), ncols=2, frameon=False,
        fontsize=sheet.small, borderaxespad=0.3,
    )  # fmt: skip


def caption(space: Space, *, dots: bool, notes: Sequence[str] = ()) -> str:
    """The same in words.

    >>> from orbiflow.density import make_space
    >>> caption(make_space("torus"), dots=True)
    'The edges with one arrow head are one edge, and so are those with two. Dots are points.'
    """
    parts = ["The edges with one arrow head are one edge, and so are those with two"]
    parts += [
        f"{SIGNS[order]} are cone points of a {TURNS[order]} turn, which no flow moves"
        for order in _orders(space)
    ]
    parts += ["Dots are points"] if dots else []
    return _sentences([*parts, *_all_notes(space, dots, notes)])


def _all_notes(space: Space, dots: bool, notes: Sequence[str]) -> list[str]:
    return [*([CROWDED] if dots and space.is_round else []), *notes]


def _sentences(parts: Sequence[str]) -> str:
    return " ".join(f"{part[0].upper()}{part[1:]}." for part in parts)


SIGNS = {2: "Lenses", 4: "Squares"}


def _orders(space: Space) -> list[int]:
    return sorted({order for _, order in cones(space.group)}, reverse=True)


def wrapped_words(words: str, sheet: Sheet) -> list[str]:
    """Lines of a caption below a picture on a screen."""
    return textwrap.wrap(words, int(0.94 * 72 * sheet.width / (0.9 * LETTER * sheet.small)))


def write_below(figure: Figure, words: str, sheet: Sheet) -> None:
    """The caption in the lower left corner."""
    lines = "\n".join(wrapped_words(words, sheet))
    figure.text(
        0.03, 0.6 * sheet.em / figure.get_size_inches()[1], lines, fontsize=sheet.small, color=INK,
        va="bottom", linespacing=1.35, parse_math=False,
    )  # fmt: skip
