"""Cut and engraving in one file lie where the tiles lie, whatever program reads it."""

import io
import re
from collections import defaultdict
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pypdfium2
import pytest
import resvg_py
import shapely
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from scipy.spatial import KDTree

from artworks import EYE, face, squirrel
from exported import Line, dxf_lines, scenes, sheet_content, svg_lines
from orbiflow.tiles import ExportSettings, Scene
from orbiflow.tiles.make.drawings import burnt
from orbiflow.tiles.page import Curve, Motif, PathPart, Style, boundary, region_of
from refusals import refused

Cut = Literal["none", "skeleton", "pieces"]
PAGE: dict[str, Any] = {"purpose": "laser", "area": (90.0, 70.0), "tile_size": 40.0}


@lru_cache
def exported(
    name: str, form: str, picture: Path | None = None, **settings: Any
) -> tuple[Scene, Any]:
    """The first sheet of an export with an eye, and its file."""
    chosen = ExportSettings(**{**PAGE, "format": form, "eyes": (EYE,), **settings})
    found, _ = scenes(squirrel(name), chosen, picture=picture)
    return found[0], sheet_content(found[0], chosen)


def eyes(name: str, scene: Scene) -> np.ndarray:
    """Where the tiles' own isometries put the eye, (M, 2) in mm."""
    tile = squirrel(name)
    assert scene.prototiles
    own, there = tile.tile.polygon, scene.prototiles[0]
    first = np.linalg.lstsq(np.column_stack([own, np.ones(len(own))]), there)[0]
    place = np.append(tile.forward(np.array(EYE)), 1.0) @ first
    return np.stack([one.linear @ place + one.offset for one in scene.tiles])


def by_layer(lines: list[Line]) -> dict[str, list[shapely.LineString]]:
    """The lines of each layer; closed ones are rings."""
    found = defaultdict(list)
    for line in lines:
        kind = shapely.LinearRing if line.closed else shapely.LineString
        found[line.layer].append(kind(line.points))
    return found


def middles(rings: list[shapely.LineString]) -> np.ndarray:
    """The centres (M, 2) of discs."""
    return np.array([shapely.Polygon(ring).centroid.coords[0] for ring in rings])


def rendered(text: str, scale: int) -> np.ndarray:
    """An SVG as another program draws it, (height, width, 3)."""
    png = bytes(resvg_py.svg_to_bytes(svg_string=text, zoom=scale, background="#ffffff", dpi=25.4))
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)


def centres(weights: np.ndarray, near: np.ndarray, scale: np.ndarray | float) -> np.ndarray:
    """The middles (M, 2) in mm of what is marked within 2 mm of some places."""
    rows, columns = np.nonzero(weights)
    points, weighed = (np.column_stack([columns, rows]) + 0.5) / scale, weights[rows, columns]
    close = [np.hypot(*(points - at).T) < 2 for at in near]
    return np.stack([np.average(points[own], axis=0, weights=weighed[own]) for own in close])


@pytest.mark.parametrize(("name", "cut"), [("IH2", "skeleton"), ("IH4", "none"), ("IH4", "pieces")])
def test_the_eye_lies_where_the_isometry_puts_it(name: str, cut: Cut) -> None:
    more = {"kerf": 0.08} if cut == "pieces" else {}
    for form in ("svg", "dxf"):
        scene, text = exported(name, form, cut=cut, **more)
        found = middles(by_layer(svg_lines(text) if form == "svg" else dxf_lines(text)[1])["score"])
        assert len(found) == len(scene.tiles) > 2
        far, order = map(np.asarray, KDTree(found).query(eyes(name, scene)))
        assert far.max() < 0.01  # in another order: that of a short way
        assert sorted(order.tolist()) == list(range(len(found)))


def test_programs_agree_on_cut_and_engraving() -> None:
    scene, text = exported("IH4", "svg", cut="skeleton")
    _, dxf = exported("IH4", "dxf", cut="skeleton")
    document, lines = dxf_lines(dxf)
    assert document.audit().errors == []
    colours = {layer.dxf.name: (layer.dxf.color, layer.rgb) for layer in document.layers}
    assert colours["engrave"] == (7, (0, 0, 0))
    assert colours["score"] == (5, (0, 0, 255))
    assert colours["cut"] == (1, (255, 0, 0))
    drawn, flat = by_layer(svg_lines(text)), by_layer(lines)
    assert list(drawn) == list(flat) == ["engrave", "score", "cut"]
    for name, apart in (("score", 0.003), ("cut", 0.01)):
        both = [shapely.MultiLineString(found[name]) for found in (drawn, flat)]
        for one, other in (both, both[::-1]):
            points = shapely.points(shapely.get_coordinates(one))
            assert shapely.distance(points, other).max() < apart
    # a renderer of SVG, a reader of PDF and the polygons of the DXF
    places, black = eyes("IH4", scene), 255 - rendered(text, 10).max(axis=2)
    page = pypdfium2.PdfDocument(exported("IH4", "pdf", cut="skeleton")[1])[0]
    pdf = 255 - np.asarray(page.render(scale=8).to_pil().convert("RGB")).max(axis=2)
    seen = centres(black, places, 10)
    printed = centres(pdf, places, np.array(pdf.shape[::-1]) / PAGE["area"])
    rings = tuple(Curve.polyline(ring.coords[:-1], closed=True) for ring in flat["engrave"])
    dark = region_of(PathPart(rings, Style()))
    burned = [(dark & shapely.Point(at).buffer(2)).centroid.coords[0] for at in places]
    assert np.hypot(*(seen - burned).T).max() < 0.01
    assert np.hypot(*(printed - burned).T).max() < 0.01


def test_files_for_machines_are_plain() -> None:
    _, text = exported("IH4", "svg", cut="pieces", strokes="hatch")
    assert not re.search("<use|clip-path|transform|currentColor| color=", text)
    labels = re.findall('groupmode="layer" inkscape:label="([^"]+)"([^>]*)>', text)
    assert [name for name, _ in labels] == ["engrave", "score", "cut"]
    assert 'fill="#000000" stroke="none"' in labels[0][1]
    assert 'fill="none" stroke="#0000ff" stroke-width="0.01"' in labels[1][1]
    assert 'fill="none" stroke="#ff0000" stroke-width="0.01"' in labels[2][1]


def test_a_plotter_draws_lines_alone(tmp_path: Path) -> None:
    _, text = exported("IH4", "svg", purpose="plotter", strokes="echoes")
    assert set(re.findall('fill="([^"]+)"', text)) == {"none"}
    assert set(re.findall('stroke="([^"]+)"', text)) == {"#000000"}
    with refused("picture", "SVG"):
        exported("IH4", "svg", face_file(tmp_path), purpose="plotter")


def face_file(folder: Path, name: str = "IH4") -> Path:
    """The picture with a red disc at the eye."""
    path = folder / "face.png"
    face(squirrel(name)).image.save(path)
    return path


def test_pictures_lie_under_the_cut(tmp_path: Path) -> None:
    path = face_file(tmp_path)
    scene, text = exported("IH4", "svg", path, cut="pieces", eyes=())
    assert text.count("<image ") == len(scene.tiles)
    pixels = rendered(text, 10)
    red = (pixels[..., 0] > 200) & (pixels[..., 1:] < 60).all(axis=2)
    places = eyes("IH4", scene)
    # the disc bends with the tile
    assert np.hypot(*(centres(red, places, 10) - places).T).max() < 0.1
    for form in ("dxf", "json"):
        with refused("face.png"):
            exported("IH4", form, path)


GREY = st.integers(0, 255).map(lambda level: f"#{level:02x}{level:02x}{level:02x}")
DISCS = st.lists(
    st.tuples(st.floats(-8, 8), st.floats(-8, 8), st.floats(1, 8), GREY), min_size=1, max_size=6
)


def disc(x: float, y: float, radius: float) -> tuple[Curve, ...]:
    return boundary(shapely.Point(x, y).buffer(radius))


@given(DISCS)
def test_what_is_light_erases_what_is_under_it(
    discs: list[tuple[float, float, float, str]],
) -> None:
    parts = tuple(PathPart(disc(x, y, r), Style(colour)) for x, y, r, colour in discs)
    area = shapely.box(-6, -6, 6, 6)
    styles = {"engrave": Style("#000000"), "score": Style(None, "#0000ff", 0.01)}
    found = burnt(Motif(parts), area, styles)["engrave"]
    assert {part.style.fill for part in found.parts} <= {"#000000"}
    region = shapely.union_all([region_of(part) for part in found.parts])
    rng = np.random.default_rng(0)
    for x, y in rng.uniform(-9, 9, (60, 2)):
        point, top = shapely.Point(x, y), "#ffffff"
        for a, b, radius, colour in discs:
            if abs(np.hypot(x - a, y - b) - radius) < 0.1:
                break  # too near to an edge to tell
            top = colour if np.hypot(x - a, y - b) < radius else top
        else:
            assert region.covers(point) == (area.covers(point) and int(top[1:3], 16) < 127.5)


def test_lines_are_scored_unless_something_lies_over_them() -> None:
    line = PathPart((Curve.polyline([[-9.0, 0.0], [9.0, 0.0]]),), Style(None, "#102030", 2.0))
    over = PathPart(disc(0, 0, 3), Style("#ffffff"))
    styles = {"engrave": Style("#000000"), "score": Style(None, "#0000ff", 0.01)}
    found = burnt(Motif((line, over)), shapely.box(-5, -5, 20, 5), styles)
    assert found["engrave"].parts == ()
    (part,) = found["score"].parts
    assert part.style == styles["score"]
    ends = sorted(x for curve in part.curves for x in (curve.start[0], curve.end[0]))
    np.testing.assert_allclose(ends, [-5, -3, 3, 9], atol=1e-9)


@pytest.mark.parametrize("fill", ["#000000", None])
def test_the_drawing_s_own_outline_is_not_drawn_beside_the_tile_s(fill: str | None) -> None:
    area = shapely.box(-20, -10, 20, 10)
    own = PathPart(
        boundary(area.buffer(-0.4)), Style("#000000" if fill is None else None, "#000000", 1.0)
    )
    mouth = PathPart((Curve.polyline([[-20.0, 0.0], [-12.0, 2.0]]),), Style(None, "#000000", 1.0))
    styles = {"engrave": Style(fill, "#000000"), "score": Style(None, "#0000ff", 0.01)}
    found = burnt(Motif((own, mouth)), area, styles, 0.7)
    assert found["engrave"].parts == ()
    (curve,) = found["score"].parts[0].curves
    low, high = curve.bounds()
    assert low == pytest.approx((-19.3, 0.175), abs=1e-6)
    assert high == pytest.approx((-12, 2), abs=1e-6)


def test_sheets_share_the_engraving_out() -> None:
    large: dict[str, Any] = {"cut": "skeleton", "clip": True, "eyes": ((*EYE, 60.0),)}
    chosen = ExportSettings(**{**PAGE, **large, "area": (120.0, 90.0)})
    beds: Any = (None, (70.0, 60.0))
    one, several = (scenes(squirrel("IH4"), chosen.replace(bed=bed))[0] for bed in beds)
    assert len(several) == 4

    def engraved(found: Any) -> float:
        parts = (part for scene in found for part in scene.layers[0].items)
        return sum(region_of(part).area for part in parts if isinstance(part, PathPart))

    assert engraved(one) == pytest.approx(engraved(several), rel=1e-6)
    for scene in several:
        low, high = np.array(scene.clip[:2]), np.array(scene.clip[2:])
        for curve in scene.curves(scene.layers[0]):
            assert (curve.bounds() > low - 1e-9).all()
            assert (curve.bounds() < high + 1e-9).all()
