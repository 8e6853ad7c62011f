"""The files of a project's tiles: each stage of a tile is a folder of its own that appears whole.

A tile's number is the number of the task that made it, times a thousand, and its place among what the
task makes. So a task that starts again gives its tiles the same numbers.
"""

from __future__ import annotations

import secrets
import shutil
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from orbiflow.errors import OrbiflowError
from orbiflow.runtime import ItemDone, Sink, write_json

if TYPE_CHECKING:
    from orbiflow.tiles import EscherTile

PLACES = 1000
STAGES = ("sketch", "better", "final")
CARD, VIEW, SAVED = "card.json", "view.json", "tile"


def tile_number(task: int, place: int) -> int:
    """Return the number of a tile that a task makes."""
    return task * PLACES + place % PLACES


def best_stage(home: Path, number: int) -> Path | None:
    """Return the folder of a tile's last stage, or None if there is none."""
    folders = (home / "tiles" / str(number) / stage for stage in reversed(STAGES))
    return next((folder for folder in folders if folder.is_dir()), None)


def tile_folder(home: Path, number: int) -> Path:
    """Return the folder of a tile, as `read_result` takes it.

    Raises `OrbiflowError` if there is none.
    """
    found = best_stage(home, number)
    if found is None:
        raise OrbiflowError("there is no such tile (any more); choose another one")
    return found / SAVED


def put_tile(
    home: Path, number: int, stage: str, tile: EscherTile, on_event: Sink, parent: int | None = None
) -> None:
    """Write a certified `EscherTile` as a stage of a tile, and announce it."""
    from orbiflow.studio.tile_view import tile_card, tile_view
    from orbiflow.tiles import save_tiles

    place = home / "tiles" / str(number) / stage
    if not place.is_dir():
        staged = home / "tiles" / f".{number}.{secrets.token_hex(4)}.tmp"
        staged.mkdir(parents=True)
        card = tile_card(tile, number, stage, parent)
        write_json(staged / CARD, card)
        write_json(staged / VIEW, tile_view(card, tile))
        save_tiles([tile], staged / SAVED)
        place.parent.mkdir(parents=True, exist_ok=True)
        with suppress(OSError):  # a worker of a server that died was faster
            staged.rename(place)
        shutil.rmtree(staged, ignore_errors=True)
    announce_tile(number, stage, on_event)


def announce_tile(number: int, stage: str, on_event: Sink) -> None:
    """Send the event that a stage of a tile is there."""
    on_event(ItemDone(f"{number}/{stage}", "done", "tile"))
