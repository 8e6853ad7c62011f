"""Pictures on tilings: every pixel covered, cells that repeat, runs read back with their maps."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from PIL import Image

from artworks import (
    EYE,
    art_settings,
    checkerboard,
    copies_of,
    flat,
    picture,
    pixels_of,
    size_of,
    squirrel,
    upside_down,
    write_run,
)
from orbiflow.drawing import PALETTES, palette
from orbiflow.errors import InputFileError
from orbiflow.symmetry import rotation_matrix
from orbiflow.tiles import (
    ArtSettings,
    EscherTile,
    FileContent,
    Made,
    Over,
    Page,
    Target,
    are_told_apart,
    artwork,
    page_picture,
    read_result,
    signed_area,
    with_map,
)
from orbiflow.tiles.make.repeats import rectangle, repeating_page
from orbiflow.tiles.page import Box
from orbiflow.tiles.search import matched
from outlines import FOLDER, animal, bent_squirrel
from refusals import refused

PAGE = art_settings(area="240x160px", tile_size="95px", outline=0.0, dpi=25.4)  # a pixel is 1 mm


def settings(**options) -> ArtSettings:
    return PAGE.replace(**options)


def owners(art: Made, points: np.ndarray) -> np.ndarray:
    """Which copy each point of the page lies in, by shapely."""
    tree = shapely.STRtree(np.asarray(shapely.polygons(copies_of(art)[2])))
    point, copy = tree.query(shapely.points(points), predicate="intersects")
    found = np.full(len(points), -1)
    found[point] = copy
    assert (found >= 0).all()
    return found


def matching(symbol: np.ndarray, tile: EscherTile) -> Callable[[np.ndarray], np.ndarray]:
    """What takes the points of a symbol to those of the tile that it is of."""
    known = np.column_stack([symbol, np.ones(len(symbol))])
    found = np.linalg.lstsq(known, tile.tile.polygon, rcond=None)[0]
    return lambda points: np.column_stack([points, np.ones(len(points))]) @ found


def rgb(colour: str) -> np.ndarray:
    return np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)])


@pytest.mark.parametrize("name", ["IH5", "IH21"])
def test_a_flat_picture_covers_the_plane(name: str) -> None:
    tile = squirrel(name)
    made = pixels_of(artwork(tile, PAGE, Over(flat(tile, "#c02040"))))
    assert made.shape == (160, 240, 3)
    assert (made == rgb("#c02040")).all()


@pytest.mark.parametrize("name", ["IH5", "IH21"])
def test_a_pixel_within_a_copy_has_its_colour(name: str) -> None:
    art = artwork(squirrel(name), PAGE)
    made = pixels_of(art)
    rows, columns = np.indices(made.shape[:2])
    points = np.stack([columns, rows], axis=-1).reshape(-1, 2) + 0.5
    rings, colours = copies_of(art)[2:]
    copy = owners(art, points)
    fills = np.array([rgb(palette("earth").fill(k)) for k in range(colours.max() + 1)])
    inner = shapely.distance(shapely.points(points), np.asarray(shapely.linearrings(rings))[copy])
    seen = made.reshape(-1, 3)
    assert (seen == fills[colours[copy]]).all(axis=1)[inner > 1.5].all()
    assert (seen == fills[colours[copy]]).all(axis=1).mean() > 0.8


@pytest.mark.parametrize("name", ["IH5", "IH21"])
def test_a_checkerboard_is_carried(name: str) -> None:
    tile = squirrel(name)
    board = checkerboard(tile, 6)
    art = artwork(tile, settings(area="480x320px", tile_size="200px"), Over(board))
    made = pixels_of(art)[..., 0] / 255.0
    rng = np.random.default_rng(1)
    row, column = rng.integers(0, 320, 4000), rng.integers(0, 480, 4000)
    points = np.stack([column, row], axis=1) + 0.5
    copy = owners(art, points)
    linear, offsets, rings, _ = copies_of(art)
    own = np.linalg.solve(linear[copy], (points - offsets[copy])[..., None])[..., 0]
    # from the symbol to the tile: both are the same polygon
    from_here = tile.inverse(matching(art.scenes[0].symbols["tile"].pieces[:, 0], tile)(own))
    share = (from_here - board.covered.low) / (board.covered.high - board.covered.low)
    x, y = share.T * np.array(board.image.size)[:, None] - 0.5
    longer = max(board.image.size)
    parity = ((np.rint(y).astype(int) * 6 // longer) + (np.rint(x).astype(int) * 6 // longer)) % 2
    # a pixel of the page is a few of the picture's: away from the squares' sides and the tile's
    into = np.stack([x, y]) * 6 / longer % 1
    clear = (abs(into - 0.5) < 0.3).all(axis=0)
    rings = np.asarray(shapely.linearrings(rings))[copy]
    clear &= shapely.distance(shapely.points(points), rings) > 3
    assert clear.sum() > 500
    np.testing.assert_allclose(made[row, column][clear], parity[clear], atol=0.02)


def test_the_fringe_of_a_cut_out_does_not_show() -> None:
    tile = squirrel("IH4")
    width, height = size_of(tile)
    shape = shapely.affinity.affine_transform(
        shapely.Polygon(tile.silhouette_outline), [1, 0, 0, 1, *-tile.covered.low]
    )
    scale = width / np.ptp(tile.covered[:2], axis=0)[0]
    rows, columns = np.indices((height, width)) + 0.5
    inside = shapely.contains_xy(shape, columns / scale, rows / scale)
    alpha = Image.fromarray((inside * 255).astype(np.uint8))
    green = Image.new("RGB", (width, height), "#108030")
    cut = Image.new("RGB", (width, height), "white")
    cut.paste(green, mask=alpha)
    # as a picture on white, and as one that is transparent around
    see_through = green.copy()
    see_through.putalpha(alpha)
    for image in (cut, see_through):
        made = pixels_of(artwork(tile, PAGE, Over(picture(image, tile))))
        np.testing.assert_allclose(made - rgb("#108030") + 0.0, 0, atol=1)


def test_a_transparent_picture_shows_the_palette() -> None:
    tile = squirrel("IH4")
    clear = picture(Image.new("RGBA", size_of(tile), (0, 0, 0, 0)), tile)
    plain = pixels_of(artwork(tile, PAGE))
    np.testing.assert_array_equal(pixels_of(artwork(tile, PAGE, Over(clear))), plain)


def test_outlines_part_tiles_of_one_colour() -> None:
    art = artwork(squirrel("IH1"), settings(colour="one", outline="3px", area="480x320px"))
    made = pixels_of(art).astype(int)
    edge = rgb(palette(art.settings.palette).outline)
    rings = copies_of(art)[2]
    middles = (rings + np.roll(rings, -1, axis=1)).reshape(-1, 2) / 2
    shown = middles[((middles > 2) & (middles < (478, 318))).all(axis=1)]
    columns, rows = shown.astype(int).T
    assert np.abs(made[rows, columns] - edge).max() < 80


@pytest.mark.parametrize("name", ["IH4", "IH6"])
def test_a_silhouette_with_y_up_is_drawn_the_same_way_up(name: str) -> None:
    tile = squirrel(name)
    turned = upside_down(tile)
    image = checkerboard(tile).image
    image.paste(Image.new("RGBA", (200, 90), "red"), (30, 20))
    options = {"outline": 2.0, "tile_size": 190.0}
    made = [
        pixels_of(artwork(own, settings(**options), Over(picture(image, own))))
        for own in (tile, turned)
    ]
    apart = np.abs(made[0].astype(int) - made[1])
    assert apart.mean() < 3  # their rasters lie a fraction of a texel apart
    assert (apart > 80).mean() < 0.002
    eyes = [
        artwork(own, settings(eyes=((EYE[0], y),))).scenes[0].motifs["motif"].parts
        for own, y in ((tile, EYE[1]), (turned, -EYE[1]))
    ]
    for first, second in zip(*eyes, strict=True):
        middles = [own.curves[0].pieces[:, 0].mean(axis=0) for own in (first, second)]
        np.testing.assert_allclose(*middles, atol=1e-6)


def test_tint_is_glass_of_each_tiles_colour_in_pixels_and_curves() -> None:
    tile, grey = squirrel("IH4"), (200, 200, 200)
    over = Over(flat(tile, "#c8c8c8"))
    given = art_settings(area="120x90px", tint=0.5, outline=0.0, palette="#ff0000,#00ff00,#0000ff")
    made = artwork(tile, given, over)
    shown = {tuple(own) for own in pixels_of(made).reshape(-1, 3).tolist()}
    glass = [tuple(200 if k == own else 100 for k in range(3)) for own in range(3)]
    assert {*glass} <= shown
    assert grey not in shown
    motifs = made.scenes[0].motifs
    images = [own.rasters[0].pixels for own in motifs.values()]
    assert {tuple(image[20, 20, :3].tolist()) for image in images} == {*glass}
    plain = artwork(tile, given.replace(tint=0.0), over)
    assert grey in {tuple(own) for own in pixels_of(plain).reshape(-1, 3).tolist()}


def twice_as_large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have artwork made of a page that is twice as wide and high, with the same tiling."""

    def double(*given) -> tuple[Page, str]:
        page, told = repeating_page(*given)
        width, height = page.size
        box = Box(0.0, 0.0, 2 * width, 2 * height)
        return replace(page, size=(2 * width, 2 * height), box=box), told

    monkeypatch.setattr("orbiflow.tiles.make.art.repeating_page", double)


def require_alike(first: np.ndarray, second: np.ndarray) -> None:
    """Check that pictures differ nowhere but by the rounding of a pixel's share."""
    differ = np.abs(first.astype(int) - second).max(axis=2)
    assert (differ > 1).mean() < 0.002, f"{(differ > 1).mean():.4f} of all pixels differ"
    assert differ.mean() < 0.1


@pytest.mark.parametrize("how", ["aspect", "neighbour", "one"])
@pytest.mark.parametrize("name", ["IH5", "IH28"])
def test_two_by_two_is_the_same_plane(name: str, how, monkeypatch) -> None:
    tile = squirrel(name)
    settings = art_settings(repeat="basic", tile_size="60px", colour=how, stretch=0.05)
    over = None if how == "one" else Over(checkerboard(tile))
    cell = pixels_of(artwork(tile, settings, over))
    twice_as_large(monkeypatch)
    require_alike(np.tile(cell, (2, 2, 1)), pixels_of(artwork(tile, settings, over)))


@pytest.mark.parametrize("name", ["IH1", "IH5"])
@pytest.mark.parametrize("repeat", ["brick", "half-drop"])
def test_rows_or_columns_moved_by_half_are_the_same_plane(repeat, name: str, monkeypatch) -> None:
    tile = squirrel(name)
    settings = art_settings(repeat=repeat, tile_size="60px", stretch=0.05)
    over = Over(checkerboard(tile))
    cell = pixels_of(artwork(tile, settings, over))
    height, width = cell.shape[:2]
    if repeat == "brick":
        moved = np.roll(cell, width // 2, axis=1)
        pasted = np.vstack([np.hstack([cell, cell]), np.hstack([moved, moved])])
    else:
        moved = np.roll(cell, height // 2, axis=0)
        pasted = np.hstack([np.vstack([cell, cell]), np.vstack([moved, moved])])
    twice_as_large(monkeypatch)
    require_alike(pasted, pixels_of(artwork(tile, settings, over)))


@pytest.mark.parametrize("repeat", ["brick", "half-drop"])
@pytest.mark.parametrize("turn", [0.0, 0.3, -1.2])
def test_half_the_cell_where_the_lattice_has_it(turn: float, repeat) -> None:
    basis = rotation_matrix(turn) @ np.array([[1.0, 0.5], [0.0, 0.9]])
    basic = rectangle(basis, 100.0, 0.0, flipped=False)
    found = rectangle(basis, 100.0, 0.0, flipped=False, repeat=repeat)
    assert (basic.cells, found.cells) == (2, 1)
    assert found.exact
    # what repeats are vectors of the lattice: a side, and the other with half of it
    width, height = found.width, found.height
    assert (width if repeat == "brick" else height) % 2 == 0
    brick, drop = [[width, 0], [width / 2, height]], [[0, height], [width, height / 2]]
    ways = np.array(brick if repeat == "brick" else drop, dtype=float)
    steps = np.linalg.solve(basis, np.linalg.solve(found.linear, ways.T))
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)
    assert abs(round(np.linalg.det(steps))) == 1


@pytest.mark.parametrize("turn", [0.0, 0.3, -1.2])
@pytest.mark.parametrize(
    ("lattice", "cells"),
    [
        ([[1.0, 0.0], [0.0, 0.7]], 1),
        ([[1.0, 0.5], [0.0, 0.75**0.5]], 2),
        ([[2.0, 1.0], [0, 0.4]], 2),
    ],
)
def test_known_lattices(lattice, cells: int, turn: float) -> None:
    basis = rotation_matrix(turn) @ np.array(lattice)
    found = rectangle(basis, 200.0, 0.0, flipped=False)
    assert found.cells == cells
    assert abs(found.turn) <= 45
    corners = np.linalg.inv(found.linear) @ np.diag([found.width, found.height])
    steps = np.linalg.solve(basis, corners)
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)
    assert abs(round(np.linalg.det(steps))) == cells


def test_oblique_lattices_need_a_tolerance() -> None:
    lattice = np.array([[1.0, 0.331], [0.0, 1.0]])
    with refused("tolerance"):
        rectangle(lattice, 100.0, 0.0, flipped=False)
    found = rectangle(lattice, 100.0, 0.02, flipped=True)
    assert found.strain < 0.021
    assert not found.exact
    assert np.linalg.det(found.linear) < 0


def test_the_map_of_a_run(tmp_path: Path) -> None:
    tile = with_map(read_result(write_run(tmp_path / "run", "IH6"), "IH6"))
    assert tile.name == "squirrel-IH6"
    assert tile.notes == ()
    there = squirrel("IH6").forward(np.array(EYE))
    np.testing.assert_allclose(tile.forward(np.array(EYE)), there, atol=1e-9)
    # the outline is the silhouette's, as fine as it was bent
    outline = animal("squirrel.dat").outline
    np.testing.assert_allclose(tile.silhouette_outline.min(axis=0), outline.min(axis=0), atol=4)
    np.testing.assert_allclose(tile.covered.high, outline.max(axis=0), atol=4)


def test_without_a_map_outlines_are_matched(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", "IH6", model=False)
    tile = with_map(run)
    assert "its outline was matched" in tile.notes[0]
    moved = tile.forward(np.array(EYE))
    known = squirrel("IH6").forward(np.array(EYE))
    # the bent head and the matched one are near each other
    assert np.hypot(*(moved - known)) < 0.15 * np.sqrt(abs(tile.tile.signed_area))
    assert artwork(tile, art_settings(area="60x40px", eyes=(EYE,))).scenes[0].motifs["motif"].parts


def test_without_a_map_or_silhouette_there_is_one_sentence(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", "IH6", model=False)
    document = json.loads((run / "result.json").read_text())
    document["input"]["source"] = "gone.dat"
    (run / "result.json").write_text(json.dumps(document))
    tile = with_map(run)
    assert artwork(tile, art_settings(area="60x40px", strokes="hatch")).scenes[0].motifs
    with refused("gone.dat"):
        artwork(tile, art_settings(area="60x40px", eyes=(EYE,)))
    document["input"]["source"] = str(FOLDER / "nagata" / "bat_60.dat")
    (run / "result.json").write_text(json.dumps(document))
    with refused("bat_60.dat"):
        with_map(run).require_map()


def test_a_model_of_another_tile_is_refused(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", "IH6")
    other = write_run(tmp_path / "other", "IH4")
    shutil.copy(other / "IH4" / "model.safetensors", run / "IH6" / "model.safetensors")
    with refused("model.safetensors", kind=InputFileError):
        with_map(run)


@pytest.mark.parametrize("name", ["IH1", "IH5", "IH7", "IH28"])
def test_matched_maps_have_no_fold_and_keep_the_outlines(name: str) -> None:
    target, polygon = animal("squirrel.dat"), bent_squirrel(name).tile.polygon
    bending = matched(target.normal, polygon)
    for points in (bending.rest, bending.images):
        corners = points[bending.triangles]
        areas = signed_area(corners)
        assert (areas > 0).all()
    whole = signed_area(bending.rest[bending.triangles]).sum()
    assert whole == pytest.approx(1, abs=1e-12)
    ring = np.asarray(target.normal)
    dense = np.concatenate([ring + t * (np.roll(ring, -1, axis=0) - ring) for t in (0, 0.3, 0.8)])
    for there, end in ((bending.forward(dense), polygon), (bending.inverse(polygon), ring)):
        assert shapely.distance(shapely.points(there), shapely.LinearRing(end)).max() < 1e-9
    np.testing.assert_allclose(
        bending.inverse(bending.forward(target.normal)), target.normal, atol=0.06
    )


@pytest.mark.parametrize("share", [0.0, 0.05, 0.5, 1.0])
@pytest.mark.parametrize("name", sorted({*PALETTES} - {"pastel"}))  # its lines are not dark
def test_light_ink_is_told_apart_from_dark_lines(share: float, name: str) -> None:
    colours, inside = np.full((40, 40, 3), 0.08), np.ones((40, 40), dtype=bool)
    colours[:, : round(40 * share)] = 0.8
    outline = PALETTES[name].outline
    # an eye on a black icon is not enough; lines that are light themselves are
    assert are_told_apart(colours, inside, outline) == (share > 0.25)
    assert are_told_apart(colours, inside, "#ffffff") == (share < 0.75)


@pytest.mark.parametrize(
    ("colour", "palette", "is_said"),
    [("#101010", "delft", True), ("#c0a040", "delft", False), ("#101010", "delft-light", False)],
)
def test_a_dark_picture_that_is_asked_for_is_laid_and_said(
    colour: str, palette: str, is_said: bool
) -> None:
    tile = squirrel("IH4")
    chosen = palette if palette in PALETTES else "1d4e79,f4ecdc,outline=ffffff"
    made = artwork(tile, art_settings(palette=chosen), Over(flat(tile, colour)))
    assert made.scenes[0].motifs["motif"].rasters
    assert any("told apart" in note for note in made.notes) == is_said


def test_a_drawing_in_its_own_ink_is_shown_black() -> None:
    drawing = FileContent(
        b'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9">'
        b'<path d="M0 0h9v9H0z" fill="currentColor"/></svg>',
        "ink.svg",
    )
    shown = page_picture(drawing, Target.from_bytes(drawing.data, drawing.name).covered, (9, 9))
    assert shown.getpixel((4, 4)) == (0, 0, 0, 255)
