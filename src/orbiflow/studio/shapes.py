"""Shapes that fit by themselves, to begin with: one of each isohedral type, and a link to open it."""

from __future__ import annotations

import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from orbiflow.studio.share_link import link_text
from orbiflow.tiles import (
    ISOHEDRAL_TYPES,
    EscherTile,
    IsohedralClass,
    Tile,
    TileVariations,
    arrangement,
    colouring,
    divided_tile,
    save_tiles,
    tiling_json,
)

SIZE = 100.0  # square root of a shape's area, in the units of its project
POINTS = 72  # about how many points an outline has
WAVE = 0.62  # length of the waves by which it is bent, in its size
BENDS = (0.11, 0.08, 0.055, 0.03, 0.015)  # their heights, the largest that leaves a clear tile
CLEARANCE = 0.01  # how far a vertex can move, in the size, before its outline may meet itself


def shape_tile(kind: IsohedralClass) -> EscherTile:
    """Return a certified tile of a class: its template, with edges that are bent as far as they may be.

    Straight ones would not show how the copies lie: many templates are the same hexagon.
    """
    template = Tile(kind.template(), kind.group(), kind.name)
    scale = SIZE / float(np.sqrt(abs(template.signed_area)))
    template = template.transformed(scale * np.eye(2), np.zeros(2))
    plain = EscherTile(template, name=kind.name)
    space = TileVariations(divided_tile(template, POINTS))
    x, y = (space.first.polygon - template.center).T * 2 * np.pi / (WAVE * SIZE)
    waves = SIZE * np.stack(
        [np.sin(y + 0.7) + np.sin(x + y), np.cos(x - 0.4) - np.sin(x - y)], axis=1
    )
    step = np.linalg.lstsq(space.matrix, waves.ravel(), rcond=None)[0]
    for height in BENDS:
        bent = space.tile(space.start + height * step, same_area=False)
        outline = shapely.Polygon(bent.polygon)
        # vertices that slide along a mirror may pass each other: rounding must not decide
        if outline.is_valid and shapely.minimum_clearance(outline) >= CLEARANCE * SIZE:
            curved = EscherTile(bent, name=kind.name)
            if curved.certificate.valid:
                return curved
    return plain


@lru_cache(maxsize=128)
def shape(name: str) -> dict[str, Any]:
    """Return what is shown of a type: its tiling, how its tiles lie, and the text of its link."""
    kind = ISOHEDRAL_TYPES[name]
    tile = shape_tile(kind)
    with tempfile.TemporaryDirectory() as folder:
        text = link_text(save_tiles([tile], Path(folder) / "tile"), f"Shape {name[2:]}", None)
    return {
        "name": name,
        "group_name": kind.group_name,
        "symmetry": kind.stabiliser_name,
        "arrangement": arrangement(tile.tiling),
        "text": text,
        **tiling_json(tile.tiling, colouring(tile.tiling), y_down=False),
    }
