"""What is made for paper: margins that stay empty, pages to colour."""

from __future__ import annotations

import numpy as np
import pytest

from exported import Line, svg_lines, tile_of
from orbiflow.errors import OrbiflowError
from orbiflow.tiles import ExportSettings, Scene, scenes, write_scene


def drawn(name: str, **options) -> tuple[Scene, list[Line]]:
    chosen = ExportSettings(format="svg", **options)
    (scene,), _ = scenes(tile_of(name), chosen)
    text = write_scene(scene, chosen)
    assert isinstance(text, str)
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
    with pytest.raises(OrbiflowError, match="60 x 50 mm with a margin of 10 mm: it needs"):
        drawn("IH5", area=(60, 50), margin=10)


def test_a_page_to_colour_is_lines_within_a_border() -> None:
    scene, lines = drawn("IH4", purpose="colouring")
    assert (scene.width, scene.height) == (210, 297)
    styles = [layer.style for layer in scene.layers]
    assert all(style == (None, "#000000", 0.8) for style in styles)
    (border,) = [line for line in lines if line.layer == "border"]
    np.testing.assert_allclose(np.ptp(border.points, axis=0), (190, 277), atol=1e-3)
