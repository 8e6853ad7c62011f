"""A web page with a stack of solids, to be turned and taken apart; one file that needs no network."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from orbiflow.arrays import Array
from orbiflow.drawing import ShadedPart, rendered, rgb
from orbiflow.solids.mesh import Mesh
from orbiflow.solids.pictures import BENT_COLOUR, TARGET_COLOUR, TILE_COLOUR, figure_axes
from orbiflow.solids.solid import EscherSolid
from orbiflow.solids.stacks import (
    STACK_PALETTE,
    colour_number,
    copy_centers,
    copy_colour,
    lighter,
    stack_of,
)

MOST_FACES = 30_000
"""Triangles of each mesh at most, so that the page stays below some 3 MB."""

START = {"yaw": -0.55, "pitch": 0.45}
"""From where the page looks first: angles in radians, about up and above the horizon."""

KINDS = {"target": "the figure", "bent": "bent", "tile": "the tile", "stack": "the stack"}


def stack_page(
    solid: EscherSolid,
    *,
    title: str = "A solid that fills space",
    caption: str = "",
    remark: str = "",
    copies: int = 24,
    apart: float = 1.2,
) -> str:
    """Return a self-contained HTML page with the figure, its bent body, the tile and a stack to open.

    WebGL 2 draws it. It is turned and zoomed by mouse, touch and keys, dark where the reader likes
    that, and moves by itself only where it is asked to.

    Args:
        solid: A tile that fills space.
        title: The title.
        caption: A sentence or two below it. Default: how many copies there are, and the group.
        remark: Another sentence after it.
        copies: How many copies are stacked, a colour for each coset.
        apart: How far the slider takes copies from the middle, as a share of their distances.
    """
    data = stack_data(solid, copies=copies, apart=apart)
    group = f" of {solid.group.name}" if solid.group.name else ""
    caption = caption or f"{copies} copies of one solid{group}: they fill space without gaps."
    caption = f"{caption} {remark}" if remark else caption
    values = {"title": title, "caption": caption, "kinds": KINDS, "legend": _legend(solid, copies)}
    return rendered("orbiflow.solids", "stack.html", **values, data=data)


def stack_data(solid: EscherSolid, *, copies: int = 24, apart: float = 1.2) -> dict[str, Any]:
    """Return what `stack.js` draws, as JSON has it: see `stack_page`."""
    meshes = {"target": solid.target, "bent": solid.bent, "tile": solid.tile}
    stack = stack_of(solid.group, solid.tile, copies)
    centers = copy_centers(solid.tile, stack)
    away = apart * (centers - centers.mean(axis=0))
    colours = {"target": TARGET_COLOUR, "bent": BENT_COLOUR, "tile": TILE_COLOUR}
    points = np.stack([solid.tile.points @ copy.linear.T + copy.shift for copy in stack])
    closed, opened = (
        float(np.linalg.norm(points + k * away[:, None] - centers.mean(axis=0), axis=2).max())
        for k in (0, 1)
    )
    balls = {name: _ball(mesh) for name, mesh in meshes.items()}
    balls["stack"] = {"center": centers.mean(axis=0).tolist(), "radius": closed, "opened": opened}
    return {
        "start": START,
        "axes": solid.upright.T.tolist(),
        "meshes": {name: _packed_mesh(mesh) for name, mesh in meshes.items()},
        "colours": {name: _shares(colour) for name, colour in colours.items()},
        "balls": balls,
        "copies": [
            {
                "turn": copy.linear.T.ravel().tolist(),  # column by column
                "shift": copy.shift.tolist(),
                "away": shift.tolist(),
                "colour": _shares(copy_colour(solid.group, copy)),
            }
            for copy, shift in zip(stack, away, strict=True)
        ],
    }


def figure_data(figure: Mesh) -> dict[str, Any]:
    """Return what `stack.js` draws of a figure alone, as JSON has it: see `stack_page`."""
    ball = _ball(figure)
    return {
        "start": START,
        "axes": figure_axes(figure).T.tolist(),
        "meshes": {"target": _packed_mesh(figure)},
        "colours": {"target": _shares(TARGET_COLOUR)},
        "balls": {"target": ball, "stack": ball},
        "copies": [],
    }


def _legend(solid: EscherSolid, copies: int) -> dict[str, str]:
    """Return what each colour stands for."""
    group, stack = solid.group, stack_of(solid.group, solid.tile, copies)
    numbers = sorted({colour_number(group, copy) for copy in stack})
    mirrored = {colour_number(group, copy): copy.is_mirrored for copy in stack}
    return {
        f"position {place}{', mirrored' * mirrored[number]}": STACK_PALETTE.fill(number)
        for place, number in enumerate(numbers, 1)
    }


def _shares(colour: str) -> list[float]:
    return [round(channel / 255, 4) for channel in rgb(colour)]


def _ball(mesh: Mesh) -> dict[str, Any]:
    center = (mesh.points.min(axis=0) + mesh.points.max(axis=0)) / 2
    radius = float(np.linalg.norm(mesh.points - center, axis=1).max())
    return {"center": center.tolist(), "radius": radius, "opened": radius}


def _packed_mesh(mesh: Mesh) -> dict[str, str]:
    """Return points, normals and triangles of a mesh, which has a point for each side of a crease."""
    light = lighter(mesh, MOST_FACES)
    part = ShadedPart.smooth(light.points, light.faces, TILE_COLOUR)
    normals = np.rint(127 * part.normals.reshape(-1, 3)).astype(np.int64)
    rows = np.column_stack([light.faces.ravel(), normals])
    vertices, triangles = np.unique(rows, axis=0, return_inverse=True)
    return {
        "points": _packed(light.points[vertices[:, 0]], "<f4"),
        "normals": _packed(vertices[:, 1:], "i1"),
        "triangles": _packed(triangles, "<u4"),
    }


def _packed(array: Array, kind: str) -> str:
    """Return the base64 text of an array."""
    return base64.b64encode(np.ascontiguousarray(array.astype(kind)).tobytes()).decode()
