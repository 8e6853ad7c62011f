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
    def as_cubic_curves(self, arc_required: int) -> Iterator[CubicBezier]: ...

class Shape:
    def __init__(self, values: Mapping[str, str] | Shape) -> None: ...
    def render(self, *, ppi: float, width: float, height: float) -> None: ...

class Path(Shape):
    def __iter__(self) -> Iterator[PathSegment]: ...

class SimpleLine(Shape):
    def __init__(self, *ends: float) -> None: ...

class Rect(Shape):
    def __init__(self, *values: float) -> None: ...

class Ellipse(Shape):
    def __init__(self, *values: float) -> None: ...

class Polygon(Shape):
    def __init__(self, *points: Mapping[str, str] | tuple[float, float]) -> None: ...

class Polyline(Shape): ...

class Matrix:
    a: float
    b: float
    c: float
    d: float
    e: float
    f: float
    def __init__(self, *values: float) -> None: ...
    def post_rotate(self, angle: float, x: float, y: float) -> None: ...
    @classmethod
    def translate(cls, tx: float = 0.0, ty: float = 0.0) -> Matrix: ...
    @classmethod
    def translate_x(cls, tx: float = 0.0) -> Matrix: ...
    @classmethod
    def translate_y(cls, ty: float = 0.0) -> Matrix: ...
    @classmethod
    def scale(cls, sx: float = 1.0, sy: float | None = None) -> Matrix: ...
    @classmethod
    def scale_x(cls, sx: float = 1.0) -> Matrix: ...
    @classmethod
    def scale_y(cls, sy: float = 1.0) -> Matrix: ...
    @classmethod
    def skew(cls, angle_a: float = 0.0, angle_b: float = 0.0) -> Matrix: ...
    @classmethod
    def skew_x(cls, angle: float = 0.0) -> Matrix: ...
    @classmethod
    def skew_y(cls, angle: float = 0.0) -> Matrix: ...

class Use:
    values: dict[str, str] | None

class Group:
    values: dict[str, str] | None

class SVG(Group):
    @staticmethod
    def parse(source: Any, reify: bool = True, ppi: float = 96.0) -> SVG: ...
