"""Silhouettes near to symmetric: first tiles of the nine classes beside those of symmetric tiles.

    python benchmarks/symmetric_tiles.py [--out FILE.png] [--effort fast|normal|best] [FILE ...]

Each row of the picture has the silhouette, the first two tiles of the nine classes and the first tile
of each class with symmetric tiles that its search adds. The table has their scores, and the processor
time of the search with the added classes over that without, in one process.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from common import BUNDLED, DATA, needed
from likeness_methods import cell, common_unit
from PIL import Image, ImageDraw, ImageFont

from orbiflow.tiles import (
    CLASSES,
    EscherTile,
    LikenessSearch,
    Target,
    certify,
    escherize_class,
    near_symmetry,
)
from orbiflow.tiles.search.search_method import SYMMETRIC, Goal

CELL, HEAD = 220, 24  # pixels
NAGATA, ICONS = BUNDLED / "nagata", DATA / "silhouettes" / "icons"
PHYLOPIC = DATA / "silhouettes" / "phylopic"
FILES = (
    NAGATA / "bat_60.dat",
    PHYLOPIC / "Platysternidae.svg",
    ICONS / "turtle_80.dat",
    ICONS / "bat_80.dat",
    PHYLOPIC / "Hipposideridae.svg",
)

Row = list[tuple[str, EscherTile | Target]]


def tiles(target: Target, names: tuple[str, ...], effort: str) -> tuple[list[EscherTile], float]:
    """The first tile of each class, best first, all certified, and the seconds of processor time."""
    method, begin = LikenessSearch.for_effort(effort), time.process_time()
    found = [escherize_class(target, name, method) for name in names]
    seconds = time.process_time() - begin
    certified = [tile for tile in found if isinstance(tile, EscherTile)]
    assert all(certify(tile.tile).valid for tile in certified)
    return sorted(certified, key=lambda tile: -tile.score), seconds


def row(path: Path, effort: str) -> Row:
    """A silhouette and its tiles, a line printed."""
    target = Target.read(path)
    near = near_symmetry(target.normal)
    added = SYMMETRIC.get(near.stabiliser, ())
    LikenessSearch.for_effort(effort).prepare(Goal(target))
    plain, before = tiles(target, tuple(CLASSES), effort)
    symmetric, more = tiles(target, added, effort) if added else ([], 0.0)
    scores = [
        "  ".join(f"{tile.name} {tile.score:.2f}" for tile in some)
        for some in (plain[:2], symmetric)
    ]
    print(
        f"{path.stem:16}{max(near):5.2f}  x {1 + more / before:.2f}  {scores[0]} | {scores[1]}",
        flush=True,
    )
    shown = [(f"{tile.name} ({tile.group_name})", tile) for tile in (*plain[:2], *symmetric)]
    return [(path.stem, target), *shown]


def page(rows: list[Row]) -> Image.Image:
    """The rows, in black on white."""
    picture = Image.new("RGB", (6 * CELL, len(rows) * (CELL + HEAD)), "white")
    pen, font = ImageDraw.Draw(picture), ImageFont.load_default(size=14)
    for i, own in enumerate(rows):
        for k, (label, shape) in enumerate(own):
            ring = shape.outline if isinstance(shape, Target) else shape.tile.polygon
            ring = ring * ((1, -1) if shape.y_down else (1, 1))
            at = (k * CELL, i * (CELL + HEAD) + HEAD)
            picture.paste(cell(ring, CELL, common_unit([ring], CELL)), at)
            pen.text((at[0] + CELL / 2, at[1] - HEAD / 2), label, "#555555", font, "mm")
    return picture


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="*", type=Path, default=FILES)
    parser.add_argument("--out", type=Path, default=Path("symmetric.png"))
    parser.add_argument("--effort", default="normal")
    own = parser.parse_args()
    print("silhouette      near  time   first of the nine | of symmetric tiles")
    rows = [row(needed(path, f"the silhouette {path.stem}"), own.effort) for path in own.files]
    page(rows).save(own.out)
    print(f"drawn in {own.out}")


if __name__ == "__main__":
    main()
