"""Lengths and sizes, under their former home, until every room uses `orbiflow.units`."""

from __future__ import annotations

from orbiflow.figures.sheet import Sheet
from orbiflow.units import (
    COLUMNS,
    MILLIMETRES,
    length,
    page_size,
    pixel_size,
    pixels,
    size,
)
from orbiflow.units import (
    LONGEST as MOST,
)

__all__ = [
    "MILLIMETRES",
    "MOST",
    "column_width",
    "length",
    "page_size",
    "pixel_size",
    "pixels",
    "size",
]


def column_width(text: str) -> str | float:
    """Return the width of a printed figure: a word of `orbiflow.units.COLUMNS`, or mm.

    Raises:
        OrbiflowError: As `length`, and for a width that no figure has.

    >>> column_width("double"), column_width("8.5cm")
    ('double', 85.0)
    """
    word = text.strip().lower()
    width = word if word in COLUMNS else length(text)
    Sheet.column(width)
    return width
