from collections.abc import Iterator, Mapping
from typing import Any

# what orbiflow uses; the rest of the library is Any

class Point:
    x: float
    y: float

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
    def get_start_t(self) -> float: ...

class Shape:
    def __init__(self, values: Mapping[str, str] | Shape) -> None: ...
    def render(self, *, ppi: float, width: float, height: float) -> None: ...

class Path(Shape):
    def __iter__(self) -> Iterator[PathSegment]: ...

class SimpleLine(Shape): ...
class Rect(Shape): ...
class Circle(Shape): ...
class Ellipse(Shape): ...
class Polygon(Shape): ...
class Polyline(Shape): ...

class Matrix:
    a: float
    b: float
    c: float
    d: float
    e: float
    f: float
    def __init__(self, transform: str) -> None: ...
    def render(self, *, ppi: float, width: float, height: float) -> None: ...

class Length:
    def __init__(self, text: str) -> None: ...
    def value(self, *, ppi: float, relative_length: float) -> float: ...

class Viewbox:
    @staticmethod
    def viewbox_transform(
        e_x: float,
        e_y: float,
        e_width: float,
        e_height: float,
        vb_x: float,
        vb_y: float,
        vb_width: float,
        vb_height: float,
        aspect: str | None,
    ) -> str: ...

class Color:
    opacity: float | None
    def __init__(self, text: str) -> None: ...

class Use:
    values: dict[str, str] | None

class Group:
    values: dict[str, str] | None

class SVG(Group):
    @staticmethod
    def parse(source: Any, reify: bool = True, ppi: float = 96.0) -> SVG: ...
