"""All nine classes on real silhouettes: quality, certificate and time of each tile.

    python benchmarks/nine_classes.py [--quick] [IMAGE ...]

Without images: the bundled squirrel, bat, turtle and night monkey.
"""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path

from common import BUNDLED

from orbiflow.tiles import (
    CLASSES,
    ClassFailure,
    EscherizeSettings,
    EscherTile,
    OccupancySearch,
    Target,
    escherize,
)

IMAGES = [
    BUNDLED / n for n in ("squirrel.dat", "nagata/bat_60.dat", "turtle.png", "night-monkey.png")
]


def row(outcome: EscherTile | ClassFailure) -> str:
    """One line of the table."""
    if isinstance(outcome, ClassFailure):
        return f"{outcome.name:6} failed: {outcome.reason}"
    c, m = outcome.certificate, outcome.metrics
    return (
        f"{outcome.name:6}{outcome.group_name:5}{m.iou:8.4f}{m.dice:8.4f}{m.hausdorff:8.3f}"
        f"{c.edge_mismatch:11.1e}{c.total_overlap:11.1e}{c.uncovered:11.1e}"
        f"{'yes' if c.valid else 'NO':>6}{outcome.starts:8}{outcome.dropped:9}{outcome.seconds:9.1f}"
    )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("images", nargs="*", type=Path)
    parser.add_argument("--quick", action="store_true", help="one image, few iterations")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    images = options.images or IMAGES[: 1 if options.quick else None]
    settings = OccupancySearch(iterations=60) if options.quick else OccupancySearch()
    head = "class group    IoU    Dice  Hausd.   mismatch    overlap  uncovered  cert.  starts  dropped"
    for image in images:
        target = Target.read(image)
        begin = time.perf_counter()
        own = EscherizeSettings(workers=options.workers)
        found = escherize(target, own, method=settings)
        results, failures = found.tiles, found.failures
        seconds = time.perf_counter() - begin
        print(f"\n{image.name}: {settings.iterations} iterations, {seconds:.0f} s wall")
        print(head + "  core s")
        for outcome in [*results, *failures]:
            print(row(outcome), flush=True)
        certified = sum(r.certificate.valid for r in results)
        best = results[0].metrics.iou if results else float("nan")
        print(f"certified {certified} of {len(CLASSES)}, best IoU {best:.4f}")


if __name__ == "__main__":
    main()
