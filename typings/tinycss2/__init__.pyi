from collections.abc import Iterable

from . import color4 as color4
from .ast import Node

# what orbiflow uses

def parse_stylesheet(
    input: str, skip_comments: bool = False, skip_whitespace: bool = False
) -> list[Node]: ...
def parse_rule_list(
    input: str | Iterable[Node], skip_comments: bool = False, skip_whitespace: bool = False
) -> list[Node]: ...
def parse_blocks_contents(
    input: str | Iterable[Node], skip_comments: bool = False, skip_whitespace: bool = False
) -> list[Node]: ...
def parse_component_value_list(input: str, skip_comments: bool = False) -> list[Node]: ...
def serialize(nodes: Iterable[Node]) -> str: ...
