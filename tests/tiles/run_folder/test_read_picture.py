"""`read.png`: what was read, in the folder before the search and after it."""

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw

from orbiflow.errors import OutputError
from orbiflow.runtime import Event, Note
from orbiflow.tiles import finding
from orbiflow.tiles.run_folder import read_png, result_folder, show_reading
from orbiflow.tiles.silhouette import Target
from refusals import refused

MAGENTA, ORANGE, BLUE = (230, 0, 126), (255, 140, 0), (0, 120, 255)


@pytest.fixture(name="picture")
def picture_fixture(tmp_path: Path) -> Path:
    """A disc with a hole, and a spot beside it."""
    image = Image.new("L", (400, 200), 255)
    pen = ImageDraw.Draw(image)
    pen.ellipse((20, 20, 180, 180), fill=0)
    pen.ellipse((80, 80, 130, 130), fill=255)
    pen.ellipse((250, 60, 330, 140), fill=0)
    image.save(tmp_path / "disc.png")
    return tmp_path / "disc.png"


def near(pixels: np.ndarray, colour: tuple[int, ...], most: int = 90) -> np.ndarray:
    return np.abs(pixels - np.array(colour)).sum(axis=2) < most


def test_outline_parts_and_holes_are_marked(picture: Path) -> None:
    image = Image.open(io.BytesIO(read_png(Target.read(picture), picture)))
    assert image.width == 1200
    pixels = np.asarray(image.convert("RGB")).astype(int)
    scale = 3
    rows, columns = np.nonzero(near(pixels[:600], MAGENTA))
    radii = np.hypot(columns / scale - 100, rows / scale - 100)
    assert np.abs(radii - 80).max() < 2.5
    assert near(pixels, ORANGE, 260)[100 * scale, 290 * scale]
    assert near(pixels, BLUE, 320)[105 * scale, 105 * scale]
    assert (pixels[100 * scale, 40 * scale] < 10).all()


@pytest.mark.parametrize("height", [200, 203])
def test_nothing_is_marked_below_the_words(height: int, tmp_path: Path) -> None:
    image = Image.new("L", (307, height), 255)
    ImageDraw.Draw(image).ellipse((20, 20, 180, 180), fill=0)
    image.save(tmp_path / "disc.png")
    read = read_png(Target.read(tmp_path / "disc.png"), tmp_path / "disc.png")
    assert (np.asarray(Image.open(io.BytesIO(read)).convert("L"))[-5:] == 255).all()


@pytest.mark.parametrize("size", [(3000, 40), (40, 3000), (2, 2)])
def test_its_size_is_bounded(size: tuple[int, int], tmp_path: Path) -> None:
    target = Target.from_polygon([[0, 0], [size[0], 0], [size[0], size[1]], [0, size[1]]])
    image = Image.open(io.BytesIO(read_png(target, tmp_path)))
    assert max(image.size) <= 1300


def test_a_polygon_is_drawn_upright(tmp_path: Path) -> None:
    target = Target.from_polygon([[0, 0], [100, 0], [50, 100]])  # y up: the tip is on top
    pixels = np.asarray(Image.open(io.BytesIO(read_png(target, tmp_path))).convert("L"))
    dark = (pixels[:1150] < 100).sum(axis=1)
    assert dark[200:400].mean() < 0.5 * dark[800:1000].mean()


def test_it_is_told_at_once_and_the_next_run_may_replace_it(picture: Path, tmp_path: Path) -> None:
    events: list[Event] = []
    target = Target.read(picture)
    show_reading(target, read_png(target, picture), tmp_path / "out", events.append)
    notes = [event for event in events if isinstance(event, Note)]
    assert any(str(tmp_path / "out" / "read.png") in note.text for note in notes)
    assert any(note.warning and "left out" in note.text for note in notes)
    assert result_folder(tmp_path / "out").has_a_run


def test_another_read_png_is_not_replaced(picture: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    Image.new("L", (9, 9)).save(tmp_path / "out" / "read.png")
    with refused("read.png", kind=OutputError):
        show_reading(Target.read(picture), b"", tmp_path / "out")


def test_a_failed_search_leaves_the_earlier_run(picture: Path, tmp_path, monkeypatch) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "result.json").write_text('{"schema_version": 2, "tiles": []}')
    (out / "read.png").write_bytes(b"earlier")
    told: list[object] = []

    def fail(*_: object) -> None:
        assert (out / "read-next.png").is_file()  # before the search
        raise RuntimeError

    monkeypatch.setattr("orbiflow.tiles.search.class_search.ClassSearch.search", fail)
    with pytest.raises(RuntimeError):
        finding.escherize(picture, out, on_event=told.append)
    note = f"read-next.png, and in {out / 'read.png'} once this run replaces the earlier one"
    assert any(isinstance(event, Note) and note in event.text for event in told)
    assert (out / "read.png").read_bytes() == b"earlier"
    assert result_folder(out).has_a_run
