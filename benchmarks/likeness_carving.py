"""What carving does to a tile: before and after, side by side.

    python benchmarks/likeness_carving.py [--picture FILE.png] [NAME ...]

For each silhouette of data/likeness_shapes.json the best tile of the classes IH4, IH5 and IH6 at effort
fast, as bending leaves it and then carved: the predicted marks, and by how many radians the silhouette
and the tiles turn in all. The picture shows the silhouette in blue and both tiles.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from common import Ring, cell, common_unit, silhouettes
from PIL import Image

from orbiflow.arrays import Complex
from orbiflow.runtime import one_blas_thread
from orbiflow.tiles import CLASSES, LikenessSearch, Target
from orbiflow.tiles.geometry import best_similarity
from orbiflow.tiles.search import bending
from orbiflow.tiles.search.carving import Race
from orbiflow.tiles.search.search_method import Goal

NAMES = ("penguin_80", "squirrel_80", "hollow-cat_80", "flamingo_80", "squid_80", "dolphin_60")
KINDS = ("IH4", "IH5", "IH6")
CELL, BLUE = 220, "#1f5fbf"


def before_and_after(name: str) -> tuple[Ring, Ring, Ring]:
    """Return a silhouette and its best tile before and after carving, and print their figures."""
    target = Target.from_polygon(silhouettes()[name]["outline"])
    settings = replace(LikenessSearch.for_effort("fast"), carved=0)
    found: list[tuple[str, bending.Bent]] = []
    for kind in KINDS:
        with one_blas_thread():
            bents, _ = bending.bent_tiles(
                settings.orientations(Goal(target)), CLASSES[kind], settings
            )
        found += [(kind, bent) for bent in bents[:1]]
    kind, plain = max(found, key=lambda one: one[1].score)
    body = plain.orientation.fine
    both = plain, bending._carved(CLASSES[kind], plain, settings.min_neck, Race())
    marks = "".join(f"{bent.fidelity.mark:8.2f}" for bent in both)
    rings = body.rest[: body.size], *(bent.ring for bent in both)
    turning = "".join(f"{_turning(ring):9.1f}" for ring in rings)
    print(f"{name:20}{kind}{marks}{turning}", flush=True)
    factors = [complex(best_similarity(bent.points, body.rest)) for bent in both]
    before, after = (
        bending.PlacedBent(bent, factor, 0j).place(bent.ring)
        for bent, factor in zip(both, factors, strict=True)
    )
    return np.asarray(target.normal), before, after


def _turning(ring: Complex) -> float:
    steps = np.roll(ring, -1) - ring
    return float(abs(np.angle(steps * np.conj(np.roll(steps, 1)))).sum())


def main() -> None:
    """Print the table and draw the picture."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", default=NAMES)
    parser.add_argument("--picture", type=Path, default=Path("out/likeness-carving.png"))
    options = parser.parse_args()
    torch.set_num_threads(1)
    print(f"{'':24}  marks           turning at rest, bent, carved")
    rows = [before_and_after(name) for name in options.names]
    page = Image.new("RGB", (6 * CELL, -(-len(rows) // 2) * CELL), "white")
    for k, rings in enumerate(rows):
        unit = common_unit(list(rings), CELL)
        for column, ring in enumerate(rings):
            picture = cell(ring, CELL, unit, "black" if column else BLUE)
            page.paste(picture, ((3 * (k % 2) + column) * CELL, k // 2 * CELL))
    options.picture.parent.mkdir(parents=True, exist_ok=True)
    page.save(options.picture)
    print(f"drawn: {options.picture}")


if __name__ == "__main__":
    main()
