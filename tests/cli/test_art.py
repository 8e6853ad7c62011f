"""`orbiflow art`: files written, mistakes answered with status 2 and one sentence."""

from __future__ import annotations

import re
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from artworks import EYE, size_of, squirrel, write_run
from orbiflow.drawing import PALETTES
from orbiflow.runtime import Cancel, Cancelled, Note, Written, find
from orbiflow.tiles import Target
from refusals import names


@pytest.fixture(name="result", scope="module")
def result_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("runs") / "squirrel", "IH6")


@pytest.fixture(name="picture", scope="module")
def picture_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pictures") / "red.png"
    Image.new("RGB", size_of(squirrel("IH6"), 200), "#c02040").save(path)
    return path


SMALL = ("--area", "120x80px", "--tile-size", "60px")


def test_a_picture(result: Path, picture: Path, tmp_path: Path, orbiflow) -> None:
    out = tmp_path / "tiles.png"
    outcome = orbiflow("art", result, "--picture", picture, "--outline", "none", *SMALL, "-o", out)
    assert outcome.status == 0, outcome.err
    names(outcome.out, out, 120, 80)
    with Image.open(out) as made:
        assert made.info["dpi"] == pytest.approx((300, 300), abs=0.1)
        assert (np.asarray(made) == (0xC0, 0x20, 0x40)).all()


def test_engraving_with_an_eye_as_svg(result: Path, tmp_path: Path, orbiflow) -> None:
    out = tmp_path / "tiles.svg"
    eye = f"{EYE[0]},{EYE[1]},20"
    outcome = orbiflow("art", result, "--engrave", "--eye", eye, *SMALL, "-o", out)
    assert outcome.status == 0, outcome.err
    assert "currentColor" in out.read_text()


def test_a_repeat_says_its_size(result: Path, tmp_path: Path, orbiflow) -> None:
    out = tmp_path / "cell.png"
    options = ("--repeat", "basic", "--tile-size", "30px", "--colour", "aspect", "--palette", "sea")
    outcome = orbiflow("art", result, *options, "-o", out)
    assert outcome.status == 0, outcome.err
    with Image.open(out) as image:
        width, height = image.size
    names(outcome.out, width, height)


def test_the_default_name(result: Path, tmp_path: Path, orbiflow, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert orbiflow("art", result, *SMALL).status == 0
    assert [path.name for path in tmp_path.iterdir()] == ["squirrel-IH6.png"]


def png_that_says(width: int, height: int) -> bytes:
    def chunk(name: bytes, data: bytes) -> bytes:
        crc = struct.pack(">I", zlib.crc32(name + data))
        return struct.pack(">I", len(data)) + name + data + crc

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", b"") + chunk(b"IEND", b"")


@pytest.mark.parametrize(
    ("options", "about"),
    [
        (("--area", "0x100px"), "--area 0 20000"),
        (("--area", "30000x30000px"), "--area 100"),
        (("--area", "99999999x2px"), "100"),
        (("--area", "0.1x2px"), "--area"),
        (("--area", "big"), "--area big"),
        (("--tile-size", "1px"), "--tile-size 8px"),
        (("--tile-size", "9px", "--area", "9000x9000px"), "20000"),
        (("--palette", "neon"), "neon"),
        (("--outline", "thick"), "--outline thick"),
        (("--eye", "5,5"), "5,5"),
        (("--eye", "here"), "--eye here"),
        (("--eye", "nan,1"), "--eye nan"),
        (("--eye", "210,190,-3"), "--eye 210,190,-3"),
        (("--repeat", "basic", "--area", "30x30px"), "--area --repeat"),
        (("--stretch", "0.1"), "--stretch --repeat"),
        (("--repeat", "basic", "--stretch", "2"), "--stretch 0 0.2"),
        (("--repeat", "basic", "--tile-size", "2500mm"), ""),
        (("--tile", "IH1"), "IH1"),
        (("--picture", "gone.png"), "gone.png"),
    ],
)
def test_mistakes(options, about: str, result: Path, tmp_path: Path, orbiflow) -> None:
    outcome = orbiflow("art", result, *options, "-o", tmp_path / "out.png")
    assert outcome.status == 2
    names(outcome.err, *about.split())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("content", "about"),
    [
        (b"", ""),
        (b"\x89PNG\r\n\x1a\nrubbish", ""),
        (b"MZ rubbish", ""),
        (png_that_says(60_000, 60_000), "128"),
        (png_that_says(40, 90), ""),
    ],
)
def test_pictures_that_are_refused(
    content: bytes, about: str, result: Path, tmp_path: Path, orbiflow
) -> None:
    path = tmp_path / "picture.png"
    path.write_bytes(content)
    outcome = orbiflow("art", result, "--picture", path, "-o", tmp_path / "out.png")
    assert outcome.status == 2
    names(outcome.err, *about.split())
    assert not (tmp_path / "out.png").exists()


def test_a_picture_of_another_aspect(result: Path, tmp_path: Path, orbiflow) -> None:
    path = tmp_path / "square.png"
    Image.new("RGB", (300, 300)).save(path)
    outcome = orbiflow("art", result, "--picture", path, "-o", tmp_path / "out.png")
    assert outcome.status == 2
    names(outcome.err, 300)


@pytest.mark.parametrize("out", ["tiles.tiff", "tiles"])
def test_other_endings(out: str, result: Path, tmp_path: Path, orbiflow) -> None:
    outcome = orbiflow("art", result, "-o", tmp_path / out)
    assert outcome.status == 2
    names(outcome.err, "--out", ".html", ".pdf", ".png", ".svg", out)


def test_the_operation_tells_what_it_did(result: Path, tmp_path: Path) -> None:
    events = []
    given = {"result": result, "out": tmp_path / "a.png", "area": "60x40px", "tile_size": "40px"}
    outcome = find("art").call(given).run(events.append)
    assert outcome.summary["width"] == 60
    assert outcome.summary["class"] == "IH6"
    assert [event.path for event in events if isinstance(event, Written)] == [tmp_path / "a.png"]
    assert any(isinstance(event, Note) for event in events)


def test_nothing_is_written_if_it_is_cancelled(result: Path, tmp_path: Path) -> None:
    cancel = Cancel()
    cancel.cancel()
    call = find("art").call({"result": result, "out": tmp_path / "a.png", "area": "60x40px"})
    with pytest.raises(Cancelled):
        call.run(cancel=cancel)
    assert list(tmp_path.iterdir()) == []


DOCS = (Path(__file__).parents[2] / "docs" / "artwork.md").read_text(encoding="utf-8")


def test_the_page_of_documentation_names_every_option_and_palette(orbiflow) -> None:
    offered = set(re.findall(r"--[a-z][a-z-]+", orbiflow("art", "--help").out)) - {"--help"}
    assert len(offered) > 12
    assert offered <= set(re.findall(r"--[a-z][a-z-]+", DOCS))
    assert set(PALETTES) <= set(re.findall(r"`([a-z-]+)`", DOCS))


def test_the_snippet_of_the_documentation(tmp_path: Path, monkeypatch) -> None:
    (snippet,) = re.findall(r"```python\n(.*?)```", DOCS, flags=re.DOTALL)
    monkeypatch.chdir(tmp_path)
    write_run(tmp_path / "out" / "barbet", "IH5")
    low, high = squirrel("IH5").covered[:2]
    box = " ".join(str(value) for value in (*low, *(high - low)))
    (tmp_path / "examples" / "artwork").mkdir(parents=True)
    drawing = f'<svg viewBox="{box}"><circle cx="{EYE[0]}" cy="{EYE[1]}" r="20"/></svg>'
    (tmp_path / "examples" / "artwork" / "barbet.svg").write_text(drawing)
    names: dict[str, Any] = {}
    exec(compile(snippet, "artwork.md", "exec"), names)
    assert names["pixels"].shape == (600, 900, 3)


def test_the_example_lies_over_its_silhouette() -> None:
    examples = Path(__file__).parents[2] / "examples"
    (box,) = re.findall('viewBox="([^"]+)"', (examples / "artwork" / "barbet.svg").read_text())
    frame = Target.read(examples / "silhouettes" / "barbet.svg").frame
    assert frame.size is not None
    assert [float(value) for value in box.split()] == [*frame.corner, *frame.size]
