"""A sphere or the hyperbolic plane as one web page, to be turned by hand; without a network."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from orbiflow.arrays import Array
from orbiflow.drawing import Palette
from orbiflow.tiles.page import Motif, cut_off
from orbiflow.tiles.worlds.outlines import with_points
from orbiflow.tiles.worlds.sheet import CONE_NEAR, World, stepped
from orbiflow.tiles.worlds.world_copies import colour_moves
from orbiflow.tiles.write import canvas_page, page_script

DIGITS = 5  # of vectors, of the radius
STEPS = 40  # of a drawing's lines along the tile
SPARE = 2  # colours that a page which chooses them may need elsewhere
AROUND = 10  # points of the outline by which a copy's size is seen


def turning_page(world: World, chosen: Palette, motifs: Sequence[Motif], title: str) -> str:
    """Return the page, with outlines and drawings as vectors, and what neighbours' motions do."""
    unfolding = world.unfolding
    assert unfolding is not None
    moves = colour_moves(unfolding)
    count = world.count + SPARE if moves is None else len(moves[0])
    fills = len(world.tiling.prototiles) * count
    rings = [
        with_points(prototile.polygon, world.cones, CONE_NEAR * world.size)
        for prototile in world.tiling.prototiles
    ]
    parts = list[dict[str, Any]]()
    for kind, motif in enumerate(motifs):
        for part in cut_off(motif, shapely.Polygon(rings[kind])).parts:
            lines = [(stepped(curve, world.size / STEPS), curve.closed) for curve in part.curves]
            curves = [[_listed(world.vectors(line)), closed] for line, closed in lines]
            style, width = part.style, part.style.width / world.size
            facts = {"kind": kind, "fill": style.fill, "stroke": style.stroke, "width": width}
            parts.append({**facts, "opacity": part.opacity, "curves": curves})
    first = world.vectors(rings[0])
    data = {
        "name": re.sub(r"[^A-Za-z0-9]+", "-", title).strip("-").lower() or "world",
        "sign": unfolding.sign,
        "view": (world.view.motion @ world.motions[0]).ravel().tolist(),
        "middle": unfolding.middle.tolist(),
        "near": unfolding.neighbours.reshape(-1, 9).tolist(),
        "moves": moves and [move.tolist() for move in moves],  # else the page chooses colours
        "rings": [_listed(world.vectors(ring)) for ring in rings],
        "around": _listed(first[:: max(1, len(first) // AROUND)]),
        "parts": parts,
        "fills": [chosen.fill(k) for k in range(fills)],
        "count": count,
        "inks": [chosen.ink(k) for k in range(fills)],
        "outline": chosen.outline,
        "paper": chosen.paper,
    }
    script = page_script("drawing/js/turned.js", "tiles/write/turning.js")
    return canvas_page("turning.html", title, script, "showWorld", data)


def _listed(vectors: Array) -> list[list[float]]:
    return np.round(vectors, DIGITS).tolist()
