"""Photographs: what is read in them is the shape, without its shadow."""

import hashlib
import io
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw
from scipy import ndimage

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError
from orbiflow.tiles import FileContent, Reading, Target, iou, read_outline
from orbiflow.tiles.silhouette import doubts

SIZE = (300, 240)
# an animal with four legs and a tail, in pixels
LEGS = [
    [235, 85], [205, 110], [200, 170], [185, 170], [180, 130], [110, 135], [105, 170], [90, 170],
]  # fmt: skip
BACK = [[85, 120], [60, 95], [48, 62], [60, 60], [75, 90], [180, 90], [200, 60], [215, 60]]
ANIMAL = np.array([*LEGS, *BACK], dtype=float)
EXAMPLES = Path(__file__).parents[3] / "examples" / "silhouettes"


def mask(outline: Array = ANIMAL) -> Array:
    image = Image.new("L", (SIZE[0] * 4, SIZE[1] * 4))
    ImageDraw.Draw(image).polygon([(4 * x, 4 * y) for x, y in outline], fill=255)
    return np.asarray(image.reduce(4)) / 255


def noise(seed: int, *sigma: float) -> Array:
    values = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=SIZE[::-1]), sigma)
    return (values / values.std())[..., None]


def gradient(top: tuple[float, ...], bottom: tuple[float, ...]) -> Array:
    share = np.linspace(0, 1, SIZE[1])[:, None, None]
    return np.array(top) * (1 - share) + np.array(bottom) * share + np.zeros((*SIZE[::-1], 3))


def shadow(depth: float) -> Array:
    """Light on the floor, where an animal's shadow falls to its right."""
    cast = ANIMAL * [1, 0.4] + [0, 102] + (170 - ANIMAL[:, 1:]) * [0.6, 0]
    return 1 - depth * ndimage.gaussian_filter(mask(cast), 3)[..., None]


def photograph(ground: Array, fur: Array, depth: float = 0.5) -> FileContent:
    inside = mask()[..., None]
    scene = ground * shadow(depth) * (1 - inside) + fur * inside
    scene = ndimage.gaussian_filter(scene, (0.7, 0.7, 0)) + 0.015 * noise(9, 0.0, 0.0)
    file = io.BytesIO()
    pixels = (np.clip(scene, 0, 1) * 255).astype(np.uint8)
    Image.fromarray(pixels).save(file, "JPEG", quality=70)
    return FileContent(file.getvalue(), "photograph.jpg")


def stripes(*colours: tuple[float, float, float]) -> Array:
    share = (noise(1, 12, 12) > 0).astype(float)
    return np.array(colours[0]) * share + np.array(colours[1]) * (1 - share) + 0.03 * noise(2, 3, 1)


SCENES = {
    "an orange cat on grey": lambda: (
        gradient((0.72, 0.71, 0.7), (0.6, 0.6, 0.6)),
        stripes((0.85, 0.5, 0.2), (0.7, 0.35, 0.12)),
    ),
    "a grey animal on grey": lambda: (
        gradient((0.8, 0.8, 0.8), (0.68, 0.68, 0.68)),
        stripes((0.33, 0.33, 0.33), (0.4, 0.4, 0.4)),
    ),
    "black and white on grass": lambda: (
        gradient((0.3, 0.5, 0.2), (0.35, 0.55, 0.2)) * (1 + 0.1 * noise(3, 1, 1)),
        stripes((0.95, 0.93, 0.9), (0.1, 0.09, 0.1)),
    ),
}


@cache
def scene(name: str) -> FileContent:
    ground, fur = SCENES[name]()
    return photograph(ground, fur, 0.35 if "grey animal" in name else 0.5)


@pytest.mark.parametrize("name", SCENES)
def test_a_shadow_is_background(name: str) -> None:
    reading = read_outline(scene(name))
    assert iou(reading.outline, ANIMAL) > 0.93
    assert any("photograph" in note for note in reading.notes)
    assert not doubts(Target(**vars(reading)))


def test_one_level_of_luminance_takes_the_shadow_too() -> None:
    """What `threshold` asks for; so the test above can fail."""
    reading = read_outline(scene("an orange cat on grey"), threshold=0.5)
    assert iou(reading.outline, ANIMAL) < 0.85


def test_a_turned_photograph_gives_the_turned_shape() -> None:
    image = Image.open(io.BytesIO(scene("an orange cat on grey").data))
    turned = np.asarray(image.transpose(Image.Transpose.ROTATE_180))
    file = io.BytesIO()
    Image.fromarray(turned).save(file, "PNG")
    outline = read_outline(FileContent(file.getvalue(), "turned.png")).outline
    assert iou(np.array(SIZE) - outline, ANIMAL) > 0.93


def test_a_shape_that_hardly_shows_is_warned_of() -> None:
    snow = gradient((0.9, 0.91, 0.93), (0.88, 0.89, 0.91)) + 0.01 * noise(4, 8, 8)
    reading = read_outline(photograph(snow, snow - 0.035 + 0.02 * noise(5, 1, 1), 0.1))
    said = doubts(Target(**vars(reading)))
    assert "is left out" in said[0]
    assert "a plain ground" in said[0]


def test_a_photograph_of_nothing() -> None:
    ground = gradient((0.2, 0.3, 0.5), (0.8, 0.7, 0.6))
    try:
        reading = read_outline(photograph(ground, ground, 0.0))
    except InputFileError:
        return
    assert doubts(Target(**vars(reading)))


# the outlines of drawings in two levels, as version 0.1 read them
AS_BEFORE = {"turtle.png": "d1dee0ed5c7ba2c3", "night-monkey.png": "d4943dce4d275128"}


def digest(reading: Reading) -> str:
    return hashlib.sha256(reading.outline.round(6).tobytes()).hexdigest()[:16]


@pytest.mark.parametrize("name", AS_BEFORE)
def test_drawings_in_two_levels_are_read_as_before(name: str) -> None:
    assert digest(read_outline(EXAMPLES / name)) == AS_BEFORE[name]
