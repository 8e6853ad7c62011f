"""A picture of a box and masks for it, shared by the tests of emphasis."""

import json
from pathlib import Path
from typing import Any

import pytest
from PIL import Image, ImageDraw

from orbiflow.tiles import Emphasis, Target

# A picture of 200 x 100 pixels with a box drawn from (20, 10) to (180, 90).
SIZE = (200, 100)
BODY = (20, 10, 180, 90)
CORNERS = {"top left": (20, 10), "top right": (180, 10)}
CORNERS |= {"bottom left": (20, 90), "bottom right": (180, 90)}
SVG = (
    '<svg xmlns="http://www.w3.org/2000/svg" {page}>'
    '<rect x="{x}" y="{y}" width="160" height="80"/></svg>'
)


def save(folder: Path, image: Image.Image, name: str = "mask.png", **options: Any) -> Path:
    image.save(folder / name, **options)
    return folder / name


def picture(folder: Path) -> Target:
    image = Image.new("L", SIZE, 255)
    x0, y0, x1, y1 = BODY
    ImageDraw.Draw(image).rectangle((x0, y0, x1 - 1, y1 - 1), fill=0)
    return Target.read(save(folder, image, "picture.png"))


def drawing(folder: Path, page: str, x: float = 20, y: float = 10) -> Target:
    path = folder / "drawing.svg"
    path.write_text(SVG.format(page=page, x=x, y=y))
    return Target.read(path)


def polygon(folder: Path, *, y_down: bool) -> Target:
    x0, y0, x1, y1 = BODY
    path = folder / "polygon.json"
    ring = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
    path.write_text(json.dumps({"polygon": ring, "y_down": y_down}))
    return Target.read(path)


def mask(corner: str = "top left", size: tuple[int, int] = SIZE, light: int = 255) -> Image.Image:
    """Light on the quarter of the picture at `corner`."""
    width, height = size
    left = 0 if "left" in corner else width // 2
    top = 0 if "top" in corner else height // 2
    image = Image.new("L", size, 0)
    image.paste(light, (left, top, left + width // 2, top + height // 2))
    return image


def inverted(image: Image.Image) -> Image.Image:
    return image.point([255 - level for level in range(256)])


def painted(ink: Any, ground: Any, mode: str = "RGBA") -> Image.Image:
    image = Image.new(mode, SIZE, ground)
    image.paste(ink, (0, 0, SIZE[0] // 2, SIZE[1] // 2))
    return image


def corner_weights(emphasis: Emphasis, target: Target) -> dict[str, float]:
    at = target.to_normal(list(CORNERS.values()))
    return dict(zip(CORNERS, emphasis.weight(at), strict=True))


def assert_emphasised(emphasis: Emphasis, target: Target, corner: str, weight: float = 4) -> None:
    expected = {name: weight if name == corner else 1 for name in CORNERS}
    assert corner_weights(emphasis, target) == pytest.approx(expected, abs=0.03)
