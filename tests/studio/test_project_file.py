"""A project's file and the text of a link: what was saved comes back, and others' do no harm."""

import base64
import io
import json
import re
import zipfile
import zlib
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bent_tiles import bent_tile
from orbiflow.errors import CertificationError, InputFileError, OrbiflowError
from orbiflow.runtime import ignore
from orbiflow.studio import StudioProject, open_project, project_file
from orbiflow.studio.project_file import FORMAT, PROJECT, write_project
from orbiflow.studio.share_link import MAX_TEXT, MAX_UNPACKED, link_text, write_linked
from orbiflow.studio.tile_files import put_tile
from orbiflow.tiles import CLASSES, EscherTile, read_result, save_tiles
from small_pairs import pair_result
from studio.served import SQUARE

DOCUMENT: dict[str, Any] = {
    **{"name": "house", "kind": "tile", "view": {}, "reading": {}},
    **{"input": {"name": "house.json"}, "tiles": [{"id": 7000, "parent": None}]},
}


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    home = tmp_path_factory.mktemp("project")
    (home / "input.json").write_bytes(SQUARE)
    put_tile(home, 7000, "final", EscherTile(bent_tile("IH4", 40.0)), ignore)
    write_project(home, DOCUMENT, home / "house.orbiflow")
    return (home / "house.orbiflow").read_bytes()


def opened(tmp_path: Path, content: bytes) -> project_file.StudioProject:
    file = tmp_path / "house.orbiflow"
    file.write_bytes(content)
    return open_project(file)


def changed(saved: bytes, **entries: bytes | None) -> bytes:
    """Return a file with some entries changed, left out or added."""
    data = io.BytesIO()
    names = {
        name.replace("__", "/").replace("_json", ".json"): own for name, own in entries.items()
    }
    with zipfile.ZipFile(io.BytesIO(saved)) as old, zipfile.ZipFile(data, "w") as new:
        whole = {entry.filename: old.read(entry) for entry in old.infolist()}
        for name, content in {**whole, **names}.items():
            if content is not None:
                new.writestr(name, content)
    return data.getvalue()


def test_what_the_page_of_docs_says_of_it_runs(saved: bytes, tmp_path, monkeypatch, capsys) -> None:
    page = (Path(__file__).parents[2] / "docs" / "studio.md").read_text(encoding="utf-8")
    [snippet] = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "turtle.orbiflow").write_bytes(saved)
    exec(compile(snippet, "studio.md", "exec"), {})
    assert capsys.readouterr().out == "house IH4-IH4 True\n"
    assert read_result(tmp_path / "turtle").certificate.valid
    assert (tmp_path / "turtles.png").stat().st_size > 1000


def test_what_was_saved_is_there_again(saved: bytes, tmp_path: Path) -> None:
    project = opened(tmp_path, saved)
    assert (project.name, project.numbers) == ("house", ((7000, None),))
    assert project.target is not None
    assert project.target.source == "house.json"
    (tile,) = project.tiles
    assert tile.certificate.valid
    # whole, though the file was unpacked for a moment only
    assert save_tiles([tile], tmp_path / "tile")


def test_what_is_no_project(tmp_path: Path) -> None:
    for content in (b"", b"PK", b"not a zip", b"PK\x03\x04" + b"\0" * 100, SQUARE * 1000):
        with pytest.raises(InputFileError, match="not a project"):
            opened(tmp_path, content)


@pytest.mark.parametrize(
    "document",
    [
        *(b"", b"[]", b"{}", b"\xff", b"[" * 100_000),
        json.dumps({**DOCUMENT, "format": "orbiflow-project/9"}).encode(),
        json.dumps({**DOCUMENT, "format": FORMAT, "tiles": {}}).encode(),
        json.dumps({**DOCUMENT, "format": FORMAT, "view": 3}).encode(),
        json.dumps({**DOCUMENT, "format": FORMAT, "reading": {"smooth": 9}}).encode(),
        json.dumps({**DOCUMENT, "format": FORMAT, "reading": {"no such": 1}}).encode(),
    ],
)
def test_what_is_said_of_a_project_is_checked(saved: bytes, document: bytes, tmp_path) -> None:
    with pytest.raises(OrbiflowError):
        opened(tmp_path, changed(saved, **{PROJECT: document}))


def test_entries_lead_nowhere(saved: bytes, tmp_path: Path) -> None:
    names = [
        "../evil",
        "/etc/evil",
        "tiles/../../evil",
        "tiles/1/../../../evil",
        "C:\\evil",
        "x.sh",
    ]
    project = opened(tmp_path, changed(saved, **dict.fromkeys(names, b"x")))
    assert len(project.tiles) == 1
    assert not list(tmp_path.parent.rglob("evil"))


def test_a_bomb_is_not_unpacked(saved: bytes, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(project_file, "MAX_ENTRY_BYTES", 20_000)
    data = io.BytesIO(saved)
    with zipfile.ZipFile(data, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("mend.png", b"\0" * 1_000_000)
    with pytest.raises(InputFileError, match="too large"):
        opened(tmp_path, data.getvalue())
    monkeypatch.setattr(project_file, "MAX_ENTRIES", 2)
    with pytest.raises(InputFileError, match="files"):
        opened(tmp_path, saved)


def test_a_tile_that_does_not_tile_is_refused(saved: bytes, tmp_path: Path) -> None:
    name = "tiles/7000/result.json"
    with zipfile.ZipFile(io.BytesIO(saved)) as archive:
        document = json.loads(archive.read(name))
    document["tiles"][0]["polygon"][3][0] += 5.0
    with pytest.raises(OrbiflowError, match="not certified"):
        opened(tmp_path, changed(saved, **{name: json.dumps(document).encode()}))


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1, max_size=5))
def test_damage_is_an_error_of_ours_or_does_no_harm(
    saved: bytes, tmp_path_factory: pytest.TempPathFactory, damage: list[tuple[int, int]]
) -> None:
    content = bytearray(saved)
    for place, byte in damage:
        content[place % len(content)] = byte
    with suppress(OrbiflowError):
        project = opened(tmp_path_factory.mktemp("damaged"), bytes(content))
        assert all(tile.certificate.valid for tile in project.tiles)


def text_of(folder: Path, tile: EscherTile) -> str:
    return link_text(save_tiles([tile], folder / "saved"), "Mine", {"palette": "sea", "tint": 1})


def opened_of_link(folder: Path, text: str) -> StudioProject:
    write_linked(text, folder / "got.orbiflow")
    return open_project(folder / "got.orbiflow")


def packed(told: Any) -> str:
    return base64.urlsafe_b64encode(zlib.compress(json.dumps(told).encode())).decode().rstrip("=")


def unpacked(text: str) -> Any:
    return json.loads(zlib.decompress(base64.urlsafe_b64decode(text + "=" * (-len(text) % 4))))


@pytest.mark.parametrize("name", CLASSES)
def test_tile_of_each_class_comes_back(tmp_path: Path, name: str) -> None:
    tile = EscherTile(bent_tile(name, 40.0), y_down=True)
    found = opened_of_link(tmp_path, text_of(tmp_path, tile))
    own = found.tiles[0]
    assert found.name == "Mine"
    assert found.document["view"] == {"look": {"palette": "sea"}}
    assert own.certificate.valid
    assert own.isohedral_class == name
    assert own.y_down
    assert np.allclose(own.tile.polygon, tile.tile.polygon, atol=1e-9)


def test_two_figures_come_back(tmp_path: Path) -> None:
    tile = pair_result().tiles[0]
    own = opened_of_link(tmp_path, text_of(tmp_path, tile)).tiles[0]
    assert own.certificate.valid
    assert len(own.figures) == len(tile.figures) == 2


def test_link_names_no_file_of_this_machine_and_has_no_overlaps(tmp_path: Path) -> None:
    told = unpacked(text_of(tmp_path, EscherTile(bent_tile("IH4", 40.0))))
    told["input"] = {"source": "/etc/passwd", "y_down": True}
    told["tile"]["model"] = "/etc/passwd"
    own = opened_of_link(tmp_path, packed(told)).tiles[0]
    assert own.silhouette is not None
    assert own.silhouette["source"] == "shared"
    told["tile"]["polygon"][0][0] += 3.0
    with pytest.raises(CertificationError):
        opened_of_link(tmp_path, packed(told))


@pytest.mark.parametrize(
    "text",
    [
        *("", "nonsense!", "abcd", packed([1, 2]), packed({"tile": 3})),
        packed({"tile": {}})[:-6],
        "ä" * 8,
        base64.urlsafe_b64encode(zlib.compress(b"[" * 100_000)).decode(),
        base64.urlsafe_b64encode(zlib.compress(b" " * (MAX_UNPACKED + 1))).decode(),
        "A" * (MAX_TEXT + 1),
    ],
)
def test_damage_is_said(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputFileError, match="the link is"):
        write_linked(text, tmp_path / "x.orbiflow")


def test_what_is_no_tile_is_refused(tmp_path: Path) -> None:
    for tile in ({}, {"class": 5}, {"polygon": [[0, 0]], "group": {}}):
        with pytest.raises(InputFileError):
            opened_of_link(tmp_path, packed({"schema": 1, "tile": tile}))
