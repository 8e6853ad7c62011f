"""The CSS properties that decide what is seen: which inherit, and which values they take."""

import re
from collections.abc import Callable

from orbiflow.tiles.silhouette.readers.svg_transforms import can_transform
from orbiflow.tiles.silhouette.readers.svg_values import NUMBER, colour_of, quantity

WIDE = {"inherit", "initial", "unset", "revert", "revert-layer"}  # values of every property
MAX_VALUE = 20_000  # characters
_LENGTHS = {"", "px", "pt", "pc", "in", "cm", "mm", "q", "em", "ex", "ch", "rem", "%"}
REFERENCE = re.compile(r"""url\(\s*(?:"([^"]*)"|'([^']*)'|([^"')]*))\s*\)""", re.IGNORECASE)
_PATH = re.compile(r"""path\(\s*(?:(?:nonzero|evenodd)\s*,\s*)?(["'])(.*)\1\s*\)""", re.DOTALL)
_ICC = re.compile(r"\s*icc-color\([^)]*\)\s*$", re.IGNORECASE)
_FUNCTION = re.compile(r"[a-z-]+\(.*\)", re.DOTALL | re.IGNORECASE)
_WORDS = re.compile(r"[a-z][a-z0-9 -]*", re.IGNORECASE)
_NUMBER = re.compile(rf"{NUMBER}%?", re.IGNORECASE)

Check = Callable[[str, bool], str | None]
"""Returns the value that a text stands for, or None if it is not valid; given whether it is of CSS."""


def _keyword(*allowed: str) -> Check:
    return lambda text, _: lower if (lower := text.lower()) in allowed else None


def _words(text: str, _: bool) -> str | None:
    return text.lower() if _WORDS.fullmatch(text) else None


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


def _share(text: str, _: bool) -> str | None:
    return text if _NUMBER.fullmatch(text) else None


def _miter_limit(text: str, _: bool) -> str | None:
    found = quantity(text)
    return text if found and not found[1] and found[0] >= 1 else None


def _length(text: str, _: bool) -> str | None:
    found = quantity(text)
    return text if found and found[1] in _LENGTHS else None


def _width(text: str, css: bool) -> str | None:
    return None if text.startswith("-") else _length(text, css)


def _dashes(text: str, css: bool) -> str | None:
    words = text.replace(",", " ").split()
    if text.lower() == "none" or (words and all(_width(word, css) for word in words)):
        return " ".join(words)
    return None


def _geometry(text: str, css: bool) -> str | None:
    """A length of a shape, which needs a unit in CSS; an attribute is checked where it is used."""
    found = quantity(text)
    if not css or (text.lower() == "auto"):
        return text
    return text if found and found[1] in _LENGTHS and (found[1] or not found[0]) else None


def _path_data(text: str, css: bool) -> str | None:
    """Path data: in CSS the text in `path("...")`."""
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


def _any(text: str, _: bool) -> str:
    return text


_CHECKS: dict[str, Check] = {
    **dict.fromkeys(("fill", "stroke"), _paint),
    **dict.fromkeys(("color", "stop-color"), _colour),
    **dict.fromkeys(("opacity", "fill-opacity", "stroke-opacity", "stop-opacity"), _share),
    **dict.fromkeys(("fill-rule", "clip-rule"), _keyword("nonzero", "evenodd")),
    "stroke-width": _width,
    "stroke-dashoffset": _length,
    "stroke-dasharray": _dashes,
    "stroke-miterlimit": _miter_limit,
    "stroke-linecap": _keyword("butt", "round", "square"),
    "stroke-linejoin": _keyword("miter", "round", "bevel", "miter-clip", "arcs"),
    "visibility": _keyword("visible", "hidden", "collapse"),
    "overflow": _words,
    "display": _words,
    "paint-order": _words,
    "vector-effect": _words,
    "color-interpolation": _words,
    "mask-type": _keyword("luminance", "alpha"),
    "mix-blend-mode": _words,
    "transform-box": _keyword("view-box", "fill-box", "stroke-box", "content-box", "border-box"),
    **dict.fromkeys(("x", "y", "cx", "cy", "r", "rx", "ry", "width", "height"), _geometry),
    "d": _path_data,
    **dict.fromkeys(("clip-path", "mask", "filter"), _reference),
    **dict.fromkeys(("marker-start", "marker-mid", "marker-end"), _reference),
    "transform": _transform,
    **dict.fromkeys(("transform-origin", "translate", "rotate", "scale"), _any),
    **dict.fromkeys(("offset-path", "animation", "animation-name", "mask-image"), _any),
    "font-size": _any,
    "background-color": _colour,
}
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
    return text if css and "var(" in text.lower() else _CHECKS[name](text, css)


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
