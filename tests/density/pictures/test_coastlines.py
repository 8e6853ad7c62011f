"""Lines of a user's own for the globe: GeoJSON and tables, and files that are neither."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.density import PlotSettings, Sphere, make_space, read_coastlines
from orbiflow.density.pictures import coastlines
from orbiflow.density.pictures.coastlines import simplified
from orbiflow.density.spaces import Space
from orbiflow.errors import InputFileError
from refusals import refused

SQUARE = [[10, 20], [30, 20], [30, 40], [10, 20]]


def written(tmp_path: Path, content: Any) -> Path:
    path = tmp_path / "lines.geojson"
    path.write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())
    return path


def shape(kind: str, coordinates: Any) -> dict[str, Any]:
    return {"type": kind, "coordinates": coordinates}


def feature(geometry: Any) -> dict[str, Any]:
    return {"type": "Feature", "geometry": geometry}


POINT = shape("Point", [0, 0])
COLLECTION = {"type": "GeometryCollection", "geometries": [shape("LineString", SQUARE)]}


@pytest.mark.parametrize(
    ("item", "count"),
    [
        (shape("LineString", SQUARE), 1),
        (shape("LineString", [[10, 20, 99.5], [30, 20, 0]]), 1),
        (shape("MultiLineString", [SQUARE, SQUARE]), 2),
        (shape("Polygon", [SQUARE, SQUARE]), 2),
        (shape("MultiPolygon", [[SQUARE], [SQUARE, SQUARE]]), 3),
        ({"type": "Feature", "geometry": shape("LineString", SQUARE), "properties": None}, 1),
        ({"type": "FeatureCollection", "features": [feature(POINT), feature(COLLECTION)]}, 1),
    ],
)
def test_all_geometries_with_lines_are_read(tmp_path: Path, item: Any, count: int) -> None:
    lines = read_coastlines(written(tmp_path, item))
    assert len(lines) == count
    assert lines[0][0].tolist() == [20.0, 10.0]  # latitude, longitude
    marked = b"\xef\xbb\xbf" + json.dumps(item).encode()
    assert len(read_coastlines(written(tmp_path, marked))) == count


def test_edges_along_which_a_flat_map_was_cut_are_no_coasts(tmp_path: Path) -> None:
    ring = [[170, -80], [180, -80], [180, -90], [-180, -90], [-180, -80], [-170, -75], [170, -80]]
    lines = read_coastlines(written(tmp_path, shape("Polygon", [ring])))
    assert [line.tolist() for line in lines] == [
        [[-80, 170], [-80, 180]],
        [[-80, -180], [-75, -170], [-80, 170]],
    ]
    # a line is what its author drew
    assert len(read_coastlines(written(tmp_path, shape("LineString", ring)))[0]) == 7


def test_tables_end_lines_at_impossible_latitudes(tmp_path: Path) -> None:
    path = tmp_path / "lines.csv"
    path.write_text("lat,lon\n0,0\n10,10\n99,0\n20,20\n30,30\n99,0\n1,1\n")
    assert [len(line) for line in read_coastlines(path)] == [2, 2]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"{", "GeoJSON"),
        (b"\x00\x00\x27\x0a rest", "shapefile"),
        (b"PK\x03\x04 rest", "zip archive"),
        (b'{"a":' * 5000, "GeoJSON"),
        (b'{"type": "LineString", "coordinates": [[1e999, 0], [0, 0]]}', "GeoJSON"),
        (b'{"type": "LineString", "coordinates": [[NaN, 0], [0, 0]]}', "GeoJSON"),
        ({"type": "Topology", "arcs": []}, "ogr2ogr"),
        ({"type": "Circle"}, "GeoJSON"),
        ({"type": ["x"]}, "GeoJSON"),
        ({"type": "FeatureCollection"}, "GeoJSON"),
        (shape("Point", [0, 0]), "holds lines"),
        (shape("LineString", [[0, 0]]), "GeoJSON"),
        (shape("LineString", [[0, 0], "ab"]), "GeoJSON"),
        (shape("Polygon", [3]), "GeoJSON"),
        (shape("LineString", None), "GeoJSON"),
        (shape("LineString", [[500000, 4649776], [500100, 4649776]]), "globe"),
        (shape("LineString", [[48.2, 116.4], [48.3, 116.5]]), "longitude"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, content: Any, message: str) -> None:
    with refused(*message.split(), kind=InputFileError):
        read_coastlines(written(tmp_path, content))


def test_places_that_are_no_files_and_files_that_are_too_large(tmp_path, monkeypatch) -> None:
    with refused("read", kind=InputFileError):
        read_coastlines(tmp_path / "none.geojson")
    for place in (tmp_path, Path("/dev/zero")):
        with refused("file", kind=InputFileError):
            read_coastlines(place)
    path = written(tmp_path, shape("LineString", SQUARE * 10))
    monkeypatch.setattr(coastlines, "MAX_POINTS", 9)
    with refused("points", "9", kind=InputFileError):
        read_coastlines(path)
    monkeypatch.setattr(coastlines, "MAX_BYTES", 99)
    with refused("coarser", "lines", kind=InputFileError):
        read_coastlines(path)


@given(st.integers(0, 99))
def test_simplified_lines_are_few_and_near(seed: int) -> None:
    t = np.linspace(0, 6, 4000)
    noise = 0.02 * np.random.default_rng(seed).normal(size=4000)
    line = np.stack([20 * np.sin(t) + noise, 20 * t], axis=-1)
    (few,) = simplified([line], 500)
    assert len(few) <= 500
    back = np.interp(line[:, 1], few[:, 1], few[:, 0])
    assert np.abs(back - line[:, 0]).max() < 1.0
    assert simplified([line], 5000)[0] is line


def test_the_earth() -> None:
    lines = coastlines.earth()
    points = np.concatenate(lines)
    assert len(lines) > 100
    assert (abs(points) <= (90, 180)).all()
    for name, place in {"Cape of Good Hope": (-34.4, 18.5), "Gibraltar": (36.0, -5.4)}.items():
        assert np.hypot(*(points - place).T).min() < 1, name
    inland = {"Chad": (15.0, 19.0), "Pacific": (0.0, -150.0)}
    for name, place in inland.items():
        assert np.hypot(*(points - place).T).min() > 9, name
    for line in lines:  # nothing runs along the edges of a flat map
        at_cut = abs(abs(line[:, 1]) - 180) < 1e-6
        assert not (at_cut[1:] & at_cut[:-1]).any()


@pytest.mark.parametrize(
    ("space", "names", "drawn"),
    [
        (Sphere(), None, True), (Sphere(), ("Latitude (deg)", "Longitude (deg)"), True),
        (Sphere(), ("column1", "column2"), True), (Sphere(), ("dec", "ra"), False),
        (Sphere(), ("inclination", "declination"), False), (Sphere(form="vector"), None, False),
        (make_space("projective-plane"), None, False),
    ],
)  # fmt: skip
def test_where_the_earth_is_drawn(space: Space, names: tuple | None, drawn: bool) -> None:
    assert bool(coastlines.coastlines_for(space, PlotSettings(names=names))) == drawn
    assert coastlines.coastlines_for(space, PlotSettings(names=names, earth=False)) == []
