"""Without outlines, no paper shows in the seams between tiles, and cutters get nothing more."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pypdfium2
import pytest
import resvg_py
from PIL import Image

from orbiflow.tiles import EscherTile
from orbiflow.tiles.make import ExportSettings, scenes
from orbiflow.tiles.write import write_scene

PALETTE = "202020,203040,402020,404040,paper=ffffff"  # nothing but paper is lighter than 40


def drawn(content: Any, form: str, dpi: int) -> np.ndarray:
    if form == "pdf":
        image = pypdfium2.PdfDocument(content)[0].render(scale=dpi // 72 + 1).to_pil()
    else:
        image = Image.open(io.BytesIO(bytes(resvg_py.svg_to_bytes(svg_string=content, dpi=dpi))))
    return np.asarray(image.convert("RGB")).max(axis=2)


@pytest.mark.parametrize("clip", [True, False])
@pytest.mark.parametrize("form", ["svg", "pdf"])
def test_no_pixel_among_tiles_shows_paper(bent_tile: Any, form: Any, clip: bool) -> None:
    settings = ExportSettings(
        format=form, outline=0.0, clip=clip, area=(60, 60), tile_size=12, palette=PALETTE
    )
    (scene,), _ = scenes(EscherTile(bent_tile("IH4")), settings)
    for dpi in (50, 96, 170):
        pixels = drawn(write_scene(scene, form), form, dpi)
        size = len(pixels)
        middle = pixels[size * 2 // 5 : size * 3 // 5, size * 2 // 5 : size * 3 // 5]
        assert middle.max() < 0x40 + 0.05 * (0xFF - 0x40)
        # and where no tile is, there is the paper alone
        assert (pixels.max() == 255) == (not clip)


@pytest.mark.parametrize("more", [{"purpose": "laser"}, {"cut": "pieces"}, {"cut": "jigsaw"}])
def test_cutters_get_no_ground(bent_tile: Any, more: dict[str, Any]) -> None:
    made, _ = scenes(EscherTile(bent_tile("IH4")), ExportSettings(outline=0.01, **more))
    assert {layer.role for scene in made for layer in scene.layers}.isdisjoint({"paper"})


@pytest.mark.parametrize("cut", [{}, {"clip": True}])
def test_a_drawing_of_lines_has_no_ground(bent_tile: Any, cut: dict[str, Any]) -> None:
    (scene,), _ = scenes(EscherTile(bent_tile("IH4")), ExportSettings(outline=0.0, **cut))
    text = str(write_scene(scene, "dxf"))
    assert "colour 1" in text
    assert "ground" not in text
