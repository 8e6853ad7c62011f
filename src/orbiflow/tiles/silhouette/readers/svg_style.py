"""The style of an element: what is declared for it and what it has from the elements around it."""

from collections.abc import Mapping
from xml.etree.ElementTree import Element

import tinycss2
from tinycss2.ast import FunctionBlock, Node

from orbiflow.tiles.silhouette.readers.reading import Source
from orbiflow.tiles.silhouette.readers.svg_css import StyleSheets
from orbiflow.tiles.silhouette.readers.svg_properties import INHERITED, WIDE, WITH_LENGTHS, checked
from orbiflow.tiles.silhouette.readers.svg_values import FONT_SIZE, font_size, without_font_units
from orbiflow.tiles.silhouette.readers.svg_xml import Notes

MAX_VARIABLE = 10_000  # characters that a value with variables may come to
_MAX_NESTED = 20  # variables in variables

Style = Mapping[str, str]
"""The properties of an element that are not their initial ones, and the variables that it knows."""


class Styles:
    """The styles of a drawing's elements."""

    def __init__(self, path: Source, root: Element, notes: Notes) -> None:
        self.sheets, self.notes = StyleSheets(path, root, notes), notes
        self.parents = {child: parent for parent in root.iter() for child in parent}
        self.rem = FONT_SIZE
        self._declared: dict[Element, dict[str, str]] = {}
        self._standing: dict[Element, Style] = {}
        self.rem = self.em(self.standing(root))

    def em(self, style: Style) -> float:
        """Return the size of the font in user units."""
        return float(style.get("font-size", FONT_SIZE))

    def standing(self, element: Element) -> Style:
        """Return the style of an element where it stands in the document."""
        if element not in self._standing:
            parent = self.parents.get(element)
            around: Style = {} if parent is None else self.standing(parent)
            self._standing[element] = self.computed(element, around)
        return self._standing[element]

    def computed(self, element: Element, around: Style) -> Style:
        """Return the style of an element inside one that has the style `around`."""
        if element not in self._declared:
            self._declared[element] = self.sheets.declared(element)
        declared = self._declared[element]
        style = {
            key: value for key, value in around.items() if key in INHERITED or key.startswith("--")
        }
        for key in [key for key in declared if key.startswith("--")]:
            style[key] = declared[key]
        if "font-size" in declared:
            self._set(style, "font-size", declared["font-size"], around)
        for key, text in declared.items():
            if key != "font-size" and not key.startswith("--"):
                self._set(style, key, text, around)
        return style

    def _set(self, style: dict[str, str], key: str, text: str, around: Style) -> None:
        """Set one property of a style, with keywords, variables and sizes of the font resolved."""
        if "var(" in text.lower():
            filled = _with_variables(text, style)
            value = None if filled is None else checked(key, filled)
            if value is None:
                self.notes.add(f"{key} {text[:40]!a} is not understood and left out")
            text = value or "unset"
        if text in WIDE:
            inherits = text == "inherit" or (text != "initial" and key in INHERITED)
            style.pop(key, None)
            if inherits and key in around:
                style[key] = around[key]
            return
        if key == "font-size":
            style[key] = repr(font_size(text, self.em(around), self.rem))
        elif key in WITH_LENGTHS and "url(" not in text:
            style[key] = without_font_units(text, self.em(style), self.rem)
        else:
            style[key] = text


def _with_variables(text: str, style: Style) -> str | None:
    """Return a value with each `var(--name, fallback)` replaced, or None where that is impossible."""
    for _ in range(_MAX_NESTED):
        tokens = tinycss2.parse_component_value_list(text, skip_comments=True)
        if not (len(text) <= MAX_VARIABLE and _balanced(text)):
            return None
        parts = [_replaced(token, style) for token in tokens]
        found = [part for part in parts if part is not None]
        if len(found) < len(parts):
            return None
        text = "".join(found)
        if "var(" not in text.lower():
            return text.strip()
    return None


def _balanced(text: str) -> bool:
    return text.count("(") <= 50  # which the recursion of serializing stands


def _replaced(token: Node, style: Style) -> str | None:
    if not isinstance(token, FunctionBlock):
        return token.serialize()
    if token.lower_name != "var":
        inner = [_replaced(part, style) for part in token.arguments]
        if None in inner:
            return None
        return f"{token.name}({''.join(part or '' for part in inner)})"
    words = [part for part in token.arguments if part.type != "whitespace"]
    value = style.get(words[0].serialize()) if words else None
    if value is None and len(words) > 1 and words[1] == ",":
        comma = token.arguments.index(words[1])
        return tinycss2.serialize(token.arguments[comma + 1 :])
    return value if value is None or len(value) <= MAX_VARIABLE else None
