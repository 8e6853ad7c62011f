"""`orbiflow batch` and `orbiflow density batch`: what a user sees."""

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import jsonschema
import numpy as np
import pytest
from PIL import Image

from batch.small_batches import rows, write_boot
from cli.conftest import LAUNCH
from orbiflow.runtime import find
from orbiflow.tiles.run_folder.files import TILE_FILES
from outlines import FOLDER
from refusals import names
from small_pairs import small_pairs
from small_searches import small_searches

QUICK = ["--classes", "IH4", "--effort", "fast"]
TESTS = str(Path(__file__).parents[1])
DOCS = Path(__file__).parents[2] / "docs"


def test_every_pair_of_a_folder(tmp_path: Path, orbiflow) -> None:
    (tmp_path / "in").mkdir()
    for name in ("squirrel.dat", "nagata/dolphin_60.dat"):
        shutil.copy(FOLDER / name, tmp_path / "in")
    few = ("--effort", "fast", "--ratio", "1")
    command = ("batch", tmp_path / "in", "--pairs", "all", *few)
    with small_pairs(), small_searches():
        done = orbiflow(*command, "--out", tmp_path / "out")
    assert done.status == 0, done.err
    found = rows(tmp_path / "out")["dolphin_60.dat + squirrel.dat"]
    assert found["certified"] == "yes"
    assert found["folder"] == "dolphin_60-squirrel"
    page = (tmp_path / "out" / "index.html").read_text()
    assert f'<a href="dolphin_60-squirrel/index.html">{float(found["stars"]):g}</a>' in page
    own = tmp_path / "out" / "dolphin_60-squirrel"
    document = json.loads((own / "result.json").read_text())
    jsonschema.validate(document, json.loads((DOCS / "result.schema.json").read_text()))
    left = {path.name for path in own.iterdir()}
    assert left >= {"read.png", "read-2.png", "overview.png", "index.html"}
    name = document["tiles"][0]["class"]
    left = {path.name for path in (own / name).iterdir()}
    assert left == {*TILE_FILES, "overlay-2.png", "model-2.safetensors"}
    ElementTree.parse(own / name / "tiling.svg")
    small = ("--area", "120x80mm")
    orbiflow.done("export", own, "--cut", "pieces", *small, "-o", tmp_path / "pieces.svg")
    assert (tmp_path / "pieces-2.svg").is_file()
    again = orbiflow.refused(*command[:2], "--ratio", "1", "--out", tmp_path / "other")
    names(again.err, "--ratio")


@pytest.mark.skipif(os.name != "posix", reason="sends signals")
def test_ctrl_c_says_how_to_go_on(tmp_path: Path) -> None:
    for name in ("one", "two", "three"):
        write_boot(tmp_path / "in" / f"{name}.json")
    endless = f"import sys; sys.path.append({TESTS!r})\nimport runtime.endless_process\n"
    command = [sys.executable, "-u", "-c", endless + LAUNCH, "batch", tmp_path / "in"]
    command += ["--out", tmp_path / "out", "--workers", "2", *QUICK]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(
        list(map(str, command)), text=True, start_new_session=True, **pipes
    ) as process:
        assert process.stdout is not None
        while "silhouettes for 2 processes" not in (line := process.stdout.readline()):
            assert line, process.communicate()
        os.killpg(process.pid, signal.SIGINT)
        # returns once the last process that holds the pipes has ended
        rest, said = process.communicate()
    assert process.returncode == 130, rest + said
    names(said, 3)
    assert rows(tmp_path / "out") == {}
    assert not (tmp_path / "out" / "one").exists()


def test_tables(tmp_path: Path, orbiflow) -> None:
    (tmp_path / "in").mkdir()
    draws = np.random.default_rng(0).vonmises(0, 2, size=(60, 2))
    np.savetxt(tmp_path / "in" / "one.csv", draws, delimiter=",")
    command = ("density", "batch", tmp_path / "in", "--out", tmp_path / "out")
    command += ("--space", "torus", "--unit", "radians", "--components")
    orbiflow.done(*command, "mixture")
    row = rows(tmp_path / "out")["one.csv"]
    report = json.loads((tmp_path / "out" / "one" / "report.json").read_text())
    assert float(row["log_likelihood"]) == report["log_likelihood"]["natural"]
    assert row["rows"] == "60"
    page = (tmp_path / "out" / "index.html").read_text()
    assert '<a href="one/"><img src="thumbnails/one.png"' in page
    assert 'alt="Density of one.csv"' in page
    for picture in ("one/thumbnail.png", "thumbnails/one.png"):
        with Image.open(tmp_path / "out" / picture) as image:
            assert image.size == (360, 240)
    # it is a density's folder like any other: pictures may come and go there
    model = ("--model", tmp_path / "out" / "one", "--out", tmp_path / "out" / "one")
    for form in ("png", "svg"):
        orbiflow.done("density", "plot", *model, "--format", form)
    orbiflow.done(*command, "chains")
    left = {path.name for path in (tmp_path / "out" / "one").iterdir()}
    assert left == {"density.safetensors", "report.json", "thumbnail.png"}


@pytest.mark.parametrize(
    ("arguments", "about"),
    [
        *((("nowhere",), "nowhere"), (("file.png",), "file.png"), (("empty",), ".png")),
        *((("in", "--out", "in/out"), "in/out"), (("in", "--match", "*.webp"), "1 *.webp")),
    ],
)
def test_mistakes(arguments: tuple[str, ...], about: str, tmp_path, orbiflow, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "file.png").touch()
    write_boot(tmp_path / "in" / "boot.json")
    outcome = orbiflow.refused("batch", *arguments)
    assert outcome.err.startswith("error: ")
    names(outcome.err, *about.split())
    assert not (tmp_path / "batch").exists()
    assert not (tmp_path / "in" / "out").exists()


def test_options_of_a_search_are_those_of_escherize() -> None:
    def options(name: str) -> set[tuple[str, ...]]:
        return {field.option.names for field in find(name).fields if not field.positional}

    of_one = {"--emphasis", "--strength", "--pin", "--pin-angle"}
    of_one |= {"--background", "--second-emphasis", "--second-pin", "--second-called"}
    own, other = options("batch"), options("escherize")
    assert {names[0] for names in other - own} == {*of_one, "--called", "--shown-out", "--verbose"}


def test_a_batch_of_densities_has_all_options_of_a_fit() -> None:
    own, of_one = ({field.name for field in find(f"density {n}").fields} for n in ("batch", "fit"))
    # words of a column are another table's words
    assert of_one - own == {"data", "picture", "given"}
