"""How long the pictures of a run take: nine classes, one core, CPU time.

    OMP_NUM_THREADS=1 python benchmarks/figures.py [silhouette] [--figures]

Start-up (imports) and the search are not counted.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from orbiflow.tiles import (
    LikenessSearch,
    Target,
    TileMap,
    colouring,
    escherize,
    overlay_raster,
    overview_png,
    tile_svg,
    tiling_raster,
    tiling_svg,
    write_gallery,
)

TURTLE = Path(__file__).parents[1] / "examples" / "silhouettes" / "turtle.png"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("silhouette", nargs="?", default=TURTLE)
    parser.add_argument(
        "--figures", action="store_true", help="the rest, too, as the command has it"
    )
    given = parser.parse_args()
    target = Target.read(given.silhouette)
    found = escherize(target, method=LikenessSearch.for_effort("fast"))
    results = found.tiles
    colours = [colouring(result.tile) for result in results]
    both = list(zip(results, colours, strict=True))
    print(f"{len(results)} tiles of {target.source}; CPU seconds for all of them")
    y_down = target.y_down
    row("colouring", lambda: [colouring(result.tile) for result in results])
    row("tile.svg", lambda: [tile_svg(r.tile, y_down=y_down) for r in results])
    row("tiling.svg", lambda: [tiling_svg(r.tile, y_down=y_down, colours=c) for r, c in both])
    row(
        "tiling.png",
        lambda: [tiling_raster(r.tile, y_down=y_down, colours=c).png() for r, c in both],
    )
    row("overlay.png", lambda: [overlay_raster(r.tile, target.outline).png() for r in results])
    row("model", lambda: [(r.map or TileMap()).to_bytes() for r in results])
    row("overview.png", lambda: overview_png(results, target, colours))
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        row("the whole folder", lambda: write_gallery(found, out, figures=given.figures))


def row(name: str, draw: Callable[[], object]) -> None:
    """Print the least CPU time of three."""
    times = []
    for _ in range(3):
        begin = time.process_time()
        draw()
        times.append(time.process_time() - begin)
    print(f"  {name:<18} {min(times):6.2f}")


if __name__ == "__main__":
    main()
