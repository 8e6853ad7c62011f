"""Windows in which regions of a space are drawn: rectangles that hold each point once."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.spaces import RoundSpace, Space, to_latlon, to_vectors, whole_turn
from orbiflow.errors import OrbiflowError


@dataclass(frozen=True, eq=False)
class Window:
    """A rectangle that holds each point of a space once, except on its edges.

    - `names`: Names of x and y. `low`, `high`: Corners (2,) in data units.
    - `cells`: Numbers of cells of the coarsest grid.
    - `edges`: Which edges are one, and so where regions are cut, in words.
    - `on_globe`: Whether x and y are longitude and latitude.
    - `to_chart`, `from_chart`: Functions from points (N, 2) of the rectangle to chart points and back.
    """

    names: tuple[str, str]
    low: Array
    high: Array
    cells: tuple[int, int]
    edges: str
    on_globe: bool
    to_chart: Callable[[Array], Tensor]
    from_chart: Callable[[Tensor], Array]

    def area(self, shape: shapely.Geometry) -> float:
        """Return the natural area of a polygon or several.

        On the globe it is in steradians, and sides are straight in longitude and latitude.
        """
        if not self.on_globe:
            return float(shapely.area(shape))
        return sum(_steradians(part) for part in shapely.get_parts(shape))


def window_of(space: Space) -> Window:
    """Return the window in which regions of a space are drawn.

    Raises:
        OrbiflowError: If the space does not have two dimensions.
    """
    if space.dim != 2:
        raise OrbiflowError(
            f"outlines are drawn in two dimensions, this {space.name} has {space.dim}; thresholds, "
            "sizes and which rows are inside can be found all the same"
        )
    if isinstance(space, RoundSpace):
        return _round(space)
    return _flat(space)


def _round(space: RoundSpace) -> Window:
    def to_chart(points: Array) -> Tensor:
        return space.vectors_to_chart(to_vectors(points[:, ::-1]))

    def from_chart(points: Tensor) -> Array:
        data = space.from_chart(points)
        return (to_latlon(data) if data.shape[1] == 3 else data)[:, ::-1]

    half = len(space.features(to_chart(np.zeros((1, 2))))) > 1
    edges = "longitude -180 is longitude 180"
    if half:
        edges += "; on the equator, a point is that opposite; polygons are of northern ends"
    return Window(
        ("lon", "lat"),
        np.array([-180.0, 0.0 if half else -90.0]),
        np.array([180.0, 90.0]),
        (180, 45 if half else 90),
        edges,
        True,
        to_chart,
        from_chart,
    )


def _flat(space: Space) -> Window:
    period = whole_turn(str(space.unit))
    if space.is_torus:
        low = np.full(2, -period / 2)
        high, edges = -low, "opposite edges are one"
    else:
        low, high = np.array([0.0, -period / 4]), np.array([period / 2, 3 * period / 4])
        theta, phi = space.columns
        edges = f"{theta} 0 is {theta} {period / 2:g} with {phi} turned over; the others are one"
    return Window(
        (space.columns[0], space.columns[1]),
        low,
        high,
        (128, 128),
        edges,
        False,
        space.to_chart,
        space.from_chart,
    )


def _steradians(polygon: shapely.Geometry) -> float:
    assert isinstance(polygon, shapely.Polygon)
    outside, *holes = [
        abs(_ring_area(np.asarray(r.coords))) for r in (polygon.exterior, *polygon.interiors)
    ]
    return outside - sum(holes)


def _ring_area(ring: Array) -> float:
    """Return the integral of sin(lat) dlon around a ring (n, 2), exact for straight sides."""
    lon, lat = np.radians(ring.T)
    half = np.diff(lat) / 2
    mean = np.sin(lat[:-1] + half) * np.sinc(half / np.pi)
    return float((mean * np.diff(lon)).sum())
