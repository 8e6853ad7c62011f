"""Machines with their materials, kept by name."""

import json
from pathlib import Path

import pytest

from exported import tile_of
from orbiflow.runtime import Event, Note
from orbiflow.tiles import ExportSettings, export
from orbiflow.tiles.make import Profiles, profiles
from refusals import refused

NAME = "my K40, 3 mm birch"


@pytest.fixture(name="kept")
def kept_fixture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Profiles:
    monkeypatch.setattr(profiles, "user_config_path", lambda _: tmp_path / "config")
    own = Profiles()
    own.keep(NAME, {"kerf": 0.15, "bed": "120x100mm", "margin": "5mm", "power": 20})
    return own


def test_what_is_given_beats_a_profile_and_a_profile_beats_defaults(
    kept: Profiles, tmp_path: Path
) -> None:
    cut = ExportSettings(cut="pieces", kerf=0.3, tile_size=30.0)
    made = export(tile_of("IH4"), tmp_path / "pieces.svg", cut, profile=NAME).settings
    assert (made.kerf, made.bed, made.margin) == (0.3, (120.0, 100.0), 5.0)
    lines = ExportSettings(cut="skeleton", tile_size=30.0)
    notes: list[Event] = []
    path = tmp_path / "lines.svg"
    made = export(tile_of("IH4"), path, lines, profile=NAME, on_event=notes.append).settings
    left = [note.text for note in notes if isinstance(note, Note) and NAME in note.text]
    assert [text for text in left if "kerf" in text and "margin" not in text] == left != []
    assert (made.kerf, made.margin, made.power) == (0.0, 5.0, 20)  # one line for two: no kerf
    assert json.loads(kept.file.read_text())[NAME]["bed"] == "120x100mm"
    kept.forget(NAME)
    with refused(NAME):
        export(tile_of("IH4"), tmp_path / "none.svg", lines, profile=NAME)


@pytest.mark.parametrize(
    "text", ["{", "[]", '{"a": 1}', '{"a": {"kerv": 1}}', '{"a": {"kerf": "x"}}']
)
def test_a_file_that_is_wrong_is_named(kept: Profiles, text: str) -> None:
    kept.file.write_text(text)
    with refused(kept.file):
        kept.read()
