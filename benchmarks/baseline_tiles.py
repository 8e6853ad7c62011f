"""Tiles of EST and ARAP for the nine goals, scored by our metrics after the best similarity.

    python benchmarks/baseline_tiles.py [GOAL ...]

Needs the tiles, which docs/benchmarks.md tells how to make; the best of each method are the rows
"EST here" and "ARAP here" of `escherization.py`, kept in benchmarks/data/published.json.
"""

from __future__ import annotations

import argparse
import json

import numpy as np
import shapely
from common import DATA, GOALS, aligned, goal, needed

from orbiflow.tiles import Recogniser, compare

METHODS = {"est": "est_euclid_top20", "arap": "arap_EIR_top20"}


def best(name: str, key: str) -> dict[str, float]:
    """IoU, Dice and recognisability of the tile of largest IoU among one method's twenty."""
    folder = needed(DATA / "silhouettes" / "baseline_tiles", "the tiles of EST and ARAP")
    document = json.loads((folder / f"{name}.json").read_text())
    outline = goal(name).outline
    recognise = Recogniser(outline)
    scores = []
    for tile in document[key]:
        ring = np.array(tile["tile"])
        if not shapely.Polygon(ring).is_valid:
            continue
        moved = aligned(ring, outline)
        metrics = compare(moved, outline)
        scores.append((metrics.iou, metrics.dice, recognise(moved).score))
    return dict(zip(("iou", "dice", "recognisability"), max(scores), strict=True))


def main() -> None:
    """Print a row for each goal and method."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("goals", nargs="*")
    for name in parser.parse_args().goals or GOALS:
        for method, key in METHODS.items():
            print(json.dumps({"goal": name, "method": method, **best(name, key)}), flush=True)


if __name__ == "__main__":
    main()
