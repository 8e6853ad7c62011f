"""How far a machine's head travels between lines, in the order in which they were made and as written.

    python benchmarks/cut_travel.py TILE [--picture FILE]

TILE is what `orbiflow export` takes. Lengths in metres, layer by layer.
"""

from __future__ import annotations

import argparse
from typing import Any
from unittest import mock

import numpy as np

from orbiflow.tiles import ExportSettings, Scene, scenes
from orbiflow.tiles.make import exporting

SHEETS: dict[str, dict[str, Any]] = {
    "skeleton": {},
    "pieces": {"cut": "pieces", "kerf": 0.15},
    "jigsaw": {"cut": "jigsaw", "margin": 8.0},
    "hatched pieces": {"cut": "pieces", "strokes": "hatch"},
    "plotter, echoes": {"purpose": "plotter", "strokes": "echoes"},
}


def travel(scene: Scene) -> dict[str, tuple[float, float]]:
    """For each layer the length of its lines and of the way between them, in metres."""
    found: dict[str, tuple[float, float]] = {}
    place = np.zeros(2)
    for layer in scene.layers:
        drawn, between = 0.0, 0.0
        for curve in scene.curves(layer):
            points = curve.flattened(0.05)
            points = np.concatenate([points, points[:1]]) if curve.closed else points
            drawn += float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
            between += float(np.hypot(*(points[0] - place)))
            place = points[-1]
        found[layer.name] = drawn / 1000, between / 1000
    return found


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("tile")
    parser.add_argument("--picture")
    given = parser.parse_args()
    print(f"{'sheet':16} {'layer':8} {'lines':>8} {'as made':>8} {'written':>8}")
    for name, own in SHEETS.items():
        settings = ExportSettings(**{"purpose": "laser", "area": (400.0, 300.0), **own})
        picture = given.picture if name.endswith("pieces") else None
        written = scenes(given.tile, settings, picture=picture)[0]
        with mock.patch.object(exporting, "in_cutting_order", lambda scene: scene):
            made = scenes(given.tile, settings, picture=picture)[0]
        for before, after in zip(made, written, strict=True):
            for layer, (length, far) in travel(before).items():
                short = travel(after)[layer][1]
                print(f"{name:16} {layer:8} {length:8.2f} {far:8.2f} {short:8.2f}")


if __name__ == "__main__":
    main()
