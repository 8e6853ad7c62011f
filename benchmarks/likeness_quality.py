"""What the search for likeness gives on the nine goals: fit, necks, hairs and slits, time.

    python benchmarks/likeness_quality.py [--effort fast|normal|best] [--workers 2] [NAME ...]

Of each goal's first tile: its score, IoU with the silhouette as it is, IoU with the bent silhouette;
the narrowest neck of the silhouette and of the tile in square roots of their areas; shares of the
outline on parts (hairs) and beside gaps (slits) thinner than 1 % of the size, of the silhouette and of
the tile; seconds from the call to the first certified tile and to the end; how many classes gave a
certified tile. Names may be of PhyloPic silhouettes, too.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from common import GOALS, Ring
from likeness_methods import silhouette

from orbiflow.runtime import Event, Preview, TileFound
from orbiflow.tiles import (
    EscherizeSettings,
    LikenessSearch,
    escherize,
    hair_share,
    narrowest_neck,
    slit_share,
)

THIN = 0.01
"""Of the size: hairs and slits."""


def thin(ring: Ring) -> tuple[float, float, float]:
    """Narrowest neck, and the shares of hairs and of slits."""
    return narrowest_neck(ring).share, hair_share(ring, THIN), slit_share(ring, THIN)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*")
    parser.add_argument("--effort", choices=("fast", "normal", "best"), default="normal")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    print(f"effort {options.effort}; of: silhouette > tile")
    print("goal          class  score   IoU  bent        neck", end="")
    print("         hairs       slits  first  all s  tiles")
    rows = []
    for name in options.names or GOALS:
        target = silhouette(name)
        began = time.perf_counter()
        first: list[float] = []

        def watch(event: Event, first: list[float] = first, began: float = began) -> None:
            if not first and isinstance(event, Preview | TileFound):
                first.append(time.perf_counter() - began)

        settings = LikenessSearch.for_effort(options.effort)
        own = EscherizeSettings(workers=options.workers)
        results = escherize(target, own, method=settings, on_event=watch).tiles
        seconds = time.perf_counter() - began
        best = results[0]
        assert all(result.certificate.valid for result in results)
        own, tile = thin(np.asarray(target.normal)), thin(best.normal_tile.polygon)
        rows.append([best.score, best.metrics.iou, best.bent_iou or 0.0, first[0], seconds])
        shares = " ".join(f"{a:4.0%} > {b:4.0%}" for a, b in zip(own[1:], tile[1:], strict=True))
        shares = " ".join(f"{a:4.0%} > {b:4.0%}" for a, b in zip(own[1:], tile[1:], strict=True))
        print(
            f"{name:14}{best.name:6}{best.score:6.3f}{best.metrics.iou:6.3f}{best.bent_iou:6.3f}"
            f"   {own[0]:.3f} > {tile[0]:.3f}  {shares}"
            f"{first[0]:7.2f}{seconds:7.1f}{len(results):5}",
            flush=True,
        )
    mean = np.mean(rows, axis=0)
    print(
        f"{'mean':20}{mean[0]:6.3f}{mean[1]:6.3f}{mean[2]:6.3f}{'':43}{mean[3]:7.2f}{mean[4]:7.1f}"
    )


if __name__ == "__main__":
    main()
