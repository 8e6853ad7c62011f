"""Aerofoils, tables of points, GeoJSON and WKT: read right, or refused by their cause."""

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


def read(content: str, name: str = "a.dat") -> Reading:
    return read_outline(FileContent(content.encode(), name))


def points(rows: Any, separator: str = " ") -> str:
    return "\n".join(separator.join(map(str, row)) for row in rows) + "\n"


def aerofoil(thickness: float, n: int = 15, length: float = 1.0) -> tuple[Any, Any]:
    """The upper and the lower side (n, 2) of a NACA section with camber, each from the nose."""
    x = (1 - np.cos(np.linspace(0, np.pi, n))) / 2
    half = (
        5
        * thickness
        * (0.2969 * x**0.5 - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1015 * x**4)
    )
    camber = 0.08 * x * (1 - x)
    sides = (np.stack([x, camber + sign * half], axis=1) for sign in (1, -1))
    upper, lower = (np.round(length * side, 6) for side in sides)
    return upper, lower


@pytest.mark.parametrize(
    "title", ["0015", "2412", "NACA 2412", "E423 AIRFOIL (smoothed)", "230 112", "15"]
)
@pytest.mark.parametrize("length", [1.0, 100.0])
def test_aerofoils_of_selig_below_any_title(title: str, length: float) -> None:
    upper, lower = aerofoil(0.12, length=length)
    ring = np.concatenate([upper[::-1], lower[1:]])
    reading = read(f"{title}\n{points(ring)}")
    assert not reading.y_down
    assert reading.notes[0] == f"took line 1 for a title: '{title}'"
    assert iou(reading.outline, ring) == pytest.approx(1)


@pytest.mark.parametrize("title", ["0015", "NACA 2412", "35"])
@pytest.mark.parametrize("counts", ["15. 15.", "15 15", "  15.0   15.0", None])
@pytest.mark.parametrize("blank", ["\n", ""])
def test_aerofoils_of_lednicer_are_joined_at_the_nose(
    title: str, counts: str | None, blank: str
) -> None:
    if not counts and not blank:
        return  # nothing would tell where the second side begins
    upper, lower = aerofoil(0.15)
    first = "" if counts is None else f"{counts}\n{blank}"
    reading = read(f"{title}\n{first}{points(upper)}{blank}{points(lower)}")
    assert "joined the two sides of an aerofoil at its nose" in reading.notes
    assert iou(reading.outline, np.concatenate([upper[::-1], lower[1:]])) == pytest.approx(1)
    assert not reading.y_down


@given(st.integers(3, 30), st.integers(-3, 9))
def test_a_promise_that_is_not_kept_is_refused(n: int, more: int) -> None:
    turns = 2 * np.pi * np.arange(n + more) / max(n + more, 1)
    text = f"{n}\n" + points(np.stack([np.cos(turns), np.sin(turns)], axis=1))
    if more == 0:
        assert len(read(text).outline) == n
    else:
        with refused("line 1", n, max(n + more, 0), kind=InputFileError):
            read(text)


FOUR = [
    *("x,y", "X;Y", "x\ty", "x y", '"x","y"', "x (mm),y (mm)", "x_coord,y_coord", "lon,lat"),
    *("longitude,latitude", "decimalLongitude,decimalLatitude", "Easting;Northing", "lng,lat"),
]


@pytest.mark.parametrize("header", FOUR)
@pytest.mark.parametrize("is_turned", [False, True])
@pytest.mark.parametrize("is_closed", [False, True])
def test_headers_say_which_column_is_which(header: str, is_turned: bool, is_closed: bool) -> None:
    separator = next(s for s in (",", ";", "\t", " ") if s in header)
    names = header.split(separator)
    rows = [*SHAPE, SHAPE[0]] if is_closed else SHAPE
    if is_turned:
        names, rows = names[::-1], [row[::-1] for row in rows]
    reading = read(separator.join(names) + "\n" + points(rows, separator), "a.csv")
    assert reading.outline.tolist() == SHAPE
    assert not reading.y_down
    assert reading.notes[0].startswith("took ")


@pytest.mark.parametrize("separator", [";", "\t", " ", "; "])
@pytest.mark.parametrize("header", ["", "x{}y\n", "# a comment\n"])
def test_decimal_commas(separator: str, header: str) -> None:
    text = header.format(separator) + points(SHAPE, separator).replace(".", ",")
    assert read(text, "a.csv").outline.tolist() == SHAPE


@pytest.mark.parametrize("name", ["a.csv", "a.txt", "a.xy", "a.dat"])
@pytest.mark.parametrize("is_clockwise", [False, True])
def test_points_without_a_header(name: str, is_clockwise: bool) -> None:
    rows = SHAPE[::-1] if is_clockwise else SHAPE
    reading = read("\n" + points(rows, ",") + "\n\n", name)
    assert reading.outline.tolist() == rows
    assert reading.notes == ("took y to point up",)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,2,3\n4,5,6\n", r"'1,2,3' has 3 columns of numbers.*write a header"),
        ("0 0\n1 0\n1 1 5\n", "line 3: '1 1 5' is not a vertex.*name two in a header"),
        ("0,5,1,5\n2,5,1,5\n", "has 4 columns of numbers"),
        ("0 0\n1 0\n1 1\n\n5 5\n6 5\n6 6\n", "line 5 begins another run of points"),
        ("x,y\n0,0\n1\n1,1\n", r"line 3: '1' has no two numbers under 'x' and 'y', of 2"),
        ("x,y,x\n0,0,1\n", "names several columns"),
        ("x,y\n", "no line below the header|is not a vertex"),
        ("x,y\n0,0\n1,0\nnan,1\n", "line 4: 'nan,1' has no two numbers"),
        ("hello there\n", "line 1: 'hello there' is not"),
        (">\n0 0\n1 0\n0 1\n>\n3 3\n", "line 5: '>' is not a vertex"),
    ],
)
def test_tables_that_are_no_outline_are_refused(text: str, message: str) -> None:
    with pytest.raises(InputFileError, match=message):
        read(text, "a.csv")


# GeoJSON and WKT


def polygon(*rings: Any) -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": [[*ring, ring[0]] for ring in rings]}


def feature(geometry: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": {}, "geometry": geometry}


ISLAND = np.array([[178.0, -16], [181, -16.5], [182, -18], [179, -18.5], [177.5, -17]])


def wrapped(ring: Any, low: float) -> list[list[float]]:
    ring = np.array(ring)
    return np.stack([(ring[:, 0] - low) % 360 + low, ring[:, 1]], axis=1).tolist()


@pytest.mark.parametrize("start", range(5))
@pytest.mark.parametrize("shift", [0.0, -180.0])
def test_rings_over_the_date_line_or_greenwich_are_joined(start: int, shift: float) -> None:
    ring = np.roll(ISLAND, start, axis=0) + np.array([shift, 0])
    cut = -180.0 if shift == 0 else 0.0
    content = feature(polygon(wrapped(ring, cut)))
    reading = read(json.dumps(content), "a.geojson")
    assert "joined the shape where its longitudes jump by 360 degrees" in reading.notes
    lag = np.round((reading.outline - ring)[0, 0] / 360) * 360
    np.testing.assert_allclose(reading.outline - (lag, 0), ring, atol=1e-9)


def test_an_island_cut_at_the_date_line_is_joined() -> None:
    west = [[177, -16], [180, -16], [180, -18], [177, -18]]
    east = [[-180, -16], [-178, -16], [-178, -18], [-180, -18]]
    content = {
        "type": "MultiPolygon",
        "coordinates": [polygon(r)["coordinates"] for r in (west, east)],
    }
    reading = read(json.dumps(content), "a.geojson")
    assert iou(reading.outline, [[177, -16], [182, -16], [182, -18], [177, -18]]) == pytest.approx(
        1
    )
    assert reading.notes == ("joined the shape where its longitudes jump by 360 degrees",)


def test_what_goes_around_a_pole_is_refused() -> None:
    content = polygon([[lon, -70 - lon % 7] for lon in range(-180, 180, 30)])
    with refused("a.geojson", kind=InputFileError):
        read(json.dumps(content), "a.geojson")


def test_large_flat_shapes_are_left_as_they_are() -> None:
    ring = [[-100, -50], [100, -50], [100, 50], [-100, 50]]
    assert read(json.dumps(polygon(ring)), "a.geojson").outline.tolist() == ring
    ring = [[-1000, -50], [1000, -50], [1000, 50]]
    assert read(json.dumps(polygon(ring)), "a.geojson").outline.tolist() == ring


SMALL = [[9, 1], [10, 1], [10, 2]]
COLLECTIONS: dict[str, Any] = {
    "MultiPolygon": {
        "type": "MultiPolygon",
        "coordinates": [polygon(SMALL)["coordinates"], polygon(SHAPE)["coordinates"]],
    },
    "FeatureCollection": {
        "type": "FeatureCollection",
        "features": [feature(polygon(SMALL)), feature(polygon(SHAPE))],
    },
    "GeometryCollection": {
        "type": "GeometryCollection",
        "geometries": [polygon(SHAPE), {"type": "Point", "coordinates": [0, 0]}],
    },
    "a Feature of several": feature(
        {"type": "MultiPolygon", "coordinates": [polygon(SHAPE)["coordinates"]]}
    ),
    "with altitudes": polygon([[*at, 12.5] for at in SHAPE]),
    "with a hole": polygon(SHAPE, [[2, 1], [3, 1], [3, 1.5]]),
    "a closed line": {"type": "LineString", "coordinates": [*SHAPE, SHAPE[0]]},
}


@pytest.mark.parametrize("case", COLLECTIONS)
def test_the_largest_polygon_of_geojson_is_kept(case: str) -> None:
    reading = read(json.dumps(COLLECTIONS[case]), "a.geojson")
    assert iou(reading.outline, SHAPE) == pytest.approx(1)
    said = {
        "with altitudes": "altitudes",
        "with a hole": "filled 1 hole",
        "GeometryCollection": "left Point",
    }
    if case in ("MultiPolygon", "FeatureCollection"):
        assert "kept the largest of 2 components" in reading.notes[0]
    assert said.get(case, "") in " ".join(reading.notes)


def test_how_much_wider_degrees_of_longitude_are_is_said() -> None:
    reading = read(json.dumps(polygon([[x, 60 + y] for x, y in SHAPE])), "a.geojson")
    assert "at latitude 62 the shape is 2.1 times as wide as on the ground" in reading.notes[-1]
    assert read(json.dumps(polygon(SHAPE)), "a.geojson").notes == ()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"type": "Topology", "objects": {}, "arcs": []}, "no polygon .it has 'Topology'"),
        ({"rings": [SHAPE]}, "'rings'.*GeoJSON"),
        ({"type": "Point", "coordinates": [0, 0]}, "no polygon .it has 'Point'"),
        ({"type": "LineString", "coordinates": SHAPE}, "no polygon .it has 'LineString'"),
        ({"type": "FeatureCollection", "features": []}, "no polygon .it has nothing"),
        ({"type": "FeatureCollection"}, "no polygon"),
        ({"type": "MultiPolygon", "coordinates": [[]]}, "no ring"),
        ({"type": "Polygon", "coordinates": [[["1", "2"], [3, 4], [5, 6]]]}, "vertex 0"),
        (polygon([[0, 0], [4, 4], [4, 0], [0, 4]]), "crosses or touches itself"),
    ],
)
def test_geojson_without_an_outline_is_refused_by_its_cause(content: Any, message: str) -> None:
    with pytest.raises(InputFileError, match=message):
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
    ("text", "message"),
    [
        ("POLYGON ((0 0, 1 0", "not valid WKT"),
        ("POINT (1 2)", "WKT of type Point"),
        ("POLYGON ((0 0, 4 4, 4 0, 0 4, 0 0))", "crosses or touches itself"),
        ("POLYGON EMPTY", "no polygon|at least 3|WKT of type"),
    ],
)
def test_wkt_without_an_outline_is_refused(text: str, message: str) -> None:
    with pytest.raises(InputFileError, match=message):
        read(text, "a.wkt")


FIJI = [[178, -6], [179.2, -5.9], [-179.6, -6.1], [-178.9, -7.2], [-179.5, -8.3], [179.1, -8]]
JOINED = [[x % 360, y] for x, y in FIJI]
IN_WKT = ", ".join(f"{x} {y}" for x, y in [*FIJI, FIJI[0]])


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.csv", "lon,lat\n" + points(FIJI, ",")),
        ("a.csv", "decimalLongitude,decimalLatitude\n" + points(FIJI, ",")),
        ("a.csv", "id;latitude;longitude\n" + "".join(f"1;{y};{x}\n" for x, y in FIJI)),
        ("a.wkt", f"SRID=4326;POLYGON (({IN_WKT}))"),
    ],
)
def test_degrees_are_joined_at_the_date_line_in_every_format(name: str, text: str) -> None:
    reading = read(text, name)
    assert iou(reading.outline, JOINED) == pytest.approx(1)
    assert "joined the shape where its longitudes jump by 360 degrees" in reading.notes


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.csv", points(FIJI, ",")),
        ("a.json", json.dumps(FIJI)),
        ("a.wkt", f"POLYGON (({IN_WKT}))"),
    ],
)
def test_numbers_that_may_be_degrees_over_the_date_line_are_noted(name: str, text: str) -> None:
    notes = read(text, name).notes
    assert any("across the date line, save it as GeoJSON" in note for note in notes)


def test_latitudes_and_longitudes_that_are_exchanged_are_said() -> None:
    right = [[110 + x, 40 + y] for x, y in SHAPE]
    exchanged = [[y, x] for x, y in right]
    reading = read(json.dumps(polygon(exchanged)), "a.geojson")
    assert iou(reading.outline, right) == pytest.approx(1)
    assert "exchanged latitudes" in reading.notes[0]
    notes = read(json.dumps(polygon([[10, 50], [11, 50], [11, 91]])), "a.geojson").notes
    assert "beyond 90 are no latitudes" in notes[0]
    with refused("line 2", "110.5", "lat", kind=InputFileError):
        read("lat,lon\n" + points(right, ","), "a.csv")


def test_rows_point_down_and_holes_may_come_first() -> None:
    reading = read("row,col\n" + points([[y, x] for x, y in SHAPE], ","), "a.csv")
    assert reading.y_down
    assert iou(reading.outline, SHAPE) == pytest.approx(1)
    content = {"type": "Polygon", "coordinates": [[[2, 1], [3, 1], [3, 1.5], [2, 1]], SHAPE]}
    reading = read(json.dumps(content), "a.geojson")
    assert iou(reading.outline, SHAPE) == pytest.approx(1)
    assert "took the ring around the others for the outer one" in reading.notes


def test_an_aerofoil_below_its_number_of_points_is_said_to_point_down() -> None:
    upper, lower = aerofoil(0.12)
    rows = [*upper[::-1], *lower[1:]]
    reading = read(f"{len(rows)}\n" + points(rows))
    assert reading.y_down
    assert "took line 1 for the number of vertices" in reading.notes[-1]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.wkt", "CURVEPOLYGON (CIRCULARSTRING (0 0, 2 2, 4 0, 2 -2, 0 0))", "ST_CurveToLine"),
        ("a.wkt", "SRID=4326;COMPOUNDCURVE ((0 0, 1 1))", "curved geometry"),
        ("a.wkt", "MULTISURFACE (((0 0, 4 0, 4 4, 0 0)))", "curved geometry"),
        ("a.wkt", "CIRCULARSTRING (0 0, 1 1, 2 0)", "curved geometry"),
        ("a.dxf", "0\nSECTION\n2\nENTITIES\n0\nENDSEC\n0\nEOF\n", "is a DXF drawing"),
        ("a.dxf", "999\nmade by hand\n  0\r\nSECTION\n", "is a DXF drawing"),
        ("a.dat", "Two\n" + points([*SHAPE, [999.0, 999.0], *SHAPE]), "line 6: 999 parts"),
    ],
)
def test_other_kinds_are_refused_by_their_cause(name: str, text: str, message: str) -> None:
    with pytest.raises(InputFileError, match=message):
        read(text, name)
