"""The text of a link: the tile comes back from it, certified; what others wrote does no harm."""

import base64
import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bent_tiles import bent_tile
from orbiflow.errors import CertificationError, InputFileError
from orbiflow.studio import StudioProject, open_project
from orbiflow.studio.share_link import MAX_TEXT, MAX_UNPACKED, link_text, write_linked
from orbiflow.tiles import CLASSES, EscherTile, save_tiles
from small_pairs import pair_result


def text_of(folder: Path, tile: EscherTile) -> str:
    return link_text(save_tiles([tile], folder / "saved"), "Mine", {"palette": "sea", "tint": 1})


def opened(folder: Path, text: str) -> StudioProject:
    write_linked(text, folder / "got.orbiflow")
    return open_project(folder / "got.orbiflow")


def packed(told: Any) -> str:
    return base64.urlsafe_b64encode(zlib.compress(json.dumps(told).encode())).decode().rstrip("=")


def unpacked(text: str) -> Any:
    return json.loads(zlib.decompress(base64.urlsafe_b64decode(text + "=" * (-len(text) % 4))))


@pytest.mark.parametrize("name", CLASSES)
def test_tile_of_each_class_comes_back(tmp_path: Path, name: str) -> None:
    tile = EscherTile(bent_tile(name, 40.0), y_down=True)
    found = opened(tmp_path, text_of(tmp_path, tile))
    own = found.tiles[0]
    assert found.name == "Mine"
    assert found.document["view"] == {"look": {"palette": "sea"}}
    assert own.certificate.valid
    assert own.isohedral_class == name
    assert own.y_down
    assert np.allclose(own.tile.polygon, tile.tile.polygon, atol=1e-9)


def test_two_figures_come_back(tmp_path: Path) -> None:
    tile = pair_result().tiles[0]
    own = opened(tmp_path, text_of(tmp_path, tile)).tiles[0]
    assert own.certificate.valid
    assert len(own.figures) == len(tile.figures) == 2


def test_tile_with_overlaps_is_refused(tmp_path: Path) -> None:
    told = unpacked(text_of(tmp_path, EscherTile(bent_tile("IH4", 40.0))))
    told["tile"]["polygon"][0][0] += 3.0
    with pytest.raises(CertificationError):
        opened(tmp_path, packed(told))


def test_link_names_no_file_of_this_machine(tmp_path: Path) -> None:
    told = unpacked(text_of(tmp_path, EscherTile(bent_tile("IH4", 40.0))))
    told["input"] = {"source": "/etc/passwd", "y_down": True}
    told["tile"]["model"] = "/etc/passwd"
    own = opened(tmp_path, packed(told)).tiles[0]
    assert own.silhouette is not None
    assert own.silhouette["source"] == "shared"


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


@pytest.mark.parametrize("tile", [{}, {"class": 5}, {"polygon": [[0, 0]], "group": {}}])
def test_what_is_no_tile_is_refused(tmp_path: Path, tile: Any) -> None:
    with pytest.raises(InputFileError):
        opened(tmp_path, packed({"schema": 1, "tile": tile}))
