"""What the benchmarks share: inputs, published figures, the best similarity of two shapes."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.optimize
import shapely
from numpy.typing import NDArray

from orbiflow.runtime import one_blas_thread
from orbiflow.tiles import CLASSES, LikenessSearch, Target, isohedral_class, orient, plane_points
from orbiflow.tiles.likeness import least_neck, near_symmetry
from orbiflow.tiles.search.bending import bent_tiles
from orbiflow.tiles.search.search_method import SYMMETRIC, Goal

ROOT = Path(__file__).resolve().parents[1]
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


def goal(name: str) -> Target:
    """One of the nine goals, or another polygon of their authors, at its true aspect."""
    path = BUNDLED / "nagata" / f"{name}.dat"
    if not path.exists():
        path = needed(DATA / "silhouettes" / "nagata" / f"{name}.dat", f"the polygon {name}")
    return Target.read(path)


def published(section: str) -> dict[str, Any]:
    """Figures to compare with: "nine_goals" or "density_nll"; the file says where each comes from."""
    document = json.loads((ROOT / "benchmarks" / "data" / "published.json").read_text())
    return document[section]["figures"]


def needed(path: Path, what: str) -> Path:
    """`path`, or one line and exit status 2 where those data are not at hand."""
    if not path.exists():
        print(f"{what} are not here ({path}): docs/benchmarks.md says where to get them")
        raise SystemExit(2)
    return path


class LikenessTile(NamedTuple):
    """A tile of the search for likeness.

    - `name`: of its class.
    - `ring`: (M, 2) the tile, counter-clockwise with y up, up to a similarity.
    - `bent`: (M, 2) the points of the target's outline on it, in the same frame.
    - `source`: (M, 2) where they are on the target, in its normal form.
    """

    name: str
    ring: Ring
    bent: Ring
    source: Ring


def likeness_tiles(target: Target, effort: str) -> list[LikenessTile]:
    """Tiles of all classes by the search for likeness, best first: the only place that calls it.

    Where the silhouette is near to symmetric, symmetric tiles are among them, as in the search.
    """
    settings = LikenessSearch.for_effort(effort)
    wide = least_neck(target.normal, settings.min_neck)
    symmetric = SYMMETRIC.get(near_symmetry(target.normal).stabiliser, ())
    found = []
    for name in (*CLASSES, *symmetric):
        kind = isohedral_class(name)
        both = settings.hands(Goal(target), kind.divisor)
        with one_blas_thread():
            bents, _ = bent_tiles(both, kind, replace(settings, min_neck=wide))
        for bent in bents:
            n = bent.hand.fine.size
            flip = (1.0, -1.0 if bent.hand.mirrored else 1.0)
            outlines = bent.ring, bent.points[:n], bent.hand.fine.rest[:n]
            rings = (orient(plane_points(z) * flip) for z in outlines)
            found.append((-bent.score, LikenessTile(name, *rings)))
    found.sort(key=lambda one: one[0])
    return [tile for _, tile in found]


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
