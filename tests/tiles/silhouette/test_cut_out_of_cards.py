"""A card with a hole in the shape of an animal: it is said, and `invert` takes the hole."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from PIL import Image, ImageDraw

from orbiflow.errors import InputFileError
from orbiflow.tiles import Target, iou
from orbiflow.tiles.silhouette import ReadingSettings, doubts, holes_filled, parts_left_out
from refusals import refused

TURNS = np.linspace(0, 2 * np.pi, 200, endpoint=False)
RADIUS = 35 + 12 * np.cos(3 * TURNS) + 4 * np.sin(7 * TURNS)
ANIMAL = np.stack([105 + RADIUS * np.cos(TURNS), 95 + RADIUS * np.sin(TURNS)], axis=1)
ROUND = np.stack([105 + 85 * np.cos(TURNS), 95 + 85 * np.sin(TURNS)], axis=1)
SQUARE = np.array([[20.0, 10.0], [190.0, 10.0], [190.0, 180.0], [20.0, 180.0]])
PAGE = np.array([[0.0, 0.0], [210.0, 0.0], [210.0, 190.0], [0.0, 190.0]])
SPECK = 0.02 * (ANIMAL - ANIMAL.mean(axis=0)) + (200, 180)  # .04 % of the animal's area
FINER = 3
"""Pixels of a picture for a unit."""


def drawn(path: Path, form: str, *rings: np.ndarray) -> Path:
    """Fill rings by the even-odd rule."""
    if form == "svg":
        data = "".join(f"M{' '.join(f'{x:.3f},{y:.3f}' for x, y in ring)}Z" for ring in rings)
        path.write_text(
            '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 210 190">'
            f'<path fill-rule="evenodd" d="{data}"/></svg>'
        )
        return path
    dark = np.zeros((190 * FINER, 210 * FINER), dtype=bool)
    for ring in rings:
        one = Image.new("1", (210 * FINER, 190 * FINER))
        ImageDraw.Draw(one).polygon((FINER * ring).ravel().tolist(), fill=1)
        dark ^= np.asarray(one)
    Image.fromarray(~dark).convert("L").save(path)
    return path


def units(target: Target) -> np.ndarray:
    return target.outline / (FINER if target.kind == "image" else 1)


@pytest.mark.parametrize(("form", "card"), [("svg", SQUARE), ("png", SQUARE), ("svg", ROUND)])
def test_a_card_is_doubted_and_invert_takes_its_hole(tmp_path: Path, form: str, card: Any) -> None:
    file = drawn(tmp_path / f"a.{form}", form, card, ANIMAL)
    whole = ReadingSettings().read(file)
    assert iou(units(whole), card) > 0.98
    assert any("invert" in doubt for doubt in doubts(whole))
    hole = ReadingSettings(invert=True).read(file)
    assert iou(units(hole), ANIMAL) > 0.97
    assert doubts(hole) == []
    assert iou(units(ReadingSettings(invert=False).read(file)), card) > 0.98


@pytest.mark.parametrize("form", ["svg", "png"])
@pytest.mark.parametrize(
    "rings",
    [
        (ANIMAL,),
        (ANIMAL, 0.2 * (ROUND - (105, 95)) + (95, 95)),  # an eye
        (ROUND, 0.6 * (ROUND - (105, 95)) + (105, 95)),  # a ring
        (ANIMAL, 0.9 * (ANIMAL - (105, 95)) + (105, 95)),  # an outline
    ],
)
def test_what_is_no_card_is_not_called_one(
    tmp_path: Path, form: str, rings: tuple[np.ndarray, ...]
) -> None:
    target = ReadingSettings().read(drawn(tmp_path / f"a.{form}", form, *rings))
    assert not any("card" in doubt for doubt in doubts(target))


def test_a_drawing_without_a_hole_has_nothing_to_invert(tmp_path: Path) -> None:
    with refused("a.svg", "invert", kind=InputFileError):
        ReadingSettings(invert=True).read(drawn(tmp_path / "a.svg", "svg", ANIMAL))


@pytest.mark.parametrize("form", ["svg", "png"])
def test_a_speck_is_no_part(tmp_path: Path, form: str) -> None:
    target = ReadingSettings().read(drawn(tmp_path / f"a.{form}", form, ANIMAL, SPECK))
    assert parts_left_out(target) == holes_filled(target) == doubts(target) == []
    assert not any("component" in note for note in target.notes)
    larger = SPECK.mean(axis=0) + 4 * (SPECK - SPECK.mean(axis=0)) - (20, 20)
    target = ReadingSettings().read(drawn(tmp_path / f"b.{form}", form, ANIMAL, larger))
    (part,) = parts_left_out(target)
    assert part.area / shapely.Polygon(target.outline).area == pytest.approx(0.0064, rel=0.2)
    assert any("component" in note for note in target.notes)
