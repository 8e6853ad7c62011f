"""What the benchmarks share: where inputs are, and the best similarity between two shapes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import scipy.optimize
import shapely
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[1]
BUNDLED = ROOT / "examples" / "silhouettes"
SHARED = ROOT.parent / "shared" / "data"
SILHOUETTES = SHARED / "silhouettes"

Ring = NDArray[np.float64]


def reference() -> dict[str, Any]:
    """Published and measured figures of the nine goals, by name."""
    if not SHARED.exists():
        raise SystemExit(f"the paper's goals and their figures are expected in {SHARED}")
    document = json.loads((SHARED / "reference.json").read_text())
    return document["escherization"]["goals"]


def aligned(tile: Ring, goal: Ring) -> Ring:
    """The tile moved by the similarity (turns and mirror images included) of largest IoU with the goal.

    Nelder and Mead from the best three of 48 turns.
    """
    target = shapely.Polygon(goal)
    shapely.prepare(target)
    z = tile @ np.array([1, 1j])
    z = z - z.mean()
    scale = np.sqrt(target.area / shapely.Polygon(tile).area)
    center = complex(*np.asarray(target.centroid.coords)[0])

    def moved(parameters: Ring, mirrored: bool) -> Ring:
        x, y, log_scale, angle = parameters
        factor = scale * np.exp(log_scale + 1j * angle)
        placed = (
            factor * (np.conj(z) if mirrored else z) + center + np.sqrt(target.area) * (x + 1j * y)
        )
        return np.stack([placed.real, placed.imag], axis=-1)

    def loss(parameters: Ring, mirrored: bool) -> float:
        polygon = shapely.Polygon(moved(parameters, mirrored))
        common = polygon.intersection(target).area
        return -common / (polygon.area + target.area - common)

    starts = [
        (np.array([0.0, 0.0, 0.0, angle]), mirrored)
        for mirrored in (False, True)
        for angle in np.arange(24) * np.pi / 12
    ]
    starts.sort(key=lambda start: loss(*start))
    best = min(
        (
            (
                scipy.optimize.minimize(
                    loss,
                    start,
                    args=(mirrored,),
                    method="Nelder-Mead",
                    options={"xatol": 1e-4, "fatol": 1e-6, "maxiter": 400},
                ),
                mirrored,
            )
            for start, mirrored in starts[:3]
        ),
        key=lambda found: found[0].fun,
    )
    return moved(best[0].x, best[1])
