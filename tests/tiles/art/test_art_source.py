"""Runs read back with their maps, or with one from the outlines; copies that cannot be told apart."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import shapely

from artworks import EYE, art_settings, flat, squirrel, write_run
from orbiflow.drawing import PALETTES
from orbiflow.errors import InputFileError
from orbiflow.tiles import (
    FileContent,
    Over,
    Target,
    are_told_apart,
    artwork,
    page_picture,
    read_result,
    signed_area,
    with_map,
)
from orbiflow.tiles.search import matched
from outlines import FOLDER, animal, bent_squirrel
from refusals import refused


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
    assert artwork(tile, art_settings(area="60x40px", eyes=(EYE,))).motifs[0].parts


def test_without_a_map_or_silhouette_there_is_one_sentence(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", "IH6", model=False)
    document = json.loads((run / "result.json").read_text())
    document["input"]["source"] = "gone.dat"
    (run / "result.json").write_text(json.dumps(document))
    tile = with_map(run)
    assert artwork(tile, art_settings(area="60x40px", strokes="hatch")).motifs[0].parts
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


@pytest.mark.parametrize("name", ["IH1", "IH5", "IH21", "IH28"])
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
    assert made.pictures[0] is not None
    assert any("told apart" in note for note in made.notes) == is_said


def test_a_drawing_in_its_own_ink_is_shown_black() -> None:
    drawing = FileContent(
        b'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9">'
        b'<path d="M0 0h9v9H0z" fill="currentColor"/></svg>',
        "ink.svg",
    )
    shown = page_picture(drawing, Target.from_bytes(drawing.data, drawing.name).covered, (9, 9))
    assert shown.getpixel((4, 4)) == (0, 0, 0, 255)
