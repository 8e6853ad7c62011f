"""The SVG files are well-formed, complete and upright."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
import pytest

from orbiflow.arrays import Array
from orbiflow.drawing import Sheet
from orbiflow.tiles import (
    CLASSES,
    Tile,
    colouring,
    default_window,
    patch,
    tile_picture,
    tiling_picture,
)
from refusals import refused

SVG = "{http://www.w3.org/2000/svg}"


def tiling_svg(tile: Tile, *window: Any) -> str:
    return tiling_picture(tile, *window, sheet=Sheet.column(300.0)).svg()


def paths(text: str) -> list[Array]:
    """Every path but the paper's."""
    found = []
    groups = [g for g in ET.fromstring(text).iter(f"{SVG}g") if g.attrib["id"] != "paper"]
    for element in (path for group in groups for path in group.iter(f"{SVG}path")):
        data = element.attrib["d"]
        assert data.startswith("M")
        assert data.endswith("Z")
        numbers = [float(value) for value in re.findall(r"-?\d+\.?\d*", data)]
        found.append(np.reshape(numbers, (-1, 2)))
    return found


def page(text: str) -> tuple[float, float]:
    root = ET.fromstring(text)
    left, top, width, height = (float(value) for value in root.attrib["viewBox"].split())
    assert (left, top) == (0, 0)
    assert root.attrib["width"] == f"{width:g}mm"
    assert float(root.attrib["height"].removesuffix("mm")) == height
    return width, height


@pytest.mark.parametrize("name", CLASSES)
def test_one_path_per_tile_in_a_group_per_colour(name: str, bent_tile: Any) -> None:
    tile = bent_tile(name)
    text = tiling_svg(tile)
    assert len(paths(text)) == len(patch(tile, default_window(tile)))
    groups = [group.attrib.get("id", "") for group in ET.fromstring(text).iter(f"{SVG}g")]
    expected = [f"colour-{k + 1}" for k in range(colouring(tile).count)]
    assert groups == ["paper", *expected]
    assert all(len(path) == len(tile.polygon) for path in paths(text))


def test_nothing_lies_outside_the_page(bent_tile: Any) -> None:
    text = tiling_svg(bent_tile("IH5"))
    width, height = page(text)
    assert (width, height) == (300, 200)
    for path in paths(text):
        assert (path.min(axis=0) <= (width, height)).all()
        assert (path.max(axis=0) >= 0).all()
    root = ET.fromstring(text)
    colours = [group for group in root.iter(f"{SVG}g") if group.attrib["id"] != "paper"]
    assert colours
    assert all(group.attrib["clip-path"] == "url(#window)" for group in colours)
    assert root.find(f"{SVG}title") is not None
    assert not list(root.iter(f"{SVG}use"))
    assert not any("transform" in element.attrib for element in root.iter())


def test_default_window_is_a_few_tiles_across(bent_tile: Any) -> None:
    for name in CLASSES:
        tile = bent_tile(name, scale=30.0)
        xmin, ymin, xmax, ymax = default_window(tile)
        assert (xmax - xmin) / (ymax - ymin) == pytest.approx(1.5)
        width = float(np.ptp(tile.polygon[:, 0]))
        assert 3 < (xmax - xmin) / width < 6
        np.testing.assert_allclose([(xmin + xmax) / 2, (ymin + ymax) / 2], tile.center, atol=1e-9)


def triangle(top: float) -> Tile:
    """Half a square, its apex at y = `top`, below or above its base at y = 0."""
    kind = CLASSES["IH1"]
    return Tile(np.array([[0.0, 0.0], [2.0, 0.0], [1.0, top]]), kind.group())


@pytest.mark.parametrize(("top", "y_down"), [(1.0, False), (-1.0, True)])
def test_upright(top: float, y_down: bool) -> None:
    """A triangle that points up in its own coordinates points up on the page."""
    (path,) = paths(tile_picture(triangle(top), y_down=y_down).svg())
    assert path[2, 1] < path[0, 1]  # SVG's y points down
    assert path[0, 0] < path[1, 0]  # not mirrored


def test_tile_alone_fits_its_page(bent_tile: Any) -> None:
    text = tile_picture(bent_tile("IH28"), title="Cat & <mouse>").svg()
    width, height = page(text)
    (path,) = paths(text)
    assert (path.min(axis=0) > 0).all()
    assert (path.max(axis=0) < (width, height)).all()
    title = ET.fromstring(text).find(f"{SVG}title")
    assert title is not None
    assert title.text == "Cat & <mouse>"


def test_mistakes(bent_tile: Any) -> None:
    with refused("window", "(1, 0, 0, 1)"):
        tiling_svg(bent_tile("IH1"), (1, 0, 0, 1))
    with refused("window", 20000):
        tiling_svg(bent_tile("IH1"), (0, 0, 1e4, 1e4))
