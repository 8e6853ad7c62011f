"""Sheets for a bed, paper and margins: a tile lies in the same place in all of them."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pypdfium2
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from artworks import art_settings, pixels_of, squirrel, upside_down
from exported import Line, dxf_lines, polygons, scenes, sheet_content, svg_lines, tile_of
from orbiflow.drawing import palette, rgb
from orbiflow.errors import SettingError
from orbiflow.settings import PAGES
from orbiflow.tiles import (
    ArtSettings,
    EscherTile,
    ExportSettings,
    Made,
    Scene,
    Uses,
    artwork,
    as_tile,
    exported,
)
from orbiflow.tiles.make.layout import layout
from orbiflow.tiles.make.paper import LEAST_OVERLAP, paper_grid
from orbiflow.tiles.make.sheets import ARM, OVERLAP
from orbiflow.tiles.make.templates import numbered_edges
from orbiflow.tiles.page import mark_corners
from refusals import refused

TILE = tile_of("IH7")


def sheets_of(area, bed, **options):
    """For each sheet its place on the page, its size, and its lines where they are on the page."""
    chosen = ExportSettings(area=area, bed=bed, cut="skeleton", format="dxf", **options)
    made, _ = scenes(TILE, chosen)
    across = 1 + max(round((area[0] - s.width) / max(s.width - OVERLAP, 1)) for s in made[:1])
    found = []
    for k, scene in enumerate(made):
        row, column = divmod(k, across)
        place = np.array([column * (scene.width - OVERLAP), row * (scene.height - OVERLAP)])
        text = sheet_content(scene, chosen)
        lines = [line._replace(points=line.points + place) for line in dxf_lines(text)[1]]
        found.append((place, (scene.width, scene.height), lines))
    return found


@settings(max_examples=3, deadline=None)
@given(st.floats(120, 320), st.floats(90, 300), st.floats(90, 200), st.floats(80, 200))
def test_together_they_are_the_page(width, height, bed_width, bed_height) -> None:
    parts = sheets_of((width, height), (bed_width, bed_height), clip=True)
    ((_, _, whole),) = sheets_of((width, height), None, clip=True)
    total = sum(shapely.LineString(line.points).length for line in whole)
    cut = [line for _, _, lines in parts for line in lines if line.layer == "cut"]
    assert sum(shapely.LineString(x.points).length for x in cut) == pytest.approx(total, rel=1e-3)
    for place, size, lines in parts:
        assert size[0] <= bed_width + 1e-9
        assert size[1] <= bed_height + 1e-9
        points = np.concatenate([line.points for line in lines]) - place
        assert (points >= -1e-9).all()
        assert (points <= np.array(size) + 1e-9).all()
    last = parts[-1]
    assert np.allclose(last[0] + last[1], (width, height))


def test_neighbours_have_the_same_crosses() -> None:
    parts = sheets_of((400.0, 300.0), (200.0, 160.0), clip=True)
    assert len(parts) == 6
    centers = []
    for place, size, lines in parts:
        marks = [line.points for line in lines if line.layer == "registration"]
        own = {tuple(np.round(mark.mean(axis=0), 6)) for mark in marks}
        assert len(marks) == 2 * len(own)
        assert all(np.linalg.norm(mark[1] - mark[0]) == pytest.approx(2 * ARM) for mark in marks)
        centers.append((place, size, own))
    for i, (place, size, own) in enumerate(centers):
        for other_place, other_size, others in centers[i + 1 :]:
            low = np.maximum(place, other_place)
            high = np.minimum(np.add(place, size), np.add(other_place, other_size))
            if ((high - low) > OVERLAP + 1).any() and (high > low).all():  # side by side
                assert len(own & others) >= 2


def test_a_tiling_in_colours_on_sheets() -> None:
    chosen = ExportSettings(area=(400.0, 200.0), bed=(220.0, 200.0), clip=True)
    made, _ = scenes(TILE, chosen)
    assert len(made) == 2
    texts = [str(sheet_content(scene, chosen)) for scene in made]
    assert all('clip-path="url(#window)"' in text and "<use" in text for text in texts)
    assert "Sheet 2 of 2" in texts[1]
    assert all(tile.neighbours for scene in made for tile in scene.tiles)


def test_what_the_bed_holds_is_one_sheet() -> None:
    (made,), _ = scenes(TILE, ExportSettings(bed=(300.0, 200.0)))
    assert not any(layer.name == "registration" for layer in made.layers)


@pytest.mark.parametrize(
    ("area", "bed", "about"),
    [((300.0, 200.0), (29.0, 200.0), "29 mm"), ((3000.0, 3000.0), (100.0, 100.0), 400)],
)
def test_beds_that_are_too_small(area, bed, about) -> None:
    with refused(about):
        scenes(TILE, ExportSettings(area=area, bed=bed, tile_size=150.0))


PAGE: dict[str, Any] = {"area": "211.7x148mm", "tile_size": "37mm"}


def painted_rings(art: Made) -> np.ndarray:
    """The tiles (M, N, 2) of artwork in mm."""
    scene = art.scenes[0]
    fills = [item for layer in scene.layers for item in layer.items if layer.style.fill]
    return np.concatenate(
        [
            uses.images(scene.symbols["tile"].pieces[:, 0])
            for uses in fills
            if isinstance(uses, Uses)
        ]
    )


def cut_rings(tile: Any, **settings: Any) -> np.ndarray:
    """The tiles (M, N, 2) of an export in mm."""
    (scene,), _ = scenes(tile, ExportSettings(**settings))
    assert scene.prototiles
    return np.stack([scene.prototiles[0] @ one.linear.T + one.offset for one in scene.tiles])


def apart(some: np.ndarray, others: np.ndarray) -> float:
    """How far each of some tiles is from the nearest other, at most, in mm."""
    gaps = np.abs(some[:, None] - others[None]).max(axis=(2, 3))
    return float(gaps.min(axis=1).max())


@settings(max_examples=3)
@given(
    st.sampled_from(["IH4", "IH5", "IH21"]),
    *(st.booleans(), st.booleans(), st.floats(-360, 360)),
    st.sampled_from(["skeleton", "none"]),
    st.sampled_from(["laser", "print", None]),
)
def test_art_and_export_put_tiles_in_the_same_places(
    name: str, turned: bool, clip: bool, rotate: float, cut: str, purpose: str | None
) -> None:
    tile = upside_down(squirrel(name)) if turned else squirrel(name)
    same: dict[str, Any] = {"rotate": rotate, "clip": clip}
    painted = painted_rings(artwork(tile, ArtSettings(**PAGE, **same)))
    found = cut_rings(tile, **PAGE, **same, cut=cut, purpose=purpose)
    assert apart(found, painted) < 1e-6
    page = shapely.box(0, 0, 211.7, 148)
    shown = [page.intersects(one) for one in np.asarray(shapely.polygons(painted))]
    assert apart(painted[shown], found) < 1e-6


def test_whole_tiles_alone_are_painted() -> None:
    art = artwork(squirrel("IH6"), ArtSettings(**PAGE, clip=False, dpi=60))
    rings = painted_rings(art)
    assert rings.min() > 0
    assert (rings < (211.7, 148)).all()
    assert art.tiles == len(rings)
    # on the paper of the palette, nothing but these tiles
    pixels = np.asarray(pixels_of(art))[2::8, 2::8]
    rows, columns = np.indices(pixels.shape[:2]) * 8 + 2.5
    region = shapely.union_all(np.asarray(shapely.polygons(rings))).buffer(0.7)
    inside = shapely.contains_xy(region, columns * 25.4 / 60, rows * 25.4 / 60)
    on_paper = (pixels == rgb(palette("earth").paper)).all(axis=2)
    assert on_paper[~inside].all()
    assert not on_paper[inside].all()
    with refused("2500 x 1748 pixels"):
        artwork(squirrel("IH6"), ArtSettings(**{**PAGE, "tile_size": "25cm", "clip": False}))


def test_the_cell_that_repeats_is_neither_turned_nor_whole() -> None:
    settings: list[dict[str, Any]] = [{"rotate": 10.0}, {"clip": False}]
    for setting in settings:
        with refused("repeat"):
            art_settings(repeat="basic", **setting)


def drawn(tile: str | EscherTile, **options) -> tuple[Scene, list[Line]]:
    chosen = ExportSettings(format="svg", **options)
    (scene,), _ = scenes(tile_of(tile) if isinstance(tile, str) else tile, chosen)
    text = sheet_content(scene, chosen)
    return scene, svg_lines(text)


@pytest.mark.parametrize(
    "options",
    [
        {"cut": "none"},
        {"cut": "skeleton", "clip": True, "border": True},
        {"cut": "skeleton", "calibrate": True},
        {"cut": "pieces"},
    ],
    ids=str,
)
def test_the_margin_stays_empty(options) -> None:
    scene, lines = drawn("IH5", area=(130, 110), margin=13, tile_size=30, **options)
    foot = 8 if "calibrate" in options else 0  # the mark's own strip
    inner = [line.points for line in lines if not line.layer.startswith("calibration")]
    points = np.concatenate(inner)
    assert (points >= 13 - 1e-3).all()
    assert (points <= np.array([117, 97 - foot]) + 1e-3).all()
    assert len(scene.tiles) >= 4


def test_tiles_that_only_the_margin_keeps_from_fitting() -> None:
    with refused("60 x 50 mm", "10 mm"):
        drawn("IH5", area=(60, 50), margin=10)


def test_a_page_to_colour_is_lines_within_a_border() -> None:
    scene, lines = drawn("IH4", purpose="colouring")
    assert (scene.width, scene.height) == (210, 297)
    styles = [layer.style for layer in scene.layers]
    assert all(style == (None, "#000000", 0.8) for style in styles)
    (border,) = [line for line in lines if line.layer == "border"]
    np.testing.assert_allclose(np.ptp(border.points, axis=0), (190, 277), atol=1e-3)


@pytest.mark.parametrize("name", ["IH1", "IH5"])
def test_a_template_says_which_edges_fit_together(name: str) -> None:
    scene, lines = drawn(squirrel(name), purpose="template", tolerance=0.3)
    layers = {layer.name: layer for layer in scene.layers}
    assert list(layers) == ["silhouette", "outline", "numbers"]
    (outline,) = polygons([line for line in lines if line.layer == "outline"])
    # as large as the page allows, and everything on it
    low, high = np.reshape(outline.bounds, (2, 2))
    assert min(abs(np.array([172, 259]) - (high - low))) < 0.2
    points = np.concatenate([line.points for line in lines if line.layer != "silhouette"])
    assert (points > 10).all()
    assert (points < (200, 287)).all()
    # an arrow's tip on the outline for each edge or half of one, in pairs
    marks = [line.points for line in lines if line.layer == "numbers"]
    tips = [mark[1] for mark in marks if is_arrow(mark)]
    assert len(tips) % 2 == 0
    assert len(tips) >= 6
    apart = shapely.distance(shapely.points(tips), outline.exterior)
    assert apart.max() < 0.15


def is_arrow(points: np.ndarray) -> bool:
    """Whether a line is two sides of the same length; the 1 has unequal ones."""
    sides = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return len(sides) == 2 and abs(sides[0] - sides[1]) < 0.01


def test_partners_are_images_of_each_other() -> None:
    """What carries an edge onto its partner carries its arrow, and the number stands at both."""
    placed = layout(as_tile(tile_of("IH5")), ExportSettings(purpose="template"))
    edges = list(numbered_edges(placed))
    assert [number for number, _ in edges[::2]] == [number for number, _ in edges[1::2]]
    for (_, first), (_, second) in zip(edges[::2], edges[1::2], strict=True):
        # the isometry nearest to the one that takes first onto second, start to start
        moved, there = (evenly(points) - evenly(points).mean(axis=0) for points in (first, second))
        left, _, right = np.linalg.svd(moved.T @ there)
        assert np.abs(moved @ left @ right - there).max() < 0.2
        turned = moved[::-1] @ left @ right
        assert np.abs(turned - there).max() > 5  # and not the other way round


def evenly(points: np.ndarray) -> np.ndarray:
    line, shares = shapely.LineString(points), np.linspace(0, 1, 33)
    return shapely.get_coordinates(shapely.line_interpolate_point(line, shares, normalized=True))


@pytest.mark.parametrize("offset", [2.0, -1.0])
def test_a_sheet_of_stickers(offset: float) -> None:
    options = {"tile_size": 50.0, "spacing": 1.0, "offset": offset}
    scene, lines = drawn("IH5", purpose="stickers", **options)
    cuts = polygons([line for line in lines if line.layer == "cut"])
    coloured = polygons([line for line in lines if line.layer.startswith("colour")])
    assert len(cuts) == len(coloured) == len(scene.tiles) > 5
    tree = shapely.STRtree(cuts)
    for tile in coloured:
        (cut,) = [cuts[k] for k in tree.query(tile.representative_point(), "within")]
        outer, inner = (cut, tile) if offset > 0 else (tile, cut)
        assert outer.buffer(0.1).contains(inner)
        assert inner.exterior.hausdorff_distance(outer.exterior) > abs(offset) - 0.2
    # colours do not run into other stickers, and nothing lies on the marks
    both = [*cuts, *coloured]
    own = shapely.STRtree(coloured)
    first, second = own.query(coloured, "dwithin", 0.5)
    assert (first == second).all()
    for box in mark_corners((210, 297)):
        assert not shapely.intersects(shapely.box(*box), cuts).any()
    assert (np.reshape([shape.bounds for shape in both], (-1, 2)) > 8).all()
    marks = [line for line in lines if line.layer.startswith("registration")]
    assert len(marks) == 3
    with refused("marks", "margin", "0 mm", kind=SettingError):
        ExportSettings(cut="pieces", marks=True)


def test_a_poster_is_pages_of_paper_that_make_it_up(tmp_path: Path) -> None:
    """Read by pdfium: six sheets of A4 make A2, and nothing lies where printers leave paper empty."""
    chosen = ExportSettings(purpose="print", area=PAGES["a2"], tile_size=60.0)
    whole = pypdfium2.PdfDocument(exported(TILE, chosen).content(format="pdf"))
    made = exported(TILE, chosen.replace(bed="A4")).written(tmp_path / "poster.pdf")
    (file,) = made.files
    pages = pypdfium2.PdfDocument(file)
    assert len(pages) == 6
    assert not pypdfium2.raw.FPDF_VIEWERREF_GetPrintScaling(pages.raw)
    dots = 4  # in a millimetre
    picture, *sheets = (
        np.asarray(
            page.render(scale=0.999999 * dots * 25.4 / 72).to_pil().convert("L"), dtype=float
        )
        for page in (whole[0], *pages)
    )
    glued = np.full_like(picture, np.nan)
    for number, sheet in enumerate(sheets):
        assert sheet.shape == (210 * dots, 297 * dots)
        edges = [sheet[:19], sheet[-19:], sheet[:, :19], sheet[:, -19:]]
        assert all((edge > 250).all() for edge in edges)
        top, left = 197 * (number // 2) * dots, 205 * (number % 2) * dots
        part = sheet[20:, 20:][: 200 * dots, : 215 * dots]
        glued[top : top + len(part), left : left + part.shape[1]] = part
    # crosses apart, which lie at the seams alone
    assert (np.abs(glued - picture) > 40).mean() < 1e-3


@settings(max_examples=30)
@given(st.floats(220, 2000), st.floats(300, 2000), st.sampled_from(["a4", "letter", "a3"]))
def test_paper_holds_the_whole_page(width: float, height: float, paper: str) -> None:
    grid = paper_grid((width, height), PAGES[paper], None)
    for parts, length, side in zip(
        (grid.columns, grid.rows), (width, height), grid.paper, strict=True
    ):
        assert parts[0][0] == 0
        assert parts[-1][1] == pytest.approx(length)
        shared = [end - start for (_, end), (start, _) in pairwise(parts)]
        assert all(LEAST_OVERLAP - 1e-9 <= strip <= OVERLAP + 1e-9 for strip in shared)
        assert max(end - start for start, end in parts) <= side - 10 + 1e-9
    asked = paper_grid((width, height), PAGES[paper], 20.0)
    assert asked.sheets >= grid.sheets
