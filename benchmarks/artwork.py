"""Times of artwork: pages of 3000 x 2000 pixels, from few large tiles to many small ones.

    python benchmarks/artwork.py RESULT [--tile CLASS]

RESULT is the folder of `orbiflow escherize`. Reading it and start-up (imports) are not counted; one
thread.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
import torch
from PIL import Image

from orbiflow.tiles import ArtSettings, EscherTile, artwork, read_result, render_artwork, with_map
from orbiflow.tiles.art.making import png_of
from orbiflow.tiles.motifs.source import Picture


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("result", type=Path)
    parser.add_argument("--tile", default="1")
    options = parser.parse_args()
    torch.set_num_threads(1)
    tile = with_map(read_result(options.result, options.tile))
    render_artwork(artwork(tile, ArtSettings(size=(60, 40), strokes="hatch")))  # imports
    board = checkerboard(tile)
    print(f"{'':34} {'tiles':>6} {'prepare s':>9} {'render s':>9} {'PNG s':>6} {'MB':>6}")
    for size in (3000, 1000, 400, 100):
        row(tile, f"picture, tiles of {size} px", ArtSettings(tile_size=size), board)
    for strokes in ("hatch", "echoes", "feathers"):
        row(tile, strokes, ArtSettings(tile_size=600, strokes=strokes))
    row(tile, "repeat", ArtSettings(tile_size=600, repeat="basic", tolerance=0.05), board)


def row(tile: EscherTile, name: str, settings: ArtSettings, picture: Picture | None = None) -> None:
    start = time.perf_counter()
    art = artwork(tile, settings, picture=picture)
    ready = time.perf_counter()
    pixels = render_artwork(art)
    rendered = time.perf_counter()
    content = png_of(pixels, settings.dpi)
    end = time.perf_counter()
    name = f"{name}, {art.page.width} x {art.page.height}"
    print(
        f"{name:34} {art.page.shown:>6.0f} {ready - start:>9.2f} {rendered - ready:>9.2f} "
        f"{end - rendered:>6.2f} {len(content) / 1e6:>6.1f}"
    )


def checkerboard(tile: EscherTile) -> Picture:
    """A picture of the silhouette, 1500 pixels along its longer side."""
    sides = tile.covered.high - tile.covered.low
    width, height = np.rint(1500 * sides / sides.max()).astype(int)
    rows, columns = np.indices((height, width)) // 50
    image = Image.fromarray((((rows + columns) % 2) * 200 + 30).astype(np.uint8))
    return Picture(image.convert("RGBA"), tile.covered)


if __name__ == "__main__":
    main()
