"""Silhouettes from what is in memory: arrays, bytes and streams."""

import io
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image, ImageDraw

from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.tiles import Target
from refusals import refused

EXAMPLES = Path(__file__).parents[3] / "examples" / "silhouettes"
FILES = ("turtle.png", "barbet.svg", "squirrel.dat")


def drawn(mode: str = "L") -> Image.Image:
    """A white quadrilateral on black."""
    image = Image.new(mode, (90, 60))
    ImageDraw.Draw(image).polygon([(12, 8), (80, 15), (70, 52), (20, 40)], fill=255)
    return image


def png(image: Image.Image) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, "PNG")
    return buffer.getvalue()


@pytest.mark.parametrize("name", FILES)
def test_bytes_and_streams_are_read_as_files_are(name: str) -> None:
    path = EXAMPLES / name
    from_file = Target.read(path)
    data = path.read_bytes()
    with path.open("rb") as file:
        from_open = Target.read(file)
    others = (
        Target.from_bytes(data),
        Target.from_bytes(memoryview(data), "another.txt"),
        Target.read(io.BytesIO(data)),
        from_open,
    )
    for target in others:
        assert np.array_equal(target.outline, from_file.outline)
        assert target.report() | {"source": ""} == from_file.report() | {"source": ""}
    assert [t.source for t in others[:3]] == ["bytes", "another.txt", "stream"]
    assert others[3].source == str(path)


def test_drawings_in_memory() -> None:
    svg = b'<svg xmlns="http://www.w3.org/2000/svg"><path d="M0 0 L9 0 L9 9 L0 9 Z"/></svg>'
    assert Target.from_bytes(svg).area == pytest.approx(81)
    assert Target.from_bytes(b"4\n0 0\n2 0\n2 2\n0 2\n").kind == "dat"


def test_a_mask_is_read_as_its_picture_is() -> None:
    image = drawn()
    levels = np.asarray(image)
    read = Target.from_bytes(png(image))
    gray = Target.from_mask(levels)
    assert np.array_equal(gray.outline, read.outline)
    assert gray.notes == read.notes
    marked = [levels > 0, (levels > 0).astype(int), torch.tensor(levels > 0), (levels > 0).tolist()]
    for mask in marked:
        target = Target.from_mask(mask)
        assert np.array_equal(target.outline, read.outline)
        assert target.kind == "image"
        assert target.size == (90, 60)
        assert target.y_down


@pytest.mark.parametrize(
    ("dtype", "full"), [(np.uint8, 255), (np.uint16, 65535), (np.float32, 1), (np.float64, 1)]
)
def test_gray_levels_of_every_type(dtype: type, full: float) -> None:
    levels = (np.asarray(drawn()) / 255.0 * full).astype(dtype)
    target = Target.from_mask(levels)
    assert np.allclose(target.outline, Target.from_mask(levels > 0).outline, atol=0.05)
    assert "light on dark" in target.notes[0]


def test_the_settings_are_those_of_images() -> None:
    ramp = np.tile(np.linspace(0, 1, 100), (40, 1))
    ramp[:, 95:] = ramp[:3] = ramp[-3:] = 0.0
    narrow = Target.from_mask(ramp, threshold=0.7, invert=True)
    wide = Target.from_mask(ramp, threshold=0.3, invert=True)
    assert wide.area > 1.5 * narrow.area
    # a mask says by itself which part is meant, whatever its border is
    frame = np.ones((40, 60), bool)
    frame[10:20, 10:20] = False
    assert Target.from_mask(frame, invert=True).area == pytest.approx(100, rel=0.02)
    with refused("mask", "threshold"):
        Target.from_mask(frame, threshold=0.5)
    with refused("threshold", 2):
        Target.from_mask(ramp, threshold=2)


@given(st.integers(3, 60), st.integers(3, 60), st.integers(0, 3), st.integers(0, 3))
def test_the_area_is_that_of_the_marked_pixels(width, height, left, top) -> None:
    mask = np.zeros((height + top + 4, width + left + 4), bool)
    mask[top + 2 : top + 2 + height, left + 2 : left + 2 + width] = True
    if width * height < 40:
        return
    target = Target.from_mask(mask)
    assert target.area == pytest.approx(width * height, rel=0.08)
    low, high = target.outline.min(axis=0), target.outline.max(axis=0)
    assert np.allclose(low, [left + 2, top + 2], atol=0.6)
    assert np.allclose(high, [left + 2 + width, top + 2 + height], atol=0.6)


@pytest.mark.parametrize(
    ("mask", "error", "message"),
    [
        (np.zeros((9, 9, 3)), OrbiflowError, r"expected an array \(H, W\), got shape \(9, 9, 3\)"),
        (np.zeros(9), OrbiflowError, r"expected an array \(H, W\)"),
        ([[1, 0], [1]], OrbiflowError, "expected an array of booleans or levels, got a list of 2"),
        ("cat.png", OrbiflowError, "expected an array of booleans or levels, got 'cat.png'"),
        (np.full((9, 9), 1j), OrbiflowError, "booleans or levels"),
        (np.full((40, 40), np.nan), OrbiflowError, "lie from 0 to 1, got nan to nan"),
        (np.arange(1600.0).reshape(40, 40), OrbiflowError, "lie from 0 to 1, got 0 to 1599; scale"),
        (np.full((40, 40), -1), OrbiflowError, "lie from 0 to 255"),
        (np.zeros((40, 40), bool), InputFileError, "there is no shape in it"),
        (np.zeros((0, 0), bool), InputFileError, "0 x 0 pixels cannot hold a silhouette"),
        (np.zeros((1, 50_000_000), bool), InputFileError, "at most 40 megapixels"),
    ],
)
def test_masks_that_cannot_be_used(mask, error, message) -> None:
    with pytest.raises(error, match=message) as caught:
        Target.from_mask(mask, source="my mask")
    assert str(caught.value).startswith("my mask: ")


def test_bytes_that_cannot_be_used() -> None:
    with refused("cat.png", kind=InputFileError):
        Target.from_bytes(b"", "cat.png")
    with refused("cat.png", kind=InputFileError):
        Target.from_bytes(b"\0\1\2", "cat.png")
    with refused("bytes", "PNG", kind=InputFileError):
        Target.from_bytes(png(drawn())[:40])
    with refused("data", "cat.png"):
        Target.from_bytes("cat.png")  # pyright: ignore[reportArgumentType]
    with refused("bytes", "16 MB", kind=InputFileError):
        Target.from_bytes(b"[" + b" " * (16 * 2**20))
    with refused("stream", "64 MB", kind=InputFileError):
        Target.read(io.BytesIO(png(drawn()) + b"\0" * (64 * 2**20)))


@pytest.mark.parametrize("wrong", [b"bytes", 3, None, np.zeros((9, 9))])
def test_what_is_no_file(wrong) -> None:
    with refused("path", "bytes"):
        Target.read(wrong)


def test_streams_of_text_and_closed_ones_are_refused() -> None:
    with refused("stream", "rb"):
        Target.read(io.StringIO("[[0, 0]]"))  # pyright: ignore[reportArgumentType]
    closed = io.BytesIO(b"x")
    closed.close()
    with refused("stream", kind=InputFileError):
        Target.read(closed)
