"""The boundaries of regions in two dimensions: polygons in a window."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
import shapely
import torch
from numpy.typing import NDArray
from shapely.geometry.polygon import orient
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import Density
from orbiflow.density.regions.grid import Block, filled, refined, with_islands
from orbiflow.density.regions.levels import DensityLevels, DensityRegion
from orbiflow.density.spaces import RoundSpace, Space, to_vectors, whole_turn
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import one_thread
from orbiflow.typed_torch import unique

DOUBLINGS = 3
"""How often the coarsest grid is made twice as fine: to a quarter of a degree on the globe."""

BUDGET = 300_000
"""Number of evaluations after which no grid gets finer."""

MAX_PEAKS = 30_000
"""Number of kernels' centres at which islands are looked for."""

CHECKED = 100_000
"""Number of new samples with which the mass inside the polygons is measured."""

TOLERANCE = 0.005
"""Error of that mass beyond what samples leave open; a larger one is a note."""

MAX_SIDE = 4.0
"""Degrees of a side on the globe, so that it hardly matters which lines a program draws."""

SIMPLIFIED = 0.03
"""Distance from the line, in cells, of vertices that may be left out."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RegionOutline(DensityRegion):
    """A region with its boundary.

    - `window`: The window in which it is drawn.
    - `shape`: Polygons in the window's units, outer rings counter-clockwise, cut at the window's edges.
    - `polygons_size`: Area of the polygons in natural measure.
    - `polygons_mass`, `polygons_mass_error`: Share of new samples that lie inside the polygons, and its
      standard error.
    - `vertices_off`: Root mean square of the log density at the vertices, less the threshold, in nats.
    - `notes`: What the user should know, in words.
    """

    window: Window = field(repr=False)
    shape: shapely.MultiPolygon = field(repr=False)
    polygons_size: float
    polygons_mass: float
    polygons_mass_error: float
    vertices_off: float
    notes: tuple[str, ...] = ()

    @property
    def polygons_fraction(self) -> float:
        """The polygons' share of the space's natural measure."""
        return self.polygons_size / self.density.space.volume

    @property
    def polygons(self) -> list[list[Array]]:
        """For each polygon its outer ring (n, 2), closed, and then its holes."""
        return rings_of(self.shape)


def rings_of(shape: shapely.MultiPolygon) -> list[list[Array]]:
    """Return for each polygon its outer ring (n, 2), closed, and then its holes."""
    return [
        [np.asarray(ring.coords) for ring in (part.exterior, *part.interiors)]
        for part in shape.geoms
    ]


@one_thread()
@torch.no_grad()
def outlines(
    levels: DensityLevels,
    regions: Sequence[DensityRegion],
    *,
    budget: int = BUDGET,
    seed: int = 0,
    min_mass: float | None = None,
    told: Callable[[float, str], None] = lambda _share, _what: None,
) -> list[RegionOutline]:
    """Return the boundaries of regions of one density of two dimensions.

    A grid is made finer three times where a threshold is crossed. Samples on the other side of a
    threshold than all of their cell show islands between its nodes, and get a grid of their own. Each
    vertex is moved along its cell's side to where the density itself is at the threshold. The mass
    inside the polygons is measured with new samples. Islands that hold less than `min_mass` of it are
    left out.
    `told` is called with the share of the work done, and what is being done.
    """
    density = levels.surface
    window = window_of(density.space)
    if not regions:
        return []

    def function(points: Array) -> Array:
        told(min(0.9, spent / budget), "drawing outlines")
        return density.log_prob(window.to_chart(points), measure="natural").numpy()

    spent = 0
    peaks = window.from_chart(_peaks(density))
    thresholds = np.array([region.log_prob for region in regions])
    points = np.concatenate([window.from_chart(levels.points), peaks])
    seeds = points, np.concatenate([levels.log_probs, function(peaks)])
    counts = np.array(window.cells)
    coarse = Block(np.zeros(counts + 1), window.low, (window.high - window.low) / counts)
    grid, spent = refined(function, coarse, thresholds, seeds, DOUBLINGS, budget)
    spent += len(peaks)
    generator = torch.Generator().manual_seed(seed + 1)
    fresh = window.from_chart(levels.density.sample((CHECKED,), generator).double())
    drawn: list[RegionOutline] = []
    for number, region in enumerate(regions):
        told(min(0.9, spent / budget), "drawing outlines")
        shape, off = filled(grid, region.log_prob, function)
        left = (budget - spent) // (len(regions) - number)
        shape, more, missed = with_islands(shape, grid, function, seeds, region.log_prob, left)
        spent += more
        shape = _polygons(shape, float(grid.step.min()), MAX_SIDE if window.on_globe else np.inf)
        shape, inside, held = _large(shape, window, fresh, min_mass or 0.0)
        error = float(np.sqrt(max(inside * (1 - inside), 1 / CHECKED) / CHECKED))
        notes = _notes(region, held[0], error, missed)
        if held[1]:
            islands = f"island{'s' * (held[1] > 1)} of less than {min_mass:g} of the mass"
            notes += (f"left out {held[1]} {islands}, which held {held[0] - inside:.4f} in all",)
        drawn.append(
            RegionOutline(
                **{entry.name: getattr(region, entry.name) for entry in fields(DensityRegion)},
                window=window,
                shape=shape,
                polygons_size=window.area(shape),
                polygons_mass=inside,
                polygons_mass_error=error,
                vertices_off=off,
                notes=notes,
            )
        )
    return drawn


def _large(
    shape: shapely.MultiPolygon, window: Window, points: Array, least: float
) -> tuple[shapely.MultiPolygon, float, tuple[float, int]]:
    """Return the islands that hold a share of points (N, 2), and how much they hold together.

    Last come the share that all hold, and the number of islands that are left out.
    """
    parts = list(shape.geoms)
    tree = shapely.STRtree(parts)
    of = tree.query(shapely.points(points), predicate="intersects")[1]
    islands = _islands(parts, tree, window)
    shares = np.bincount(islands[of], minlength=islands.max(initial=-1) + 1) / len(points)
    kept = shapely.MultiPolygon(
        [p for p, k in zip(parts, islands, strict=True) if shares[k] >= least]
    )
    large = shares >= least
    return kept, float(shares[large].sum()), (float(shares.sum()), int((~large).sum()))


def _islands(
    parts: list[shapely.Polygon], tree: shapely.STRtree, window: Window
) -> NDArray[np.int64]:
    """Return the island of each polygon: those that meet across the window's edges are one."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = [np.empty((2, 0), dtype=np.int64)]
    step = 1e-6 * (window.high - window.low)
    for number, part in enumerate(parts):
        ring = np.asarray(part.exterior.coords)
        middles, beyond = (ring[1:] + ring[:-1]) / 2, np.zeros((len(ring) - 1, 2))
        for edge, sign in ((window.low, -1), (window.high, 1)):
            beyond += sign * (np.diff(ring, axis=0) == 0) * (abs(middles - edge) < step)
        cut = (beyond != 0).any(axis=1)
        if cut.any():
            places = window.canonical(middles[cut] + step * beyond[cut])
            others = tree.query(shapely.points(places), predicate="intersects")[1]
            pairs.append(np.stack([np.full(len(others), number), others]))
    rows, columns = np.concatenate(pairs, axis=1)
    graph = coo_array((np.ones(len(rows)), (rows, columns)), (len(parts), len(parts)))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _peaks(density: Density) -> Tensor:
    """Return chart points (P, 2) at which narrow islands may be."""
    bumps = torch.cat([part.bumps() for _, part in density.parts()])
    places = unique((bumps * 1e6).round(), dim=0) / 1e6
    chosen = torch.randperm(len(places), generator=torch.Generator().manual_seed(0))
    return places[chosen[:MAX_PEAKS]]


def parts_of(shapes: Any) -> list[shapely.Polygon]:
    """Return the polygons of which shapes consist."""
    parts = shapely.get_parts(shapes).tolist()
    return [part for part in parts if isinstance(part, shapely.Polygon) and part.area > 0]


def _polygons(shape: shapely.Geometry, step: float, longest: float) -> shapely.MultiPolygon:
    simple = [shapely.simplify(p, SIMPLIFIED * min(step, np.sqrt(p.area))) for p in parts_of(shape)]
    kept = [orient(p) for p in simple if p.is_valid and p.area > 0]
    if longest < np.inf:
        kept = [shapely.segmentize(p, longest) for p in kept]
    return shapely.MultiPolygon(kept)


def _notes(region: DensityRegion, inside: float, error: float, missed: int) -> tuple[str, ...]:
    notes: list[str] = []
    beyond = abs(inside - region.held) - 3 * float(np.hypot(error, region.error))
    if beyond > TOLERANCE:
        notes.append(
            f"the polygons hold {inside:.4f} of the mass, the region {region.held:.4f}: it has islands "
            "or holes too small to outline; which rows are inside is exact all the same"
        )
    if missed:
        notes.append(f"{missed} islands or holes were not outlined: a larger budget would")
    return tuple(notes)


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

    def canonical(self, points: Array) -> Array:
        """Return points (N, 2) beside the rectangle as points of it."""
        if self.on_globe:
            points = np.stack([points[:, 0] % 360, np.clip(points[:, 1], -90, 90)], axis=1)
        return self.from_chart(self.to_chart(points))

    def area(self, shape: shapely.MultiPolygon) -> float:
        """Return the natural area; on the globe, of sides straight in longitude and latitude."""
        return sum(map(_steradians, shape.geoms)) if self.on_globe else shape.area


def window_of(space: Space) -> Window:
    """Return the window in which regions of a space are drawn."""
    if not space.is_planar:
        raise OrbiflowError(
            f"outlines are drawn in two dimensions, this {space.name} has {space.dimensions}; "
            "thresholds, sizes and which rows are inside can be found all the same"
        )
    return _round(space) if isinstance(space, RoundSpace) else _flat(space)


def _round(space: RoundSpace) -> Window:
    def to_chart(points: Array) -> Tensor:
        return space.vectors_to_chart(to_vectors(points[:, ::-1]))

    def from_chart(points: Tensor) -> Array:
        data = space.from_chart(points)
        return (space.latlon(data) if data.shape[1] == 3 else data)[:, ::-1]

    half = len(space.features(to_chart(np.zeros((1, 2))))) > 1
    first = 0.0 if space.from_zero else -180.0
    edges = f"longitude {first:g} is longitude {first + 360:g}"
    if half:
        edges += "; on the equator, a point is that opposite; polygons are of northern ends"
    low, high = np.array([first, 0.0 if half else -90.0]), np.array([first + 360, 90.0])
    cells = (180, 45 if half else 90)
    return Window(("lon", "lat"), low, high, cells, edges, True, to_chart, from_chart)


def _flat(space: Space) -> Window:
    period = whole_turn(str(space.unit))
    if space.axes:
        low = np.array([axis.first_turn * period for axis in space.axes])
        high, edges = low + period, "opposite edges are one"
    else:
        low, high = np.array([0.0, -period / 4]), np.array([period / 2, 3 * period / 4])
        theta, phi = space.columns
        edges = f"{theta} 0 is {theta} {period / 2:g} with {phi} turned over; the others are one"
    names, cells = (space.columns[0], space.columns[1]), (128, 128)
    return Window(names, low, high, cells, edges, False, space.to_chart, space.from_chart)


def _steradians(polygon: shapely.Polygon) -> float:
    """Return the area of a polygon: integrals of sin(lat) dlon, exact for straight sides."""
    areas: list[float] = []
    for ring in (polygon.exterior, *polygon.interiors):
        lon, lat = np.radians(np.asarray(ring.coords).T)
        half = np.diff(lat) / 2
        mean = np.sin(lat[:-1] + half) * np.sinc(half / np.pi)
        areas.append(abs(float((mean * np.diff(lon)).sum())))
    return areas[0] - sum(areas[1:])
