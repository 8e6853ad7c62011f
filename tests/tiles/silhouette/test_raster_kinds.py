"""Pictures of every depth and way of transparency, masks, animations and large pictures."""

import io
import struct
from typing import Any

import numpy as np
import pytest
import tifffile
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image, ImageDraw

from orbiflow.errors import InputFileError
from orbiflow.tiles import FileContent, Reading, Target, doubts, iou, read_outline, signed_area
from png_files import COLOUR, PALETTE, png, saved
from refusals import refused

# An L whose long arm points down and whose foot points right, in pixels.
SHAPE = np.array([[20, 10], [40, 10], [40, 70], [80, 70], [80, 90], [20, 90]], dtype=float)
INSIDE = np.zeros((100, 100), bool)
INSIDE[10:90, 20:40] = INSIDE[70:90, 20:80] = True
OPAQUE = "the shape is what is not transparent (edge at 0.50)"


def read(data: bytes, name: str = "a.png") -> Reading:
    return read_outline(FileContent(data, name))


def tiff(pixels: Any, **options: Any) -> bytes:
    stream = io.BytesIO()
    tifffile.imwrite(stream, np.asarray(pixels), **options)
    return stream.getvalue()


def of_inside(shape: Any, ground: Any) -> Any:
    return np.where(INSIDE if np.ndim(shape) == 0 else INSIDE[..., None], shape, ground)


@st.composite
def depths_and_levels(draw: st.DrawFn) -> tuple[int, int, int]:
    depth = draw(st.sampled_from([1, 2, 4, 8, 16]))
    level = st.integers(0, 2**depth - 1)
    shape, ground = draw(st.lists(level, min_size=2, max_size=2, unique=True))
    return depth, shape, ground


@given(depths_and_levels())
def test_a_transparent_level_of_grey_cuts_out_at_every_depth(case: tuple[int, int, int]) -> None:
    depth, shape, ground = case
    reading = read(png(of_inside(shape, ground), depth, transparent=struct.pack(">H", ground)))
    assert reading.notes[-1] == OPAQUE
    assert iou(reading.outline, SHAPE) > 0.995


@given(
    st.sampled_from([8, 16]),
    st.lists(st.tuples(*[st.integers(0, 255)] * 3), min_size=2, max_size=2, unique=True),
)
def test_a_transparent_colour_cuts_out_at_every_depth(
    depth: int, colours: list[tuple[int, int, int]]
) -> None:
    shape, ground = (np.array(c) * (257 if depth == 16 else 1) for c in colours)
    key = struct.pack(">HHH", *ground)
    reading = read(png(of_inside(shape, ground), depth, COLOUR, transparent=key))
    assert reading.notes == (OPAQUE,)
    assert iou(reading.outline, SHAPE) > 0.995


@given(st.sampled_from([1, 2, 4, 8]), st.data())
def test_palettes_cut_out_by_any_of_their_entries(depth: int, data: st.DataObject) -> None:
    entries = st.integers(0, 2**depth - 1)
    shape, ground = data.draw(st.lists(entries, min_size=2, max_size=2, unique=True))
    opacity = bytearray([255] * 2**depth)
    opacity[ground] = data.draw(st.integers(0, 20))
    colours = data.draw(st.binary(min_size=3 * 2**depth, max_size=3 * 2**depth))
    reading = read(
        png(of_inside(shape, ground), depth, PALETTE, transparent=bytes(opacity), palette=colours)
    )
    assert reading.notes == (OPAQUE,)
    assert iou(reading.outline, SHAPE) > 0.99


DEEP = {
    "16 bits": of_inside(9000, 60_000).astype("u2"),
    "16 bits, big-endian": of_inside(9000, 60_000).astype(">u2"),
    "12 bits in 16": of_inside(4000, 100).astype("u2"),
    "32 bits": of_inside(200, 0).astype("i4"),
    "with a sign": of_inside(-3000, 9000).astype("i2"),
    "floats to 1": of_inside(0.0, 1.0).astype("f4"),
    "floats to a million": of_inside(1e6, -1e6).astype("f4"),
    "small floats": of_inside(1e-7, 0.0).astype(">f4"),
    "colours of 16 bits": of_inside((60_000, 9000, 0), (65_535,) * 3).astype("u2"),
    "with opacity": of_inside((0, 0, 0, 65_535), (65_535,) * 4).astype("u2"),
}


@pytest.mark.parametrize("pixels", DEEP.values(), ids=DEEP)
def test_deep_tiffs_are_neither_clipped_nor_wrapped(pixels: Any) -> None:
    colour = {"photometric": "rgb"} if pixels.ndim == 3 else {}
    assert iou(read(tiff(pixels, **colour), "a.tif").outline, SHAPE) > 0.995


def test_ramps_of_16_bits_keep_their_order() -> None:
    ramp = np.linspace(0, 65_535, 100).astype(int)[None].repeat(100, axis=0)
    reading = read(png(np.where(INSIDE, 65_535, ramp // 2), 16))
    assert iou(reading.outline, SHAPE) > 0.97


def test_tiffs_that_are_not_read_say_what_to_save() -> None:
    pixels = of_inside((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)).astype("f4")
    with refused("a.tif", "PNG", kind=InputFileError):
        read(tiff(pixels, photometric="rgb"), "a.tif")


@pytest.mark.parametrize(("shape", "ground"), [(1, 0), (0, 1)])
def test_masks_of_0_and_1_are_read_and_said(shape: int, ground: int) -> None:
    reading = read(tiff(of_inside(shape, ground).astype("u1")), "a.tif")
    assert "0 and 1" in reading.notes[0]
    assert iou(reading.outline, SHAPE) > 0.995
    mask = of_inside(1, 0).astype("u1")
    assert iou(Target.from_mask(mask).outline, reading.outline) > 0.999


@pytest.mark.parametrize("levels", [(0, 4), (1, 2, 3)])
def test_levels_that_the_eye_cannot_tell_apart_are_refused(levels: tuple[int, ...]) -> None:
    noise = np.random.default_rng(0).choice(levels, (60, 60)).astype(np.uint8)
    with refused("a.png", "mask", "threshold", kind=InputFileError):
        read(saved(Image.fromarray(noise)))
    with refused("mask", "threshold", kind=InputFileError):
        Target.from_mask(noise)


def test_dark_pictures_are_read() -> None:
    disc = Image.new("L", (800, 800), 4)
    ImageDraw.Draw(disc).ellipse((100, 100, 700, 700), fill=36)
    area = abs(signed_area(read(saved(disc.reduce(8))).outline))
    assert area == pytest.approx(np.pi * 37.5**2, rel=0.01)


def test_colours_behind_full_transparency_are_hinted_at() -> None:
    pixels = of_inside((0, 0, 0, 0), (255, 255, 255, 0)).astype(np.uint8)
    with refused("a.png", "alpha", kind=InputFileError):
        read(saved(Image.fromarray(pixels)))


@pytest.mark.parametrize(
    ("mode", "kind", "size", "orientation"),
    [("L", "JPEG", (7000, 6000), 6), ("1", "PNG", (7000, 6000), 1)],
)
def test_pictures_of_telephones_are_shrunk_and_said(
    mode: str, kind: str, size: tuple[int, int], orientation: int
) -> None:
    image = Image.new("L", (size[0], size[1]), 255)
    scale = np.array(size) / 100
    ImageDraw.Draw(image).polygon([tuple(xy) for xy in SHAPE * scale], fill=0)
    exif = Image.Exif()
    exif[0x0112] = orientation
    reading = read(saved(image.convert(mode), kind, exif=exif))
    shape = SHAPE * scale
    turned = {1: shape, 6: np.stack([size[1] - shape[:, 1], shape[:, 0]], axis=1)}[orientation]
    assert reading.size == (size if orientation == 1 else size[::-1])
    assert "megapixels: 2 x 2 pixels became one" in reading.notes[0]
    assert iou(reading.outline, turned) > 0.995


@pytest.mark.parametrize("orientation", [5, 6, 7, 8])
def test_plain_tiffs_that_are_turned_are_read_by_path(orientation: int, tmp_path: Any) -> None:
    pixels = np.where(INSIDE[:, :90], 0, 255).astype(np.uint8)
    turns = {5: "TRANSPOSE", 6: "ROTATE_90", 7: "TRANSVERSE", 8: "ROTATE_270"}
    turned = Image.fromarray(pixels).transpose(Image.Transpose[turns[orientation]])
    turned.save(tmp_path / "a.tif", tiffinfo={0x112: orientation})
    assert iou(read_outline(tmp_path / "a.tif").outline, SHAPE) > 0.995


@pytest.mark.parametrize("tones", [(0, 255), (255, 0), (40, 200)])
def test_a_frame_around_a_shape_is_the_shape_and_doubted(tones: tuple[int, int]) -> None:
    kept = np.pad(of_inside(*tones).astype(np.uint8), 8, constant_values=tones[1])
    framed = np.pad(np.pad(kept, 3, constant_values=tones[0]), 5, constant_values=tones[1])
    target = Target.from_bytes(saved(Image.fromarray(framed)), "a.png")
    assert target.area > 100**2
    (doubt,) = doubts(target)
    assert "frame" in doubt


@pytest.mark.parametrize("corner", [0, 12])
def test_a_card_with_a_drawing_on_it_is_the_shape_and_doubted(corner: int) -> None:
    where = Image.new("L", (110, 110))
    ImageDraw.Draw(where).rounded_rectangle((4, 4, 105, 105), corner, 255)
    pixels = np.where(np.pad(INSIDE, 5)[..., None], 255, (40, 90, 200))
    card = np.dstack([pixels, np.asarray(where)]).astype(np.uint8)
    target = Target.from_bytes(saved(Image.fromarray(card)), "a.png")
    assert OPAQUE in target.notes
    assert target.area == pytest.approx(102**2, rel=0.02)
    (doubt,) = doubts(target)
    assert "card" in doubt
