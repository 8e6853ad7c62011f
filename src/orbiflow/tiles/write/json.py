"""A scene as JSON, for programs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from orbiflow.tiles.page import Layer, PlacedTile, Scene, flattened
from orbiflow.tiles.write.formats import TOLERANCE

SCHEMA_VERSION = 1


def write_json(scene: Scene, *, tolerance: float = TOLERANCE) -> str:
    """Return the scene as JSON; all lengths in mm, y down from the page's upper left corner."""
    scene, prototiles = flattened(scene, tolerance), scene.prototiles
    several = {"prototiles": list(map(_rounded, prototiles))} if len(prototiles) > 1 else {}
    document: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "kind": "orbiflow-export",
        "title": scene.title,
        "notes": list(scene.notes),
        "units": "mm",
        "y": "down",
        "page": {"width": scene.width, "height": scene.height, "window": list(scene.clip)},
        **scene.facts,
        "prototile": _rounded(prototiles[0]) if prototiles else None,
        **several,
        "tiles": [_tile(tile, number, prototiles) for number, tile in enumerate(scene.tiles)],
        "layers": [_layer(scene, layer, tolerance) for layer in scene.layers],
    }
    return json.dumps(document, allow_nan=False, separators=(",", ":"))


def _tile(tile: PlacedTile, number: int, prototiles: Sequence[np.ndarray]) -> dict[str, Any]:
    placed: dict[str, Any] = {"prototile": tile.prototile} if len(prototiles) > 1 else {}
    if prototiles:
        polygon = prototiles[tile.prototile]
        placed["polygon"] = _rounded(polygon @ tile.linear.T + tile.offset)
    return {
        "number": number,
        "aspect": tile.aspect,
        # as in SVG: a, b, c, d, e, f of x' = a x + c y + e, y' = b x + d y + f
        "transform": [*np.round(tile.linear.T.ravel(), 9).tolist(), *_rounded(tile.offset, 6)],
        "neighbours": list(tile.neighbours),
        "whole": tile.whole,
        **placed,
    }


def _layer(scene: Scene, layer: Layer, tolerance: float) -> dict[str, Any]:
    paths: list[dict[str, Any]] = []
    if layer.role not in ("paper", "tiles"):  # tiles are listed as such
        paths = [
            {"closed": curve.closed, "points": _rounded(curve.flattened(tolerance))}
            for curve in scene.curves(layer)
        ]
    style = layer.style
    return {
        "name": layer.name,
        "role": layer.role,
        "fill": style.fill,
        "stroke": style.stroke,
        "stroke_width": style.width,
        "paths": paths,
    }


def _rounded(values: np.ndarray, decimals: int = 4) -> list[Any]:
    return (np.round(values, decimals) + 0.0).tolist()
