"""Several rings in one table or JSON: the largest part is taken, and what was left out is said."""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from orbiflow.errors import InputFileError
from orbiflow.tiles import Target, doubts, iou
from refusals import refused

SHAPE = [[0.5, 0.25], [4.5, 0.25], [4.5, 3.25], [1.5, 2.25]]
OTHER = [[6, 0], [7, 0], [7, 1], [6, 1]]
INNER = [[3, 1], [3.5, 1], [3.5, 1.5], [3, 1.5]]
CLOSED = [*OTHER, OTHER[0]]
FLAT = [n for pair in SHAPE for n in pair]


def read(content: Any, name: str = "a.json") -> Target:
    text = content if isinstance(content, str) else json.dumps(content)
    return Target.from_bytes(text.encode(), name)


def table(header: str, *parts: tuple[str, Sequence[Sequence[float]]]) -> Target:
    rows = [
        word.format(k=k, x=x, y=y) for word, ring in parts for k, (x, y) in enumerate(ring, start=1)
    ]
    return read("\n".join([header, *rows]), "a.csv")


@pytest.mark.parametrize(
    ("header", "shape", "other"),
    [
        ("part,x,y", "0,{x},{y}", "1,{x},{y}"),
        ("part,x,y", "head,{x},{y}", "tail,{x},{y}"),
        (
            "vertex_index,vertex_part,vertex_part_index,x,y",
            "{k},0,{k},{x},{y}",
            "9{k},1,{k},{x},{y}",
        ),
        ("X,Y,L1,L2", "{x},{y},1,1", "{x},{y},1,2"),
        ("x,y,polygonID", "{x},{y},7", "{x},{y},9"),
        ("x,y,id", "{x},{y},7", "{x},{y},9"),
    ],
)
@pytest.mark.parametrize("is_first", [True, False])
def test_a_column_of_parts(header: str, shape: str, other: str, is_first: bool) -> None:
    parts = [(shape, SHAPE), (other, OTHER)]
    target = table(header, *(parts if is_first else parts[::-1]))
    assert iou(target.outline, SHAPE) == pytest.approx(1)
    assert any("took the largest part of 2 rings that" in note for note in target.notes)
    assert "left out" in doubts(target)[0]


def test_rings_that_are_numbered_again_in_each_part_and_holes() -> None:
    rows = [(SHAPE, 1, 1), (INNER, 2, 1), (OTHER, 1, 2)]
    target = table("X,Y,L1,L2", *((f"{{x}},{{y}},{ring},{part}", at) for at, ring, part in rows))
    assert iou(target.outline, SHAPE) == pytest.approx(1)


def test_an_unknown_column_tells_closed_rings_apart() -> None:
    shape = [*SHAPE, SHAPE[0]]
    target = table("x,y,k", ("{x},{y},a", shape), ("{x},{y},b", CLOSED))
    assert iou(target.outline, SHAPE) == pytest.approx(1)


def test_an_unknown_column_in_runs_is_asked_about() -> None:
    ring = [[0, 0], [2, 0], [4, 0], [4, 2], [4, 4], [0, 4]]
    target = table("x,y,side", ("{x},{y},1", ring[:3]), ("{x},{y},2", ring[3:]))
    assert iou(target.outline, ring) == pytest.approx(1)
    assert "'side' comes in runs" in target.notes[1]


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("id,x,y", "{k},{x},{y}"), (",x,y", "{k},{x},{y}"), ("part,x,y", "1,{x},{y}"),
        ("x,y,z", "{x},{y},0"), ("x,y,z", "{x},{y},{y}"), ("x,y,name", "{x},{y},corner {k}"),
    ],
)  # fmt: skip
def test_other_columns_stay_unread(header: str, row: str) -> None:
    target = table(header, (row, SHAPE))
    assert iou(target.outline, SHAPE) == pytest.approx(1)
    assert target.notes == ("took 'x' for x and 'y' for y, which points up",)
    assert target.seen is None


@pytest.mark.parametrize("first", [0, 1])
def test_row_numbers_without_a_header(first: int) -> None:
    text = "\n".join(f"{k},{x},{y}" for k, (x, y) in enumerate(SHAPE, start=first))
    target = read(text, "a.csv")
    assert iou(target.outline, SHAPE) == pytest.approx(1)
    assert "row numbers" in target.notes[0]


def test_three_columns_that_nothing_names_are_refused() -> None:
    text = "\n".join(f"{x},{y},0" for x, y in SHAPE)
    with refused("line 1", "0.5,0.25,0", "part,x,y", kind=InputFileError):
        read(text, "a.csv")


@pytest.mark.parametrize(
    ("content", "y_down"),
    [
        ([SHAPE], False), ([SHAPE, INNER], False), ([[SHAPE, INNER], [OTHER]], False),
        ([OTHER, SHAPE], False), ([{"x": x, "y": y} for x, y in SHAPE], False),
        ([[{"x": x, "y": y} for x, y in ring] for ring in (OTHER, SHAPE)], False),
        (dict(zip("xy", np.transpose(SHAPE).tolist(), strict=True)), False),
        ({"points": SHAPE}, False), ({"vertices": SHAPE, "y_down": True}, True),
        ({"outline": [{"x": x, "y": y} for x, y in SHAPE], "y_down": True}, True),
    ],
)  # fmt: skip
def test_json_of_other_programs(content: Any, y_down: bool) -> None:
    target = read(content)
    assert iou(target.outline, SHAPE) == pytest.approx(1)
    assert target.y_down is y_down


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"annotations": [{"segmentation": [FLAT]}], "categories": []}, "'annotations'.*mask"),
        ({"version": "5", "shapes": [{"label": "a", "points": SHAPE}]}, "'shapes'.*mask"),
        ({"x": [1, 2], "y": [1]}, '"x" and "y" must be lists'),
        ([SHAPE, None], "no list of pairs"),
        ([[[[SHAPE]]]], "not a pair of numbers"),
        ([{"x": 1, "y": 2}, {"x": 1}, {"x": 2, "y": 3}], "vertex 1 "),
        (FLAT, "vertex 0 "),
    ],
)
def test_json_that_is_no_polygon_is_refused(content: Any, message: str) -> None:
    with pytest.raises(InputFileError, match=message):
        read(content)


def test_parts_of_geojson_are_doubted_where_much_is_left_out() -> None:
    target = read({"type": "MultiPolygon", "coordinates": [[SHAPE], [CLOSED]]})
    assert iou(target.outline, SHAPE) == pytest.approx(1)
    assert "left out" in doubts(target)[0]
    assert not doubts(read({"type": "Polygon", "coordinates": [SHAPE]}))
