from collections.abc import Iterator
from typing import Any

# what orbiflow uses; the rest of the library is Any

class Point:
    x: float
    y: float

class Color:
    value: int | None
    hexrgb: str
    opacity: float
    def __init__(self, text: str) -> None: ...

class PathSegment:
    start: Point
    end: Point

class Move(PathSegment): ...
class Close(PathSegment): ...
class Line(PathSegment): ...

class QuadraticBezier(PathSegment):
    control: Point

class CubicBezier(PathSegment):
    control1: Point
    control2: Point
    def npoint(self, positions: Any) -> Any: ...

class Arc(PathSegment):
    center: Point
    prx: Point
    pry: Point
    sweep: float | None
    def as_cubic_curves(self, arc_required: int) -> Iterator[CubicBezier]: ...

class Shape:
    values: dict[str, Any]
    fill: Color | None
    stroke: Color | None
    stroke_width: float | None

class Path(Shape):
    def __init__(self, values: str | Shape) -> None: ...
    def __iter__(self) -> Iterator[PathSegment]: ...
    def length(self, error: float = 1e-12) -> float: ...

class Matrix:
    a: float
    b: float
    c: float
    d: float
    def __init__(self, text: str = "") -> None: ...
    def __mul__(self, other: Matrix) -> Matrix: ...

class Use:
    values: dict[str, str] | None

class Group:
    values: dict[str, str] | None

class SVG(Group):
    @staticmethod
    def parse(source: Any, reify: bool = True, ppi: float = 96.0, color: str = "black") -> SVG: ...
    def elements(self) -> Iterator[object]: ...
