"""Tables of points, GeoJSON and WKT: read right, or refused by their cause."""

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.errors import InputFileError
from orbiflow.tiles import FileContent, Reading, iou, read_outline
from refusals import refused

# three corners of a rectangle and one drawn in: no symmetry that would hide a mistake
SHAPE = [[0.5, 0.25], [4.5, 0.25], [4.5, 3.25], [1.5, 2.25]]
SMALL = [[9, 1], [10, 1], [10, 2]]


def read(content: str, name: str = "a.dat") -> Reading:
    return read_outline(FileContent(content.encode(), name))


def points(rows: Any, separator: str = " ") -> str:
    return "\n".join(separator.join(map(str, row)) for row in rows) + "\n"


@given(st.integers(3, 30), st.integers(-3, 9))
def test_a_promise_that_is_not_kept_is_refused(n: int, more: int) -> None:
    turns = 2 * np.pi * np.arange(n + more) / max(n + more, 1)
    text = f"{n}\n" + points(np.stack([np.cos(turns), np.sin(turns)], axis=1))
    if more == 0:
        assert len(read(text).outline) == n
    else:
        with refused("line 1", n, max(n + more, 0), kind=InputFileError):
            read(text)


def test_a_title_may_stand_above_points_of_dat_files_alone() -> None:
    for title in ("NACA 2412", "0015"):
        assert read(f"{title}\n" + points(SHAPE)).outline.tolist() == SHAPE
    with refused("line 1", "NACA 2412", kind=InputFileError):
        read("NACA 2412\n" + points(SHAPE), "a.csv")


@pytest.mark.parametrize("header", ["x,y", "X;Y", '"x","y"', "longitude\tlatitude", "lon lat"])
@pytest.mark.parametrize("is_turned", [False, True])
def test_headers_say_which_column_is_which(header: str, is_turned: bool) -> None:
    separator = next(s for s in (",", ";", "\t", " ") if s in header)
    names, rows = header.split(separator), SHAPE
    if is_turned:
        names, rows = names[::-1], [row[::-1] for row in rows]
    reading = read(separator.join(names) + "\n" + points(rows, separator), "a.csv")
    assert reading.outline.tolist() == SHAPE
    assert not reading.y_down


@pytest.mark.parametrize(
    ("text", "about"),
    [
        ("1,2,3\n4,5,6\n", "line 1|1,2,3|header"),
        ("0 0\n1 0\n1 1 5\n", "line 3|1 1 5|header"),
        ("0,5,1,5\n2,5,1,5\n", "line 1"),
        ("0 0\n1 0\n1 1\n\n5 5\n6 5\n6 6\n", "line 5|blank line"),
        ("x,y\n0,0\n1\n1,1\n", "line 3|'1'"),
        ("x,y\n", "line 1"),
        ("x,y\n0,0\n1,0\nnan,1\n", "line 4|nan,1|finite"),
        ("row,col\n0,0\n1,0\n1,1\n", "line 1|row,col"),
        ("0,5;1,5\n2,5;1,5\n", "line 1"),
        (">\n0 0\n1 0\n0 1\n>\n3 3\n", "line 1|'>'"),
    ],
)
def test_tables_that_are_no_outline_are_refused(text: str, about: str) -> None:
    with refused(*about.split("|"), kind=InputFileError):
        read(text, "a.csv")


@pytest.mark.parametrize("column", ["id", "", "part", "z", "name"])
def test_other_columns_stay_unread(column: str) -> None:
    values = {"id": range(4), "part": [1] * 4, "z": [0.5, 1, 2, 1.5]}.get(column, "abcd")
    rows = [[value, *at] for value, at in zip(values, SHAPE, strict=True)]
    reading = read(f"{column},x,y\n" + points(rows, ","), "a.csv")
    assert reading.outline.tolist() == SHAPE
    assert len(reading.notes) == 1


def polygon(*rings: Any) -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": [[*ring, ring[0]] for ring in rings]}


def feature(geometry: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": {}, "geometry": geometry}


BOTH = [polygon(ring)["coordinates"] for ring in (SMALL, SHAPE)]
GEOJSON: dict[str, tuple[dict[str, Any], str]] = {
    "MultiPolygon": ({"type": "MultiPolygon", "coordinates": BOTH}, "largest of 2"),
    "FeatureCollection": (
        {"type": "FeatureCollection", "features": [feature(polygon(r)) for r in (SMALL, SHAPE)]},
        "largest of 2",
    ),
    "GeometryCollection": (
        {
            "type": "GeometryCollection",
            "geometries": [polygon(SHAPE), {"type": "Point", "coordinates": [0, 0]}],
        },
        "left Point",
    ),
    "with altitudes": (polygon([[*at, 12.5] for at in SHAPE]), ""),
    "with a hole": (feature(polygon(SHAPE, [[2, 1], [3, 1], [3, 1.5]])), "filled 1 hole"),
}


@pytest.mark.parametrize("case", GEOJSON)
def test_the_largest_polygon_of_geojson_is_kept(case: str) -> None:
    content, note = GEOJSON[case]
    reading = read(json.dumps(content), "a.geojson")
    assert iou(reading.outline, SHAPE) == pytest.approx(1)
    assert note in " ".join(reading.notes)


def test_how_much_wider_degrees_of_longitude_are_is_said() -> None:
    reading = read(json.dumps(polygon([[x, 60 + y] for x, y in SHAPE])), "a.geojson")
    assert "at latitude 62 the shape is 2.1 times as wide" in reading.notes[-1]
    assert read(json.dumps(polygon(SHAPE)), "a.geojson").notes == ()


@pytest.mark.parametrize(
    ("content", "about"),
    [
        ({"type": "Topology", "objects": {}, "arcs": []}, "GeoJSON"),
        ({"rings": [SHAPE]}, "'rings'|GeoJSON"),
        ({"annotations": [{"segmentation": [[0, 1, 2]]}]}, "'annotations'|mask"),
        ([SHAPE, SHAPE], "vertex 0"),
        ([{"x": 1, "y": 2}, {"x": 1}], "vertex 0"),
        ({"type": "Point", "coordinates": [0, 0]}, "Point|no polygon"),
        ({"type": "FeatureCollection", "features": []}, "no polygon"),
        ({"type": "FeatureCollection"}, "GeoJSON"),
        ({"type": "MultiPolygon", "coordinates": [[]]}, "no polygon"),
        ({"type": "Polygon", "coordinates": [[["1", "2"], [3, 4], [5, 6]]]}, "GeoJSON"),
        (polygon([[0, 0], [4, 4], [4, 0], [0, 4]]), "crosses or touches itself"),
    ],
)
def test_geojson_without_an_outline_is_refused_by_its_cause(content: Any, about: str) -> None:
    with refused("a.json", *about.split("|"), kind=InputFileError):
        read(json.dumps(content), "a.json")


CORNERS = ", ".join(f"{x} {y}" for x, y in [*SHAPE, SHAPE[0]])


@pytest.mark.parametrize(
    "text",
    [
        f"POLYGON (({CORNERS}))",
        f"SRID=4326;POLYGON(({CORNERS}), (2 1, 3 1, 3 1.5, 2 1))",
        f"multipolygon ((({CORNERS})), ((9 1, 10 1, 10 2, 9 1)))",
        f"POLYGON Z (({CORNERS.replace(',', ' 7,')} 7))",
    ],
)
def test_wkt(text: str) -> None:
    for name in ("a.wkt", "a.txt"):
        assert iou(read(text, name).outline, SHAPE) == pytest.approx(1)


@pytest.mark.parametrize(
    ("name", "text", "about"),
    [
        ("a.wkt", "POLYGON ((0 0, 1 0", "WKT"),
        ("a.wkt", "POINT (1 2)", "Point"),
        ("a.wkt", "POLYGON ((0 0, 4 4, 4 0, 0 4, 0 0))", "crosses or touches itself"),
        ("a.wkt", "POLYGON EMPTY", "no polygon"),
        ("a.wkt", "CURVEPOLYGON (CIRCULARSTRING (0 0, 2 2, 4 0, 2 -2, 0 0))", "WKT"),
        ("a.dxf", "0\nSECTION\n2\nENTITIES\n0\nENDSEC\n0\nEOF\n", "SVG or PNG"),
        ("a.dxf", "999\nmade by hand\n  0\r\nSECTION\n", "SVG or PNG"),
    ],
)
def test_other_kinds_are_refused_by_their_cause(name: str, text: str, about: str) -> None:
    with refused(name, about, kind=InputFileError):
        read(text, name)
