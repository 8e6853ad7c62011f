"""Masks as files: modes of images, levels, and what is refused."""

import os
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from mask_files import (
    SIZE,
    assert_emphasised,
    corner_weights,
    inverted,
    mask,
    painted,
    picture,
    save,
)
from orbiflow.errors import InputFileError
from orbiflow.tiles import Emphasis
from refusals import refused

# Levels


MODES: dict[str, tuple[Callable[[], Image.Image], float]] = {
    "1": (lambda: mask().convert("1"), 4),
    "L": (mask, 4),
    "RGB": (lambda: mask().convert("RGB"), 4),
    "P": (lambda: mask().convert("RGB").quantize(4), 4),
    "I;16": (lambda: Image.fromarray(np.asarray(mask()).astype(np.uint16) * 257), 4),
    "opaque RGBA": (lambda: painted((255, 255, 255, 255), (0, 0, 0, 255)), 4),
    "half-transparent": (lambda: painted((255, 255, 255, 90), (0, 0, 0, 90)), 4),
    "alpha, black on white": (lambda: painted((0, 0, 0, 255), (255, 255, 255, 0)), 4),
    "alpha, white on black": (lambda: painted((255, 255, 255, 255), (0, 0, 0, 0)), 4),
    "alpha of LA": (lambda: painted((0, 255), (255, 0), "LA"), 4),
    "graded": (lambda: mask(light=51), 1 + 3 * 0.2),
    "graded alpha": (lambda: painted((9, 9, 9, 102), (9, 9, 9, 0)), 1 + 3 * 0.4),
    "faint alpha": (lambda: painted((9, 9, 9, 26), (255, 255, 255, 0)), 1 + 3 * 26 / 255),
    "graded 16": (lambda: Image.fromarray(np.asarray(mask()).astype(np.uint16) * 100), 2.167),
}


@pytest.mark.parametrize("mode", MODES)
def test_every_mode_of_png(tmp_path: Path, mode: str) -> None:
    make, weight = MODES[mode]
    target = picture(tmp_path)
    emphasis = Emphasis.read(save(tmp_path, make()), target)
    assert_emphasised(emphasis, target, "top left", weight)
    by_alpha = "took the mask's alpha channel: opaque is emphasised, whatever its colour"
    assert (by_alpha in emphasis.notes) == ("alpha" in mode)


@pytest.mark.parametrize("name", ["a.jpg", "a.webp", "a.bmp", "a.gif", "a.tiff"])
def test_other_formats(tmp_path: Path, name: str) -> None:
    target = picture(tmp_path)
    assert_emphasised(Emphasis.read(save(tmp_path, mask(), name), target), target, "top left")


def test_palette_with_a_transparent_colour(tmp_path: Path) -> None:
    target = picture(tmp_path)
    image = painted(1, 0, "P")
    image.putpalette([255, 255, 255, 10, 10, 10])
    emphasis = Emphasis.read(save(tmp_path, image, transparency=0), target)
    assert_emphasised(emphasis, target, "top left")


def test_first_frame_of_an_animation(tmp_path: Path) -> None:
    path = save(tmp_path, mask(), "a.gif", save_all=True, append_images=[mask("bottom left")])
    target = picture(tmp_path)
    emphasis = Emphasis.read(path, target)
    assert emphasis.notes[0] == "took the first frame of 2"
    assert_emphasised(emphasis, target, "top left")


def test_what_falls_short_of_white_is_said(tmp_path: Path) -> None:
    emphasis = Emphasis.read(save(tmp_path, mask(light=51)), picture(tmp_path), strength=11)
    assert emphasis.notes == ("the mask reaches 20% of full emphasis: weights go up to 3, not 11",)


def test_a_mask_that_looks_inverted_is_said(tmp_path: Path) -> None:
    emphasis = Emphasis.read(save(tmp_path, inverted(mask())), picture(tmp_path))
    assert emphasis.notes[0].startswith("the mask emphasises 75")
    assert emphasis.notes[0].endswith("if the other part was meant, invert the mask")


# Refusals


def header_of(width: int, height: int) -> bytes:
    """A PNG that promises so many pixels and holds none."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return (
            struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        )

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", b"") + chunk(b"IEND", b"")


BAD_MASKS: dict[str, tuple[Callable[[], Image.Image], str]] = {
    "black": (lambda: Image.new("L", SIZE, 0), "all black .* paint what must survive white"),
    "white": (lambda: Image.new("L", SIZE, 255), r"uniform, .* 1\.00 to 1\.00 .* paint what"),
    "grey": (lambda: Image.new("RGB", SIZE, (99, 99, 99)), r"uniform, .* 0\.39"),
    "nearly black": (lambda: mask(light=9), "all black"),
    "nearly grey": (lambda: painted(209, 200, "L"), "uniform"),
    "transparent": (lambda: Image.new("RGBA", SIZE, (255, 255, 255, 0)), "wholly transparent"),
    "nearly so": (lambda: painted((0, 0, 0, 5), (0, 0, 0, 0)), "wholly transparent"),
    "opaque black": (lambda: Image.new("RGBA", SIZE, (0, 0, 0, 255)), "all black"),
    "one alpha, white": (lambda: Image.new("RGBA", SIZE, (255, 255, 255, 128)), "uniform"),
    "one pixel": (lambda: Image.new("L", (1, 1), 255), "1 x 1 pixels"),
    "beside the silhouette": (
        lambda: Image.fromarray(np.pad(np.full((100, 9), 255, np.uint8), ((0, 0), (0, 191)))),
        "does not touch the silhouette",
    ),
}


@pytest.mark.parametrize("case", BAD_MASKS)
def test_masks_that_emphasise_nothing(tmp_path: Path, case: str) -> None:
    make, message = BAD_MASKS[case]
    path = save(tmp_path, make())
    with pytest.raises(InputFileError, match=message) as caught:
        Emphasis.read(path, picture(tmp_path))
    assert str(caught.value).startswith(f"{path}: ")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"this is no picture at all\n" * 30, "or it is none; give a PNG"),
        (b"<svg xmlns='http://www.w3.org/2000/svg'/>", "or it is none"),
        (b"", "the file is empty"),
        (header_of(200, 100), "damaged or cut short"),
        (header_of(20_000, 7000), r"20000 x 7000 pixels \(140 megapixels\), at most 128"),
        (header_of(100_000, 50_000), "5000 megapixels, at most 128"),
    ],
)
def test_files_that_are_no_mask(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "mask.png"
    path.write_bytes(content)
    with pytest.raises(InputFileError, match=message):
        Emphasis.read(path, picture(tmp_path))


def test_missing_folder_and_oversized_files(tmp_path: Path) -> None:
    target = picture(tmp_path)
    with refused("none.png", kind=InputFileError):
        Emphasis.read(tmp_path / "none.png", target)
    with refused("directory", kind=InputFileError):
        Emphasis.read(tmp_path, target)
    path = save(tmp_path, mask())
    os.truncate(path, 64 * 2**20 + 1)
    with refused("mask.png", "64 MB", kind=InputFileError):
        Emphasis.read(path, target)


@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.webp", "a.gif", "a.bmp", "a.tiff"])
def test_damaged_files_never_raise_anything_else(tmp_path: Path, name: str) -> None:
    target = picture(tmp_path)
    whole = save(tmp_path, mask().convert("RGB"), name).read_bytes()
    rng = np.random.default_rng(1)
    path = tmp_path / name
    for _ in range(25):
        data = bytearray(whole)
        for at in rng.integers(0, min(len(data), 400), size=4):
            data[at] = rng.integers(256)
        path.write_bytes(data[: rng.integers(1, 2 * len(data))])
        try:
            emphasis = Emphasis.read(path, target)
        except InputFileError:
            continue
        assert np.isfinite(emphasis.weight(target.normal)).all()


@pytest.mark.parametrize("strength", [1, 0, -4, 100.1, float("inf"), float("nan")])
def test_strength_out_of_range(tmp_path: Path, strength: float) -> None:
    path, target = save(tmp_path, mask()), picture(tmp_path)
    with refused("strength", 100):
        Emphasis.read(path, target, strength=strength)


@pytest.mark.parametrize("strength", [1.5, 100])
def test_strength(tmp_path: Path, strength: float) -> None:
    path, target = save(tmp_path, mask()), picture(tmp_path)
    weights = corner_weights(Emphasis.read(path, target, strength=strength), target)
    assert weights["top left"] == pytest.approx(strength, rel=0.01)


@pytest.mark.parametrize(
    ("array", "box"),
    [
        (np.zeros(4), (0, 0, 1, 1)),
        (np.zeros((0, 3)), (0, 0, 1, 1)),
        (np.full((2, 2), 1.5), (0, 0, 1, 1)),
        (np.full((2, 2), np.nan), (0, 0, 1, 1)),
        (np.eye(2), (0, 0, 0, 1)),
        (np.eye(2), (0, 0, np.inf, 1)),
    ],
)
def test_arrays_that_are_no_mask(array: np.ndarray, box: Any) -> None:
    with refused("mask"):
        Emphasis(array, box)
