"""`orbiflow art`: files written, mistakes answered with status 2 and one sentence."""

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from artworks import size_of, squirrel, write_run
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
    outcome = orbiflow.done(
        "art", result, "--picture", picture, "--outline", "none", *SMALL, "-o", out
    )
    names(outcome.out, out, 120, 80)
    with Image.open(out) as made:
        assert made.info["dpi"] == pytest.approx((300, 300), abs=0.1)
        assert (np.asarray(made) == (0xC0, 0x20, 0x40)).all()


def test_the_default_name(result: Path, tmp_path: Path, orbiflow, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    orbiflow.done("art", result, *SMALL)
    assert [path.name for path in tmp_path.iterdir()] == ["squirrel-IH6.png"]


@pytest.mark.parametrize(
    ("options", "about"),
    [
        *((("--area", "0x100px"), "--area 0 20000"), (("--area", "30000x30000px"), "--area 100")),
        (("--tile-size", "1px"), "--tile-size 8px"),
        *((("--tile-size", "9px", "--area", "9000x9000px"), "20000"), (("--eye", "5,5"), "5,5")),
        (("--eye", "nan,1"), "--eye nan"),
        (("--repeat", "basic", "--area", "30x30px"), "--area --repeat"),
        *((("--repeat", "basic", "--tile-size", "2500mm"), ""), (("--tile", "IH1"), "IH1")),
        (("--picture", "gone.png"), "gone.png"),
    ],
)
def test_mistakes(options, about: str, result: Path, tmp_path: Path, orbiflow) -> None:
    outcome = orbiflow.refused("art", result, *options, "-o", tmp_path / "out.png")
    names(outcome.err, *about.split())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("out", ["tiles.tiff", "tiles"])
def test_other_endings(out: str, result: Path, tmp_path: Path, orbiflow) -> None:
    outcome = orbiflow.refused("art", result, "-o", tmp_path / out)
    names(outcome.err, "--out", ".html", ".pdf", ".png", ".svg", out)


def test_the_example_lies_over_its_silhouette() -> None:
    examples = Path(__file__).parents[2] / "examples"
    (box,) = re.findall('viewBox="([^"]+)"', (examples / "artwork" / "barbet.svg").read_text())
    frame = Target.read(examples / "silhouettes" / "barbet.svg").frame
    assert frame.size is not None
    assert [float(value) for value in box.split()] == [*frame.corner, *frame.size]
