"""Other worlds of the tiles of a search: how exactly edges match, what pieces cover, and times.

    python benchmarks/worlds.py out/barbet [--directions 1000000]

RESULT is the folder of a search; its tiles of the nine classes are taken.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from scipy.spatial import KDTree

from orbiflow import ArtSettings, art, read_result
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.worlds import Unfolding, copies, facing, unfolded, usual_orders
from orbiflow.tiles.worlds.curved import disc_of

CLASSES = "IH1", "IH2", "IH3", "IH4", "IH5", "IH6", "IH7", "IH21", "IH28"
SPHERES = (2, 3, 3), (2, 3, 4), (2, 3, 5)


def match(found: Unfolding) -> float:
    """Return the largest distance of an outline's vertex from one of its neighbours'."""
    ring = found.vectors(found.ring)
    around: Any = np.einsum("eij,nj->eni", found.neighbours, ring).reshape(-1, 3)
    return float(np.asarray(KDTree(around).query(ring)[0]).max())


def covered(found: Unfolding, count: int) -> tuple[int, int, int]:
    """Return of how many directions none, one or more pieces have them; sides are divided by 96."""
    ways = np.random.default_rng(0).normal(size=(count, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    turn = facing(found.middle)
    ring, ends = found.ring, np.roll(found.ring, -1, axis=0)
    shares = np.linspace(0, 1, 96, endpoint=False)[:, None, None]
    fine = ((1 - shares) * ring + shares * ends).swapaxes(0, 1).reshape(-1, 2)
    seen = disc_of(found.vectors(fine) @ turn.T)
    polygon = shapely.Polygon(np.column_stack([seen.real, seen.imag]))
    shapely.prepare(polygon)
    hits = np.zeros(count, dtype=int)
    for motion in copies(found, lambda own: np.ones(len(own), dtype=bool), 500):
        local = disc_of(ways @ motion @ turn.T)
        hits += shapely.contains_xy(polygon, local.real, local.imag)
    return int((hits == 0).sum()), int((hits == 1).sum()), int((hits > 1).sum())


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("result", type=Path)
    parser.add_argument("--directions", type=int, default=1_000_000)
    given = parser.parse_args()
    print("tile    orders   edges    in no, one, more pieces")
    for name in CLASSES:
        try:
            tile = read_result(given.result, name)
        except OrbiflowError:
            continue
        spheres = SPHERES if len(usual_orders(tile.tiling.group, -1)) == 3 else ()
        for orders in (*spheres, usual_orders(tile.tiling.group, -1)):
            found = unfolded(tile.tiling, orders)
            hits = covered(found, given.directions) if found.sign > 0 else ""
            print(f"{name:7} {orders!s:9} {match(found):.1e} {hits}", flush=True)
        with tempfile.TemporaryDirectory() as folder:
            files = [("disc", "svg"), ("disc", "png"), *[("sphere", "svg")] * bool(spheres)]
            for world, ending in files:
                begin = time.perf_counter()
                settings = ArtSettings(world=world, format=ending)  # type: ignore[arg-type]
                done = art(tile, Path(folder) / f"a.{ending}", settings)
                spent = time.perf_counter() - begin
                print(
                    f"{name:7} {world}.{ending}: {done.shown:.0f} copies in {spent:.1f} s",
                    flush=True,
                )


if __name__ == "__main__":
    main()
