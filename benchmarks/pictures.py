"""How long pictures take: the files of a run, and pages of artwork.

    OMP_NUM_THREADS=1 python benchmarks/pictures.py [SILHOUETTE] [--figures] [--quick]

The silhouette is searched in nine classes at effort fast. Files: the least CPU time of three, for all
tiles together. Artwork: pages of 3000 x 2000 pixels of the first tile, from few large tiles to many
small ones, in CPU seconds. Start-up (imports) and the search are not counted. One thread.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from common import BUNDLED
from PIL import Image

from orbiflow.tiles import (
    ArtSettings,
    EscherTile,
    LikenessSearch,
    Over,
    SearchResult,
    Target,
    TileMap,
    artwork,
    colouring,
    escherize,
    overlay_picture,
    overview_png,
    render_artwork,
    tile_picture,
    tiling_picture,
    with_map,
    write_gallery,
)
from orbiflow.tiles.make.art import png_of
from orbiflow.tiles.motifs.carried import Picture


def print_files(found: SearchResult, *, figures: bool) -> None:
    """Print how long the files of a run take."""
    target, results = found.target, found.tiles
    colours = [colouring(result.tiling) for result in results]
    both, y_down = list(zip(results, colours, strict=True)), target.y_down
    print(f"{len(results)} tiles of {target.source}; CPU seconds for all of them")
    row("colouring", lambda: [colouring(result.tiling) for result in results])
    row("tile.svg", lambda: [tile_picture(r.tile, y_down=y_down).svg() for r in results])
    row(
        "tiling.svg",
        lambda: [tiling_picture(r.tile, y_down=y_down, colours=c).svg() for r, c in both],
    )
    row(
        "tiling.png",
        lambda: [tiling_picture(r.tile, y_down=y_down, colours=c).png() for r, c in both],
    )
    row("overlay.png", lambda: [overlay_picture(r.tile, target.outline).png() for r in results])
    row("model", lambda: [(r.map or TileMap()).to_bytes() for r in results])
    row("overview.png", lambda: overview_png(results, [target], colours))
    with tempfile.TemporaryDirectory() as folder:
        row("the whole folder", lambda: write_gallery(found, Path(folder), figures=figures))


def row(name: str, draw: Callable[[], object]) -> None:
    """Print the least CPU time of three."""
    times = []
    for _ in range(3):
        begin = time.process_time()
        draw()
        times.append(time.process_time() - begin)
    print(f"  {name:<18} {min(times):6.2f}", flush=True)


def print_artwork(tile: EscherTile, sizes: tuple[int, ...]) -> None:
    """Print how long pages of artwork take."""
    render_artwork(artwork(tile, ArtSettings(area=(60, 40), dpi=25.4, strokes="hatch")))  # imports
    board = checkerboard(tile)
    print(f"\n{'':34} {'tiles':>6} {'prepare s':>9} {'render s':>9} {'PNG s':>6} {'MB':>6}")
    for size in sizes:
        art_row(tile, f"picture, tiles of {size} px", pixel_page(tile_size=size), board)
    for strokes in ("hatch", "echoes", "feathers"):
        art_row(tile, strokes, pixel_page(tile_size=600, strokes=strokes))
    art_row(tile, "repeat", pixel_page(tile_size=600, repeat="basic", stretch=0.05), board)


def pixel_page(**options: Any) -> ArtSettings:
    """Return settings of a page of 3000 x 2000 pixels, each of which is a millimetre."""
    return ArtSettings(dpi=25.4, **options)


def art_row(
    tile: EscherTile, name: str, settings: ArtSettings, picture: Picture | None = None
) -> None:
    """Print the times of one page."""
    start = time.process_time()
    art = artwork(tile, settings, Over(picture))
    ready = time.process_time()
    pixels = render_artwork(art)
    rendered = time.process_time()
    content = png_of(pixels, settings.dpi)
    end = time.process_time()
    name = f"{name}, {art.width} x {art.height}"
    print(
        f"{name:34} {art.shown:>6.0f} {ready - start:>9.2f} {rendered - ready:>9.2f} "
        f"{end - rendered:>6.2f} {len(content) / 1e6:>6.1f}",
        flush=True,
    )


def checkerboard(tile: EscherTile) -> Picture:
    """A picture of the silhouette, 1500 pixels along its longer side."""
    sides = tile.covered.high - tile.covered.low
    width, height = np.rint(1500 * sides / sides.max()).astype(int)
    rows, columns = np.indices((height, width)) // 50
    image = Image.fromarray((((rows + columns) % 2) * 200 + 30).astype(np.uint8))
    return Picture(image.convert("RGBA"), tile.covered)


def main() -> None:
    """Search, then print both tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("silhouette", nargs="?", default=BUNDLED / "turtle.png")
    parser.add_argument("--figures", action="store_true", help="all pictures that a run can have")
    parser.add_argument("--quick", action="store_true", help="fewer pages of artwork")
    options = parser.parse_args()
    torch.set_num_threads(1)
    target = Target.read(options.silhouette)
    found = escherize(target, method=LikenessSearch.for_effort("fast"))
    print_files(found, figures=options.figures)
    print_artwork(with_map(found.tiles[0]), (3000,) if options.quick else (3000, 1000, 400, 100))


if __name__ == "__main__":
    main()
