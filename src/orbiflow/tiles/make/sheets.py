"""Pages too large for a machine's bed on several sheets that overlap, with marks to align them."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from orbiflow.errors import OrbiflowError
from orbiflow.tiles.make.layout import BLACK, BLUE, STRIP
from orbiflow.tiles.page import (
    Box,
    Curve,
    Layer,
    PlacedTile,
    Scene,
    Style,
    Uses,
    clipped,
    mark_corners,
    rectangle,
)

OVERLAP = 10.0  # usual width in mm of the strip that two neighbouring sheets share
ARM = 4.0  # half the width in mm of a cross in that strip, if the strip is as wide

MOST_SHEETS = 400

MARK = Style(None, BLUE, 0.1)


Spans = list[tuple[float, float]]
"""The sheets' places along one side of a scene: where each starts and ends, in mm."""


def split(
    scene: Scene, bed: tuple[float, float], tolerance: float, overlap: float = OVERLAP
) -> list[Scene]:
    """Split a scene into sheets no larger than the bed, row by row, unless the bed holds it.

    Neighbouring sheets overlap. Lines go from one sheet to the next in the middle of the strip that
    both share, where both have the same crosses; no line is on two sheets. Curves become polygons
    within `tolerance` where sheets meet.
    """
    if scene.width <= bed[0] and scene.height <= bed[1]:
        return [scene]
    columns = spans(scene.width, bed[0], overlap)
    rows = spans(scene.height, bed[1], overlap)
    require_few(len(columns) * len(rows))
    return sheets_of(scene, columns, rows, tolerance, shared=overlap / 2)


def sheets_of(
    scene: Scene, columns: Spans, rows: Spans, tolerance: float, shared: float, edge: float = 0.0
) -> list[Scene]:
    """Return the parts of a scene as scenes of their own, row by row, with crosses at their seams.

    Each part leaves out the outer `shared` mm of the strips that it has in common with its neighbours,
    and lies `edge` mm from the left and the top.
    """
    crosses = _crosses(columns, rows)
    pages = [Box(left, top, right, bottom) for top, bottom in rows for left, right in columns]
    return [
        replace(
            _sheet(scene, page, crosses, tolerance, shared, edge),
            notes=(
                *scene.notes,
                f"Sheet {k} of {len(pages)}; crosses are common to neighbouring sheets.",
            ),
        )
        for k, page in enumerate(pages, 1)
    ]


def require_few(sheets: int) -> None:
    """Check that no more sheets are needed than anybody would handle."""
    if sheets > MOST_SHEETS:
        raise OrbiflowError(
            f"the page needs {sheets} sheets of the bed's size; the most is {MOST_SHEETS}"
        )


def counts_by_sheet(wanted: int, fit: int) -> list[int]:
    """Return how many things lie on each sheet, if a sheet holds `fit` of those that are wanted.

    >>> counts_by_sheet(7, 3)
    [3, 3, 1]
    """
    if not fit:
        raise OrbiflowError("the bed holds no whole tile; choose a smaller tile size")
    sheets = math.ceil(wanted / fit)
    require_few(sheets)
    return [min(fit, wanted - k * fit) for k in range(sheets)]


def spans(length: float, bed: float, overlap: float) -> Spans:
    """Return overlapping intervals of one length, `bed` at most, that cover 0 to `length`."""
    if length <= bed:
        return [(0.0, length)]
    if bed < 3 * overlap:
        raise OrbiflowError(
            f"a bed of {bed:g} mm is too narrow for sheets that overlap by {overlap:g} mm; give one "
            f"of at least {3 * overlap:g} mm"
        )
    count = math.ceil((length - overlap) / (bed - overlap) - 1e-9)
    part = (length + (count - 1) * overlap) / count
    return [(k * (part - overlap), k * (part - overlap) + part) for k in range(count)]


def _crosses(columns: Spans, rows: Spans) -> list[tuple[float, float]]:
    """Return two crosses for each stretch of seam between two sheets."""
    x_seams, y_seams = (
        [(end + start) / 2 for (_, end), (start, _) in pairwise(parts)] for parts in (columns, rows)
    )
    across, down = (
        [start + share * (end - start) for start, end in parts for share in (0.2, 0.8)]
        for parts in (columns, rows)
    )
    return [(x, y) for x in x_seams for y in down] + [(x, y) for y in y_seams for x in across]


def _sheet(
    scene: Scene,
    page: Box,
    crosses: list[tuple[float, float]],
    tolerance: float,
    shared: float,
    edge: float,
) -> Scene:
    # each side that is not the scene's own border is a seam
    seams = Box(
        page.left + (shared if page.left > 0 else 0.0),
        page.top + (shared if page.top > 0 else 0.0),
        page.right - (shared if page.right < scene.width - 1e-9 else 0.0),
        page.bottom - (shared if page.bottom < scene.height - 1e-9 else 0.0),
    )
    low, high = np.maximum(seams[:2], scene.clip[:2]), np.minimum(seams[2:], scene.clip[2:])
    window = Box(*low.tolist(), *high.tolist())
    back = edge - np.array([page.left, page.top])
    layers = [_part(layer, scene, seams, window, back, tolerance) for layer in scene.layers]
    marks = list[Curve]()
    for x, y in crosses:
        across = min(ARM, x - page.left, page.right - x)
        down = min(ARM, y - page.top, page.bottom - y)
        if min(across, down) > 0:
            ends = np.array([[[-across, 0.0], [across, 0.0]], [[0.0, -down], [0.0, down]]])
            marks += [Curve.polyline(line) for line in ends + back + np.array([x, y])]
    layers.append(Layer("registration", "mark", MARK, tuple(marks)))
    return replace(
        scene,
        width=page.width,
        height=page.height,
        layers=tuple(layers),
        window=Box(*(np.array(window) + np.tile(back, 2)).tolist()),
        tiles=_tiles(scene, seams, back),
    )


def _part(
    layer: Layer, scene: Scene, seams: Box, window: Box, back: np.ndarray, tolerance: float
) -> Layer:
    """Return the part of a layer that a sheet shows, in the sheet's own coordinates."""
    items: list[Curve | Uses] = []
    for item in layer.items:
        if isinstance(item, Uses):
            near = item.select(item.near(scene.points(item.symbol), window))
            items.append(replace(near, offsets=near.offsets + back))
        elif not isinstance(item, Curve):
            raise TypeError("motifs are flattened after a page is split")
        else:
            parts = clipped(item, seams, tolerance, filled=layer.role == "paper")
            items += [part.moved(np.eye(2), back) for part in parts]
    copies = any(isinstance(item, Uses) for item in items)
    return replace(layer, items=tuple(items), clipped=layer.clipped or copies)


def _tiles(scene: Scene, seams: Box, back: np.ndarray) -> tuple[PlacedTile, ...]:
    if not scene.prototiles:
        return ()
    kept: dict[int, PlacedTile] = {}
    for number, tile in enumerate(scene.tiles):
        ring = scene.prototiles[tile.prototile] @ tile.linear.T + tile.offset
        low, high = ring.min(axis=0), ring.max(axis=0)
        if (high > seams[:2]).all() and (low < seams[2:]).all():
            whole = tile.whole and bool((low >= seams[:2]).all() and (high <= seams[2:]).all())
            kept[number] = replace(tile, offset=tile.offset + back, whole=whole)
    new = {number: k for k, number in enumerate(kept)}
    return tuple(
        replace(tile, neighbours=tuple(new[k] for k in tile.neighbours if k in new))
        for tile in kept.values()
    )


def calibrated(scene: Scene) -> Scene:
    """Add a mark exactly 100 mm long at the foot of the scene, on a layer of its own."""
    if scene.width < 110:
        raise OrbiflowError(
            f"the calibration mark is 100 mm long and needs a page at least 110 mm wide, got "
            f"{scene.width:g} mm"
        )
    return scene.with_layers(millimetre_rule((scene.width - 100) / 2, scene.height - STRIP / 2))


def millimetre_rule(x: float, y: float, *, upright: bool = False) -> Layer:
    """Return a mark exactly 100 mm long that starts at a point, to the right or downwards."""
    lines = [[[0.0, 0.0], [100.0, 0.0]], *([[at, -2.5], [at, 2.5]] for at in (0.0, 50.0, 100.0))]
    marks = np.array(lines)[..., ::-1] if upright else np.array(lines)
    curves = tuple(Curve.polyline(line) for line in marks + np.array([x, y]))
    return Layer("calibration 100 mm", "mark", MARK, curves)


def registered(scene: Scene) -> Scene:
    """Add the marks by which cutters of the brand Silhouette find what is printed.

    They are a square of 5 mm and two angles of 20 mm, in lines of 0.3 mm, as its cameras expect them.
    """
    first, second, third = mark_corners((scene.width, scene.height))
    left, top = first.left, first.top
    square = rectangle(Box(left, top, left + 5, top + 5))
    angles = (
        Curve.polyline([[second.left, top], [second.right, top], [second.right, second.bottom]]),
        Curve.polyline([[left, third.top], [left, third.bottom], [third.right, third.bottom]]),
    )
    layers = (
        Layer("registration", "mark", Style(BLACK), (square,)),
        Layer("registration angles", "mark", Style(None, BLACK, 0.3), angles),
    )
    return replace(scene, layers=(*layers, *scene.layers))
