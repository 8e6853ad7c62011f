"""Transforms of SVG's attributes and of CSS as matrices (3, 3)."""

import re
from collections.abc import Callable

import numpy as np

from orbiflow.arrays import Array
from orbiflow.tiles.silhouette.readers.svg_values import NUMBER, angle, length, quantity

MAX_TRANSFORM = 2000  # characters
_CALL = re.compile(r"\s*,?\s*([a-zA-Z0-9]+)\s*\(([^()]*)\)")
_ARGUMENT = re.compile(rf"\s*,?\s*({NUMBER}(?:[a-z]+|%)?)", re.IGNORECASE)
# a list of transforms as SVG's attributes write it: six names with plain numbers
_ATTRIBUTE = re.compile(
    r"(?:[\s,]*(?:matrix|translate|scale|rotate|skewX|skewY)\s*\([-+.,\s\deE]*\))*[\s,]*"
)
_KEYWORDS = {"left": "0%", "top": "0%", "center": "50%", "right": "100%", "bottom": "100%"}
_Size = tuple[float, float]  # what percentages refer to
_Make = Callable[[list[str], _Size, bool], Array]


class NotATransform(ValueError):
    """The text is no list of transforms in the plane."""


def transform_matrix(text: str, size: _Size, *, css: bool = False) -> Array:
    """Return the matrix of a list of transforms such as "translate(10,20) rotate(30deg)".

    Percentages are those of `size`. With `css` units are needed, as in a style. Raises `NotATransform`.
    """
    matrix, end = np.eye(3), 0
    if len(text) > MAX_TRANSFORM:
        raise NotATransform(text[:60])
    while text[end:].strip(" \t\r\n,"):
        found = _CALL.match(text, end)
        if found is None:
            raise NotATransform(text)
        end = found.end()
        matrix = matrix @ _call(found[1].lower(), _arguments(found[2]), size, css)
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
    calls = ""
    if translate != "none":
        calls += f"translate({','.join(translate.split()[:2])})"
    if rotate != "none":
        calls += f"rotate({rotate})"
    if scale != "none":
        calls += f"scale({','.join(scale.split()[:2])})"
    return transform_matrix(calls, size, css=True)


def shift(x: float, y: float) -> Array:
    """Return the matrix that moves by (x, y)."""
    return np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])


def _arguments(text: str) -> list[str]:
    found, end = list[str](), 0
    while text[end:].strip():
        match = _ARGUMENT.match(text, end)
        if match is None:
            raise NotATransform(text)
        found.append(match[1])
        end = match.end()
    return found


def _call(name: str, words: list[str], size: _Size, css: bool) -> Array:
    """Return the matrix of one transform."""
    rule = _RULES.get(name)
    if rule is None or len(words) not in rule[1]:
        raise NotATransform(name)
    return rule[0](words, size, css)


def _plain(word: str) -> float:
    """A number without a unit; scales may be percentages."""
    found = quantity(word)
    if found is None or found[1] not in ("", "%"):
        raise NotATransform(word)
    return found[0] / 100 if found[1] else found[0]


def _long(word: str, relative: float, css: bool) -> float:
    value, found = length(word, relative), quantity(word)
    if found and found[1] in ("em", "ex", "ch", "rem"):
        return 0.0  # checked before the size of the font is known
    if value is None or found is None or (css and not found[1] and found[0]):
        raise NotATransform(word)
    return value


def _turn(word: str, css: bool) -> float:
    value, found = angle(word), quantity(word)
    if value is None or found is None or (css and not found[1] and found[0]):
        raise NotATransform(word)
    return value


def _matrix(words: list[str], size: _Size, css: bool) -> Array:  # noqa: ARG001
    a, b, c, d, e, f = map(_plain, words)
    return np.array([[a, c, e], [b, d, f], [0.0, 0.0, 1.0]])


def _translate(words: list[str], size: _Size, css: bool) -> Array:
    x, y = (_long(word, own, css) for word, own in zip([*words, "0"][:2], size, strict=True))
    return shift(x, y)


def _scale(words: list[str], size: _Size, css: bool) -> Array:  # noqa: ARG001
    x, y = map(_plain, (words * 2)[:2])
    return np.diag([x, y, 1.0])


def _rotate(words: list[str], size: _Size, css: bool) -> Array:
    if css and len(words) == 3:
        raise NotATransform("rotate")
    turn = _turn(words[0], css)
    cos, sin = np.cos(turn), np.sin(turn)
    around = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    x, y = (
        _long(word, own, css) for word, own in zip((words[1:] + ["0"] * 2)[:2], size, strict=True)
    )
    return shift(x, y) @ around @ shift(-x, -y)


def _skew(words: list[str], size: _Size, css: bool) -> Array:  # noqa: ARG001
    x, y = (np.tan(_turn(word, css)) for word in [*words, "0"][:2])
    return np.array([[1.0, x, 0.0], [y, 1.0, 0.0], [0.0, 0.0, 1.0]])


def _along(make: _Make, first: bool, other: str) -> _Make:
    """Return the rule of a transform along one axis, the `first` or second, such as `translateX`."""

    def one(words: list[str], size: _Size, css: bool) -> Array:
        return make([words[0], other] if first else [other, words[0]], size, css)

    return one


_RULES: dict[str, tuple[_Make, tuple[int, ...]]] = {  # and how many arguments there may be
    "matrix": (_matrix, (6,)),
    "translate": (_translate, (1, 2)),
    "translatex": (_along(_translate, True, "0"), (1,)),
    "translatey": (_along(_translate, False, "0"), (1,)),
    "translate3d": (_translate, (3,)),
    "scale": (_scale, (1, 2)),
    "scalex": (_along(_scale, True, "1"), (1,)),
    "scaley": (_along(_scale, False, "1"), (1,)),
    "rotate": (_rotate, (1, 3)),
    "rotatez": (_rotate, (1,)),
    "skew": (_skew, (1, 2)),
    "skewx": (_along(_skew, True, "0"), (1,)),
    "skewy": (_along(_skew, False, "0"), (1,)),
}
