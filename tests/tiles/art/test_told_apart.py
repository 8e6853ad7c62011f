"""Copies that carry a picture as dark as their outlines cannot be told apart: it is said."""

from __future__ import annotations

import numpy as np
import pytest

from artworks import art_settings, flat, squirrel
from orbiflow.drawing import PALETTES
from orbiflow.tiles import FileContent, Over, Target, are_told_apart, artwork, page_picture


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
