"""Lengths, sizes and colours as people write them: 40mm, 4 cm, 1.5in, 300x200mm, #2a9d8f.

The functions read text, and raise an `OrbiflowError` for what they cannot read. The types are for
fields of settings classes, where a plain number is in mm.
"""

from __future__ import annotations

import re
from typing import Annotated

from orbiflow.errors import OrbiflowError
from orbiflow.settings.arguments import Range
from orbiflow.settings.kinds import Parsed, Unit

MILLIMETRES = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72}
"""Millimetres in each unit."""

LONGEST = 100_000.0
"""Longest length in mm; beyond it, number or unit is a slip."""

LONGEST_SIDE = 20_000.0
"""Longest side of a page and largest length on it, in mm."""

COLUMNS = {"single": 85.0, "double": 180.0}
"""Widths in mm of a journal's one and two columns, between those of the large publishers."""

PAGES = {
    **{f"a{n}": size for n, size in enumerate([(420, 594), (297, 420), (210, 297), (148, 210)], 2)},
    "letter": (215.9, 279.4),
    "legal": (215.9, 355.6),
    "tabloid": (279.4, 431.8),
    "mug": (228.6, 88.9),  # print files of mugs of 11 oz: 9 x 3.5 in
    "phone": (
        90.0,
        180.0,
    ),  # the largest telephones, some 80 x 165, and what wraps around their edges
    **{name: (width, round(width / 1.5, 1)) for name, width in COLUMNS.items()},
}
"""Width and height in mm of pages that have a name; those of paper are upright."""

POSTS = {"square": (1080, 1080), "story": (1080, 1920)}
"""Width and height in pixels of posts and clips, 1:1 and 9:16, as the large networks show them."""

_NUMBER = r"\+?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?"
_UNIT = r"[a-z\"'µ]*"


def length(text: str, dpi: float | None = None) -> float:
    """Return a length in mm: a number and one of mm, cm, in, pt, or px where `dpi` is given.

    0 needs no unit.

    Raises:
        OrbiflowError: If the unit is missing or unknown, or the length negative or too large.

    >>> length("4 cm"), length("1in"), length("0"), length("150px", 300)
    (40.0, 25.4, 0.0, 12.7)
    """
    match = re.fullmatch(rf"\s*({_NUMBER})\s*({_UNIT})\s*", text, flags=re.IGNORECASE)
    if not match:
        raise OrbiflowError(f"{text!r} is not a length; write a number and its unit, such as 40mm")
    number, unit = match[1], match[2].lower()
    return 0.0 if float(number) == 0 and not unit else _millimetres(number, unit, text, number, dpi)


def length_or_none(text: str, dpi: float | None = None) -> float:
    """Return a length in mm as `length` does; 0 for "none".

    >>> length_or_none("none"), length_or_none("3px", 25.4)
    (0.0, 3.0)
    """
    return 0.0 if text.strip().lower() == "none" else length(text, dpi)


def signed_length(text: str) -> float:
    """Return a length in mm that may be negative.

    >>> signed_length("-2mm"), signed_length("0.25in")
    (-2.0, 6.35)
    """
    text = text.strip()
    return -length(text[1:]) if text.startswith("-") else length(text)


def size(text: str, dpi: float | None = None) -> tuple[float, float]:
    """Return width and height in mm of a text such as 300x200mm, 30cm x 200mm or 12x8 in.

    >>> size("300x200mm"), size("1in × 5 cm"), size("300x150px", 300)
    ((300.0, 200.0), (25.4, 50.0), (25.4, 12.7))
    """
    pattern = rf"\s*({_NUMBER})\s*({_UNIT})\s*[x×]\s*({_NUMBER})\s*({_UNIT})\s*"
    match = re.fullmatch(pattern, text, flags=re.IGNORECASE)
    if not match:
        raise OrbiflowError(
            f"{text!r} is not a width and a height; write both and their unit, such as 300x200mm"
        )
    width, first, height, last = match[1], match[2].lower(), match[3], match[4].lower()
    both = f"{width}x{height}"
    return (
        _millimetres(width, first or last, text, both, dpi),
        _millimetres(height, last, text, both, dpi),
    )


def page_size(text: str, dpi: float | None = None) -> tuple[float, float]:
    """Return width and height of a page in mm: two lengths, or one of `PAGES`, perhaps turned.

    At so many `dpi`, it may also be in pixels, or one of `POSTS`.

    >>> page_size("3x2cm"), page_size("A4"), page_size("letter-landscape")
    ((30.0, 20.0), (210, 297), (279.4, 215.9))
    >>> page_size("story", 25.4)
    (1080.0, 1920.0)
    """
    name, _, way = text.strip().lower().partition("-")
    if dpi is not None and name in POSTS and not way:
        return size("{}x{}px".format(*POSTS[name]), dpi)
    if name in PAGES and way in ("", "portrait", "landscape"):
        page = PAGES[name]
        if not way:
            return page
        short, long = sorted(page)
        return (long, short) if way == "landscape" else (short, long)
    if not re.search(r"\d.*[x×]", text, flags=re.IGNORECASE):
        names = ", ".join((*(() if dpi is None else POSTS), *PAGES))
        raise OrbiflowError(
            f"{text!r} is not a page; write a size such as 300x200mm, or one of {names}, with "
            "-landscape or -portrait to turn it"
        )
    return size(text, dpi)


def colour(text: str) -> str:
    """Return a colour as #rrggbb.

    >>> colour("2A9D8F")
    '#2a9d8f'
    """
    match = re.fullmatch(r"\s*#?([0-9a-fA-F]{6})\s*", text)
    if not match:
        raise OrbiflowError(f"{text!r} is not a colour; write it as #rrggbb, such as #2a9d8f")
    return f"#{match[1].lower()}"


_Side = Annotated[float, Range(above=0, most=LONGEST_SIDE)]

Length = Annotated[
    float,
    Parsed(length, "a length such as 40mm", "LENGTH"),
    Range(above=0, most=LONGEST_SIDE),
    Unit("mm"),
]
"""A length above 0: text with a unit, or a number of mm."""

LengthOrZero = Annotated[
    float, Parsed(length, "a length such as 2mm", "LENGTH"), Range(0, LONGEST_SIDE), Unit("mm")
]
"""A length of at least 0: text with a unit, or a number of mm."""

SignedLength = Annotated[
    float,
    Parsed(signed_length, "a length such as 2mm or -1mm", "LENGTH"),
    Range(-LONGEST_SIDE, LONGEST_SIDE),
    Unit("mm"),
]
"""A length that may be negative: text with a unit, or a number of mm."""

PageSize = Annotated[
    tuple[_Side, _Side],
    Parsed(page_size, "a size such as 300x200mm, or a page such as A4 or A4-landscape", "SIZE"),
    Unit("mm"),
]
"""A width and a height, or a page's name."""

PageArea = Annotated[
    tuple[_Side, _Side],
    Parsed(
        page_size,
        "a size such as 300x200mm or 3000x2000px, or a page such as A4 or A4-landscape",
        "SIZE",
        needs="dpi",
    ),
    Unit("mm"),
]
"""A `PageSize` that may also be in pixels, of which a field `dpi` says how large they are."""

PageLength = Annotated[
    float,
    Parsed(length, "a length such as 40mm or 400px", "LENGTH", needs="dpi"),
    Range(above=0, most=LONGEST_SIDE),
    Unit("mm"),
]
"""A `Length` that may also be in pixels, of which a field `dpi` says how large they are."""

LineWidth = Annotated[
    float,
    Parsed(length_or_none, "a width such as 0.3mm or 3px, or none", "LENGTH", needs="dpi"),
    Range(0, LONGEST_SIDE),
    Unit("mm"),
]
"""The width of a line: a length that may also be in pixels, or 0 for none."""

Colour = Annotated[str, Parsed(colour, "a colour such as #2a9d8f", "COLOUR")]
"""A colour as #rrggbb."""


def _millimetres(number: str, unit: str, text: str, numbers: str, dpi: float | None) -> float:
    """Return a number of a unit in mm; `numbers` are all of the text's, for the message."""
    units = MILLIMETRES if dpi is None else {**MILLIMETRES, "px": MILLIMETRES["in"] / dpi}
    if not unit:
        forms = [f"{numbers}{name}" for name in units if name != "pt"]
        raise OrbiflowError(f"{text!r} has no unit; write {', '.join(forms[:-1])} or {forms[-1]}")
    if unit not in units:
        raise OrbiflowError(
            f"{text!r} has the unknown unit {unit!r}; use one of {', '.join(units)}"
        )
    value = float(number) * units[unit]
    if value > LONGEST:
        raise OrbiflowError(f"{text!r} is longer than 100 m; check number and unit")
    return value
