"""Pictures of a tile over its silhouette: what is missing and added, or how the silhouette bent."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array
from orbiflow.drawing import Sheet, rgb
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_array
from orbiflow.tiles.pictures.sketch import ScenePicture, Sketch
from orbiflow.tiles.silhouette import Target
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import Tile

# Fills of the overlay: in both, in the target only, in the tile only
COMMON, MISSING, ADDED = "#c9d3dc", "#d95f02", "#2b6cb0"


def overlay_picture(
    tile: Tile,
    target: ArrayLike | BaseGeometry,
    *,
    y_down: bool = False,
    label: str | None = "",
    sheet: Sheet | None = None,
) -> ScenePicture:
    """Return a tile over its target, with what is missing and what is added in two colours.

    Args:
        tile: The tile.
        target: The outline (M, 2), or a shapely polygon, in the tile's coordinates.
        y_down: Whether the y axis points down, as in images.
        label: The words in front of the legend. Default: the class. Without words (None) there is
            no legend.
        sheet: The sheet. Default: 1200 pixels. In print a caption says what the legend would.

    Raises:
        OrbiflowError: If the target is empty or not an outline.
    """
    sheet = sheet or Sheet.screen(1200)
    shape, goal = _clean(shapely.Polygon(tile.polygon)), _target(target)
    common, text = shapely.intersection(shape, goal), ""
    if label is not None and not sheet.printed:
        overlap = common.area / shapely.union(shape, goal).area
        text = f"{label or tile.isohedral_class}  IoU {overlap:.3f}".strip()
    bounds = np.array(goal.bounds).reshape(2, 2)
    sketch = Sketch.around([tile.polygon, bounds], sheet, y_down=y_down, text=text)
    sketch.fill(common, COMMON)
    sketch.fill(shapely.difference(goal, shape), MISSING)
    sketch.fill(shapely.difference(shape, goal), ADDED)
    sketch.line(tile.polygon, "#1a1a1a", 0.0028 * sketch.width, closed=True)
    if text:
        for name, colour, x in (
            ("in both", COMMON, 0.40),
            ("missing", MISSING, 0.58),
            ("added", ADDED, 0.76),
        ):
            sketch.swatch(x, x + 0.03, 0.014, colour)
            sketch.caption(x + 0.04, name)
    title = f"Tile {tile.isohedral_class} over the silhouette".replace("  ", " ")
    caption = "Grey: in both. Orange: missing, in the silhouette alone. Blue: added."
    return sketch.picture(title, caption)


def _target(target: ArrayLike | BaseGeometry) -> BaseGeometry:
    if not isinstance(target, BaseGeometry):
        outline = as_array(target, "the target's outline", (...,))
        if outline.ndim != 2 or outline.shape[1] != 2 or len(outline) < 3:
            raise OrbiflowError(f"a target's outline is (M >= 3, 2) numbers, got {outline.shape}")
        target = shapely.Polygon(outline)
    cleaned = _clean(target)
    if not cleaned.area > 0:
        raise OrbiflowError("the target has no area")
    return cleaned


def _clean(geometry: BaseGeometry) -> BaseGeometry:
    return geometry if shapely.is_valid(geometry) else shapely.make_valid(geometry)


TILE, GHOST, ARROW = "#d7dee6", "#9a8c7a", "#b0413e"
STILL = 0.06  # distance, in square roots of the area, up to which no arrow is drawn
FAR = 0.3  # distance, in square roots of the area, at which the outline has the ramp's last colour

_STEPS = 11
_LINE, _GHOST = 0.0042, 0.0022  # widths of lines, as shares of the picture's


def bending_picture(
    tile: Tile,
    rest: Array,
    bent: Array,
    *,
    y_down: bool = False,
    label: str | None = "",
    thick: float = 1.0,
    sheet: Sheet | None = None,
) -> ScenePicture:
    """Return a tile with the bent silhouette's outline, coloured by how far points moved.

    The silhouette as it was is a faint dashed line; arrows lead from it to the tile where it bent.

    Args:
        tile: The tile in the input's coordinates, which is filled.
        rest, bent: The outlines (n, 2) of the silhouette as it was and bent, point by point.
        y_down, label, sheet: As for `overlay_picture`.
        thick: How many times as wide lines are, for small pictures.
    """
    sheet = sheet or Sheet.screen(1200)
    text = label or tile.isohedral_class or " " if label is not None and not sheet.printed else ""
    sketch = Sketch.around([rest, bent, tile.polygon], sheet, y_down=y_down, text=text)
    sketch.fill(tile.polygon, TILE)
    size = float(np.sqrt(abs(tile.signed_area)))
    moved = np.linalg.norm(bent - rest, axis=1) / size
    unit = thick * sketch.width
    closed = sketch.on_page(np.concatenate([rest, rest[:1]]))
    sketch.dashed(closed, GHOST, _GHOST * unit, unit)
    _arrows(sketch, rest, bent, moved, size, _GHOST * unit)
    values = np.clip((moved + np.roll(moved, -1)) / 2 / FAR, 0, 1)
    steps = np.rint(values * (_STEPS - 1)).astype(int)
    for step, run in sorted(_runs(bent, steps), key=lambda item: item[0]):
        sketch.line(run, RAMP[step], _LINE * unit)
    if text:
        _bending_legend(sketch)
    caption = (
        "Dashed: the silhouette as it was, with arrows to where it went. The tile's outline is "
        "coloured by how far each point moved, from blue, little, to red, far."
    )
    return sketch.picture(f"Silhouette bent into a tile {tile.isohedral_class}".strip(), caption)


def comparison(
    result: EscherTile,
    target: Target,
    *,
    label: str | None = None,
    thick: float = 1.0,
    sheet: Sheet | None = None,
) -> ScenePicture:
    """Return how the silhouette bent into a tile, or the tile over it where it did not bend."""
    tile, y_down = result.tile, target.y_down
    if result.likeness.bent is None or result.likeness.rest is None:
        return overlay_picture(tile, target.outline, y_down=y_down, label=label, sheet=sheet)
    text = label and f"{label}  IoU {result.likeness.metrics.iou:.3f}"
    rest, bent = result.likeness.rest, result.likeness.bent
    return bending_picture(tile, rest, bent, y_down=y_down, label=text, thick=thick, sheet=sheet)


def _ramp(stops: tuple[str, ...], count: int) -> tuple[str, ...]:
    """Return so many colours, evenly spaced from the first stop to the last."""
    values = np.array([rgb(stop) for stop in stops], dtype=float)
    places = np.linspace(0, len(stops) - 1, count)
    mixed = [np.interp(places, np.arange(len(stops)), values[:, k]) for k in range(3)]
    return tuple(
        f"#{red:02x}{green:02x}{blue:02x}"
        for red, green, blue in np.rint(mixed).astype(int).T.tolist()
    )


# Colours of the outline, from where it stayed to where it moved far
RAMP = _ramp(("#1d4e79", "#d98a2b", ARROW), _STEPS)


def _runs(ring: Array, steps: Array) -> Iterator[tuple[int, Array]]:
    """Yield the runs of a ring's sides (n, 2) that have the same step (n,) of the ramp."""
    starts = np.flatnonzero(steps != np.roll(steps, 1))
    if not len(starts):
        yield int(steps[0]), np.concatenate([ring, ring[:1]])
        return
    for first, last in zip(starts, np.roll(starts, -1), strict=True):
        count = (last - first - 1) % len(ring) + 2
        yield int(steps[first]), ring[(first + np.arange(count)) % len(ring)]


def _arrows(
    sketch: Sketch, rest: Array, bent: Array, moved: Array, size: float, width: float
) -> None:
    """Draw arrows to where the outline went, at points some way apart that moved far."""
    taken: list[int] = []
    for k in np.argsort(-moved):
        if moved[k] < STILL or len(taken) == 24:
            break
        if not (np.linalg.norm(rest[taken] - rest[k], axis=1) < 0.16 * size).any():
            taken.append(int(k))
    for k in taken:
        sketch.arrow(rest[k], bent[k], GHOST, width)


def _bending_legend(sketch: Sketch) -> None:
    y, wide = sketch.strip_middle, sketch.width
    sample = np.array([[0.47 * wide, y], [0.52 * wide, y]])
    sketch.dashed(sample, GHOST, _GHOST * wide, wide)
    sketch.caption(0.53, "as it was")
    edges = pairwise(np.linspace(0.68, 0.78, _STEPS + 1))
    for (left, right), colour in zip(edges, RAMP, strict=True):
        sketch.swatch(left, right, 0.009, colour)
    sketch.caption(0.79, "moved, little to far")
