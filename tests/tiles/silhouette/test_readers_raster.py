"""Images of every mode, photographs, and images that cannot be read."""

import hashlib
import io
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from PIL import Image, ImageDraw
from scipy import ndimage

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError
from orbiflow.tiles import FileContent, Reading, Target, iou, read_outline
from orbiflow.tiles.silhouette import doubts
from orbiflow.tiles.silhouette.readers.colour_models import ColourCut, middle_of
from png_files import promise, saved
from refusals import refused

# An L whose long arm points down and whose foot points right, in pixels.
SHAPE = np.array([[20, 10], [40, 10], [40, 70], [80, 70], [80, 90], [20, 90]], dtype=float)


def draw(mode: str = "L", shape: object = 0, ground: object = 255, scale: int = 1) -> Image.Image:
    image = Image.new(mode, (100 * scale, 100 * scale), ground)  # type: ignore[arg-type]
    # Pillow fills the last row and column that it is given.
    boxes = [(20, 10, 40, 90), (20, 70, 80, 90)]
    for x0, y0, x1, y1 in boxes:
        corners = (x0 * scale, y0 * scale, x1 * scale - 1, y1 * scale - 1)
        ImageDraw.Draw(image).rectangle(corners, fill=shape)  # type: ignore[arg-type]
    return image


def save(tmp_path: Path, image: Image.Image, name: str = "shape.png", **options: Any) -> Path:
    path = tmp_path / name
    image.save(path, **options)
    return path


MODES: dict[str, Callable[[], Image.Image]] = {
    "1": lambda: draw("1", 0, 1),
    "L": draw,
    "LA": lambda: draw("LA", (0, 255), (0, 0)),
    "P": lambda: draw("RGB", (200, 30, 30), "white").quantize(8),
    "RGB": lambda: draw("RGB", "navy", "ivory"),
    "RGBA": lambda: draw("RGBA", (250, 250, 250, 255), (250, 250, 250, 0)),
    "I;16": lambda: Image.fromarray(np.asarray(draw()).astype(np.uint16) * 257),
    "opaque RGBA": lambda: draw("RGBA", (0, 0, 0, 255), (255, 255, 255, 255)),
    "half-transparent": lambda: draw("RGBA", (0, 0, 0, 230), (255, 255, 255, 230)),
}


@pytest.mark.parametrize("mode", MODES)
def test_every_mode_of_png(tmp_path: Path, mode: str) -> None:
    reading = read_outline(save(tmp_path, MODES[mode]()))
    assert reading.y_down
    assert reading.kind == "image"
    assert reading.size == (100, 100)
    assert iou(reading.outline, SHAPE) > 0.995
    # The edges of the pixels are the shape's edges: no half pixel is lost.
    assert reading.outline.min(axis=0) == pytest.approx([20, 10], abs=0.05)
    assert reading.outline.max(axis=0) == pytest.approx([80, 90], abs=0.05)


def test_rounded_corners_cut_nothing_out(tmp_path: Path) -> None:
    """A screenshot's transparent corners once made a rectangle of whatever it showed."""
    image = draw("RGBA", (0, 0, 0, 255), (255, 255, 255, 255))
    for corner in ((0, 0), (99, 0), (0, 99), (99, 99)):
        image.putpixel(corner, (0, 0, 0, 0))
    reading = read_outline(save(tmp_path, image))
    assert iou(reading.outline, SHAPE) > 0.995
    assert "took the few transparent pixels for white" in reading.notes
    plain = Image.new("RGBA", (100, 100), (9, 9, 9, 255))
    plain.putpixel((0, 0), (0, 0, 0, 0))  # nothing else to be seen
    assert "transparent" in read_outline(save(tmp_path, plain)).notes[0]


@pytest.mark.parametrize(
    ("name", "mode"),
    [("a.jpg", "L"), ("a.jpg", "CMYK"), ("a.webp", "RGBA"), ("a.bmp", "L"), ("a.gif", "P")],
)
def test_other_formats(tmp_path: Path, name: str, mode: str) -> None:
    inks = {"CMYK": ((0, 0, 0, 255), (0, 0, 0, 0)), "RGBA": ((0, 0, 0, 255), (0, 0, 0, 0))}
    image = draw(mode, *inks[mode]) if mode in inks else draw("L").convert(mode)
    assert iou(read_outline(save(tmp_path, image, name)).outline, SHAPE) > 0.97


def test_anti_aliased_edges_are_found_between_pixels(tmp_path: Path) -> None:
    image = Image.new("L", (800, 800), 255)
    ImageDraw.Draw(image).ellipse((101, 101, 698, 698), fill=0)
    reading = read_outline(save(tmp_path, image.reduce(8)))
    radii = np.hypot(*(reading.outline - 50).T)
    assert radii == pytest.approx(299 / 8, abs=0.15)


def test_polarity_is_detected_and_said(tmp_path: Path) -> None:
    dark = read_outline(save(tmp_path, draw()))
    light = read_outline(save(tmp_path, draw("L", 255, 0)))
    assert dark.notes == ("shape detected: dark on light (edge at 0.50)",)
    assert light.notes == ("shape detected: light on dark (edge at 0.50)",)
    assert iou(dark.outline, light.outline) > 0.999


def test_threshold_and_invert_override(tmp_path: Path) -> None:
    image = draw("L", 100, 250)
    ImageDraw.Draw(image).rectangle((20, 10, 39, 49), fill=20)
    path = save(tmp_path, image)
    reading = read_outline(path, threshold=0.2, invert=False)
    assert reading.notes == ("shape as set: dark on light (edge at 0.20, as given)",)
    # Interpolated towards a light ground, a low threshold draws the edge inwards.
    assert iou(reading.outline, [[20, 10], [40, 10], [40, 50], [20, 50]]) > 0.9
    with refused("shape.png", "100 x 100 pixels", "invert", kind=InputFileError):
        read_outline(path, invert=True)


@pytest.mark.parametrize("threshold", [0.0, 1.0, -3, float("nan")])
def test_threshold_out_of_range(tmp_path: Path, threshold: float) -> None:
    with refused("threshold"):
        read_outline(save(tmp_path, draw()), threshold=threshold)


def test_threshold_beyond_the_image(tmp_path: Path) -> None:
    with refused("threshold", "0.20", kind=InputFileError):
        read_outline(save(tmp_path, draw("L", 100, 250)), threshold=0.2)


def test_largest_component_and_holes(tmp_path: Path) -> None:
    image = draw()
    pen = ImageDraw.Draw(image)
    pen.rectangle((60, 10, 69, 19), fill=0)
    pen.rectangle((25, 20, 29, 29), fill=255)
    reading = read_outline(save(tmp_path, image))
    assert reading.notes[1:] == (
        "kept the largest of 2 components (96.0% of the filled area)",
        "filled 1 hole (2.1% of the area)",
    )
    assert iou(reading.outline, SHAPE) > 0.995
    seen = shapely.Polygon(SHAPE).union(shapely.box(60, 10, 70, 20)) - shapely.box(25, 20, 30, 30)
    assert reading.seen is not None
    assert reading.seen.symmetric_difference(seen).area < 0.02 * seen.area


def test_dust_is_no_component(tmp_path: Path) -> None:
    image = draw()
    pixels = np.asarray(image).copy()
    rng = np.random.default_rng(3)
    pixels[tuple(rng.integers(0, 100, (2, 40)))] ^= 255
    reading = read_outline(save(tmp_path, Image.fromarray(pixels)))
    assert reading.notes[1:] == ("left out specks of dust",)
    assert isinstance(reading.seen, shapely.Polygon)
    assert not reading.seen.interiors


def test_shape_on_the_border_is_closed_along_it(tmp_path: Path) -> None:
    image = Image.new("L", (100, 100), 255)
    ImageDraw.Draw(image).rectangle((0, 20, 59, 99), fill=0)
    reading = read_outline(save(tmp_path, image))
    assert iou(reading.outline, [[0, 20], [60, 20], [60, 100], [0, 100]]) > 0.995
    assert "touches the image's border" in reading.notes[-1]
    assert reading.outline.min() >= 0
    assert reading.outline.max() <= 100


def test_first_frame_of_an_animation(tmp_path: Path) -> None:
    path = save(tmp_path, draw(), "a.gif", save_all=True, append_images=[draw("L", 255, 0)])
    reading = read_outline(path)
    assert reading.notes[0] == "took the first frame of 2"


def test_outline_is_simple_where_pixels_meet_at_corners(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    noise = np.where(rng.random((120, 120)) < 0.7, 0, 255).astype(np.uint8)
    framed = np.pad(noise, 10, constant_values=255)
    reading = read_outline(save(tmp_path, Image.fromarray(framed)))
    assert iou(reading.outline, reading.outline) == 1


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Image.new("L", (1, 1)), "1 x 1 pixels cannot hold"),
        (lambda: Image.new("L", (50, 50), 77), "empty"),
        (lambda: Image.new("RGBA", (50, 50)), "wholly transparent"),
        (lambda: draw("L", 250, 255), "all but blank"),
        (lambda: draw().resize((8, 8)), "covers only .* pixels"),
    ],
)
def test_images_without_a_shape(tmp_path, make: Callable[[], Image.Image], message: str) -> None:
    path = save(tmp_path, make())
    with pytest.raises(InputFileError, match=message) as caught:
        read_outline(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_a_bomb_is_refused_by_its_header(tmp_path: Path) -> None:
    path = tmp_path / "bomb.png"
    for side, said in ((12_000, "12000 x 12000 pixels"), (60_000, "3600 megapixels")):
        path.write_bytes(promise(side, side))
        with pytest.raises(InputFileError, match=f"{said}.*128 megapixels are read"):
            read_outline(path)


@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.webp", "a.gif", "a.bmp", "a.tiff"])
@pytest.mark.parametrize("share", [0.05, 0.5, 0.9])
def test_truncated_files(tmp_path: Path, name: str, share: float) -> None:
    rng = np.random.default_rng(0)
    whole = io.BytesIO()
    noise = Image.fromarray(rng.integers(0, 256, (64, 64), dtype=np.uint8))
    noise.save(whole, {"jpg": "JPEG"}.get(name[2:], name[2:].upper()))
    path = tmp_path / name
    path.write_bytes(whole.getvalue()[: int(share * whole.tell())])
    with refused("a.", kind=InputFileError):
        read_outline(path)


@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.webp", "a.gif", "a.bmp", "a.tiff"])
def test_damaged_files_never_raise_anything_else(tmp_path: Path, name: str) -> None:
    whole = io.BytesIO()
    draw("RGB", "black", "white").save(whole, {"jpg": "JPEG"}.get(name[2:], name[2:].upper()))
    rng = np.random.default_rng(1)
    path = tmp_path / name
    for _ in range(40):
        data = bytearray(whole.getvalue())
        for at in rng.integers(0, min(len(data), 400), size=4):
            data[at] = rng.integers(256)
        path.write_bytes(data)
        try:
            reading = read_outline(path)
        except InputFileError:
            continue
        assert iou(reading.outline, reading.outline) == pytest.approx(1)


def test_a_file_over_the_limit_is_not_opened(tmp_path: Path) -> None:
    path = save(tmp_path, draw())
    os.truncate(path, 64 * 2**20 + 1)
    with refused("shape.png", "64 MB", kind=InputFileError):
        read_outline(path)


SIZE = (180, 144)
# an animal with four legs and a tail, in pixels once it is made smaller
LEGS = [
    [235, 85], [205, 110], [200, 170], [185, 170], [180, 130], [110, 135], [105, 170], [90, 170],
]  # fmt: skip
BACK = [[85, 120], [60, 95], [48, 62], [60, 60], [75, 90], [180, 90], [200, 60], [215, 60]]
ANIMAL = 0.6 * np.array([*LEGS, *BACK], dtype=float)
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
    cast = ANIMAL * [1, 0.4] + [0, 61.2] + (102 - ANIMAL[:, 1:]) * [0.6, 0]
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
    """Also where a photograph is upside down."""
    photo, is_turned = scene(name), "orange" in name
    if is_turned:
        image = Image.open(io.BytesIO(photo.data)).transpose(Image.Transpose.ROTATE_180)
        photo = FileContent(saved(image), "turned.png")
    reading = read_outline(photo)
    outline = np.array(SIZE) - reading.outline if is_turned else reading.outline
    assert iou(outline, ANIMAL) > 0.9
    assert any("photograph" in note for note in reading.notes)
    assert not doubts(Target(**vars(reading)))


def test_colours_that_the_border_has_too_may_be_the_shapes() -> None:
    """Grass and sky around a white and brown animal, and a white fence along the border."""
    ground = np.where(noise(6, 8, 20) > 0, (0.3, 0.5, 0.2), (0.45, 0.55, 0.7)) + 0.03 * noise(
        7, 1, 1
    )
    ground[-30:, ::24] = ground[-30:, 1::24] = (0.95, 0.93, 0.9)
    reading = read_outline(photograph(ground, stripes((0.95, 0.93, 0.9), (0.4, 0.25, 0.15)), 0.0))
    assert iou(reading.outline, ANIMAL) > 0.9


@pytest.mark.parametrize("seed", range(3))
def test_a_cut_from_the_middle_costs_no_more_than_the_truth(seed: int) -> None:
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:60, :80]
    disc = (x - rng.integers(30, 50)) ** 2 + (y - rng.integers(25, 35)) ** 2 < 400
    colours = np.array([[[20, 5, 5], [90, 0, 9]], [[60, -40, 30], [40, 9, -50]]], dtype=float)
    lab = colours[disc.astype(int), rng.integers(2, size=disc.shape)] + rng.normal(
        0, 4, (60, 80, 3)
    )
    border = np.ones(disc.shape, bool)
    border[2:-2, 2:-2] = False
    cut, start = ColourCut(lab, border), middle_of(disc.shape)
    shape = cut.shape(start)
    assert (shape & disc).sum() > 0.9 * (shape | disc).sum()
    assert cut.cost(shape) < cut.cost(disc) < cut.cost(start)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("pixels", [1, 7, 39, 41, 4791])
@pytest.mark.parametrize("spread", [0.0, 10.0])
def test_a_cut_may_begin_with_few_pixels_and_colours(pixels: int, spread: float) -> None:
    start = (np.arange(4800) < pixels).reshape(60, 80)
    lab = 50 + spread * np.random.default_rng(0).normal(size=(60, 80, 3))
    shape = ColourCut(lab, np.zeros((60, 80), bool)).shape(start)
    assert shape.shape == start.shape
    if min(pixels, 4800 - pixels) < 40:  # too few for a model
        assert shape.sum() >= min(pixels, 4791)
    else:
        assert np.isfinite(ColourCut(lab, np.zeros((60, 80), bool)).cost(start))


def test_one_level_of_luminance_takes_the_shadow_too() -> None:
    """What `threshold` asks for; so the test above can fail."""
    reading = read_outline(scene("an orange cat on grey"), threshold=0.5)
    assert iou(reading.outline, ANIMAL) < 0.85


def test_a_shape_that_hardly_shows_is_warned_of() -> None:
    snow = gradient((0.9, 0.91, 0.93), (0.88, 0.89, 0.91)) + 0.01 * noise(4, 8, 8)
    reading = read_outline(photograph(snow, snow - 0.035 + 0.02 * noise(5, 1, 1), 0.1))
    said = doubts(Target(**vars(reading)))
    assert "is left out" in said[0]
    assert "a plain ground" in said[0]


def test_a_photograph_of_nothing() -> None:
    ground = gradient((0.2, 0.6, 0.9), (0.9, 0.4, 0.1))
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
