"""How the search's time grows with the number of an outline's vertices, and with its length.

    OMP_NUM_THREADS=1 python benchmarks/long_outlines.py [--effort fast|normal] [--quick]

The bundled turtle with 60 to 240 vertices evenly along its outline, then a squirrel and a spider with
long thin legs. Processor seconds of the search alone, in one process, in all nine classes.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from common import BUNDLED, goal

from orbiflow.tiles import LikenessSearch, Target, escherize
from orbiflow.tiles.geometry import resampled

VERTICES = (60, 90, 120, 180, 240)


def seconds(target: Target, effort: str) -> float:
    """Processor seconds of a search."""
    begin = time.process_time()
    found = escherize(target, method=LikenessSearch.for_effort(effort))
    assert found.tiles
    assert all(tile.certificate.valid for tile in found.tiles)
    return time.process_time() - begin


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--effort", choices=("fast", "normal"), default="fast")
    parser.add_argument("--quick", action="store_true", help="the fewest vertices alone")
    options = parser.parse_args()
    turtle = Target.read(BUNDLED / "turtle.png").outline
    sizes = VERTICES[:1] if options.quick else VERTICES
    print(f"turtle, effort {options.effort}: vertices, processor seconds")
    spent: list[float] = []
    for size in sizes:
        spent.append(seconds(Target.from_polygon(resampled(turtle, size)), options.effort))
        print(f"{size:8}{spent[-1]:10.1f}", flush=True)
    if options.quick:
        return
    power = float(np.polyfit(np.log(sizes), np.log(spent), 1)[0])
    print(f"seconds grow as the number of vertices to the power {power:.2f}")
    squirrel, spider = (
        seconds(goal(name), options.effort) for name in ("squirrel1_60", "spider_120")
    )
    print(f"squirrel {squirrel:.1f} s, spider {spider:.1f} s: {spider / squirrel:.1f} times")


if __name__ == "__main__":
    main()
