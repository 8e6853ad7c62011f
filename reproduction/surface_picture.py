"""A still picture of one of the four surfaces: small faces, drawn from the back to the front."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch

from orbiflow.arrays import Array
from orbiflow.density import (
    Space,
    immersion,
    viewpoint,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LIGHT = np.array([-0.45, 0.55, 0.70])
"""Towards the light, from the left above the eye."""

EYE = 6.0
"""Distance of the eye, in radii of the surface."""


def draw_surface(
    axes: Axes,
    space: Space,
    colours: Array,
    *,
    turn: tuple[float, float] | None = None,
    front: tuple[float, float] = (0.5, 0.5),
) -> None:
    """Draw a space's surface into axes without a frame.

    Args:
        colours: (n, n, 3) RGB of the n x n faces, 0 to 1: of the square's even grid, x first.
        turn: yaw and pitch of the eye in radians; default so that `front` is seen.
        front: place of the canonical square.
    """
    from matplotlib.collections import PolyCollection

    n = len(colours)
    t = torch.linspace(0.0, 1.0, n + 1, dtype=torch.float64)
    grid = torch.stack(torch.meshgrid(t, t, indexing="ij"), dim=-1).reshape(-1, 2)
    points = immersion(space)(grid)
    points = points - (points.min(axis=0) + points.max(axis=0)) / 2
    radius = float(np.linalg.norm(points, axis=1).max())
    if turn is None:
        seen = viewpoint(space, torch.tensor(front, dtype=torch.float64))
        turn = (seen.yaw, seen.pitch)
    seen_points = (points / radius) @ _camera(*turn).T
    corners = seen_points.reshape(n + 1, n + 1, 3)
    faces = np.stack(
        [corners[:-1, :-1], corners[1:, :-1], corners[1:, 1:], corners[:-1, 1:]], axis=2
    )
    faces = faces.reshape(-1, 4, 3)
    normals = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    sight = np.array([0, 0, EYE]) - faces.mean(axis=1)
    normals *= np.sign((normals * sight).sum(axis=1, keepdims=True))  # surfaces have two sides
    shade = 0.62 + 0.38 * np.clip(normals @ (LIGHT / np.linalg.norm(LIGHT)), 0, 1)
    order = np.argsort(faces[..., 2].mean(axis=1))
    flat = faces[..., :2] * (EYE / (EYE - faces[..., 2:]))
    fills = np.clip(colours.reshape(-1, 3) * shade[:, None], 0, 1)
    axes.add_collection(
        PolyCollection(
            list(flat[order]), facecolors=fills[order], edgecolors=fills[order], linewidths=0.35,
            rasterized=True,
        )
    )  # fmt: skip
    axes.set_xlim(-1.12, 1.12)
    axes.set_ylim(-1.12, 1.12)
    axes.set_aspect("equal")
    axes.set_axis_off()


def _camera(yaw: float, pitch: float) -> Array:
    """(3, 3): right, up and towards the eye, as rows."""
    toward = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
    right = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    return np.stack([right, np.cross(toward, right), toward])
