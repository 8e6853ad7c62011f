"""Tiles kept on disk for the benchmarks of likeness: searches are slow, drawing is not."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
from common import LikenessTile


def kept(
    folder: Path | None, name: str, effort: str, search: Callable[[], list[LikenessTile]]
) -> list[LikenessTile]:
    """What the search gives, read from FOLDER/tiles if it is kept there, else kept.

    Args:
        folder: None for a search every time.
        name: of the target.
        effort: of the search.
        search: what finds the tiles.
    """
    if folder is None:
        return search()
    path = folder / "tiles" / f"{name}-likeness-{effort}.json"
    if path.exists():
        return [
            LikenessTile(tile["class"], np.array(tile["ring"]), np.array(tile["source"]))
            for tile in json.loads(path.read_text())
        ]
    tiles = search()
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [
        {"class": tile.name, "ring": tile.ring.tolist(), "source": tile.source.tolist()}
        for tile in tiles
    ]
    path.write_text(json.dumps(rows))
    return tiles
