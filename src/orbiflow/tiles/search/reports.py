"""The `result.json` of an escherization (schema: docs/result.schema.json)."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import version
from typing import Any, cast

import numpy as np
import shapely

from orbiflow import __version__
from orbiflow.tiles.result_file import SCHEMA_VERSION, tile_json
from orbiflow.tiles.search.certifying import ClassFailure
from orbiflow.tiles.search.method import SearchMethod
from orbiflow.tiles.silhouette import (
    Emphasis,
    Pins,
    Target,
)
from orbiflow.tiles.tile import EscherTile


def report(
    target: Target,
    results: Sequence[EscherTile],
    failures: Sequence[ClassFailure],
    method: SearchMethod,
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
        "method": method.method_name,
        "objective": method.objective,
        "seed": method.seed,
        "settings": asdict(cast(Any, method)),
        "versions": {
            "orbiflow": __version__,
            "python": platform.python_version(),
            "torch": version("torch"),
            "numpy": np.__version__,
            "shapely": shapely.__version__,
        },
        "timings": {
            "wall_seconds": round(seconds, 3),
            "core_seconds": round(sum({r.isohedral_class: r.seconds for r in results}.values()), 3),
            "workers": workers,
        },
        "input": target.report(),
        "emphasis": None if emphasis is None else emphasis.report(),
        "pins": None if pins is None else pins.report(),
        "tiles": [tile_json(result) for result in results],
        "failed": [{"class": f.name, "reason": f.reason} for f in failures],
    }
