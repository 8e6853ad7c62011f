"""The gallery's table and page are consistent: files, licences, classes and commands."""

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from gallery_page import PAGE, page, shown
from gallery_table import FREE, Entry, read_table
from orbiflow.drawing import palette
from orbiflow.runtime import Call
from refusals import refused
from shell_lines import call_by_orbiflow

ROOT = Path(__file__).parents[1]
GALLERY = ROOT / "docs" / "gallery"

ENTRIES = read_table()
MOST_BYTES = 250_000
each = pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.name)


@each
def test_files_are_there(entry: Entry) -> None:
    for silhouette, drawing, *_ in entry.silhouettes:
        assert (ROOT / silhouette).is_file()
        assert not drawing or (ROOT / drawing).is_file()
    assert entry.picture.stat().st_size <= MOST_BYTES
    width, height = (int(side) for side in entry.size.removesuffix("px").split("x"))
    with Image.open(entry.picture) as image:
        assert image.size == (width, height)
    assert entry.picture.with_suffix(".svg").is_file() == entry.svg


@each
def test_licences_are_named(entry: Entry) -> None:
    for _, _, image, source in entry.silhouettes:
        assert source.licence in FREE
        assert image
        assert source.by
        assert source.url.startswith("https://")
        # MIT asks for its text
        assert source.text or source.licence != "MIT"
        assert not source.text or (GALLERY / source.text).is_file()


@each
def test_commands_parse(entry: Entry) -> None:
    for words in entry.commands():
        read = parsed(words)
        if words[0] == "art":
            assert palette(read["palette"] or "earth").colours
            assert read["tile"] in (None, entry.tile)


def parsed(words: list[str]) -> dict[str, Any]:
    """What the command line makes of a command: its settings by name."""
    call = call_by_orbiflow(words)
    assert isinstance(call, Call), call
    return call.flat


def test_nothing_is_left_over() -> None:
    used = {(ROOT / entry.silhouette).name for entry in ENTRIES}
    assert {file.name for file in (GALLERY / "silhouettes").iterdir()} <= used
    used = {Path(entry.drawing).name for entry in ENTRIES}
    assert {file.name for file in (GALLERY / "drawings").iterdir()} <= used
    used = {entry.name for entry in ENTRIES}
    assert {file.stem for file in (GALLERY / "pictures").iterdir()} == used
    used = {Path(entry.source.text).name for entry in ENTRIES}
    assert {file.name for file in (GALLERY / "licences").iterdir()} <= used


def test_the_page_is_the_table() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert text == page(ENTRIES), "run python docs/gallery/make.py --page"
    commands = re.findall(r"^    orbiflow (.*)$", text, flags=re.MULTILINE)
    assert len(commands) == sum(len(entry.commands()) for entry in ENTRIES)
    for line, words in zip(
        commands, (words for entry in ENTRIES for words in entry.commands()), strict=True
    ):
        assert shlex.split(line) == words
        assert f"orbiflow {line}" == shown(words)


def test_a_source_that_is_not_there(tmp_path: Path) -> None:
    table = tmp_path / "gallery.toml"
    table.write_text(
        '[source.a]\nname="a"\nby="b"\nurl="c"\nlicence="MIT"\n[[entry]]\nname="owl"\nsource="z"\n'
    )
    with refused("'z'", kind=ValueError):
        read_table(table)
    table.write_text(table.read_text().replace('"z"', '"a"'))
    with refused("owl", kind=ValueError):
        read_table(table)
