"""Contact sheets of tiles: black silhouettes on white, of one area, upright, beside their targets.

    python benchmarks/likeness_sheets.py [--out FOLDER] [--effort fast|normal|best]
        [--only nine|phylopic] [--methods METHOD ...] [--blocks N] [--quick] [NAME ...]

FOLDER/nine.png has of each goal the target, the first tile of the search for overlap and of the search
for likeness, of ARAP, of EST and of the trial; FOLDER/phylopic.png the first three of the twenty
PhyloPic silhouettes; with names FOLDER/sheet.png has those. Tiles that are not at hand are left out.
Searches are kept in FOLDER/tiles: drawing anew takes seconds.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable
from pathlib import Path

import torch
from common import GOALS, Ring
from likeness_methods import METHODS, cell, common_unit, first_tiles, phylopic_names
from PIL import Image, ImageDraw, ImageFont

CELL, HEAD = 220, 24  # pixels

WORDS = {"arap": "ARAP", "est": "EST"}

Row = tuple[str, dict[str, Ring]]


def sheet(rows: list[Row], columns: tuple[str, ...], blocks: int = 1) -> Image.Image:
    """One row for each target, its name above it; rows go on in the next of the blocks."""
    height = -(-len(rows) // blocks)
    step = len(columns) * CELL + HEAD
    page = Image.new("RGB", (blocks * step, height * (CELL + HEAD)), "white")
    pen, font = ImageDraw.Draw(page), ImageFont.load_default(size=14)
    for i, (name, rings) in enumerate(rows):
        x, y = (i // height) * step, (i % height) * (CELL + HEAD)
        unit = common_unit(list(rings.values()), CELL)
        for k, column in enumerate(columns):
            if column in rings:
                page.paste(cell(rings[column], CELL, unit), (x + k * CELL, y + HEAD))
            text = name if column == "target" else WORDS.get(column, column)
            pen.text((x + k * CELL + CELL / 2, y + 12), text, "#555555", font, "mm")
    return page


def found(names: Iterable[str], effort: str, folder: Path, methods: tuple[str, ...]) -> list[Row]:
    """The tiles, a line printed for each target."""
    rows = []
    for name in names:
        begin = time.perf_counter()
        rings = first_tiles(name, effort, folder, methods)
        seconds = time.perf_counter() - begin
        print(
            f"{name:19}{seconds:7.1f} s  {', '.join(m for m in methods if m in rings)}", flush=True
        )
        rows.append((name, rings))
    return rows


def main() -> None:
    """Search where nothing is kept, and draw."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", help="goals or PhyloPic families")
    parser.add_argument("--out", type=Path, default=Path("out/likeness"))
    parser.add_argument("--effort", choices=("fast", "normal", "best"), default="normal")
    parser.add_argument("--only", choices=("nine", "phylopic"))
    parser.add_argument("--methods", nargs="+", choices=METHODS, help="columns beside the target")
    parser.add_argument("--blocks", type=int, help="side by side")
    parser.add_argument("--quick", action="store_true", help="one goal, effort fast")
    options = parser.parse_args()
    torch.set_num_threads(1)
    effort = "fast" if options.quick else options.effort
    ours = ("overlap", "likeness")
    wanted: list[tuple[str, list[str], tuple[str, ...], int]] = []
    if options.quick or options.names:
        wanted.append(("sheet", options.names or ["dolphin_60"], METHODS, 1))
    elif options.only != "phylopic":
        wanted.append(("nine", list(GOALS), METHODS, 1))
    if not wanted or not (options.quick or options.names or options.only):
        wanted.append(("phylopic", phylopic_names(), ours, 2))
    for file, names, usual, usual_blocks in wanted:
        methods = tuple(options.methods or usual)
        blocks = options.blocks or usual_blocks
        rows = found(names, effort, options.out, methods)
        path = options.out / f"{file}.png"
        sheet(rows, ("target", *methods), blocks).save(path)
        print(f"sheet: {path}")


if __name__ == "__main__":
    main()
