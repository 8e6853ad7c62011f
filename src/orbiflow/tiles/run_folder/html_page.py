"""The page of a search, `index.html`: tiles, what to make of them and how, their figures and files.

It works in light and dark, on a phone and on paper, and without its script, which copies commands.
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import PurePath
from typing import Any

import numpy as np
import shapely

from orbiflow.arrays import Array
from orbiflow.drawing import PALETTES, rendered, window_of
from orbiflow.tiles.page import Page
from orbiflow.tiles.pictures import RAMP, STRIP
from orbiflow.tiles.result_file import part_file
from orbiflow.tiles.run_folder.files import READ, TILE_FILES, files_of
from orbiflow.tiles.run_folder.overview import FILLED, LEFT_OUT, OUTLINE
from orbiflow.tiles.search import ClassFailure, rounded_for, why_poor
from orbiflow.tiles.silhouette import Target
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import Colouring, colouring, default_window

TRIED = ("delft", "lagoon", "ochre", "dusk", "forest", "ink")
"""The palettes that the page shows."""


def index_page(
    results: Sequence[EscherTile],
    targets: Sequence[Target],
    folders: Sequence[str],
    *,
    out: str = ".",
    read: bool = False,
    colours: Sequence[Colouring] | None = None,
    failures: Sequence[ClassFailure] = (),
    figures: Sequence[tuple[str, ...]] = (),
) -> str:
    """Return the page of one search's tiles, best first, to be written beside their `folders`.

    `out` is what commands call the folder that the page is in, `read` whether `read.png` is there.
    `colours` has the colouring of each tiling, if it is known already; `figures` are the names of the
    files in each folder besides the `TILE_FILES`.
    """
    names = [PurePath(target.source).name for target in targets]
    name = " and ".join(names)
    extra = figures or [()] * len(results)
    colourings = colours or [colouring(tile.tiling) for tile in results]
    tiles = [
        {
            "found": tile,
            "folder": folder,
            "files": files_of(TILE_FILES + more, len(targets)),
            "patch": _patch(tile, coloured),
            "words": f" a tile like {name}" if len(targets) == 1 else f" {name}",
        }
        for tile, folder, more, coloured in zip(results, folders, extra, colourings, strict=True)
    ]
    return rendered(
        "orbiflow.tiles.run_folder",
        "index_page.html",
        title=f"Tiles that look like {name}",
        names=names,
        name=name,
        stem="-".join(PurePath(name).stem for name in names),
        out=shlex.quote(f"./{out}" if out.startswith("-") else out),
        quote=shlex.quote,
        reads=[part_file(READ, number) for number in range(len(targets))] if read else [],
        part_file=part_file,
        marks=(OUTLINE, LEFT_OUT, FILLED),
        silhouettes=[_silhouette(target) for target in targets],
        notes=[note for target in targets for note in target.notes],
        remarks=[text for text in (rounded_for(results), results and why_poor(results[0])) if text],
        tiles=tiles,
        ramp=RAMP,
        strip=STRIP,
        failures=failures,
    )


PATCH = 150  # the width of a small tiling in its own units, about pixels


def _patch(tile: EscherTile, colours: Colouring) -> dict[str, Any]:
    """Return a small tiling as an SVG has it: a path, and where its copies of each colour are."""
    left, low, right, high = default_window(tile.tiling)
    middle, half = tile.tiling.center, np.array([right - left, high - low]) * 0.3
    window = (*(middle - half).tolist(), *(middle + half).tolist())
    page = Page.of_window(tile.tiling, window, PATCH, y_down=tile.y_down, colouring=colours)
    (width, height), paths = page.size, list[str]()
    copies: list[list[tuple[int, str]]] = [[] for _ in range(page.count)]
    for kind, prototile in enumerate(page.tiling.prototiles):
        uses, shades = page.uses(kind), page.colours[page.copies.prototiles == kind]
        columns = uses.linear[uses.which].transpose(0, 2, 1).reshape(-1, 4)
        numbers = np.concatenate([columns, uses.offsets], axis=1)
        for colour, row in zip(shades.tolist(), numbers, strict=True):
            copies[colour].append((kind, " ".join(f"{x:.4g}" for x in row)))
        ring = shapely.LinearRing(prototile.polygon - prototile.center).simplify(0.2)
        paths.append(_path(shapely.get_coordinates(ring)[:-1]))
    palettes = {way: page.palette(PALETTES[way]) for way in TRIED}
    return {
        "box": f"0 0 {width:.1f} {height:.1f}",
        "paths": paths,
        "copies": copies,
        "palettes": palettes,
    }


def _path(ring: Array) -> str:
    return "M" + "L".join(f"{x:.1f},{y:.1f}" for x, y in ring) + "Z"


def _silhouette(target: Target) -> dict[str, str]:
    """Return the silhouette as the path of an SVG, 100 units along its longer side."""
    left, low, right, high = window_of([target.outline])
    scale = 100 / max(right - left, high - low)
    ring = (target.outline - (left, low if target.y_down else high)) * scale
    ring = ring * (1, 1 if target.y_down else -1)
    size = {"width": f"{(right - left) * scale:.1f}", "height": f"{(high - low) * scale:.1f}"}
    return {**size, "path": _path(ring)}
