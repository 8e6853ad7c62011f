"""Tiles of the unit cubes' translations that hold one another by tabs in slots."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold

from orbiflow.solids import Mesh
from orbiflow.solids.bodies import as_mesh


def hooked_tile(*axes: int) -> Mesh:
    """A cube with a T-shaped tab on its faces ahead along some axes, and slots for them behind.

    A tab along axis a is wide along the next axis and runs all along the third: it slides along that.
    """
    body = Manifold.cube((1, 1, 1))
    for axis in axes:
        tab = _block(axis, (1.0, 1.1), (0.45, 0.55)) + _block(axis, (1.1, 1.2), (0.35, 0.65))
        body = (body + tab) - tab.translate((-np.eye(3)[axis]).tolist())
    return as_mesh(body)


def _block(axis: int, deep: tuple[float, float], wide: tuple[float, float]) -> Manifold:
    low, high = np.zeros(3), np.ones(3)
    for along, (start, end) in ((axis, deep), ((axis + 1) % 3, wide)):
        low[along], high[along] = start, end
    return Manifold.cube((high - low).tolist()).translate(low.tolist())
