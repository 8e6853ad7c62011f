"""Tabs: gaps in the lines to cut, where pieces stay in their sheet."""

import numpy as np
import pytest
import shapely

from exported import dxf_lines, scenes, sheet_content, svg_lines, tile_of
from orbiflow.tiles import ExportSettings
from refusals import refused

AREA = (150.0, 110.0)


@pytest.mark.parametrize("form", ["svg", "dxf"])
def test_a_piece_is_held_by_as_many_tabs_as_were_asked_for(form: str) -> None:
    tile = tile_of("IH4")
    cut = {"cut": "pieces", "area": AREA, "format": form, "kerf": 0.2}
    lengths = []
    for tabs in ({}, {"tabs": 3, "tab_width": 0.8}):
        settings = ExportSettings(**cut, **tabs)
        (scene,), _ = scenes(tile, settings)
        text = str(sheet_content(scene, settings))
        lines = dxf_lines(text)[1] if form == "dxf" else svg_lines(text)
        rings = [np.concatenate([own.points, own.points[:1]][: 1 + own.closed]) for own in lines]
        lengths.append(sum(shapely.length(shapely.LineString(ring)) for ring in rings))
    assert len(lines) == 3 * len(scene.tiles)
    # each tab is as wide as it was asked for, and the kerf
    assert lengths[0] - lengths[1] == pytest.approx(len(lines) * (0.8 + 0.2), rel=0.02)


@pytest.mark.parametrize("name", ["IH1", "IH4", "IH7", "IH28"])
def test_each_tile_of_a_sheet_is_held_though_edges_are_shared(name: str) -> None:
    settings = ExportSettings(cut="skeleton", area=AREA, tabs=3, tab_width=1.0)
    (scene,), _ = scenes(tile_of(name), settings)
    lines = [own.points for own in svg_lines(str(sheet_content(scene, settings)))]
    cut = shapely.union_all([shapely.LineString(points) for points in lines]).buffer(0.06)
    (ring,) = scene.prototiles
    for tile in scene.tiles:
        outline = shapely.LinearRing(ring @ tile.linear.T + tile.offset)
        gaps = shapely.get_parts(shapely.line_merge(outline - cut))
        assert len([gap for gap in gaps if gap.length > 0.5]) >= 3


def test_more_than_an_outline_holds_is_refused() -> None:
    settings = ExportSettings(cut="pieces", area=AREA, tabs=100, tab_width=2.0)
    with refused("tabs", "tab_width"):
        scenes(tile_of("IH4"), settings)
