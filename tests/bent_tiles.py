"""A bent tile of a class to draw."""

from collections.abc import Callable

import numpy as np
import pytest

from orbiflow.arrays import Array
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.tiles import Tile, isohedral_class


def equivariant(group: CrystallographicGroup) -> Callable[[Array], Array]:
    """Mean over cosets of a fixed trigonometric field."""

    def field(points: Array) -> Array:
        u = 2 * np.pi * points @ group.inverse_lattice.T
        return np.stack([np.cos(u[..., 0] + 1), np.sin(u[..., 0] - u[..., 1])], axis=-1)

    return lambda points: np.mean([field(g(points)) @ g.linear for g in group.cosets], axis=0)


def bent_tile(name: str, scale: float = 1.0) -> Tile:
    kind = isohedral_class(name)
    vertices, share = kind.template(), np.linspace(0, 1, 20, endpoint=False)[:, None]
    edges = zip(vertices, np.roll(vertices, -1, axis=0), strict=True)
    polygon = np.concatenate([a + share * (b - a) for a, b in edges])
    tile = Tile(polygon + 0.1 * equivariant(kind.group())(polygon), kind.group(), name)
    return tile.transformed(scale * np.eye(2), np.zeros(2))


@pytest.fixture(name="bent_tile")
def bent_tile_fixture() -> Callable[..., Tile]:
    return bent_tile


@pytest.fixture(name="equivariant")
def equivariant_fixture() -> Callable[[CrystallographicGroup], Callable[[Array], Array]]:
    return equivariant
