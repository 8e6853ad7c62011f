"""Values as SVG and CSS write them: numbers, colours and transforms, and which a property takes."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import tinycss2.color4
from svgelements import Matrix

from orbiflow.arrays import Array
from orbiflow.drawing import rgb

if TYPE_CHECKING:
    from orbiflow.tiles.silhouette.readers.svg_gradients import Gradient

MAX_NUMBER = 1e9  # the largest width or opacity that is believed
FONT_SIZE = 16.0  # pixels, by default
_PIXELS = {
    **{"": 1.0, "px": 1.0, "pt": 4 / 3, "pc": 16.0, "in": 96.0},
    **{"cm": 96 / 2.54, "mm": 96 / 25.4, "q": 96 / 101.6},
}
_TURNS = {"": 1 / 360, "deg": 1 / 360, "grad": 1 / 400, "rad": 1 / math.tau, "turn": 1.0}
FONT_UNITS = {"em": 1.0, "ex": 0.5, "ch": 0.5, "rem": 1.0}  # sizes of the font
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?"
_QUANTITY = re.compile(rf"\s*({NUMBER})\s?([a-z]*|%)\s*", re.IGNORECASE)
_IN_FONTS = re.compile(rf"(?<![\w.#-])({NUMBER})(em|ex|ch|rem)(?![\w-])", re.IGNORECASE)
_MAX_TEXT = 100  # characters of a quantity
_SIZES = {
    **{"xx-small": 9.0, "x-small": 10.0, "small": 13.0, "medium": 16.0},
    **{"large": 18.0, "x-large": 24.0, "xx-large": 32.0, "xxx-large": 48.0},
}
CURRENT = "currentColor"
"""The colour of what is drawn in `currentColor` where no colour is set."""

# what the library raises for what is no colour at all
_NO_COLOUR = (ValueError, TypeError, IndexError, AttributeError, ArithmeticError)
MAX_COLOUR = 100  # characters
# from CIE XYZ to linear sRGB, for the whites D65 and D50 (B. Lindbloom's tables)
_FROM_D65 = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.969266, 1.8760108, 0.041556],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
_FROM_D50 = np.array(
    [
        [3.1338561, -1.6168667, -0.4906146],
        [-0.9787684, 1.9161415, 0.033454],
        [0.0719453, -0.2289914, 1.4052427],
    ]
)


def quantity(text: str | None) -> tuple[float, str] | None:
    """Return the number and the unit, in small letters, of "12px", or None for anything else."""
    found = _QUANTITY.fullmatch(text) if text and len(text) <= _MAX_TEXT else None
    if found is None or (text and " " in text.strip()):
        return None
    return float(found[1]), found[2].lower()


def length(text: str | None, relative: float = 1.0) -> float | None:
    """Return a length in user units, percentages those of `relative`; None for what is none."""
    found = quantity(text)
    if found is None:
        return None
    number, unit = found
    if unit == "%":
        return number / 100 * relative
    return number * _PIXELS[unit] if unit in _PIXELS else None


def as_number(text: str | None, usual: float, relative: float = 1.0) -> float:
    """Read a length in user units or a share; return the usual one if it cannot be read."""
    value = length(text, relative)
    return usual if value is None or not abs(value) < MAX_NUMBER else value


def angle(text: str | None) -> float | None:
    """Return an angle in radians, in degrees where no unit is written; None for what is none."""
    found = quantity(text)
    if found is None or found[1] not in _TURNS:
        return None
    return found[0] * _TURNS[found[1]] * math.tau


def without_font_units(text: str, em: float, rem: float) -> str:
    """Return a text whose lengths in `em`, `ex`, `ch` and `rem` are in user units instead."""

    def user_units(found: re.Match[str]) -> str:
        unit = found[2].lower()
        value = float(found[1]) * FONT_UNITS[unit] * (rem if unit == "rem" else em)
        return f"{value!r}px"

    return _IN_FONTS.sub(user_units, text)


def font_size(text: str, parent: float, rem: float) -> float:
    """Return a font's size in user units from the property, and from the size around it."""
    text = text.strip().lower()
    if text in _SIZES:
        return _SIZES[text]
    if text in ("larger", "smaller"):
        return parent * (1.2 if text == "larger" else 1 / 1.2)
    return as_number(without_font_units(text, parent, rem), parent, parent)


class Brush(NamedTuple):
    """A colour, #rrggbb or `CURRENT`, and its opacity, 0 to 1.

    With a `gradient` it is its mean colour, and the opacity is without that of its stops.
    """

    colour: str
    opacity: float
    gradient: Gradient | None = None


@lru_cache(4096)
def colour_of(text: str) -> Brush | None:
    """Return the colour and opacity that a text such as "hsl(20 50% 40%)" writes, or None."""
    text = text.strip()
    if len(text) > MAX_COLOUR or text.count("(") > 1:
        return None
    try:
        colour = tinycss2.color4.parse_color(text)
        if colour is None or isinstance(colour, str):
            return Brush(CURRENT, 1.0) if colour else None
        return Brush(_hexadecimal(_srgb(colour)), colour.alpha)
    except _NO_COLOUR:
        return None


def lightness(colour: str) -> float:
    """Return how light a colour is, from 0 to 1."""
    return float(np.dot(rgb(colour), [0.2126, 0.7152, 0.0722])) / 255 if colour[0] == "#" else 0.0


def mean_colour(brushes: list[Brush]) -> Brush:
    """Return the mean of colours, each as much as it is opaque, and their mean opacity."""
    opacities = np.array([brush.opacity for brush in brushes])
    solid = [brush.colour if brush.colour[0] == "#" else "#000000" for brush in brushes]
    shares = opacities if opacities.any() else np.ones(len(brushes))
    mean = np.average([rgb(colour) for colour in solid], axis=0, weights=shares)
    return Brush(_hexadecimal(mean / 255), float(opacities.mean()))


def _srgb(colour: tinycss2.color4.Color) -> Array:
    """Return red, green and blue, 0 to 1; those of wider spaces are taken for sRGB's own."""
    if colour.space in ("hsl", "hwb"):
        return np.array(colour.to("srgb").coordinates)
    wanted = {"lab": "xyz-d50", "lch": "xyz-d50", "oklab": "xyz-d65", "oklch": "xyz-d65"}
    space = wanted.get(colour.space, colour.space)
    values = np.array([value or 0.0 for value in colour.to(space).coordinates])
    if space.startswith("xyz"):
        values = (_FROM_D50 if space == "xyz-d50" else _FROM_D65) @ values
    if space.startswith("xyz") or space == "srgb-linear":
        low, high = 12.92 * values, 1.055 * np.maximum(values, 0.0) ** (1 / 2.4) - 0.055
        values = np.where(values <= 0.0031308, low, high)
    return values


def _hexadecimal(channels: Array) -> str:
    if not np.isfinite(channels).all():
        raise ValueError
    red, green, blue = (channels.clip(0, 1) * 255).round().astype(int)
    return f"#{red:02x}{green:02x}{blue:02x}"


MAX_TRANSFORM = 2000  # characters
_CALL = re.compile(r"\s*,?\s*([a-zA-Z0-9]+)\s*\(([^()]*)\)")
_ARGUMENT = re.compile(rf"\s*,?\s*({NUMBER}(?:[a-z]+|%)?)", re.IGNORECASE)
# a list of transforms as SVG's attributes write it: six names with plain numbers
_ATTRIBUTE = re.compile(
    r"(?:[\s,]*(?:matrix|translate|scale|rotate|skewX|skewY)\s*\([-+.,\s\deE]*\))*[\s,]*"
)
KEYWORDS = {"left": "0%", "top": "0%", "center": "50%", "right": "100%", "bottom": "100%"}
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
        kinds, counts, make = _RULES.get(name.lower(), ("", (), Matrix))
        if len(words) not in counts or (css and kinds == "axy" and len(words) == 3):
            raise NotATransform(name)
        values = (_value(kind, word, size, css) for kind, word in zip(kinds, words, strict=False))
        made = make(*values)
        matrix = matrix @ [[made.a, made.c, made.e], [made.b, made.d, made.f], [0, 0, 1]]
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
    found = [length(KEYWORDS.get(word, word), own) for word, own in zip(words, size, strict=False)]
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


def _rotated(turn: float, x: float = 0.0, y: float = 0.0) -> Matrix:
    made = Matrix()
    made.post_rotate(turn, x, y)
    return made


_RULES: dict[str, tuple[str, tuple[int, ...], Callable[..., Matrix]]] = {
    "matrix": ("nnnnnn", (6,), Matrix),
    "translate": ("xy", (1, 2), Matrix.translate),
    "translatex": ("x", (1,), Matrix.translate_x),
    "translatey": ("y", (1,), Matrix.translate_y),
    "translate3d": ("xy", (3,), Matrix.translate),
    "scale": ("nn", (1, 2), Matrix.scale),
    "scalex": ("n", (1,), Matrix.scale_x),
    "scaley": ("n", (1,), Matrix.scale_y),
    "rotate": ("axy", (1, 3), _rotated),
    "rotatez": ("a", (1,), _rotated),
    "skew": ("aa", (1, 2), Matrix.skew),
    "skewx": ("a", (1,), Matrix.skew_x),
    "skewy": ("a", (1,), Matrix.skew_y),
}
"""The kinds of each transform's arguments, how many it may have, and what makes its matrix of them."""


WIDE = {"inherit", "initial", "unset", "revert", "revert-layer"}  # values of every property
MAX_VALUE = 20_000  # characters
REFERENCE = re.compile(r"""url\(\s*(?:"([^"]*)"|'([^']*)'|([^"')]*))\s*\)""", re.IGNORECASE)
_PATH = re.compile(r"""path\(\s*(?:(?:nonzero|evenodd)\s*,\s*)?(["'])(.*)\1\s*\)""", re.DOTALL)
_ICC = re.compile(r"\s*icc-color\([^)]*\)\s*$", re.IGNORECASE)
_FUNCTION = re.compile(r"[a-z-]+\(.*\)", re.DOTALL | re.IGNORECASE)
_UNIT = "(?:px|pt|pc|in|cm|mm|q|em|ex|ch|rem|%)"
_LENGTH = f"{NUMBER}{_UNIT}?"
_WIDTH = f"(?!-){_LENGTH}"
_SHARE, _WORDS, _ANYTHING = f"{NUMBER}%?", "[a-z][a-z0-9 -]*", "(?s:.*)"


def _paint(text: str, css: bool) -> str | None:
    text = _ICC.sub("", text)
    if text.lower() in ("none", "context-fill", "context-stroke"):
        return text.lower()
    found = REFERENCE.match(text)
    if found:
        rest = text[found.end() :].strip()
        return text if not rest or _paint(rest, css) else None
    return text if colour_of(text) else None


def _colour(text: str, _: bool) -> str | None:
    text = _ICC.sub("", text)
    return text if colour_of(text) else None


def _miter_limit(text: str, _: bool) -> str | None:
    found = quantity(text)
    return text if found and not found[1] and found[0] >= 1 else None


def _dashes(text: str, _: bool) -> str | None:
    words = text.replace(",", " ").split()
    are_widths = words and all(re.fullmatch(_WIDTH, word, re.IGNORECASE) for word in words)
    return " ".join(words) if are_widths or text.lower() == "none" else None


def _geometry(text: str, css: bool) -> str | None:
    """Return a shape's length, which needs a unit in CSS; attributes are checked where they count."""
    with_unit = re.fullmatch(f"auto|{NUMBER}{_UNIT}|[-+]?0*[.]?0+", text, re.IGNORECASE)
    return text if with_unit or not css else None


def _path_data(text: str, css: bool) -> str | None:
    """Return path data: in CSS the text in `path("...")`."""
    if not css:
        return text
    found = _PATH.fullmatch(text)
    return found[2] if found else "" if text.lower() == "none" else None


def _reference(text: str, _: bool) -> str | None:
    if text.lower() == "none":
        return "none"
    return text if REFERENCE.match(text) or _FUNCTION.search(text) else None


def _transform(text: str, css: bool) -> str | None:
    return text if text.lower() == "none" or can_transform(text, css=css) else None


_CHECKS: dict[str, str | Callable[[str, bool], str | None]] = {
    **dict.fromkeys(("fill", "stroke"), _paint),
    **dict.fromkeys(("color", "stop-color", "background-color"), _colour),
    **dict.fromkeys(("opacity", "fill-opacity", "stroke-opacity", "stop-opacity"), _SHARE),
    **dict.fromkeys(("fill-rule", "clip-rule"), "nonzero|evenodd"),
    "stroke-width": _WIDTH,
    "stroke-dashoffset": _LENGTH,
    "stroke-dasharray": _dashes,
    "stroke-miterlimit": _miter_limit,
    "stroke-linecap": "butt|round|square",
    "stroke-linejoin": "miter|round|bevel|miter-clip|arcs",
    "visibility": "visible|hidden|collapse",
    **dict.fromkeys(("overflow", "display", "paint-order", "vector-effect"), _WORDS),
    **dict.fromkeys(("color-interpolation", "mix-blend-mode"), _WORDS),
    "mask-type": "luminance|alpha",
    "transform-box": "view-box|fill-box|stroke-box|content-box|border-box",
    **dict.fromkeys(("x", "y", "cx", "cy", "r", "rx", "ry", "width", "height"), _geometry),
    "d": _path_data,
    **dict.fromkeys(("clip-path", "mask", "filter"), _reference),
    **dict.fromkeys(("marker-start", "marker-mid", "marker-end"), _reference),
    "transform": _transform,
    **dict.fromkeys(("transform-origin", "translate", "rotate", "scale", "font-size"), _ANYTHING),
    **dict.fromkeys(("offset-path", "animation", "animation-name", "mask-image"), _ANYTHING),
}
"""What the value of each property must be: a pattern for the whole text, in any case; or a function
that returns the value, or None for what is not valid, given whether it is of CSS."""

INHERITED = frozenset(
    {
        *("fill", "fill-rule", "fill-opacity", "clip-rule", "color", "visibility", "paint-order"),
        *("stroke", "stroke-width", "stroke-opacity", "stroke-linecap", "stroke-linejoin"),
        *("stroke-miterlimit", "stroke-dasharray", "stroke-dashoffset"),
        *("marker-start", "marker-mid", "marker-end", "font-size"),
        "color-interpolation",
    }
)
# properties of CSS alone: an attribute of such a name says nothing
_NO_ATTRIBUTES = {
    *("translate", "rotate", "scale", "mix-blend-mode", "offset-path", "animation", "mask-image"),
    *("animation-name", "background-color"),
}
ATTRIBUTES = frozenset(_CHECKS) - _NO_ATTRIBUTES
# properties whose lengths may be in sizes of the font
WITH_LENGTHS = frozenset(
    {
        *("x", "y", "cx", "cy", "r", "rx", "ry", "width", "height", "transform", "translate"),
        *("stroke-width", "stroke-dashoffset", "stroke-dasharray", "transform-origin", "clip-path"),
    }
)
_PREFIXED = {"-webkit-transform", "-webkit-transform-origin", "-webkit-clip-path", "-webkit-mask"}


def checked(name: str, text: str, *, css: bool = True) -> str | None:
    """Return the value of a property from its text, or None if the text is not valid for it."""
    text = text.strip()
    if len(text) > MAX_VALUE and name != "d":
        return None
    if text.lower() in WIDE:
        return text.lower()
    if css and "var(" in text.lower():
        return text
    check = _CHECKS[name]
    if not isinstance(check, str):
        return check(text, css)
    found = re.fullmatch(check, text, re.IGNORECASE)
    return found and (text if check is _ANYTHING else text.lower())


def longhands(name: str, text: str) -> list[tuple[str, str]]:
    """Return the properties, of those that are read, which a declaration sets, with their texts."""
    if name.startswith("--"):
        return [(name, text)]
    name = name.lower()
    if name in _PREFIXED:
        name = name.removeprefix("-webkit-")
    if name == "marker":
        return [(f"marker-{where}", text) for where in ("start", "mid", "end")]
    if name == "background":
        return [("background-color", word) for word in text.split()[:1] if colour_of(word)]
    if name == "font":
        sizes = [word for word in text.partition("/")[0].split() if quantity(word)]
        sizes = [word for word in sizes if quantity(word)[1]]  # type: ignore[index]  # no weights
        return [("font-size", sizes[-1])] if sizes else []
    return [(name, text)] if name in _CHECKS else []
