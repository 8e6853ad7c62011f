"""The style of each element of a drawing: from its style sheets, attributes and what is around it."""

import re
from collections.abc import Iterator, Mapping
from functools import cached_property, lru_cache
from typing import Any
from xml.etree.ElementTree import Element

import tinycss2
from cssselect2 import ElementWrapper, Matcher, SelectorError, compile_selector_list
from tinycss2.ast import AtRule, Declaration, FunctionBlock, Node, QualifiedRule

from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.readers.reading import Source
from orbiflow.tiles.silhouette.readers.svg_values import (
    ATTRIBUTES,
    FONT_SIZE,
    INHERITED,
    WIDE,
    WITH_LENGTHS,
    checked,
    font_size,
    longhands,
    without_font_units,
)
from orbiflow.tiles.silhouette.readers.svg_xml import SVG, Notes

MAX_STYLE = 200_000  # characters of all style sheets
MAX_STYLES = 4_000_000  # characters of all attributes `style`
MAX_BRACKETS = 50  # how deep brackets may nest: the recursion of serializing stands it
MAX_SELECTORS = 5_000
MAX_SELECTOR = 1_000  # characters
MAX_STEPS = 5_000_000  # comparisons of elements with selectors, and steps from element to element
# at-rules that paint nothing
_SILENT = {
    *(
        "charset",
        "font-face",
        "page",
        "keyframes",
        "-webkit-keyframes",
        "counter-style",
        "property",
    ),
    *("color-profile", "font-feature-values", "font-palette-values", "view-transition"),
}
_PREFERENCE = re.compile(r"(?:(?:all|screen) and )?\(prefers-[a-z-]+\s*:?\s*([a-z-]*)\)")
_USUAL = {"light", "no-preference"}  # what a reader prefers by default
_ABSENT = {"", "null", "undefined"}  # as SVG-edit and scripts write what is not set

# what the library raises for selectors that it does not know, or that nest too deeply for Python
_NO_SELECTOR = (
    *(SelectorError, NotImplementedError, TypeError, AttributeError),
    *(SyntaxError, RecursionError, MemoryError),
)

MAX_VARIABLE = 10_000  # characters that a value with variables may come to
_MAX_NESTED = 20  # variables in variables

Style = Mapping[str, str]
"""The properties of an element that are not their initial ones, and the variables that it knows."""

Declared = tuple[str, str, bool]  # a property, its value, and whether it is important


class Styles:
    """The styles of a drawing's elements, by its style sheets, attributes and what is around each."""

    def __init__(self, path: Source, root: Element, notes: Notes) -> None:
        self.path, self.notes, self.matcher = path, notes, Matcher()
        self.selectors = self.characters = 0
        self._read([item for item in root.iter("style") if _is_css(item)])
        self.nodes: dict[Element, _Node] = {}
        if self.selectors:
            top = _Node(root, None, 0, None, False)
            self.nodes = {node.etree_element: node for node in top.iter_subtree()}
            top.budget.left = MAX_STEPS
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
            self._declared[element] = self.declared(element)
        declared = self._declared[element]
        style = {
            key: value for key, value in around.items() if key in INHERITED or key.startswith("--")
        }
        style.update((key, text) for key, text in declared.items() if key.startswith("--"))
        plain = [key for key in declared if not key.startswith("--")]
        for key in sorted(plain, key=lambda key: key != "font-size"):  # in which others may be
            self._set(style, key, declared[key], around)
        return style

    def declared(self, element: Element) -> dict[str, str]:
        """Return the properties that are declared for an element, by CSS's order of precedence.

        Attributes come first, then rules by their specificity and order, then the attribute `style`;
        what is important comes over all that is not.
        """
        found: dict[str, str] = {}
        for key, text in element.attrib.items():
            if key in ATTRIBUTES and (value := checked(key, text, css=False)) is not None:
                found[key] = value
            elif key in ATTRIBUTES:
                self._misread(key, text)
        ruled = [*self._matched(element), *self._own(element)]
        for late in (False, True):
            found.update((key, value) for key, value, important in ruled if important == late)
        return found

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

    def _matched(self, element: Element) -> Iterator[Declared]:
        node = self.nodes.get(element)
        if node is None:
            return
        try:
            node.budget.charge(self._candidates(node))
            matches = self.matcher.match(node)
        except _TooManySteps as exc:
            raise self._refusal("the style sheet takes too long to apply") from exc
        for _, _, pseudo, declarations in matches:
            if pseudo is None:
                yield from declarations

    def _candidates(self, node: "_Node") -> int:
        """Return an upper bound of how many selectors are compared with an element."""
        matcher = self.matcher
        by_class = sum(len(matcher.class_selectors.get(name, ())) for name in node.classes)
        by_name = len(matcher.lower_local_name_selectors.get(node.local_name.lower(), ()))
        others = len(matcher.other_selectors) + len(matcher.id_selectors.get(node.id or "", ()))
        text = sum(map(len, node.etree_element.attrib.values()))  # which attributes are compared
        return (by_class + by_name + others) * (1 + text // 2_000)

    def _own(self, element: Element) -> tuple[Declared, ...]:
        """Return the declarations of the attribute `style`."""
        text = element.get("style")
        if not text:
            return ()
        self.characters += len(text)
        if self.characters > MAX_STYLES:
            raise self._refusal(f"more than {MAX_STYLES} characters of style")
        found, wrong = _style(text)
        for key, value in wrong:
            self._misread(key, value)
        return found

    def _refusal(self, what: str) -> InputFileError:
        return InputFileError(f"{self.path}: {what}; save the drawing as plain SVG")

    def _misread(self, key: str, value: str) -> None:
        if value.strip().lower() not in _ABSENT:
            self.notes.add(f"{key} {value.strip()[:40]!a} is not understood and left out")

    def _read(self, sheets: list[Element]) -> None:
        texts = ["".join(sheet.itertext()) for sheet in sheets]
        if (count := sum(map(len, texts))) > MAX_STYLE:
            raise self._refusal(f"<style> of {count} characters")
        for sheet, text in zip(sheets, texts, strict=True):
            if text.strip() and self._applies(sheet.get("media", "")):
                if _too_nested(text):
                    raise self._refusal("brackets nest too deeply in <style>")
                rules = tinycss2.parse_stylesheet(text, skip_comments=True, skip_whitespace=True)
                self._add(rules, {})

    def _add(self, rules: list[Node], namespaces: dict[str | None, str]) -> None:
        for rule in rules:
            if isinstance(rule, QualifiedRule):
                self._add_rule(rule, namespaces)
            elif isinstance(rule, AtRule):
                self._add_at_rule(rule, namespaces)
            else:
                self.notes.add("part of the style sheet is not CSS and left out")

    def _add_rule(self, rule: QualifiedRule, namespaces: dict[str | None, str]) -> None:
        text = tinycss2.serialize(rule.prelude).strip()
        found, wrong = _declarations(rule.content)
        for key, value in wrong:
            self._misread(key, value)
        if not found:
            return
        self.selectors += text.count(",") + 1
        if self.selectors > MAX_SELECTORS:
            raise self._refusal(f"more than {MAX_SELECTORS} selectors in <style>")
        try:
            if max(map(len, text.split(","))) > MAX_SELECTOR:
                raise SelectorError
            # The library evaluates Python that it writes for a selector: all names and texts of the
            # drawing stand in it as repr() quotes them, and numbers as parsed integers.
            compiled = compile_selector_list(rule.prelude, namespaces)
        except _NO_SELECTOR:
            self.notes.add(f"the selector {text[:40]!a} of the style sheet is not understood")
            return
        for selector in compiled:
            self.matcher.add_selector(selector, found)

    def _add_at_rule(self, rule: AtRule, namespaces: dict[str | None, str]) -> None:
        name, prelude = rule.lower_at_keyword, tinycss2.serialize(rule.prelude).strip()
        if name == "namespace":
            words = [token for token in rule.prelude if token.type != "whitespace"]
            if len(words) in (1, 2) and words[-1].type in ("string", "url"):
                namespaces[words[0].value if len(words) == 2 else None] = words[-1].value
        elif name == "media" and self._applies(prelude):
            content = rule.content or []
            inner = tinycss2.parse_rule_list(content, skip_comments=True, skip_whitespace=True)
            self._add(inner, namespaces)
        elif name != "media" and name not in _SILENT:
            self.notes.add(f"@{name} {prelude[:40]} of the style sheet is left out")

    def _applies(self, query: str) -> bool:
        """Return whether a media query is of a screen; note one that cannot be judged."""
        found = [_screen(part) for part in query.lower().split(",")]
        if not any(found) and None in found:
            self.notes.add(f"@media {query.strip()[:40]} of the style sheet is left out")
        return any(found)


def _screen(query: str) -> bool | None:
    """Return whether one media query is true of a screen, or None if it cannot be judged."""
    words = query.split()
    refused = words[:1] == ["not"]
    words = words[refused or words[:1] == ["only"] :]
    preference = _PREFERENCE.fullmatch(" ".join(words))
    if preference:
        return (preference[1] in _USUAL) != refused
    if not words or words in (["all"], ["screen"]):
        return not refused
    if words[0].startswith("(") or words[0] in ("all", "screen"):
        return None
    return refused  # print, speech and others


def _is_css(sheet: Element) -> bool:
    return sheet.get("type", "text/css").partition(";")[0].strip().lower() in ("", "text/css")


@lru_cache(2_000)
def _style(text: str) -> tuple[tuple[Declared, ...], tuple[tuple[str, str], ...]]:
    if _too_nested(text):
        return (), (("style", text[:40]),)
    return _declarations(text)


def _declarations(
    source: str | list[Node],
) -> tuple[tuple[Declared, ...], tuple[tuple[str, str], ...]]:
    """Return the valid declarations in a block, and those that are not understood."""
    found: list[Declared] = []
    wrong: list[tuple[str, str]] = []
    for item in tinycss2.parse_blocks_contents(source, skip_comments=True, skip_whitespace=True):
        if not isinstance(item, Declaration):
            nested = item.serialize() if isinstance(item, QualifiedRule) else ""
            wrong += [("the nested rule", nested)] * bool(nested)
            continue
        value = "".join(" " if t.type == "comment" else t.serialize() for t in item.value)
        for name, text in longhands(item.name, value.strip()):
            valid = text if name.startswith("--") else checked(name, text)
            if valid is None:
                wrong.append((name, text))
            else:
                found.append((name, valid, item.important))
    return tuple(found), tuple(wrong)


def _too_nested(text: str) -> bool:
    depth = 0
    for character in text:
        depth += (character in "([{") - (character in ")]}" and depth > 0)
        if depth > MAX_BRACKETS:
            return True
    return False


class _TooManySteps(Exception):
    """Matching would take longer than any drawing is worth."""


class _Budget:
    """The steps that all selectors may take together."""

    def __init__(self) -> None:
        self.left = MAX_STEPS

    def charge(self, steps: int) -> None:
        self.left -= steps
        if self.left < 0:
            raise _TooManySteps


class _Siblings(list[Element]):
    """Elements with one parent, of which it costs steps to go through them, not to count them."""

    budget = _Budget()

    def __getitem__(self, key: "slice[Any, Any, Any]") -> list[Element]:  # type: ignore[override]
        self.budget.charge(len(self))
        return super().__getitem__(key)

    def __iter__(self) -> Iterator[Element]:
        self.budget.charge(len(self))
        return super().__iter__()


class _Node(ElementWrapper):
    """An element as selectors see it, with a bound on the steps that all of them take together."""

    def __init__(
        self, etree_element: Element, parent: "_Node | None", *args: Any, **named: Any
    ) -> None:
        self.budget: _Budget = _Budget() if parent is None else parent.budget
        super().__init__(etree_element, parent, *args, **named)
        self.children: list[_Node] | None = None
        namespace, brace, name = etree_element.tag[1:].rpartition("}")
        self.local_name = name if brace else etree_element.tag
        self.namespace_url = namespace if brace else SVG
        self.etree_children = _Siblings(etree_element)
        self.etree_children.budget = self.budget

    @cached_property
    def lang(self) -> str:
        """The language of the element, which SVG may write without a namespace."""
        plain = self.etree_element.get("lang")
        own = self.etree_element.get("{http://www.w3.org/XML/1998/namespace}lang", plain)
        return own.lower() if own is not None else self.parent.lang if self.parent else ""

    @property
    def ancestors(self) -> Iterator["_Node"]:
        return self._following("parent")

    @property
    def previous_siblings(self) -> Iterator["_Node"]:
        return self._following("previous")

    def _following(self, name: str) -> Iterator["_Node"]:
        node = getattr(self, name)
        while node is not None:
            self.budget.charge(1)
            yield node
            node = getattr(node, name)

    def iter_children(self) -> Iterator["_Node"]:
        if self.children is None:
            self.children = list(super().iter_children())
        for child in self.children:
            self.budget.charge(1)
            yield child


def _with_variables(text: str, style: Style) -> str | None:
    """Return a value with each `var(--name, fallback)` replaced, or None where that is impossible."""
    for _ in range(_MAX_NESTED):
        tokens = tinycss2.parse_component_value_list(text, skip_comments=True)
        if len(text) > MAX_VARIABLE or text.count("(") > MAX_BRACKETS:
            return None
        parts = [_replaced(token, style) for token in tokens]
        found = [part for part in parts if part is not None]
        if len(found) < len(parts):
            return None
        text = "".join(found)
        if "var(" not in text.lower():
            return text.strip()
    return None


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
