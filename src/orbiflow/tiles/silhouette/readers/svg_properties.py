"""The CSS properties that decide what is seen: which inherit, and which values they take."""

import re
from collections.abc import Callable

from orbiflow.tiles.silhouette.readers.svg_values import NUMBER, can_transform, colour_of, quantity

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
