"""The files of a project's tiles: each stage of a tile is a folder of its own that appears whole.

A tile's number is the number of the task that made it, times a thousand, and its place among what the
task makes. So a task that starts again gives its tiles the same numbers.
"""

from __future__ import annotations

import json
import secrets
import shutil
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orbiflow.errors import OrbiflowError
from orbiflow.runtime import ItemDone, Sink, write_json
from orbiflow.studio.settings import Job

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
    stage = best_stage(home, number)
    if stage is None:
        raise OrbiflowError("there is no such tile (any more); choose another one")
    return stage / SAVED


def put_tile(
    home: Path,
    number: int,
    stage: str,
    tile: EscherTile,
    on_event: Sink,
    origin: Mapping[str, Any] | None = None,
) -> None:
    """Write a certified `EscherTile` as a stage of a tile, and announce it.

    Args:
        home: The project's folder.
        number: The number of the tile.
        stage: How far its search is.
        tile: The tile.
        on_event: What is told.
        origin: Where it comes from, for its card: `parent`, the tile that it was made from by hand;
            `root`, the first of these; `found_for`, the marks of the silhouettes that it is like;
            `like`, a better tile that it is nearly like.
    """
    from orbiflow.studio.tile_view import tile_card, tile_view
    from orbiflow.tiles import save_tiles

    def write(staged: Path) -> None:
        card = tile_card(tile, number, stage) | dict(origin or {})
        write_json(staged / CARD, card)
        write_json(staged / VIEW, tile_view(card, tile))
        save_tiles([tile], staged / SAVED)

    put_stage(home, number, stage, write, on_event)


def origin_of_pulled(home: Path, number: int) -> dict[str, Any]:
    """Return where a tile comes from that is made by hand from the one with this number."""
    stage = best_stage(home, number)
    card = {} if stage is None else json.loads((stage / CARD).read_text())
    searched_for = {name: card[name] for name in ("found_for",) if name in card}
    return {"parent": number, "root": card.get("root") or number, **searched_for}


def put_stage(
    home: Path, number: int, stage: str, write: Callable[[Path], object], on_event: Sink
) -> None:
    """Let a function write a stage of a tile into a folder, and announce it."""
    place = home / "tiles" / str(number) / stage
    if not place.is_dir():
        staged = home / "tiles" / f".{number}.{secrets.token_hex(4)}.tmp"
        staged.mkdir(parents=True)
        write(staged)
        place.parent.mkdir(parents=True, exist_ok=True)
        with suppress(OSError):  # a worker of a server that died was faster
            staged.rename(place)
        shutil.rmtree(staged, ignore_errors=True)
    announce_tile(number, stage, on_event)


def announce_tile(number: int, stage: str, on_event: Sink) -> None:
    """Send the event that a stage of a tile is there."""
    on_event(ItemDone(f"{number}/{stage}", "done", "tile"))


def announce_tiles(job: Job, on_event: Sink) -> None:
    """Announce tiles that a task found before it was interrupted."""
    for number in tiles_of(job):
        if stage := best_stage(job.project, number):
            announce_tile(number, stage.name, on_event)


def tiles_of(job: Job) -> list[int]:
    """Return the numbers of the tiles that a task has found so far, in order."""
    folders = (job.project / "tiles").glob("[0-9]*")
    numbers = sorted(int(folder.name) for folder in folders if folder.is_dir())
    return [number for number in numbers if number // PLACES == job.task]
