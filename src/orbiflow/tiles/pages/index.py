"""`index.html`: all tiles of a search with their pictures, figures in words, and files to take.

The page has no scripts; it works in light and dark, on a phone and on paper.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath

from orbiflow.drawing import rendered, window_of
from orbiflow.tiles.pages.overview import measures
from orbiflow.tiles.pages.tile_folder import TILE_FILES
from orbiflow.tiles.search import ClassFailure
from orbiflow.tiles.silhouette import Target
from orbiflow.tiles.tile import EscherTile

CHOICES = {
    "tile.svg": "the tile (SVG)",
    "tiling.svg": "the tiling (SVG)",
    "tiling.png": "the tiling (PNG)",
    "overlay.png": "the comparison (PNG)",
    "tiling.pdf": "the tiling, for print (PDF)",
    "overlay.pdf": "the comparison, for print (PDF)",
    "field.png": "the flow (PNG)",
    "field.pdf": "the flow, for print (PDF)",
    "model.safetensors": "the map (safetensors)",
}
"""Files of a class, in words."""


def index_page(
    results: Sequence[EscherTile],
    target: Target,
    folders: Sequence[str],
    *,
    failures: Sequence[ClassFailure] = (),
    figures: Sequence[Sequence[str]] = (),
) -> str:
    """Return the page, to be written beside the folders.

    Args:
        results: The tiles of one search, best first.
        target: The silhouette that was searched for.
        folders: The name of each tile's folder.
        failures: The classes without a tile.
        figures: The names of the files in each folder besides the `TILE_FILES`. Default: none.
    """
    name = PurePath(target.source).name
    extra = figures or [()] * len(results)
    tiles = [
        {
            "found": result,
            "folder": folder,
            "files": (*TILE_FILES, *more),
            "measures": measures(result),
        }
        for result, folder, more in zip(results, folders, extra, strict=True)
    ]
    return rendered(
        "orbiflow.tiles.pages",
        "index_page.html",
        title=f"Tiles that look like {name}",
        name=name,
        silhouette=_silhouette(target),
        compared=any(result.front is not None for result in results),
        notes=target.notes,
        tiles=tiles,
        failures=failures,
        choices=CHOICES,
    )


def _silhouette(target: Target) -> dict[str, str]:
    """Return the silhouette as the path of an SVG, 100 units along its longer side."""
    left, low, right, high = window_of([target.outline])
    scale = 100 / max(right - left, high - low)
    ring = (target.outline - (left, low if target.y_down else high)) * scale
    ring = ring * (1, 1 if target.y_down else -1)
    path = "L".join(f"{x:.1f},{y:.1f}" for x, y in ring)
    size = {"width": f"{(right - left) * scale:.1f}", "height": f"{(high - low) * scale:.1f}"}
    return {**size, "path": f"M{path}Z"}
