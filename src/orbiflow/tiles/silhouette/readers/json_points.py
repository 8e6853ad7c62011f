"""Points and rings in the shapes that JSON of annotation tools and of programs gives them."""

import json
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from orbiflow.errors import InputFileError
from orbiflow.runtime import is_list, is_object
from orbiflow.tiles.silhouette.readers.reading import Source, quoted

MAX_RINGS = 10_000
MAX_NESTED = 2  # lists of rings in one another, as of a MultiPolygon
POLYGON_KEYS = ("polygon", "tile", "outline", "points", "vertices")
"""What a list of vertices stands under; of several, the first is taken."""

_AXES = frozenset(("x", "y"))
_POLYGONS = (None, "polygon")  # the kinds of labelme's shapes that are closed outlines


class Annotation(NamedTuple):
    """One object that was outlined in a picture, as rings of pairs, and its name."""

    rings: list[list[Any]]
    name: str


def rings_of(path: Source, value: Any, depth: int = MAX_NESTED) -> list[Any]:
    """Return the rings in a value: of pairs, of objects with x and y, of two lists, or of rings."""
    if is_object(value) and value.keys() >= _AXES:
        return [_paired(path, value["x"], value["y"])]
    if not is_list(value) or not value:
        return [value]
    first: object = value[0]
    if is_object(first) and first.keys() >= _AXES:
        return [[[p["x"], p["y"]] if is_object(p) and p.keys() >= _AXES else p for p in value]]
    if (
        not depth
        or not is_list(first)
        or not first
        or not (is_list(first[0]) or is_object(first[0]))
    ):
        return [value]
    found = [ring for part in value for ring in rings_of(path, part, depth - 1)]
    if len(found) > MAX_RINGS:
        raise InputFileError(f"{path}: over {MAX_RINGS} rings; save the one that you mean")
    return found


def _paired(path: Source, xs: Any, ys: Any) -> list[Any]:
    if not is_list(xs) or not is_list(ys) or len(xs) != len(ys):
        raise InputFileError(f'{path}: "x" and "y" must be lists of numbers, as many in each')
    return [list(pair) for pair in zip(xs, ys, strict=True)]


def annotations(path: Source, content: dict[str, Any]) -> tuple[list[Annotation], list[str]] | None:
    """Return the outlines in annotations of COCO or labelme, and notes; None if it is neither."""
    if is_list(marked := content.get("annotations")):
        found, others = _coco(content, marked), "masks, boxes or points"
    elif is_list(marked := content.get("shapes")):
        found, others = _labelme(marked), "boxes, circles, lines or points"
    else:
        return None
    kept = [annotation for annotation in found if annotation.rings]
    if not kept:
        raise InputFileError(
            f"{path}: none of its {len(marked)} annotations is a polygon (they are {others}); "
            "give the mask as PNG, or outline the shape by a polygon"
        )
    left = len(marked) - len(kept)
    return kept, [f"left {left} annotation{'s' * (left > 1)} that are no polygons unread"] * (
        left > 0
    )


def _coco(content: dict[str, Any], marked: list[Any]) -> Iterator[Annotation]:
    listed = content.get("categories")
    known = [kind for kind in listed if is_object(kind)] if is_list(listed) else []
    names = {json.dumps(kind.get("id")): str(kind.get("name")) for kind in known}
    for one in marked:
        flat = one.get("segmentation") if is_object(one) else None
        parts = flat if is_list(flat) else []
        parts = [parts] if parts and not is_list(parts[0]) else parts
        rings = [_of_flat(part) for part in parts if is_list(part) and len(part) >= 6]
        yield Annotation(rings, names.get(json.dumps(one.get("category_id")), "") if rings else "")


def _of_flat(numbers: list[Any]) -> list[Any]:
    """Return the pairs of x, y, x, y and so on; what is left over stands alone, to be refused."""
    if is_list(numbers[0]):
        return numbers
    return [numbers[i : i + 2] for i in range(0, len(numbers), 2)]


def _labelme(marked: list[Any]) -> Iterator[Annotation]:
    for one in marked:
        points = one.get("points") if is_object(one) else None
        is_polygon = is_object(one) and one.get("shape_type") in _POLYGONS
        rings = [points] if is_polygon and is_list(points) and len(points) > 2 else []
        yield Annotation(rings, str(one.get("label") or "") if rings else "")


def check_pairs(path: Source, points: Any) -> None:
    """Raise `InputFileError` for a list that is not one of pairs of numbers."""
    if not is_list(points):
        raise InputFileError(f"{path}: {quoted(json.dumps(points))} is no list of pairs [x, y]")
    for i, pair in enumerate(points):
        if not is_list(pair) or len(pair) != 2 or not all(type(n) in (int, float) for n in pair):
            raise InputFileError(
                f"{path}: vertex {i} (counted from 0) is {quoted(json.dumps(pair))}, not a pair of "
                "numbers [x, y]"
            )


def is_finite(points: list[Any]) -> bool:
    """Whether all numbers of pairs are finite and far from overflowing."""
    return all(abs(n) < 1e300 for pair in points for n in pair)


def largest_annotation(found: list[Annotation]) -> tuple[Annotation, list[str]]:
    """Return the object whose outline encloses most, and a note if there are several."""
    areas = [sum(map(_area, annotation.rings)) for annotation in found]
    best = found[int(np.argmax(areas))]
    if len(found) == 1:
        return best, []
    name = f", {quoted(best.name)}" if best.name else ""
    return best, [f"took the largest of {len(found)} annotated objects{name}"]


def _area(ring: list[Any]) -> float:
    if not ring or not is_finite(ring):
        return 0.0
    x, y = np.array(ring, dtype=float).T
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2
