"""Style sheets written into the elements that they style, where renderers know less of CSS."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from xml.etree.ElementTree import Element

import numpy as np
import tinycss2
import tinycss2.color4
from cssselect2 import ElementWrapper, Matcher, SelectorError, compile_selector_list
from tinycss2.ast import AtRule, Declaration, FunctionBlock, Node, QualifiedRule

from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.readers.reading import FileContent, quoted
from orbiflow.tiles.silhouette.readers.svg_xml import SVG, Notes

MAX_STYLE = 200_000
"""Characters of all style sheets."""

MAX_SELECTOR = 200
"""Characters of a selector."""

MAX_STEPS = 20_000_000
"""Comparisons of elements with selectors, and steps from element to element."""

MAX_BRACKETS = 50
"""How deep brackets may nest: the recursion of the library stands it."""

MAX_VARIABLE = 10_000
"""Characters that a value with variables may come to."""

_FAR = re.compile(r"[~+]|:has|:nth|:only|:last|:first|:is|:not|:where")
_SCREEN = re.compile(r"(only\s+)?(all|screen)?|not\s+(print|speech)", re.IGNORECASE)
_GEOMETRY = {"x", "y", "cx", "cy", "r", "rx", "ry", "width", "height"}
_SINGLE = {"translate", "rotate", "scale", "transform-box", "offset-path", "mask-image"}
_CALL = re.compile(r"([a-zA-Z]+)\(([^()]*)\)")
_NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)([a-z%]*)", re.IGNORECASE)
_UNITS = {
    **{"": 1.0, "px": 1.0, "deg": 1.0, "pt": 4 / 3, "mm": 96 / 25.4, "cm": 96 / 2.54, "in": 96.0},
    **{"turn": 360.0, "rad": math.degrees(1), "grad": 0.9},
}
_NAMES = {
    **{name: name + "({all})" for name in ("matrix", "translate", "scale", "rotate")},
    **{"translatex": "translate({0} 0)", "translatey": "translate(0 {0})"},
    **{"scalex": "scale({0} 1)", "scaley": "scale(1 {0})", "rotatez": "rotate({0})"},
    **{"skewx": "skewX({0})", "skewy": "skewY({0})"},
}
_PATH = re.compile(r"path\(\s*(['\"])(.*)\1\s*\)", re.DOTALL)
_NO_SELECTOR = (
    *(SelectorError, NotImplementedError, TypeError, AttributeError, ValueError),
    *(SyntaxError, RecursionError),
)
# from CIE XYZ to linear sRGB, for the whites D65 and D50 (B. Lindbloom's tables)
_FROM_XYZ = {
    "xyz-d65": np.array(
        [
            [3.2404542, -1.5371385, -0.4985314],
            [-0.969266, 1.8760108, 0.041556],
            [0.0556434, -0.2040259, 1.0572252],
        ]
    ),
    "xyz-d50": np.array(
        [
            [3.1338561, -1.6168667, -0.4906146],
            [-0.9787684, 1.9161415, 0.033454],
            [0.0719453, -0.2289914, 1.4052427],
        ]
    ),
}
_PAINTS = ("fill", "stroke", "color", "stop-color", "flood-color", "lighting-color")
_KEYWORDS = {"none", "inherit", "initial", "unset", "revert", "context-fill", "context-stroke"}
_SILENT = {"charset", "font-face", "page", "keyframes", "-webkit-keyframes", "property", "layer"}
"""Rules of style sheets that paint nothing."""

Declared = tuple[str, str, bool]
"""A property, its value, and whether it is important."""


def write_styles(path: FileContent, root: Element, notes: Notes) -> None:
    """Write all that style sheets say of a document's elements into their attribute `style`.

    Variables are replaced, and what CSS writes otherwise than SVG's attributes is written as these:
    transforms with units, lengths of shapes and path data.

    Raises `InputFileError` for style sheets that are too long, or take too long to apply.
    """
    sheets = list(root.iter("style"))
    texts = ["".join(sheet.itertext()) for sheet in sheets if _applies(sheet, notes)]
    if sum(map(len, texts)) > MAX_STYLE or any(map(_is_too_nested, texts)):
        raise InputFileError(
            f"{path}: <style> is too long or nested; save the drawing as plain SVG"
        )
    matcher, selectors = Matcher(), list[str]()
    for text in texts:
        rules = tinycss2.parse_stylesheet(text, skip_comments=True, skip_whitespace=True)
        selectors += _add(matcher, rules, {}, notes)
    count = sum(1 for _ in root.iter())
    far = sum(bool(_FAR.search(selector)) for selector in selectors)
    if count * (len(selectors) + count * far) > MAX_STEPS:
        raise InputFileError(
            f"{path}: the style sheet takes too long to apply; save the drawing as plain SVG"
        )
    for sheet in sheets:
        sheet.text, sheet[:] = "", []
    variables: dict[ElementWrapper | None, dict[str, str]] = {None: {}}
    for node in ElementWrapper.from_xml_root(root).iter_subtree():
        variables[node] = _write(node, matcher, variables[node.parent], notes)


def _write(
    node: ElementWrapper, matcher: Matcher, around: dict[str, str], notes: Notes
) -> dict[str, str]:
    """Write the style of one element; return the variables that it knows."""
    element = node.etree_element
    node.local_name = element.tag if element.tag[:1] != "{" else node.local_name
    node.namespace_url = SVG
    ruled = [
        declared for *_, pseudo, rule in matcher.match(node) if pseudo is None for declared in rule
    ]
    text = element.get("style", "")
    ruled += [] if _is_too_nested(text) else _declarations(text)
    style = {name: value for name, value, important in ruled if not important}
    style |= {name: value for name, value, important in ruled if important}
    variables = around | {name: value for name, value in style.items() if name.startswith("--")}
    kept: list[str] = []
    for name, value in style.items():
        if "var(" in value.lower():
            filled = _with_variables(value, variables)
            if filled is None:
                notes.add(f"{name} {quoted(value)} is not understood and left out")
                continue
            value = filled
        value = value.lower() if value.isalpha() and name != "font-family" else value
        value = _plain_colour(value) if name in _PAINTS else value
        if not name.startswith("--") and not _set_as_attribute(element, name, value, notes):
            kept.append(f"{name}:{value}")
    if kept:
        element.set("style", ";".join(kept))
    else:
        element.attrib.pop("style", None)
    for name in set(_PAINTS) & element.attrib.keys():
        element.set(name, _plain_colour(element.attrib[name]))
    return variables


def _set_as_attribute(element: Element, name: str, value: str, notes: Notes) -> bool:
    """Write a property as the attribute that renderers read; return whether it is done with."""
    if name in _GEOMETRY and element.tag not in ("svg", "text", "tspan"):
        if value != "auto":
            element.set(name, value)
        return True
    if name.startswith("background"):
        return True  # of the page, which is no shape
    if name == "d":
        path = _PATH.fullmatch(value)
        element.set("d", path[2] if path else "")
        return True
    if name == "transform":
        plain = "" if value == "none" else _plain_transform(value)
        if plain is None:
            notes.add(f"transform {quoted(value)} is not understood and left out")
        else:
            element.set("transform", plain)
        return True
    if name in _SINGLE and value != "none":
        notes.add(f"the property {name} is left out")
    is_shape = name in ("clip-path", "mask") and "(" in value and "url(" not in value.lower()
    if is_shape:
        notes.add(f"{name} {quoted(value)} is left out: cut the drawing in its program")
    return name in _SINGLE or is_shape


def _plain_colour(text: str) -> str:
    """Return a colour of CSS 4 as rgba(), which every renderer knows; other values as they are.

    >>> _plain_colour("rgb(0 0 0 / 20%)")
    'rgba(0,0,0,0.2)'
    """
    if text.lower() == "currentcolor":
        return "currentColor"
    if "(" not in text or "url(" in text.lower() or len(text) > MAX_SELECTOR:
        return text
    try:
        colour = tinycss2.color4.parse_color(text)
        if colour is None or isinstance(colour, str):
            return text
        space = {"lab": "xyz-d50", "lch": "xyz-d50", "oklab": "xyz-d65", "oklch": "xyz-d65"}
        space |= {"hsl": "srgb", "hwb": "srgb"}
        wanted = space.get(colour.space, colour.space)
        values = np.array([value or 0.0 for value in colour.to(wanted).coordinates])
    except (ValueError, TypeError, NotImplementedError, ArithmeticError):
        return text
    if wanted.startswith("xyz"):
        linear = _FROM_XYZ[wanted] @ values
        low, high = 12.92 * linear, 1.055 * np.maximum(linear, 0.0) ** (1 / 2.4) - 0.055
        values = np.where(linear <= 0.0031308, low, high)
    red, green, blue = (values.clip(0, 1) * 255).round().astype(int)
    return f"rgba({red},{green},{blue},{colour.alpha:.4g})"


def _plain_transform(text: str) -> str | None:
    """Return transforms of CSS as an attribute writes them; None for those of space or of shares.

    >>> _plain_transform("rotate(.25turn) translateX(10px)")
    'rotate(90) translate(10 0)'
    """
    if _CALL.sub("", text).strip():
        return None
    done: list[str] = []
    for name, arguments in _CALL.findall(text):
        words = arguments.replace(",", " ").split()
        numbers = [_NUMBER.fullmatch(word) for word in words]
        if not numbers or not all(number and number[2].lower() in _UNITS for number in numbers):
            return None
        values = [
            f"{float(number[1]) * _UNITS[number[2].lower()]:.10g}" for number in numbers if number
        ]
        if len(values) > 1 and name.lower() in ("rotate", "rotatez"):
            return None
        if name.lower() not in _NAMES:
            return None
        done.append(_NAMES[name.lower()].format(*values, all=" ".join(values)))
    return " ".join(done)


def _applies(sheet: Element, notes: Notes) -> bool:
    kind = sheet.get("type", "text/css").partition(";")[0].strip().lower()
    return kind in ("", "text/css") and _is_screen(sheet.get("media", ""), notes)


def _is_screen(query: str, notes: Notes) -> bool:
    """Return whether a media query is of a screen; note one that cannot be judged."""
    parts = [part.strip() for part in query.split(",")]
    if any(_SCREEN.fullmatch(part) for part in parts):
        return True
    if any("(" in part for part in parts):
        notes.add(f"@media {query.strip()[:40]} of the style sheet is left out")
    return False


def _add(
    matcher: Matcher, rules: list[Node], namespaces: dict[str | None, str], notes: Notes
) -> Iterator[str]:
    """Add rules to a matcher; yield their selectors."""
    for rule in rules:
        is_rule = isinstance(rule, QualifiedRule | AtRule)
        prelude = tinycss2.serialize(rule.prelude).strip() if is_rule else ""
        if isinstance(rule, QualifiedRule):
            try:
                if max(map(len, prelude.split(","))) > MAX_SELECTOR:
                    raise SelectorError
                # The library evaluates Python that it writes for a selector: all names and texts of
                # the drawing stand in it as repr() quotes them, and numbers as parsed integers.
                compiled = compile_selector_list(rule.prelude, namespaces)
            except _NO_SELECTOR:
                notes.add(f"the selector {quoted(prelude)} of the style sheet is not understood")
                continue
            declared = _declarations(rule.content)
            for selector in compiled:
                matcher.add_selector(selector, declared)
            yield from prelude.split(",")
        elif isinstance(rule, AtRule) and rule.lower_at_keyword == "media":
            if _is_screen(prelude, notes):
                inner = tinycss2.parse_rule_list(
                    rule.content or [], skip_comments=True, skip_whitespace=True
                )
                yield from _add(matcher, inner, namespaces, notes)
        elif isinstance(rule, AtRule) and rule.lower_at_keyword == "namespace":
            words = [token for token in rule.prelude if token.type != "whitespace"]
            if len(words) in (1, 2) and words[-1].type in ("string", "url"):
                namespaces[words[0].value if len(words) == 2 else None] = words[-1].value
        elif isinstance(rule, AtRule) and rule.lower_at_keyword not in _SILENT:
            notes.add(f"@{rule.lower_at_keyword} {prelude[:40]} of the style sheet is left out")


def _declarations(source: str | list[Node]) -> list[Declared]:
    declarations: list[Declared] = []
    for item in tinycss2.parse_blocks_contents(source, skip_comments=True, skip_whitespace=True):
        if isinstance(item, Declaration):
            value = "".join(" " if t.type == "comment" else t.serialize() for t in item.value)
            name = item.name if item.name.startswith("--") else item.lower_name
            if name not in _PAINTS or _is_paint(value.strip()):
                declarations.append((name.removeprefix("-webkit-"), value.strip(), item.important))
    return declarations


def _is_paint(text: str) -> bool:
    """Whether a value is of a paint: what is none leaves the value that it would have replaced."""
    word = text.lower()
    return (
        word in _KEYWORDS
        or word.startswith(("url(", "var("))
        or "icc-color" in word
        or _plain_colour(text) != text
        or tinycss2.color4.parse_color(text) is not None
    )


def _is_too_nested(text: str) -> bool:
    depth = 0
    for character in text:
        depth += (character in "([{") - (character in ")]}" and depth > 0)
        if depth > MAX_BRACKETS:
            return True
    return False


def _with_variables(text: str, variables: dict[str, str]) -> str | None:
    """Return a value with each `var(--name, fallback)` replaced, or None where that is impossible."""
    for _ in range(20):
        if len(text) > MAX_VARIABLE or _is_too_nested(text):
            return None
        parts = [_replaced(token, variables) for token in tinycss2.parse_component_value_list(text)]
        if None in parts:
            return None
        text = "".join(part or "" for part in parts)
        if "var(" not in text.lower():
            return text.strip()
    return None


def _replaced(token: Node, variables: dict[str, str]) -> str | None:
    if not isinstance(token, FunctionBlock):
        return token.serialize()
    if token.lower_name != "var":
        inner = [_replaced(part, variables) for part in token.arguments]
        return None if None in inner else f"{token.name}({''.join(part or '' for part in inner)})"
    words = [part for part in token.arguments if part.type != "whitespace"]
    value = variables.get(words[0].serialize()) if words else None
    if value is None and len(words) > 1 and words[1] == ",":
        return tinycss2.serialize(token.arguments[token.arguments.index(words[1]) + 1 :])
    return value
