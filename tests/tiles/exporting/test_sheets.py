"""Sheets for a bed: together they are the page, once; their crosses agree."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from exported import dxf_lines, tile_of
from orbiflow.tiles import ExportSettings, scenes, sheet_content
from orbiflow.tiles.make.sheets import ARM, OVERLAP
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
        assert isinstance(text, str)
        lines = [line._replace(points=line.points + place) for line in dxf_lines(text)[1]]
        found.append((place, (scene.width, scene.height), lines))
    return found


@settings(max_examples=5, deadline=None)
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
    [((300.0, 200.0), (30.0, 200.0), "30 mm"), ((3000.0, 3000.0), (100.0, 100.0), 400)],
)
def test_beds_that_are_too_small(area, bed, about) -> None:
    with refused(about):
        scenes(TILE, ExportSettings(area=area, bed=bed, tile_size=150.0))
