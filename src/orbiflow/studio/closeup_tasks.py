"""What the studio's workers do for the page of one tile: how it can be pulled, and the pulled tile."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from orbiflow.errors import OrbiflowError
from orbiflow.runtime import (
    NEVER,
    Cancel,
    Outcome,
    Sink,
    ignore,
    make_folder,
    operation,
    write_json,
)
from orbiflow.studio.settings import Job
from orbiflow.studio.tile_files import STAGES, best_stage, put_tile, tile_folder, tile_number

SPACE = "space.json"
PIXELS = (".png", ".jpg", ".jpeg", ".webp")  # of pictures on which lines can be drawn


@operation("studio space")
def space(job: Job, tile: int, *, on_event: Sink = ignore, cancel: Cancel = NEVER) -> Outcome:
    """Write what a browser needs to pull a tile into the tile's folder.

    Args:
        tile: The number of the tile.
    """
    from orbiflow.studio.pulled_tiles import space_json
    from orbiflow.tiles import read_result

    del on_event
    cancel.check()
    own = tile_folder(job.project, tile)
    told = space_json(read_result(own))
    write_json(own.parent / SPACE, told)
    return Outcome({"tile": tile})


@operation("studio pull")
def pull(
    job: Job,
    tile: int,
    parameters: tuple[float, ...],
    *,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Certify a tile that was pulled by hand, and write it as a tile of its own.

    Args:
        tile: The number of the tile that was pulled.
        parameters: Where it was pulled to, in the space that `studio space` wrote.
    """
    from orbiflow.studio.pulled_tiles import pulled, space_json
    from orbiflow.tiles import read_result

    cancel.check()
    found = pulled(read_result(tile_folder(job.project, tile)), parameters)
    number, stage = tile_number(job.task, 0), STAGES[-1]
    put_tile(job.project, number, stage, found, on_event, parent=tile)
    if place := best_stage(job.project, number):  # at hand when it is pulled again
        write_json(place / SPACE, space_json(found))
    return Outcome({"tile": number})


def with_drawing(
    drawing: str, result: Path, files: dict[str, Any], settings: dict[str, Any], scratch: Path
) -> tuple[Path, dict[str, Any], dict[str, Any]]:
    """Return the result, files and settings of a take-away with a drawing on its tile.

    Args:
        drawing: What the project remembers as its drawing, as JSON; "" for nothing.
        result: The tile's folder.
        files: The files that the take-away is given; its `picture` goes below the drawing.
        settings: The settings of `export` or `art`.
        scratch: A folder for what is written on the way.
    """
    from orbiflow.studio.tile_drawing import drawing_settings, with_any_map
    from orbiflow.tiles import read_result, save_tiles

    try:
        parts = json.loads(drawing or "{}")
    except (ValueError, RecursionError):
        raise OrbiflowError("the drawing is no JSON; reload the page") from None
    if not parts or not (parts.get("strokes") or parts.get("eyes")):
        return result, files, settings
    given = read_result(result)
    tile, scratch = with_any_map(given), make_folder(scratch)
    if tile is not given:
        result = save_tiles([tile], scratch / "tile")
    under: Path | None = files.get("picture")
    if under is not None and under.suffix not in PIXELS:
        under = under.with_name("backdrop.png")
    made = drawing_settings(parts, tile, scratch, under)
    if made["picture"] is not None:
        files = {**files, "picture": made["picture"]}
    return result, files, {**settings, "eyes": made["eyes"]} if made["eyes"] else settings
