"""The elements of an SVG document, read within bounds, and the style sheet that applies to them."""

import re
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.readers.reading import Source

MAX_ELEMENTS = 20_000
MAX_DEPTH = 100
MAX_STYLE = 200_000  # characters
_COMMENT = re.compile(r"/\*.*?(?:\*/|$)", re.DOTALL)
_SELECTOR = re.compile(r"\*|[\w-]*(?:[.#][\w-]+)?")


def parse_xml(path: Source, data: bytes) -> Element:
    """Return the root element of the SVG document `data`, all names without their namespaces.

    Refused are entities, which can blow up to any size, deep nesting and too many elements.
    """
    parser = expat.ParserCreate(namespace_separator="}")
    parser.buffer_text = True
    tree = _BoundedTree(path, parser)
    parser.StartElementHandler = tree.start
    parser.EndElementHandler = tree.end
    parser.CharacterDataHandler = tree.builder.data
    parser.EntityDeclHandler = tree.refuse_entity
    try:
        parser.Parse(data, True)
    except expat.ExpatError as exc:
        raise InputFileError(
            f"{path}: line {exc.lineno}: not well-formed XML ({expat.ErrorString(exc.code)}); "
            "export the drawing again"
        ) from exc
    except (LookupError, ValueError) as exc:
        if isinstance(exc, InputFileError):
            raise
        raise InputFileError(
            f"{path}: its text encoding cannot be read ({exc}); use UTF-8"
        ) from exc
    root = tree.builder.close()
    if root.tag != "svg":
        raise InputFileError(f"{path}: the XML is a <{root.tag[:40]}>, not an <svg> drawing")
    return root


class _BoundedTree:
    def __init__(self, path: Source, parser: expat.XMLParserType) -> None:
        self.path, self.parser, self.builder = path, parser, TreeBuilder()
        self.count = self.depth = 0

    def start(self, name: str, attributes: dict[str, str]) -> None:
        self.count += 1
        self.depth += 1
        if self.count > MAX_ELEMENTS:
            self._refuse(f"more than {MAX_ELEMENTS} elements; keep only the silhouette")
        if self.depth > MAX_DEPTH:
            self._refuse(f"elements nested more than {MAX_DEPTH} deep; ungroup the drawing")
        self.builder.start(_local(name), {_local(key): value for key, value in attributes.items()})

    def end(self, name: str) -> None:
        self.depth -= 1
        self.builder.end(_local(name))

    def refuse_entity(self, name: str, *_: object) -> None:
        self._refuse(
            f"declares the XML entity {name[:40]!a}; entities are not read, save the drawing "
            "as plain SVG"
        )

    def _refuse(self, reason: str) -> None:
        raise InputFileError(f"{self.path}: line {self.parser.CurrentLineNumber}: {reason}")


def _local(name: str) -> str:
    return name.rpartition("}")[2]


class StyleSheet:
    """The rules of a drawing's `<style>` elements with selectors `tag`, `.class`, `#id`, `tag.class`.

    Enough for what drawing programs write; rules with other selectors are passed over.
    """

    def __init__(self, path: Source, root: Element) -> None:
        self.rules: dict[str, dict[str, str]] = {}
        text = "\n".join(style.text or "" for style in root.iter("style"))
        if len(text) > MAX_STYLE:
            raise InputFileError(
                f"{path}: <style> of {len(text)} characters; save the drawing as plain SVG"
            )
        for rule in _COMMENT.sub(" ", text).split("}"):
            selectors, _, body = rule.partition("{")
            declarations = _declarations(body)
            for selector in map(str.strip, selectors.split(",")):
                if _SELECTOR.fullmatch(selector):
                    self.rules.setdefault(selector, {}).update(declarations)

    def properties(self, element: Element) -> dict[str, str]:
        """Return attributes of `element` overridden by the rules that match it and by its own style."""
        properties = dict(element.attrib)
        properties.pop("marker", None)  # a property of styles alone
        tag, names = element.tag, element.get("class", "").split()
        classes = [f"{before}.{name}" for before in ("", tag) for name in names]
        for selector in ("*", tag, *classes, f"#{element.get('id', '')}"):
            properties.update(self.rules.get(selector, {}))
        properties.update(_declarations(element.get("style", "")))
        return properties


def _declarations(text: str) -> dict[str, str]:
    pairs = (item.partition(":") for item in text.split(";"))
    return {
        key.strip().lower(): value.replace("!important", "").strip()
        for key, colon, value in pairs
        if colon
    }
