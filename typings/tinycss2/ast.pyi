from typing import Any

class Node:
    type: str
    value: Any
    def __eq__(self, other: object) -> bool: ...
    def serialize(self) -> str: ...

class QualifiedRule(Node):
    prelude: list[Node]
    content: list[Node]

class AtRule(Node):
    lower_at_keyword: str
    prelude: list[Node]
    content: list[Node] | None

class FunctionBlock(Node):
    name: str
    lower_name: str
    arguments: list[Node]

class Declaration(Node):
    name: str
    lower_name: str
    value: list[Node]
    important: bool
