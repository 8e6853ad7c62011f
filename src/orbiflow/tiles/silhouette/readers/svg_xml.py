"""The elements of an SVG document, read within bounds; other names than SVG's keep their namespace."""

from collections import Counter
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.readers.reading import FileContent

SVG = "http://www.w3.org/2000/svg"
XLINK = "http://www.w3.org/1999/xlink"
HREF = f"{{{XLINK}}}href"
MAX_ELEMENTS = 20_000
MAX_DEPTH = 100
MAX_ENTITIES = 100
MAX_EXPANDED = 16 * 2**20  # characters that all references to entities can come to
# of prefixes that are used without being declared, as where a drawing was cut out of a web page
_KNOWN = {"xlink": XLINK, "xml": "http://www.w3.org/XML/1998/namespace"}


def parse_xml(path: FileContent, data: bytes) -> Element:
    """Return the root element of the SVG document `data`.

    SVG's own elements and attributes have their plain names; all others have "{namespace}name". A
    document whose root has no namespace is read as if it had SVG's. Refused are entities that hold
    more than plain text, which can blow up to any size, deep nesting and too many elements.
    """
    parser = expat.ParserCreate()
    parser.buffer_text = True
    tree = _BoundedTree(path, parser, data.count(b"&"))
    parser.StartElementHandler = tree.start
    parser.EndElementHandler = tree.end
    parser.CharacterDataHandler = tree.builder.data
    parser.EntityDeclHandler = tree.declare_entity
    parser.ProcessingInstructionHandler = tree.instruct
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
    return tree.builder.close()


def reference(element: Element) -> str | None:
    """Return what an element's `href`, or else its `xlink:href`, refers to."""
    text = element.get("href", element.get(HREF))
    return None if text is None else text.strip()


def is_own(element: Element) -> bool:
    """Return whether an element is one of SVG's own."""
    return not element.tag.startswith("{")


class Notes:
    """Notes for the user about a drawing, each once."""

    MAX_SHOWN = 12

    def __init__(self) -> None:
        self.texts = Counter[str]()

    def add(self, text: str) -> None:
        self.texts[text] += 1

    def counted(self) -> list[str]:
        """Return the notes, with how often each was met, and how many more there are."""
        every = [f"{text} ({n} times)" if n > 1 else text for text, n in self.texts.items()]
        more = len(every) - self.MAX_SHOWN
        return every[: self.MAX_SHOWN] + [f"and {more} more notes of this kind"] * (more > 0)


class _BoundedTree:
    def __init__(self, path: FileContent, parser: expat.XMLParserType, references: int) -> None:
        self.path, self.parser, self.builder = path, parser, TreeBuilder()
        self.references, self.entities = references, 0
        self.count = 0
        self.scopes = [dict[str, str](_KNOWN)]  # the namespace of each prefix, by depth
        self.own = SVG  # the namespace whose names are plain
        self.names: list[str] = []
        self.sheets = ""  # instructions that refer to style sheets

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        self.count += 1
        if self.count > MAX_ELEMENTS:
            self._refuse(f"more than {MAX_ELEMENTS} elements; keep only the silhouette")
        if len(self.scopes) > MAX_DEPTH + 1:
            self._refuse(f"elements nested more than {MAX_DEPTH} deep; ungroup the drawing")
        scoping = [key for key in attributes if key.partition(":")[0] == "xmlns"]
        declared = {key[6:]: attributes.pop(key).strip() for key in scoping}
        self.scopes.append({**self.scopes[-1], **declared} if declared else self.scopes[-1])
        if self.count == 1:
            self._check_root(tag)
        # attributes without a prefix have no namespace
        named = {self._named(k) if ":" in k else k: text for k, text in attributes.items()}
        if self.count == 1 and self.sheets:
            named["{}xml-stylesheet"] = self.sheets
        self.names.append(self._named(tag, self.own))
        self.builder.start(self.names[-1], named)

    def end(self, _: str) -> None:
        self.scopes.pop()
        self.builder.end(self.names.pop())

    def declare_entity(self, name: str, parameter: bool, value: str | None, *_: object) -> None:
        """Take an entity of plain text, such as Illustrator's for its namespaces; refuse others."""
        self.entities += 1
        plain = value is not None and not parameter and not set("&<%") & set(value)
        fits = plain and len(value or "") * self.references <= MAX_EXPANDED
        if not fits or self.entities > MAX_ENTITIES:
            self._refuse(
                f"declares the XML entity {name[:40]!a}; only entities of a short plain text are "
                "read, save the drawing as plain SVG"
            )

    def instruct(self, target: str, data: str) -> None:
        if target == "xml-stylesheet" and not self.count:
            self.sheets = data

    def _check_root(self, tag: str) -> None:
        namespace, _, name = self._named(tag)[1:].rpartition("}")
        if name != "svg":
            self._refuse(f"the XML is a <{name[:40]}>, not an <svg> drawing", line=False)
        if namespace not in ("", SVG):
            reason = f"the namespace of <svg> is {namespace[:60]!a}; it should be {SVG!a}"
            self._refuse(reason)
        self.own = namespace

    def _named(self, text: str, plain: str | None = None) -> str:
        """Return a name with its namespace, unless that is the one whose names are plain."""
        prefix, _, name = text.rpartition(":")
        namespace = self.scopes[-1].get(prefix, prefix)
        return name if namespace == plain else f"{{{namespace}}}{name}"

    def _refuse(self, reason: str, *, line: bool = True) -> None:
        where = f"line {self.parser.CurrentLineNumber}: " if line else ""
        raise InputFileError(f"{self.path}: {where}{reason}")
