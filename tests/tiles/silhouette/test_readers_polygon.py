"""Polygon files, files of an unknown kind, and silhouettes in memory."""

import io
import json
import os
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image, ImageDraw

from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.tiles import Target, read_outline
from refusals import refused

SQUARE = [[0, 0], [2, 0], [2, 2], [0, 2]]

UP = 'took y to point up; if it points down, write {"outline": [...], "y_down": true}'


def write(tmp_path: Path, content: str | bytes, name: str) -> Path:
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize(
    ("content", "y_down", "notes"),
    [
        (SQUARE, False, (UP,)),
        ([*SQUARE, SQUARE[0]], False, (UP,)),
        ({"polygon": SQUARE}, False, (UP,)),
        ({"outline": SQUARE, "y_down": True}, True, ()),
        ({"outline": SQUARE, "y_down": False}, False, ()),
        ({"tile": SQUARE, "ih": 4}, False, (UP,)),
        ({"tile": SQUARE, "polygon": SQUARE}, False, ('took "polygon", left tile unread', UP)),
    ],
)
def test_json(tmp_path: Path, content: object, y_down: bool, notes: tuple[str, ...]) -> None:
    reading = read_outline(write(tmp_path, json.dumps(content), "a.json"))
    assert reading.outline.tolist() == SQUARE
    assert (reading.kind, reading.y_down, reading.notes) == ("json", y_down, notes)


@pytest.mark.parametrize(
    ("content", "about"),
    [
        ("[[0, 0], [1, 0], [NaN, 1]]", "vertex 2|finite"),
        ("[[0, 0], [1, 0]]", "at least 3 distinct vertices"),
        ("[[0, 0], [1, 0], [0, 1, 2]]", "vertex 2|[0, 1, 2]"),
        ("[[0, 0], [1, 0], [true, 1]]", "vertex 2"),
        ("[[0, 0], [1, 0], [0, 1" + "0" * 400 + "]]", "not numbers in pairs"),
        ("[[0, 0], [1, 0], [0, 1" + "0" * 5000 + "]]", "JSON"),
        ("[[0, 0], [1, 0]", "line 1, column 16|JSON"),
        ("[" * 200_000, "nested too deeply"),
        ('{"a": 1, "b": 2}', "polygon|'a', 'b'"),
        ('{"polygon": 3}', "must be a list"),
        ('{"polygon": [[0, 0], [1, 0], [0, 1]], "y_down": "yes"}', "y_down"),
        ("[" + "[0,0]," * 100_001 + "[0,1]]", "100002 vertices|100000"),
        (b"[[0, 0], [1, 0], \xff]", "JSON"),
    ],
)
def test_bad_json(tmp_path: Path, content: str | bytes, about: str) -> None:
    path = write(tmp_path, content, "a.json")
    with refused(path, *about.split("|"), kind=InputFileError) as caught:
        read_outline(path)
    assert len(str(caught.value)) < len(str(path)) + 300


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_dat(tmp_path: Path, newline: str) -> None:
    lines = ["4 ", "0.0 0.0", " 2.0\t0.0 ", "", "2e0 2.0", "0.0 2.0", "tour 1 2 3", ""]
    reading = read_outline(write(tmp_path, newline.join(lines), "a.dat"))
    assert reading.outline.tolist() == SQUARE
    assert reading.y_down
    assert reading.notes == ("left 1 line after the vertices unread (line 7 on)",)


@pytest.mark.parametrize(
    ("content", "about"),
    [
        ("3\n0 0\n1 0\n0 x\n", "line 4|0 x"),
        ("3\n0 0\n1 0 5\n0 1\n", "line 3|1 0 5"),
        ("3\n0 0\n1 0\nnan 1\n", "line 4|nan 1|finite"),
        ("two\n0 x\n", "line 1|two"),
        ("2\n0 0\n1 0\n", "line 1|2"),
        ("999999999\n0 0\n", "line 1|100000"),
        ("4\n0 0\n1 1\n1 0\n0 1\n", "(0.5, 0.5)"),
        ("\n\n", "blank lines"),
        (b"\xe9t\xe9\n0 0\n", "byte 0"),
    ],
)
def test_bad_dat(tmp_path: Path, content: str | bytes, about: str) -> None:
    path = write(tmp_path, content, "a.dat")
    with refused(path, *about.split("|"), kind=InputFileError):
        read_outline(path)


@pytest.mark.parametrize(
    ("content", "name", "message"),
    [
        (b"\x00\x01\x02\x03" * 9, "a.bin", "of a kind that is not read"),
        ("hello", "noname", "of a kind that is not read; .*give a PNG"),
        (b"", "a.png", "the file is empty"),
        (b"\x1f\x8b\x08\x00rest", "a.svgz", "gzip-compressed"),
        ("<html><body/></html>", "a.html", "of a kind that is not read"),
    ],
)
def test_unknown_content(tmp_path: Path, content: str | bytes, name: str, message: str) -> None:
    with pytest.raises(InputFileError, match=message):
        read_outline(write(tmp_path, content, name))


def test_no_file_to_read(tmp_path: Path) -> None:
    with refused("missing.png", kind=InputFileError):
        read_outline(tmp_path / "missing.png")
    with refused("directory", kind=InputFileError):
        read_outline(tmp_path)
    with refused("path"):
        read_outline("a\0b.png")
    os.mkfifo(tmp_path / "pipe.png")
    with refused("pipe.png", kind=InputFileError):
        read_outline(tmp_path / "pipe.png")


def test_an_unreadable_file_by_its_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path, "[]", "a.json")

    def deny(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", deny)
    with refused("a.json", "Permission denied", kind=InputFileError):
        read_outline(path)


@pytest.mark.parametrize("name", ["a.json", "a.dat", "a.svg"])
def test_files_over_the_limit(tmp_path: Path, name: str) -> None:
    starts = {"a.json": b"[[0,0]", "a.dat": b"3\n0 0\n", "a.svg": b"<svg>"}
    path = write(tmp_path, starts[name] + b" " * 16 * 2**20, name)
    with refused("16 MB", kind=InputFileError):
        read_outline(path)


def test_image_settings_are_refused_for_polygons(tmp_path: Path) -> None:
    path = write(tmp_path, json.dumps(SQUARE), "a.json")
    with refused("threshold", "a.json"):
        read_outline(path, threshold=0.5)
    with refused("invert", "a.json"):
        read_outline(path, invert=True)


def test_noise_never_raises_anything_else(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    alphabet = np.frombuffer(b'[]{},:"01.5e-aN \n<>/svg', dtype=np.uint8)
    starts = [b"", b"[", b"[[0,", b'{"tile":[', b"3\n", b"<svg ", b"<svg><path d='M", b"\xff\xfe<"]
    for i in range(200):
        noise = rng.choice(alphabet, size=60).tobytes()
        path = write(tmp_path, starts[i % len(starts)] + noise, rng.choice(["a.dat", "a.json"]))
        with pytest.raises(InputFileError):
            read_outline(path)


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
def test_bytes_are_read_as_files_are(name: str) -> None:
    path = EXAMPLES / name
    from_file = Target.read(path)
    data = path.read_bytes()
    others = Target.from_bytes(data), Target.from_bytes(memoryview(data), "another.txt")
    for target in others:
        assert np.array_equal(target.outline, from_file.outline)
        assert target.report() | {"source": ""} == from_file.report() | {"source": ""}
    assert [target.source for target in others] == ["bytes", "another.txt"]


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
    with refused("large", "64 MB", kind=InputFileError):
        Target.from_bytes(png(drawn()) + b"\0" * (64 * 2**20), "large.png")


@pytest.mark.parametrize("wrong", [b"bytes", 3, None, np.zeros((9, 9)), io.BytesIO(b"[]")])
def test_what_is_no_file(wrong) -> None:
    with refused("silhouette's file", "path"):
        Target.read(wrong)
