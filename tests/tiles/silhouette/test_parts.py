"""Several rings in one file, of which the largest is taken; spots that must not bend."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image, ImageDraw

from mask_files import SIZE, picture, save
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.tiles import Pins, Target, doubts, iou
from orbiflow.tiles.silhouette import outside, triangulate
from outlines import animal, bar
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


SQUIRREL = animal("squirrel.dat")


def half_mask(folder: Path) -> Path:
    mask = Image.new("L", SIZE, 0)
    ImageDraw.Draw(mask).rectangle((0, 0, 59, 99), fill=255)
    return save(folder, mask)


def test_a_mask_holds_what_is_white(tmp_path: Path) -> None:
    target = picture(tmp_path)
    pins = Pins.read([half_mask(tmp_path)], target)
    points = [[25, 15], [55, 50], [65, 50], [170, 80]]
    assert pins.holds(target.to_normal(points)).tolist() == [True, True, False, False]
    assert pins.report()["sources"] == [str(tmp_path / "mask.png")]


def test_spots_and_masks_together(tmp_path: Path) -> None:
    target = picture(tmp_path)
    pins = Pins.read([half_mask(tmp_path), "170, 80,12", "1.7e2,20"], target, keep_angle=True)
    points = [[25, 15], [170, 85], [170, 55], [170, 12]]
    assert pins.holds(target.to_normal(points)).tolist() == [True, True, False, True]
    assert pins.keep_angle
    # of 160 units, 8% are 12.8; the outline is 10 away, but for the pixels' slant, times 1.5
    assert pins.spots[:, 2] * np.sqrt(target.area) == pytest.approx([12, 15], abs=1)


def test_a_spot_inside_reaches_the_outline() -> None:
    target = Target.from_polygon(bar(10, 4))
    pins = Pins.at(target, [(5, 2)])
    assert pins.holds(target.to_normal([[5, 0], [5, 4]])).all()
    inside = Pins.at(target, [(5, 2, 0.5)])
    assert any("keeps its shape there" in note for note in inside.notes)


def test_a_small_pin_inside_holds_the_triangle_around_it(tmp_path: Path) -> None:
    target = picture(tmp_path)
    mesh = triangulate(target.normal, 0.2)
    middle = mesh.points[mesh.triangles[np.argmin(np.hypot(*mesh.points.T)[mesh.triangles].sum(1))]]
    x, y = target.to_input(middle.mean(axis=0))
    dot = Image.new("L", SIZE, 0)
    ImageDraw.Draw(dot).ellipse((x - 2, y - 2, x + 2, y + 2), fill=255)
    for pins in (Pins.at(target, [(x, y, 1)]), Pins.read([save(tmp_path, dot)], target)):
        assert not pins.holds(mesh.points).any()
        (part,) = pins.parts(mesh.points, mesh.triangles)
        assert set(part) in [set(own) for own in mesh.triangles]


def test_each_connected_part_is_one() -> None:
    mesh = triangulate(SQUIRREL.normal)
    ends = SQUIRREL.outline[[0, 30]]
    parts = Pins.at(SQUIRREL, ends).parts(mesh.points, mesh.triangles)
    assert len(parts) == 2
    near = Pins.at(SQUIRREL, [ends[0], ends[0] + 10]).parts(mesh.points, mesh.triangles)
    assert len(near) == 1
    assert Pins.at(SQUIRREL, ends).holds(mesh.points[np.concatenate(parts)]).all()


@pytest.mark.parametrize(
    ("spots", "message"),
    [
        ([(0, 0)], r"the pin at 0,0 lies outside the silhouette, .* spans x from 114 to 781"),
        ([(300, 650, 20)], "lies outside the silhouette"),
        ([(300, 300, 0)], "the radius of a pin must be above 0, got 0"),
        ([(300, 300, -5)], "the radius of a pin must be above 0, got -5"),
        ([(300,)], "a pin must be x,y or x,y,radius, got 1 numbers"),
        ([(1, 2, 3, 4)], "a pin must be x,y or x,y,radius, got 4 numbers"),
        ([(np.nan, 2)], "a pin.*finite"),
        ([], "no pin was given"),
        ([(450, 450, 5000)], "100.0% of the outline"),
    ],
)
def test_mistakes(spots: list, message: str) -> None:
    with pytest.raises(OrbiflowError, match=message):
        Pins.at(SQUIRREL, spots)


def test_mistakes_of_masks(tmp_path: Path) -> None:
    target = picture(tmp_path)
    with refused("nowhere.png", kind=InputFileError):
        Pins.read(["nowhere.png"], target)
    corner = Image.new("L", SIZE, 0)
    ImageDraw.Draw(corner).rectangle((0, 0, 5, 5), fill=255)
    with refused("mask.png", kind=InputFileError):
        Pins.read([save(tmp_path, corner)], target)
    with refused("12;80", kind=InputFileError):
        Pins.read(["12;80"], target)


@given(st.floats(-2000, 2000), st.floats(-2000, 2000))
def test_the_place_that_a_refused_pin_is_told_lies_inside(x: float, y: float) -> None:
    squirrel = shapely.Polygon(SQUIRREL.outline)
    place = str(outside("the pin", x, y, squirrel)).split()[-1].split(",")
    assert squirrel.contains(shapely.Point(*map(float, place)))
