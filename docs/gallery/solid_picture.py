"""Draw solids: `python docs/gallery/solid_picture.py tile.3mf cutter.3mf --out solids.webp`."""

from __future__ import annotations

import argparse
from pathlib import Path

from PIL import Image

from orbiflow.drawing import read_triangles, solid_picture

WIDTH, HEIGHT, COLUMNS = 560, 420, 3


def main() -> None:
    """Draw the files, three in a row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    rows = -(-len(options.files) // COLUMNS)
    sheet = Image.new("RGB", (WIDTH * COLUMNS, HEIGHT * rows), "white")
    for k, path in enumerate(options.files):
        sheet.paste(
            solid_picture(read_triangles(path), (WIDTH, HEIGHT)),
            (k % COLUMNS * WIDTH, k // COLUMNS * HEIGHT),
        )
    sheet.save(options.out, quality=82)


if __name__ == "__main__":
    main()
