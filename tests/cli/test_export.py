"""`orbiflow export` and `orbiflow art`: files written, mistakes answered with status 2."""

import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pypdfium2
import pytest
from PIL import Image

from artworks import size_of, squirrel, write_run
from exported import boot_run, entry
from orbiflow.runtime import Finished, Written, find
from orbiflow.tiles import Target
from refusals import names


@pytest.fixture(name="result", scope="module")
def result_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return boot_run(tmp_path_factory.mktemp("runs") / "boot")


@pytest.mark.parametrize(
    ("options", "size"), [((), (85, 57)), (("--area", "double", "--tile-size", "3cm"), (180, 120))]
)
def test_a_figure_for_a_paper_is_as_wide_as_its_column(
    options: tuple[str, ...], size: tuple[int, int], result: Path, tmp_path: Path, orbiflow
) -> None:
    out = tmp_path / "figure.pdf"
    orbiflow.done("export", result, "--for", "paper", *options, "--out", out)
    page = pypdfium2.PdfDocument(out)[0]
    millimetres = (page.get_width() * 25.4 / 72, page.get_height() * 25.4 / 72)
    assert millimetres == pytest.approx(size, abs=0.01)


def test_numbered_sheets_and_their_events(result: Path, tmp_path: Path) -> None:
    events: list[Any] = []
    given = {"cut": "pieces", "copies": 12, "bed": "12x9cm", "calibrate": True}
    call = find("export").call({"result": result, "out": tmp_path / "cut.svg", **given})
    outcome = call.run(events.append)
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == [f"cut-{k}.svg" for k in range(1, len(names) + 1)]
    assert [e.path.name for e in events if isinstance(e, Written)] == names
    assert isinstance(events[-1], Finished)
    assert outcome.summary == events[-1].summary
    assert outcome.summary["tiles"] == 12
    assert all("calibration" in (tmp_path / name).read_text() for name in names)


MISTAKES: dict[str, tuple[list[str], str]] = {
    "one side": (["--bed", "300mm"], "--bed 300mm 300x200mm"),
    "small page": (["--area", "10x10mm"], "10"),
    "wide kerf": (["--cut", "pieces", "--kerf", "5cm"], ""),
    "class": (["--tile", "IH99"], "IH99"),
    "class not there": (["--tile", "IH1"], "IH1 IH6 IH4"),
    "rank": (["--tile", "4"], "4 1 3"),
    "ending": (["--format", "pdf"], "--out .svg --format pdf"),
    "dots of no picture": (["--dpi", "600"], "--dpi --format png svg"),
    "colours of lines": (["--for", "laser", "--palette", "sea"], "--palette --for laser"),
    "tiny tiles": (["--tile-size", "0.5mm", "--tolerance", "0.01mm"], "20000"),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_mistakes(case: str, result: Path, tmp_path: Path, orbiflow) -> None:
    options, about = MISTAKES[case]
    outcome = orbiflow.refused("export", result, "--out", tmp_path / "a.svg", *options)
    names(outcome.err, *about.split())
    assert not list(tmp_path.iterdir())


def damaged(**changes: Any) -> str:
    document = {"schema_version": 2, "input": {"source": "boot.png", "y_down": True}}
    return json.dumps({**document, "tiles": [{**entry("IH6"), **changes}]})


BAD_RESULTS: dict[str, tuple[str | None, str]] = {
    "none": (None, "result.json"),
    "no JSON": ("{", "result.json"),
    "a list": ("[]", "result.json"),
    "other JSON": ('{"tiles": []}', "result.json"),
    "no tile": ('{"tiles": [], "input": {"source": "a", "y_down": true}}', ""),
    "polygon": (damaged(polygon=[[0, 0]]), "1"),
    "lattice": (damaged(group={"name": "p1", "lattice": [[1, 1], [1, 1]], "cosets": []}), "1"),
    "nan": (damaged(polygon=[[0, 0], [1, 0], [float("nan"), 1], [0, 0]]), "1"),
    "not certified": (damaged(polygon=[[0, 0], [7, 0], [7, 7], [0, 0]]), "boot-IH6"),
}


@pytest.mark.parametrize("case", BAD_RESULTS)
def test_bad_results(case: str, tmp_path: Path, orbiflow) -> None:
    text, about = BAD_RESULTS[case]
    if text is not None:
        (tmp_path / "result.json").write_text(text)
    outcome = orbiflow.refused("export", tmp_path, "--out", tmp_path / "a.svg")
    names(outcome.err, *about.split())
    assert not (tmp_path / "a.svg").exists()


@pytest.fixture(name="runs")
def runs_fixture(result: Path, tmp_path: Path) -> Path:
    """A folder of two runs with the folders of their tiles."""
    for name in ("boot", "shoe"):
        shutil.copytree(result, tmp_path / name)
        for tile in ("IH6", "IH4", "IH6-2", "mine"):
            (tmp_path / name / tile).mkdir()
    return tmp_path


@pytest.mark.parametrize(
    ("place", "tile"),
    [("boot/IH6-2", None), ("boot/IH6-2", "3"), ("boot/IH4", "IH4"), ("boot/../boot/IH6", "1")],
)
def test_the_folder_of_a_tile(place: str, tile: str | None, runs: Path, orbiflow) -> None:
    own, whole = runs / "own.json", runs / "whole.json"
    choice = () if tile is None else ("--tile", tile)
    orbiflow.done("export", runs / place, *choice, "--out", own)
    rank = {"IH6": 1, "IH4": 2, "IH6-2": 3}[Path(place).name]
    orbiflow.done("export", runs / "boot", "--tile", rank, "--out", whole)
    assert own.read_bytes() == whole.read_bytes()


def test_a_silhouette_is_escherized_first(tmp_path: Path, orbiflow) -> None:
    silhouettes = {"a.png": b"\x89PNG\r\n\x1a\n", "polygon.dat": b"3\n0 0\n1 0\n0 1\n"}
    for name, content in silhouettes.items():
        (tmp_path / name).write_bytes(content)
        outcome = orbiflow.refused("export", tmp_path / name, "--out", tmp_path / "a.svg")
        names(outcome.err, f"orbiflow escherize {tmp_path / name}")


@pytest.mark.parametrize(
    ("place", "tile", "about"),
    [
        ("", None, "boot shoe {}/boot"),
        ("boot/IH4", "IH6", "IH6"),
        ("boot/IH4", "1", "{}/boot"),
        ("boot/mine", None, "IH6 IH4 IH6-2 mine"),
    ],
)
def test_folders_in_which_no_tile_is_meant(
    place: str, tile: str | None, about: str, runs: Path, orbiflow
) -> None:
    choice = () if tile is None else ("--tile", tile)
    outcome = orbiflow.refused("export", runs / place, *choice, "--out", runs / "a.svg")
    names(outcome.err, *about.format(runs).split())


def test_places_and_endings_that_cannot_be_written(result: Path, tmp_path: Path, orbiflow) -> None:
    for where in ("", "none/a.svg"):
        outcome = orbiflow.refused("export", result, "--out", tmp_path / where)
        names(outcome.err, where or tmp_path)
        assert not list(tmp_path.iterdir())
    outcome = orbiflow.refused("export", result, "--out", tmp_path / "boot.eps")
    names(outcome.err, "--out", ".eps", "--format", ".svg")
    assert not list(tmp_path.glob("boot*"))
    orbiflow.done("export", result, "--format", "svg", "--out", tmp_path / "boot.eps")


@pytest.fixture(name="result_of_art", scope="module")
def result_fixture_of_art(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("runs") / "squirrel", "IH6")


@pytest.fixture(name="picture", scope="module")
def picture_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pictures") / "red.png"
    Image.new("RGB", size_of(squirrel("IH6"), 200), "#c02040").save(path)
    return path


SMALL = ("--area", "120x80px", "--tile-size", "60px")


def test_a_picture(result_of_art: Path, picture: Path, tmp_path: Path, orbiflow) -> None:
    out = tmp_path / "tiles.png"
    options = ("--picture", picture, "--outline", "none", *SMALL, "-o", out)
    names(orbiflow.done("art", result_of_art, *options).out, out, 120, 80)
    with Image.open(out) as made:
        assert made.info["dpi"] == pytest.approx((300, 300), abs=0.1)
        assert (np.asarray(made) == (0xC0, 0x20, 0x40)).all()


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
def test_mistakes_of_art(
    options, about: str, result_of_art: Path, tmp_path: Path, orbiflow
) -> None:
    outcome = orbiflow.refused("art", result_of_art, *options, "-o", tmp_path / "out.png")
    names(outcome.err, *about.split())
    assert list(tmp_path.iterdir()) == []


def test_other_endings_and_the_default_name(
    result_of_art: Path, tmp_path: Path, orbiflow, monkeypatch
) -> None:
    for out in ("tiles.tiff", "tiles"):
        outcome = orbiflow.refused("art", result_of_art, "-o", tmp_path / out)
        names(outcome.err, "--out", ".html", ".pdf", ".png", ".svg", out)
    monkeypatch.chdir(tmp_path)
    orbiflow.done("art", result_of_art, *SMALL)
    assert [path.name for path in tmp_path.iterdir()] == ["squirrel-IH6.png"]


def test_the_example_lies_over_its_silhouette() -> None:
    examples = Path(__file__).parents[2] / "examples"
    (box,) = re.findall('viewBox="([^"]+)"', (examples / "artwork" / "barbet.svg").read_text())
    frame = Target.read(examples / "silhouettes" / "barbet.svg").frame
    assert frame.size is not None
    assert [float(value) for value in box.split()] == [*frame.corner, *frame.size]
