"""What the benchmarks share: inputs, published figures, shapes laid on each other and drawn."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import scipy.optimize
import shapely
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from orbiflow.tiles import Target

ROOT = Path(__file__).resolve().parents[1]
HELD = ROOT / "benchmarks" / "data"
BUNDLED = ROOT / "examples" / "silhouettes"
DATA = Path(os.environ.get("ORBIFLOW_DATA") or ROOT.parent / "shared" / "data")
"""What is not in the repository: see docs/benchmarks.md."""

GOALS = (
    "bat_60",
    "beetle_60",
    "camel_60",
    "dolphin_60",
    "octpus_94",
    "pegasus_60",
    "penguin_60",
    "spider_120",
    "squirrel1_60",
)
"""The paper's nine, by their files' names."""

Ring = NDArray[np.float64]


SMOOTH = 3
"""Pixels drawn for each pixel of a side."""


def goal(name: str) -> Target:
    """One of the nine goals at its true aspect."""
    return Target.read(BUNDLED / "nagata" / f"{name}.dat")


def silhouettes() -> dict[str, dict[str, Any]]:
    """The silhouettes whose tiles were judged, by name: part, source, by, licence, outline."""
    return json.loads((HELD / "likeness_shapes.json").read_text())["silhouettes"]


def published(section: str) -> dict[str, Any]:
    """Figures to compare with: "nine_goals" or "density_nll"; the file says where each comes from."""
    document = json.loads((HELD / "published.json").read_text())
    return document[section]["figures"]


def needed(path: Path, what: str) -> Path:
    """`path`, or one line and exit status 2 where those data are not at hand."""
    if not path.exists():
        print(f"{what} are not here ({path}): docs/benchmarks.md says where to get them")
        raise SystemExit(2)
    return path


def aligned(tile: Ring, goal: Ring, tries: int = 3) -> Ring:
    """The tile moved by the similarity (turns and mirror images included) of largest IoU with the goal.

    Nelder and Mead from the best of 48 turns: `tries` of them.
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
            for start, mirrored in starts[:tries]
        ),
        key=lambda found: found[0].fun,
    )
    return moved(best[0].x, best[1])


def cell(ring: Ring, size: int, unit: float, colour: str = "black") -> Image.Image:
    """A filled ring (M, 2), y up, in a white square of `size` pixels; its unit is `unit` pixels."""
    middle = (ring.min(axis=0) + ring.max(axis=0)) / 2
    pixels = ((ring - middle) * (1, -1) * unit + size / 2) * SMOOTH
    picture = Image.new("RGB", (size * SMOOTH, size * SMOOTH), "white")
    ImageDraw.Draw(picture).polygon([(float(x), float(y)) for x, y in pixels], fill=colour)
    return picture.resize((size, size), Image.Resampling.LANCZOS)


def common_unit(rings: list[Ring], size: int, share: float = 0.9) -> float:
    """Pixels for one unit so that every ring fills at most `share` of a square of `size` pixels."""
    return share * size / max(float(np.ptp(ring, axis=0).max()) for ring in rings)
