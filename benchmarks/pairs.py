"""What searches for two figures find, and how long they take.

    python benchmarks/pairs.py [--effort fast|normal] [--workers N] [--sheet FILE.png]
        [--figures FILE.png] [FILE FILE ...]

Without files ten bundled pairs are searched. A row is of the first tile: stars and predicted marks of
both figures, the share of boundaries between them, and seconds until the first certified tile and to
the end. The sheet shows the first tile of each pair. With --figures its figures are drawn black and
upright, numbered in a random order, for people to name; what they are is printed.
"""

from __future__ import annotations

import argparse
import random
import time
from pathlib import Path

import numpy as np
from common import BUNDLED, ROOT
from PIL import Image, ImageDraw

from orbiflow.drawing import font, png_bytes
from orbiflow.runtime import Event, Preview
from orbiflow.tiles import EscherizeSettings, EscherTile, Target, Tiling, escherize, tilings_png
from orbiflow.tiles.tilings import mixing

GALLERY = ROOT / "docs" / "gallery" / "silhouettes"
PAIRS = [
    (BUNDLED / "nagata/pegasus_60.dat", BUNDLED / "nagata/camel_60.dat"),
    (BUNDLED / "nagata/dolphin_60.dat", BUNDLED / "squirrel.dat"),
    (BUNDLED / "nagata/penguin_60.dat", BUNDLED / "nagata/beetle_60.dat"),
    (GALLERY / "cat.dat", GALLERY / "duck.svg"),
    (GALLERY / "seal.svg", GALLERY / "shark.svg"),
    (GALLERY / "swan.svg", GALLERY / "fish.svg"),
    (GALLERY / "elephant.svg", GALLERY / "unicorn.svg"),
    (GALLERY / "lizard.svg", GALLERY / "parrot.svg"),
    (GALLERY / "rooster.svg", GALLERY / "leaf.svg"),
    (GALLERY / "rabbit.svg", GALLERY / "hedgehog.svg"),
]
ENOUGH_STARS = 3.5


def searched(
    one: Path, two: Path, settings: EscherizeSettings
) -> tuple[EscherTile | None, float, bool]:
    """Print the row of a pair; return its tile, its seconds, and whether it has enough stars."""
    begin, first = time.perf_counter(), list[float]()

    def tell(event: Event) -> None:
        if isinstance(event, Preview):
            first.append(event.seconds)

    found = escherize(Target.read(one), settings, second=Target.read(two), on_event=tell)
    seconds, name = time.perf_counter() - begin, f"{one.stem}, {two.stem}"
    if not found.tiles:
        print(f"{name:32} nothing found {seconds:46.0f}", flush=True)
        return None, seconds, False
    best = found.tiles[0]
    figures = best.likenesses
    stars = [own.rating.stars if own.rating else 0.0 for own in figures]
    marks = [own.likeness.fidelity.mark if own.likeness.fidelity else 0.0 for own in figures]
    row = f"{name:32} {best.name:5} {stars[0]:3g} {stars[1]:4g}  {marks[0]:5.2f} {marks[1]:5.2f}"
    count, look = len(found.tiles), min(first, default=0.0)
    print(f"{row} {mixing(best.tiling):7.2f} {count:6} {look:7.1f} {seconds:6.0f}", flush=True)
    return best, seconds, min(stars) >= ENOUGH_STARS


def upright(tile: EscherTile) -> Tiling:
    """Return a pair's tiling with y up."""
    return tile.tiling.transformed(np.diag([1.0, -1.0 if tile.y_down else 1.0]), np.zeros(2))


def figures_png(tiles: list[EscherTile]) -> bytes:
    """Return a picture of all figures of pairs, numbered in a random order, and print their names."""
    figures = [part.figure for tile in tiles for part in tile.figures]
    random.Random(0).shuffle(figures)
    side, columns = 300, 4
    picture = Image.new("RGB", (columns * side, -(-len(figures) // columns) * side), "white")
    pen = ImageDraw.Draw(picture)
    for k, figure in enumerate(figures):
        corner = side * np.array([k % columns, k // columns])
        ring = figure.tile.polygon * (1, 1 if figure.y_down else -1)
        ring = (ring - ring.min(axis=0)) * (side - 70) / np.ptp(ring, axis=0).max()
        pen.polygon([(float(x), float(y)) for x, y in ring + corner + (35, 45)], fill="black")
        pen.text((float(corner[0]) + 6, float(corner[1]) + 6), str(k + 1), "black", font(20))
    print("; ".join(f"{k} {figure.name}" for k, figure in enumerate(figures, 1)))
    return png_bytes(picture)


def main() -> None:
    """Search pairs and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--effort", choices=("fast", "normal"), default="normal")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--sheet", type=Path)
    parser.add_argument("--figures", type=Path)
    parser.add_argument("files", nargs="*", type=Path)
    options = parser.parse_args()
    pairs = list(zip(options.files[::2], options.files[1::2], strict=True)) or PAIRS
    settings = EscherizeSettings(effort=options.effort, workers=options.workers)
    print(f"{'pair':32} class stars      marks       mixed  tiles   first  whole")
    rows = [searched(one, two, settings) for one, two in pairs]
    good, slowest = sum(good for *_, good in rows), max(seconds for _, seconds, _ in rows)
    print(f"{good} of {len(rows)} have {ENOUGH_STARS:g} stars for both; at most {slowest:.0f} s")
    if options.sheet is not None:
        shown = {
            f"{one.stem}, {two.stem}": upright(tile)
            for (one, two), (tile, *_) in zip(pairs, rows, strict=True)
            if tile is not None
        }
        options.sheet.write_bytes(tilings_png(shown, columns=2, width_px=1800))
    if options.figures is not None:
        found = [tile for tile, *_ in rows if tile is not None]
        options.figures.write_bytes(figures_png(found))


if __name__ == "__main__":
    main()
