"""The template tiles: the regular hexagon, the floret and the Cairo pentagon (design point 8)."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch

from orbiflow.symmetry import rotation_matrix
from orbiflow.symmetry.isometry import cast_like
from orbiflow.tilings.class_table import TemplateKind


class PentagonGauge(NamedTuple):
    """A family of pentagons with a rotation centre at p0 and another at p2.

    p0 is the origin, p2 = (distance, 0) and p1 is free; p4 is p1 turned by `degrees_0` about p0
    and p3 is p1 turned by `degrees_2` about p2. Then p3 + p4, and with it the lattice and the
    group, depend on p2 alone. `default` is p1 at shape (0, 0).
    """

    distance: float
    default: tuple[float, float]
    degrees_0: float
    degrees_2: float


# The distances give all templates the area of the hexagon with unit sides, 3 sqrt(3) / 2.
_FLORET_DISTANCE = math.sqrt(6.0)
_CAIRO_DISTANCE = 3.0**0.75

PENTAGONS: dict[str, PentagonGauge] = {
    "floret": PentagonGauge(
        _FLORET_DISTANCE,
        # with sides 2, 1, 1, 1, 2 and angles 60, 120, ... degrees, p2 is (5, sqrt(3)) / 2
        (_FLORET_DISTANCE * 5 / 7, -_FLORET_DISTANCE * math.sqrt(3.0) / 7),
        60.0,
        -120.0,
    ),
    "cairo": PentagonGauge(
        _CAIRO_DISTANCE,
        # apex of the isosceles triangle over p0 p2 with base angles of 30 degrees
        (_CAIRO_DISTANCE / 2, -_CAIRO_DISTANCE / (2 * math.sqrt(3.0))),
        90.0,
        -90.0,
    ),
}


def hexagon() -> torch.Tensor:
    """(6, 2) vertices p_k = (cos 60k, sin 60k), float64, counter-clockwise."""
    half, high = 0.5, math.sqrt(3.0) / 2
    return torch.tensor(
        [(1.0, 0.0), (half, high), (-half, high), (-1.0, 0.0), (-half, -high), (half, -high)],
        dtype=torch.float64,
    )


def pentagon(gauge: PentagonGauge, shape: torch.Tensor) -> torch.Tensor:
    """Vertices (..., 5, 2) of the pentagon whose p1 is moved by `shape` (..., 2) from its default.

    Counter-clockwise for small shapes. Differentiable in `shape`.

    >>> tile = pentagon(PENTAGONS["cairo"], torch.zeros(2, dtype=torch.float64))
    >>> sides = (tile.roll(-1, 0) - tile).norm(dim=1) / tile[1].norm()
    >>> [round(float(side), 6) for side in sides]
    [1.0, 1.0, 1.0, 0.732051, 1.0]
    """

    def turn(degrees: float, vector: torch.Tensor) -> torch.Tensor:
        return vector @ cast_like(rotation_matrix(math.radians(degrees)), shape).T

    p1 = shape + shape.new_tensor(gauge.default)
    p0 = torch.zeros_like(p1)
    p2 = torch.zeros_like(p1) + shape.new_tensor((gauge.distance, 0.0))
    p3 = p2 + turn(gauge.degrees_2, p1 - p2)
    p4 = turn(gauge.degrees_0, p1)
    return torch.stack([p0, p1, p2, p3, p4], dim=-2)


def template_vertices(kind: TemplateKind, shape: torch.Tensor) -> torch.Tensor:
    """Vertices (..., K, 2) for shape parameters (..., 2) of a pentagon or (..., 0) of the hexagon."""
    if kind == "hexagon":
        vertices = hexagon().to(dtype=shape.dtype, device=shape.device)
        return vertices.expand(*shape.shape[:-1], 6, 2)
    return pentagon(PENTAGONS[kind], shape)
