"""The `result.json` of an escherization (schema: docs/result.schema.json)."""

from __future__ import annotations

import platform
from dataclasses import asdict
from importlib.metadata import version
from typing import Any, cast

import numpy as np
import shapely

from orbiflow import __version__
from orbiflow.tiles.result_file import SCHEMA_VERSION, tile_json
from orbiflow.tiles.search.escherizing import SearchResult


def report(result: SearchResult) -> dict[str, Any]:
    """Return the whole document, ready for JSON, tiles best first."""
    tiles, method = result.tiles, result.method
    core_seconds = sum({tile.isohedral_class: tile.seconds for tile in tiles}.values())
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
            "wall_seconds": round(result.seconds, 3),
            "core_seconds": round(core_seconds, 3),
            "workers": result.workers,
        },
        "input": result.target.report(),
        "emphasis": None if result.emphasis is None else result.emphasis.report(),
        "pins": None if result.pins is None else result.pins.report(),
        "tiles": [tile_json(tile) for tile in tiles],
        "failed": [{"class": f.name, "reason": f.reason} for f in result.failures],
    }
