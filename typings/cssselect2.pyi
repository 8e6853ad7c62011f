from collections.abc import Iterable, Iterator, Mapping
from typing import Any
from xml.etree.ElementTree import Element

from tinycss2.ast import Node

# what orbiflow uses

class SelectorError(ValueError): ...

class CompiledSelector:
    specificity: tuple[int, int, int]

def compile_selector_list(
    input: str | Iterable[Node], namespaces: Mapping[str | None, str] | None = None
) -> list[CompiledSelector]: ...

class Matcher:
    id_selectors: dict[str, list[Any]]
    class_selectors: dict[str, list[Any]]
    lower_local_name_selectors: dict[str, list[Any]]
    other_selectors: list[Any]
    def add_selector(self, selector: CompiledSelector, payload: Any) -> None: ...
    def match(
        self, element: ElementWrapper
    ) -> list[tuple[tuple[int, int, int], int, str | None, Any]]: ...

class ElementWrapper:
    etree_element: Element
    parent: Any
    previous: Any
    local_name: str
    namespace_url: str
    id: str | None
    classes: set[str]
    etree_children: list[Element]
    def __init__(
        self,
        etree_element: Element,
        parent: Any,
        index: int,
        previous: Any,
        in_html_document: bool,
        content_language: str | None = None,
    ) -> None: ...
    def iter_children(self) -> Iterator[Any]: ...
    def iter_subtree(self) -> Iterator[Any]: ...
