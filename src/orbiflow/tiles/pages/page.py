"""The page of a search, `index.html`: tiles, what to make of them and how, their figures and files.

It works in light and dark, on a phone and on paper, and without its script, which copies commands.
"""

from __future__ import annotations

import shlex
from bisect import bisect_right
from collections.abc import Sequence
from pathlib import PurePath
from typing import Any, NamedTuple

import numpy as np
import shapely

from orbiflow.arrays import Array
from orbiflow.drawing import PALETTES, STRIP, rendered, window_of
from orbiflow.tiles.pictures import RAMP, default_window
from orbiflow.tiles.search import ClassFailure
from orbiflow.tiles.silhouette import Target
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import Colouring, colouring, copies_meeting


class Measure(NamedTuple):
    """A number in words: its `name`, its `value` as text, a judgement (`words`), and its `meaning`."""

    name: str
    value: str
    words: str
    meaning: str


def measures(result: EscherTile) -> list[Measure]:
    """Return a tile's measures, the most important first, without those that were not taken."""
    meaning = "How much of the outline's shape bending left, 0 to 1."
    if result.fidelity is None:
        meaning = "Overlap and recognisability together, 0 to 1."
    found = [Measure("Score", f"{result.score:.3g}", "ranks the tiles", meaning)]
    bent, thinnest = result.deformation, result.thinnest
    if bent is not None:
        words = ("bent a little", "bent somewhat", "bent much", "bent very much")
        word = words[bisect_right((0.1, 0.2, 0.35), bent)]
        meaning = "What bending the silhouette into the tile costs; 0 is the silhouette itself."
        found.append(Measure("Deformation", f"{bent:.3f}", word, meaning))
    common = f"{100 * result.metrics.dice:.0f} % of their areas in common"
    meaning = "Area common to tile and silhouette, as it is, over the area of both together."
    found.append(Measure("Overlap (IoU)", f"{result.metrics.iou:.3f}", common, meaning))
    same = result.recognisability
    meaning = "Share of the outlines that is found again, point by point; 1 is all."
    found.append(Measure("Recognised", f"{same.score:.2f}", f"limbs {same.limbs:.2f}", meaning))
    if thinnest is not None:
        thin = thinnest.share < max(result.min_neck, 0.02)
        word = "thin: take care when you cut" if thin else "sound"
        meaning = "Its width, in hundredths of the square root of the tile's area."
        found.append(Measure("Thinnest neck", f"{100 * thinnest.share:.1f} %", word, meaning))
    if result.pinned is not None:
        word = "as they were" if result.pinned < 0.01 else "changed"
        meaning = "How far the worst of them is from similar to what it was; 0 is the same shape."
        found.append(Measure("Pinned parts", f"{result.pinned:.4f}", word, meaning))
    return found


# The files in every tile's folder
TILE_FILES = ("tile.svg", "tiling.svg", "tiling.png", "overlay.png", "model.safetensors")

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


MAKINGS = {
    "Laser, every line cut once": ("export", "--for laser", ".svg"),
    "Laser, pieces apart": ("export", "--for laser --cut pieces", "-pieces.svg"),
    "Print": ("export", "--for print", ".pdf"),
    "Artwork, engraved": ("art", "--engrave", "-art.png"),
    "Animation": ("animate", "", ".gif"),
    "A tile in 3D": ("solid", "", ".stl"),
    "Cookie cutter": ("solid", "--kind cutter", "-cutter.stl"),
}
"""What can be made of a tile: the command, its options, and the end of the file's name."""

TRIED = ("delft", "lagoon", "ochre", "dusk", "forest", "ink")
"""The palettes that the page shows."""


def index_page(
    results: Sequence[EscherTile],
    target: Target,
    folders: Sequence[str],
    *,
    out: str = ".",
    read: bool = False,
    colours: Sequence[Colouring] | None = None,
    failures: Sequence[ClassFailure] = (),
    figures: Sequence[tuple[str, ...]] = (),
) -> str:
    """Return the page of one search's tiles, best first, to be written beside their `folders`.

    Args:
        results: The tiles.
        target: The silhouette.
        folders: The names of the tiles' folders.
        out: What commands call the folder that the page is in.
        read: Whether `read.png` is beside the page.
        colours: The colouring of each tiling, if it is known already.
        failures: The classes without a tile.
        figures: The names of the files in each folder besides the `TILE_FILES`.
    """
    name = PurePath(target.source).name
    extra = figures or [()] * len(results)
    known = colours or [colouring(tile.tile) for tile in results]
    tiles = [
        {
            "found": tile,
            "folder": folder,
            "files": TILE_FILES + more,
            "measures": measures(tile),
            "makings": _makings(tile, folder, rank, f"{PurePath(name).stem}-{folder}"),
            "patch": _patch(tile, own),
        }
        for rank, (tile, folder, more, own) in enumerate(
            zip(results, folders, extra, known, strict=True), 1
        )
    ]
    return rendered(
        "orbiflow.tiles.pages",
        "index_page.html",
        title=f"Tiles that look like {name}",
        name=name,
        out=shlex.quote(f"./{out}" if out.startswith("-") else out),
        read=read,
        silhouette=_silhouette(target),
        compared=any(result.front is not None for result in results),
        notes=target.notes,
        tiles=tiles,
        palettes={way: PALETTES[way] for way in TRIED},
        ramp=RAMP,
        strip=STRIP,
        failures=failures,
        choices=CHOICES,
    )


def _makings(tile: EscherTile, folder: str, rank: int, stem: str) -> list[tuple[str, str, str]]:
    """Return what can be made: a title or a palette, a command, and the words after its folder."""
    which = folder if folder == tile.isohedral_class else str(rank)
    force = "" if tile.certificate.valid else "--force"
    makings = {**MAKINGS, **{way: ("art", f"--palette {way}", f"-{way}.png") for way in TRIED}}
    return [
        (title, verb, " ".join(["--tile", which, *force.split(), *options.split(), "-o", file]))
        for title, (verb, options, end) in makings.items()
        for file in [shlex.quote(stem + end)]
    ]


PATCH = 150  # the width of a small tiling in its own units, about pixels


def _patch(tile: EscherTile, colours: Colouring) -> dict[str, Any]:
    """Return a small tiling as an SVG has it: a path, and where its copies of each colour are."""
    left, low, right, high = default_window(tile.tile)
    middle, half = tile.tile.center, np.array([right - left, high - low]) * 0.3
    scale = np.array([1, 1 if tile.y_down else -1]) * PATCH / (2 * half[0])
    copies = copies_meeting(tile.tile, (*(middle - half), *(middle + half)))
    linear = copies.group.linear_parts[copies.cosets] * scale[:, None] / scale
    places = (copies.images(middle[None])[:, 0] - middle) * scale
    numbers = np.concatenate([linear.transpose(0, 2, 1).reshape(-1, 4), places], axis=1)
    matrices = [" ".join(f"{x:.4g}" for x in row) for row in numbers]
    ring = shapely.LinearRing((tile.tile.polygon - middle) * scale).simplify(0.2)
    own = colours.colours(copies)
    width, height = (2 * half * abs(scale)).tolist()
    return {
        "box": f"{-width / 2:.1f} {-height / 2:.1f} {width:.1f} {height:.1f}",
        "path": _path(shapely.get_coordinates(ring)[:-1]),
        "copies": [[matrices[k] for k in np.flatnonzero(own == n)] for n in range(colours.count)],
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
