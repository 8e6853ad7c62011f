"""Transforms of SVG's attributes and of CSS as matrices (3, 3)."""

import re
from collections.abc import Callable
from functools import partial

import numpy as np

from orbiflow.arrays import Array
from orbiflow.tiles.silhouette.readers.svg_values import FONT_UNITS, NUMBER, angle, length, quantity

MAX_TRANSFORM = 2000  # characters
_CALL = re.compile(r"\s*,?\s*([a-zA-Z0-9]+)\s*\(([^()]*)\)")
_ARGUMENT = re.compile(rf"\s*,?\s*({NUMBER}(?:[a-z]+|%)?)", re.IGNORECASE)
# a list of transforms as SVG's attributes write it: six names with plain numbers
_ATTRIBUTE = re.compile(
    r"(?:[\s,]*(?:matrix|translate|scale|rotate|skewX|skewY)\s*\([-+.,\s\deE]*\))*[\s,]*"
)
_KEYWORDS = {"left": "0%", "top": "0%", "center": "50%", "right": "100%", "bottom": "100%"}
_Size = tuple[float, float]  # what percentages refer to


class NotATransform(ValueError):
    """The text is no list of transforms in the plane."""


def transform_matrix(text: str, size: _Size, *, css: bool = False) -> Array:
    """Return the matrix of a list of transforms such as "translate(10,20) rotate(30deg)".

    Percentages are those of `size`. With `css` units are needed, as in a style. Raises `NotATransform`.
    """
    if len(text) > MAX_TRANSFORM or _CALL.sub("", text).strip(" \t\r\n,"):
        raise NotATransform(text[:60])
    matrix = np.eye(3)
    for name, arguments in _CALL.findall(text):
        if _ARGUMENT.sub("", arguments).strip():
            raise NotATransform(text)
        words: list[str] = _ARGUMENT.findall(arguments)
        kinds, counts, make = _RULES.get(name.lower(), ("", (), shift))
        if len(words) not in counts or (css and kinds == "axy" and len(words) == 3):
            raise NotATransform(name)
        values = (_value(kind, word, size, css) for kind, word in zip(kinds, words, strict=False))
        matrix = matrix @ make(*values)
    return matrix


def can_transform(text: str, *, css: bool) -> bool:
    """Return whether a text is a list of plane transforms as CSS or an attribute of SVG writes it."""
    if not css and _ATTRIBUTE.fullmatch(text) is None:
        return False
    try:
        transform_matrix(text, (1.0, 1.0), css=css)
    except NotATransform:
        return False
    return True


def origin_of(text: str, size: _Size) -> _Size:
    """Return the point that a `transform-origin` names, relative to the corner of its box."""
    words = text.replace(",", " ").lower().split()[:2]
    if len(words) == 1:
        words = ["center", words[0]] if words[0] in ("top", "bottom") else [words[0], "center"]
    if words and (words[0] in ("top", "bottom") or words[1] in ("left", "right")):
        words = words[::-1]
    found = [length(_KEYWORDS.get(word, word), own) for word, own in zip(words, size, strict=False)]
    if len(found) < 2 or found[0] is None or found[1] is None:
        raise NotATransform(text)
    return found[0], found[1]


def single_transforms(translate: str, rotate: str, scale: str, size: _Size) -> Array:
    """Return the matrix of the properties `translate`, `rotate` and `scale` of CSS; "none" is none."""
    calls = {"translate": translate.split()[:2], "rotate": [rotate], "scale": scale.split()[:2]}
    given = {name: ",".join(words) for name, words in calls.items() if words != ["none"]}
    return transform_matrix(
        "".join(f"{name}({text})" for name, text in given.items()), size, css=True
    )


def shift(x: float, y: float = 0.0) -> Array:
    """Return the matrix that moves by (x, y)."""
    return np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])


def _value(kind: str, word: str, size: _Size, css: bool) -> float:
    """Return an argument: a plain number or a share "n", an angle "a", or a length along "x" or "y"."""
    found = quantity(word)
    number, unit = found or (0.0, "")
    if kind == "n":
        value = {"": number, "%": number / 100}.get(unit)
    elif kind == "a":
        value = angle(word)
    else:
        # in sizes of the font: checked before that is known
        value = 0.0 if unit in FONT_UNITS else length(word, size[kind == "y"])
    if found is None or value is None or (css and kind != "n" and not unit and number):
        raise NotATransform(word)
    return value


def _matrix(a: float, b: float, c: float, d: float, e: float, f: float) -> Array:
    return np.array([[a, c, e], [b, d, f], [0.0, 0.0, 1.0]])


def _scaled(x: float, y: float | None = None) -> Array:
    return np.diag([x, x if y is None else y, 1.0])


def _rotated(turn: float, x: float = 0.0, y: float = 0.0) -> Array:
    cos, sin = np.cos(turn), np.sin(turn)
    around = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return shift(x, y) @ around @ shift(-x, -y)


def _skewed(x: float, y: float = 0.0) -> Array:
    return np.array([[1.0, np.tan(x), 0.0], [np.tan(y), 1.0, 0.0], [0.0, 0.0, 1.0]])


_RULES: dict[str, tuple[str, tuple[int, ...], Callable[..., Array]]] = {
    "matrix": ("nnnnnn", (6,), _matrix),
    "translate": ("xy", (1, 2), shift),
    "translatex": ("x", (1,), shift),
    "translatey": ("y", (1,), partial(shift, 0.0)),
    "translate3d": ("xy", (3,), shift),
    "scale": ("nn", (1, 2), _scaled),
    "scalex": ("n", (1,), partial(_scaled, y=1.0)),
    "scaley": ("n", (1,), partial(_scaled, 1.0)),
    "rotate": ("axy", (1, 3), _rotated),
    "rotatez": ("a", (1,), _rotated),
    "skew": ("aa", (1, 2), _skewed),
    "skewx": ("a", (1,), _skewed),
    "skewy": ("a", (1,), partial(_skewed, 0.0)),
}
"""The kinds of each transform's arguments, how many it may have, and what makes its matrix of them."""
