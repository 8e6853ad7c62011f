"""Shapely's functions of whole arrays, with types where the stubs leave something unknown.

The same functions under the same names: their stubs have no type for `**kwargs`, which is not here.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, TypeAlias, overload

import numpy as np
import shapely
from numpy.typing import NDArray

Reals: TypeAlias = NDArray[np.float64]
Shapes: TypeAlias = NDArray[np.object_] | Sequence[shapely.Geometry]


class _Measure(Protocol):
    @overload
    def __call__(self, geometry: shapely.Geometry) -> np.float64: ...
    @overload
    def __call__(self, geometry: Shapes) -> Reals: ...


class _Distance(Protocol):
    @overload
    def __call__(self, a: shapely.Geometry, b: shapely.Geometry) -> np.float64: ...
    @overload
    def __call__(self, a: Shapes, b: shapely.Geometry | Shapes) -> Reals: ...
    @overload
    def __call__(self, a: shapely.Geometry, b: Shapes) -> Reals: ...


class _Ufuncs(Protocol):
    area: _Measure
    length: _Measure
    distance: _Distance

    def polygons(
        self, geometries: NDArray[Any] | Sequence[NDArray[Any]]
    ) -> NDArray[np.object_]: ...
    def points(self, coords: NDArray[Any]) -> NDArray[np.object_]: ...
    def intersects_xy(self, geom: shapely.Geometry, x: Reals, y: Reals) -> NDArray[np.bool_]: ...
    def contains_xy(self, geom: shapely.Geometry, x: Reals, y: Reals) -> NDArray[np.bool_]: ...
    def total_bounds(self, geometry: shapely.Geometry | Shapes) -> Reals: ...
    def contains_properly(self, a: shapely.Geometry, b: Shapes) -> NDArray[np.bool_]: ...
    def intersects(self, a: shapely.Geometry, b: Shapes) -> NDArray[np.bool_]: ...
    def get_point(self, geometry: Shapes, index: int) -> NDArray[np.object_]: ...
    def line_locate_point(self, line: shapely.Geometry, other: Shapes) -> Reals: ...
    def line_interpolate_point(
        self, line: shapely.Geometry | Shapes, distance: float | Reals, normalized: bool = False
    ) -> NDArray[np.object_]: ...
    def shortest_line(self, a: Shapes, b: Shapes) -> NDArray[np.object_]: ...


_shapely: Any = shapely
ufuncs: _Ufuncs = _shapely
