"""A user's mistakes: status 2, one message that says what is wrong, nothing written."""

from pathlib import Path

import pytest
from PIL import Image, ImageDraw

from refusals import names


def disc(folder: Path) -> Path:
    image = Image.new("L", (60, 60), 255)
    ImageDraw.Draw(image).ellipse([10, 15, 45, 50], fill=0)
    image.save(folder / "disc.png")
    return folder / "disc.png"


OCCUPANCY = ["--method", "occupancy"]
BAD_OPTIONS: dict[str, tuple[list[str], str]] = {
    "class": (["--classes", "IH4,IH98"], "IH98"),
    "no class": (["--classes", " , "], "--classes IH4"),
    "frequency of likeness": (["--max-frequency", "5"], "--max-frequency --objective"),
    "objective of occupancy": ([*OCCUPANCY, "--objective", "likeness"], "--objective --method"),
    "other method's option": (["--turns", "3"], "--turns --method occupancy"),
    "emphasis": (["--emphasis", "nowhere.png"], "nowhere.png"),
    "emphasis for occupancy": ([*OCCUPANCY, "--emphasis", "m.png"], "--emphasis --method"),
    "effort of occupancy": ([*OCCUPANCY, "--effort", "fast"], "--effort --method"),
    "pin outside": (["--pin", "5000,5000"], "5000,5000"),
    "pin that is no file": (["--pin", "head.png"], "head.png"),
    "pins of overlap": (["--objective", "overlap", "--pin", "9,9"], "--pin --objective"),
    "pins of occupancy": ([*OCCUPANCY, "--pin", "9,9"], "--pin --method"),
    "angle of nothing": (["--pin-angle"], "--pin-angle --pin"),
    "ratio of one": (["--ratio", "1"], "--ratio"),
    "second pin of one": (["--second-pin", "9,9"], "--second-pin"),
    "ratio that is none": (["--ratio", "big"], "--ratio big"),
}


@pytest.mark.parametrize("case", BAD_OPTIONS)
def test_bad_options(case: str, tmp_path: Path, orbiflow) -> None:
    options, about = BAD_OPTIONS[case]
    out = tmp_path / "out"
    outcome = orbiflow.refused("escherize", disc(tmp_path), "--out", out, *options)
    names(outcome.err, *about.split())
    assert not out.exists()


@pytest.mark.parametrize("below", ["", "sub", "sub/folder"])
def test_a_file_in_the_way_of_the_folder(below: str, tmp_path: Path, orbiflow) -> None:
    wall = tmp_path / "wall"
    wall.write_text("keep me")
    command = ("escherize", disc(tmp_path), "--out", wall / below, "--classes", "IH4")
    names(orbiflow.refused(*command).err, wall / below)
    assert wall.read_text() == "keep me"


def test_a_markup_like_name_is_printed_as_it_is(tmp_path: Path, orbiflow) -> None:
    outcome = orbiflow("escherize", tmp_path / "[bold]x[/bold].png", "--out", tmp_path / "out")
    assert "[bold]x[/bold].png" in outcome.err


def test_a_mistake_in_a_process_of_its_own(tmp_path: Path, orbiflow_process) -> None:
    outcome = orbiflow_process("escherize", tmp_path / "none.png", "--out", tmp_path / "out")
    assert outcome.status == 2
    names(outcome.err, tmp_path / "none.png")
    assert outcome.out == ""
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("words", ["--out --force", "--seed --out x", "--for -o x.svg"])
def test_an_option_is_not_taken_for_the_value_of_another(words: str, orbiflow) -> None:
    command = "export" if words.startswith("--for") else "escherize"
    outcome = orbiflow.refused(command, "silhouette.png", *words.split())
    assert outcome.err.startswith(f"error: {words.split()[0]} needs a value; give ")
    names(orbiflow.refused("escherize").err, "IMAGE")
