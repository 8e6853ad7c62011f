"""The `result.json` of an escherization (schema: docs/result.schema.json)."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import shapely
import torch

from orbiflow import __version__
from orbiflow.arrays import Array
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.tiles.search.methods import (
    Settings,
    method_name,
    objective_name,
)
from orbiflow.tiles.search.result import ClassFailure, TileResult
from orbiflow.tiles.silhouette import (
    Emphasis,
    Pins,
    Target,
)

SCHEMA_VERSION = 1


def group_json(group: CrystallographicGroup) -> dict[str, Any]:
    """Lattice (basis vectors as columns) and coset representatives as nested lists."""
    return {
        "name": group.name,
        "lattice": group.lattice.tolist(),
        "cosets": [
            {"linear": g.linear.tolist(), "translation": g.translation.tolist()}
            for g in group.cosets
        ],
    }


def tile_json(result: TileResult) -> dict[str, Any]:
    """One entry of `tiles`: polygon and group in the input's own coordinates."""
    return {
        "class": result.name,
        "score": result.score,
        "objective": result.objective,
        "front": result.front,
        "metrics": {
            **result.metrics.as_dict(),
            "deformation": result.deformation,
            "bent_iou": result.bent_iou,
            "pinned": result.pinned,
            "fidelity": None if result.fidelity is None else asdict(result.fidelity),
        },
        "recognisability": result.recognisability.as_dict(),
        "certificate": result.certificate.as_dict(),
        "polygon": _closed(result.tile.polygon),
        "bent": None if result.bent is None else _closed(result.bent),
        "thinnest": _thinnest(result),
        "corners": list(result.tile.corners),
        "group": group_json(result.tile.group),
        "starts": result.starts,
        "dropped": result.dropped,
        "seconds": round(result.seconds, 3),
    }


def _closed(ring: Array) -> list[list[float]]:
    return np.concatenate([ring, ring[:1]]).tolist()


def _thinnest(result: TileResult) -> dict[str, Any] | None:
    found = result.thinnest
    if found is None:
        return None
    return {"width": found.width, "share": found.share, "ends": found.ends.tolist()}


def report(
    target: Target,
    results: Sequence[TileResult],
    failures: Sequence[ClassFailure],
    settings: Settings,
    *,
    seconds: float,
    workers: int,
    emphasis: Emphasis | None = None,
    pins: Pins | None = None,
) -> dict[str, Any]:
    """The whole document, ready for JSON, tiles best first.

    Args:
        seconds: wall-clock time of the search.
        workers: processes that were used.
        emphasis: the mask, if there was one.
        pins: what was not to bend, if anything.
    """
    return {
        "schema_version": SCHEMA_VERSION,
        "method": method_name(settings),
        "objective": objective_name(settings),
        "seed": settings.seed,
        "settings": asdict(settings),
        "versions": {
            "orbiflow": __version__,
            "python": platform.python_version(),
            "torch": torch.__version__,
            "numpy": np.__version__,
            "shapely": shapely.__version__,
        },
        "timings": {
            "wall_seconds": round(seconds, 3),
            "core_seconds": round(sum({r.name: r.seconds for r in results}.values()), 3),
            "workers": workers,
        },
        "input": target.report(),
        "emphasis": None if emphasis is None else emphasis.report(),
        "pins": None if pins is None else pins.report(),
        "tiles": [tile_json(result) for result in results],
        "failed": [{"class": f.name, "reason": f.reason} for f in failures],
    }
