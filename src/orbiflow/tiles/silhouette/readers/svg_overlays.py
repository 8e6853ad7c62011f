"""Layers of paint laid over one another: what is seen of them on a paper, without grids."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from collections.abc import Iterator, Sequence
from itertools import groupby

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from orbiflow.drawing import rgb
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.silhouette.outlines import outer_outline, percent
from orbiflow.tiles.silhouette.readers.svg_regions import MIN_VISIBLE_OPACITY, PaintedLayer, painted
from orbiflow.tiles.silhouette.readers.svg_values import Brush

OVERLAY_GRID = 1e-9  # of the size of the drawing: the grid that the united outline is snapped to
OVERLAY_GRID_FLOOR = 1e-12  # of the largest coordinate
PAPER_COLOUR = "#ffffff"  # what a drawing without a background lies on
MAX_CHANNEL_DISTANCE = 10  # of 255: colours whose channels differ by no more are one
COVERING_OPACITY = 0.9  # opacity: more hides what lies below
MIN_SHOWN_SHARE, MIN_NOTED_SHARE, MIN_OVERLAP_SHARE = 0.5, 0.001, 0.1  # shares of areas
MAX_FAINT_LAYERS = 200  # laid over one another; of more, each is judged by itself
MAX_GRID_LINE_SHARE = 0.01  # of all that is painted: a line that is no wider may belong to a grid
MIN_SPAN_SHARE = 0.98  # of the shape's width or height: what a line of a grid spans
BLACK = Brush("#000000", 1.0)
_Shades = dict[tuple[float, float], BaseGeometry]
"""Regions by how much of the shapes' paint is seen there, and how much of the ground is covered."""


def overlay(layers: list[PaintedLayer], ground: str | None) -> tuple[BaseGeometry, list[str]]:
    """Return the region that is seen of layers on a ground, and notes."""
    paper = ground or PAPER_COLOUR
    # Snapped to a grid: neighbours that all but share an edge would leave cracks between them.
    bounds = shapely.total_bounds([layer.region for layer in layers])
    size = max(bounds[2] - bounds[0], bounds[3] - bounds[1])
    grid = max(OVERLAY_GRID * size, OVERLAY_GRID_FLOOR * float(np.abs(bounds).max()))
    opaque, n = _with_faint_joined(layers, paper)
    if not opaque:
        return painted(layers, [1] * n, grid), ["took faint shapes, as there are no others"]
    notes = [f"left out {n} faint shape{'s' * (n > 1)}"] * (n > 0)
    pale = [alike(layer.brush.colour, paper) for layer in opaque]
    signs = [
        1 if not own else -1 if layer.brush.opacity >= COVERING_OPACITY else 0
        for layer, own in zip(opaque, pale, strict=True)
    ]
    seen = painted(opaque, signs, grid)
    if not any(pale):
        return seen, notes
    # what has the paper's colour and lies on the bare paper may be the shape itself
    every = painted(opaque, [_sign(opaque, k, pale) for k in range(len(opaque))], grid)
    hidden = 1 - solid(seen) / (solid(every) or 1.0)
    if not seen.area > 0 or (ground is None and hidden > MIN_SHOWN_SHARE):
        return every, [*notes, f"took shapes in {paper} too: they are most of the drawing"]
    dark = painted(opaque, [int(not own) for own in pale], grid)
    bitten = 1 - solid(seen) / solid(dark)
    if bitten > MIN_NOTED_SHARE:
        notes.append(
            f"took shapes in {paper} for background, which hide {percent(bitten)} of the others; "
            "give them another colour if they belong to the shape"
        )
    return seen, notes


def _sign(layers: list[PaintedLayer], k: int, pale: list[bool]) -> int:
    """Return -1 for a pale layer that lies over darker ones for a good part, else 1."""
    below = [layer.region for layer, own in zip(layers[:k], pale, strict=False) if not own]
    over = shapely.area(shapely.intersection(below, layers[k].region)).sum() if pale[k] else 0.0
    return -1 if over > MIN_OVERLAP_SHARE * layers[k].region.area else 1


def alike(colour: str, other: str) -> bool:
    """Return whether two colours all but are one."""
    both = (rgb(c if c[0] == "#" else BLACK.colour) for c in (colour, other))
    return max(abs(a - b) for a, b in zip(*both, strict=True)) <= MAX_CHANNEL_DISTANCE


def solid(region: BaseGeometry) -> float:
    """Return the area of the largest part of a region, with its holes filled."""
    return outer_outline(region)[0].area if region.area > 0 else 0.0


def _with_faint_joined(layers: list[PaintedLayer], paper: str) -> tuple[list[PaintedLayer], int]:
    """Return opaque layers, with one where faint ones together are opaque; and how many show nowhere.

    A group is laid on with its opacity as a whole: what overlaps inside it does not add up to more.
    """
    faint = [layer for layer in layers if _is_faint(layer)]
    if not 1 < len(faint) <= MAX_FAINT_LAYERS or not _overlap(faint):
        return [layer for layer in layers if not _is_faint(layer)], len(faint)
    found: list[PaintedLayer] = []
    shades: _Shades = {}
    runs = (run for own in _by_groups(layers, 0) for run in groupby(own, key=_is_faint))
    for is_faint, run in runs:
        own = list(run)
        if not is_faint:
            found += own
            for layer in own:
                if alike(layer.brush.colour, paper) and layer.brush.opacity >= COVERING_OPACITY:
                    shades = _laid(shades, layer.region, 0.0, 1.0)
            continue
        for (dark, cover), region in _shades(own, 0, paper).items():
            shades = _laid(shades, region, dark, cover)
        dense = [region for (dark, _), region in shades.items() if dark >= MIN_VISIBLE_OPACITY]
        shades = {key: region for key, region in shades.items() if key[0] < MIN_VISIBLE_OPACITY}
        colours = (layer.brush.colour for layer in own if not alike(layer.brush.colour, paper))
        brush = Brush(next(colours, BLACK.colour), 1.0)
        found += [PaintedLayer(region, brush) for region in dense]
    seen = _united(found)
    if len(faint) == len(layers) and seen.area < MIN_SHOWN_SHARE * _united(layers).area:
        return [], len(faint)  # the overlaps of a drawing that is all faint are not its shape
    shares = [layer.region.intersection(seen).area / layer.region.area for layer in faint]
    return found, sum(share < MIN_SHOWN_SHARE for share in shares)


def _united(layers: Sequence[PaintedLayer]) -> BaseGeometry:
    return shapely.union_all([layer.region for layer in layers])


def _is_faint(layer: PaintedLayer) -> bool:
    return layer.brush.opacity < MIN_VISIBLE_OPACITY


def _overlap(layers: Sequence[PaintedLayer]) -> bool:
    tree = shapely.STRtree([layer.region for layer in layers])
    return tree.query(tree.geometries, predicate="intersects").shape[1] > len(layers)


def _by_groups(layers: Sequence[PaintedLayer], depth: int) -> Iterator[list[PaintedLayer]]:
    """Yield layers that are of one group at a depth together, and any other by itself."""

    def key(at: int) -> object:
        groups = layers[at].groups
        return groups[depth] if len(groups) > depth else at

    for _, run in groupby(range(len(layers)), key=key):
        yield [layers[at] for at in run]


def _shades(layers: Sequence[PaintedLayer], depth: int, paper: str) -> _Shades:
    """Return what is seen of one layer, or of those that are of one group at a depth."""
    first = layers[0]
    if len(first.groups) <= depth:
        opacity = first.brush.opacity
        for group in first.groups:
            opacity /= group.opacity
        return {(0.0 if alike(first.brush.colour, paper) else opacity, opacity): first.region}
    whole: _Shades = {}
    for own in _by_groups(layers, depth + 1):
        for (dark, cover), region in _shades(own, depth + 1, paper).items():
            whole = _laid(whole, region, dark, cover)
    share = first.groups[depth].opacity
    return {(dark * share, cover * share): region for (dark, cover), region in whole.items()}


def _laid(shades: _Shades, region: BaseGeometry, dark: float, cover: float) -> _Shades:
    """Return shades after a paint is laid over a region."""
    found: dict[tuple[float, float], list[BaseGeometry]] = {}
    for (below, covered), old in shades.items():
        through = 1 - cover
        mixed = round(dark + below * through, 3), round(cover + covered * through, 3)
        found.setdefault(mixed, []).append(old.intersection(region))
        found.setdefault((below, covered), []).append(old.difference(region))
    bare = region.difference(shapely.union_all(list(shades.values())))
    found.setdefault((round(dark, 3), round(cover, 3)), []).append(bare)
    joined = {key: shapely.union_all(own) for key, own in found.items()}
    return {key: region for key, region in joined.items() if region.area > 0}


def without_grid(layers: list[PaintedLayer], paper: str) -> tuple[list[PaintedLayer], list[str]]:
    """Return layers without level or upright thin lines of another colour that run past the shape."""
    bounds = shapely.total_bounds([layer.region for layer in layers])
    thin = MAX_GRID_LINE_SHARE * max(bounds[2] - bounds[0], bounds[3] - bounds[1])
    dark = [k for k, layer in enumerate(layers) if not alike(layer.brush.colour, paper)]
    lines = [k for k in dark if _is_of_lines(layers[k].region, thin)]
    rest = [layers[k] for k in dark if k not in {*lines}]
    if not lines or not rest:
        return layers, []
    own = max(rest, key=lambda layer: layer.region.area).brush.colour
    whole = outer_outline(shapely.union_all([layer.region for layer in rest]))[0]
    across = [k for k in lines if _is_across(layers[k].region, whole)]
    meeting = [k for k in across if layers[k].region.intersects(whole)]
    colours = [layers[k].brush.colour for k in meeting if not alike(layers[k].brush.colour, own)]
    left = {k for k in across if any(alike(layers[k].brush.colour, colour) for colour in colours)}
    beyond = sum(layers[k].region.difference(whole).area for k in left.intersection(meeting))
    lines_left = f"{len(left)} thin line{'s' * (len(left) > 1)}"
    note = (
        f"left out {lines_left} of another colour that run{'s' * (len(left) == 1)} across the shape"
    )
    kept = [layer for k, layer in enumerate(layers) if k not in left]
    return kept, [note] * (beyond > MIN_NOTED_SHARE * whole.area)


def _is_of_lines(region: BaseGeometry, thin: float) -> bool:
    """Whether all parts of a region are thin and level or upright."""
    bounds = shapely.bounds(polygons_in(region))
    return bool((np.minimum(*(bounds[:, 2:] - bounds[:, :2]).T) <= thin).all())


def _is_across(region: BaseGeometry, whole: Polygon) -> bool:
    """Whether every part of a region spans the width or the height of a shape."""
    low, high = np.array(whole.bounds).reshape(2, 2)
    bounds = shapely.bounds(polygons_in(region))
    common = np.minimum(bounds[:, 2:], high) - np.maximum(bounds[:, :2], low)
    return bool((common >= MIN_SPAN_SHARE * (high - low)).any(axis=1).all())
