from collections.abc import Iterable, Iterator, Mapping
from typing import Any
from xml.etree.ElementTree import Element

from tinycss2.ast import Node

# what orbiflow uses

class SelectorError(ValueError): ...
class CompiledSelector: ...

def compile_selector_list(
    input: str | Iterable[Node], namespaces: Mapping[str | None, str] | None = None
) -> list[CompiledSelector]: ...

class Matcher:
    def add_selector(self, selector: CompiledSelector, payload: Any) -> None: ...
    def match(
        self, element: ElementWrapper
    ) -> list[tuple[tuple[int, int, int], int, str | None, Any]]: ...

class ElementWrapper:
    etree_element: Element
    parent: ElementWrapper | None
    local_name: str
    namespace_url: str
    @classmethod
    def from_xml_root(cls, root: Element) -> ElementWrapper: ...
    def iter_subtree(self) -> Iterator[ElementWrapper]: ...
