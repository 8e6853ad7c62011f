"""Shapes that fit, to begin with: each type is a certified tile, clear of itself, and can be pulled."""

import numpy as np
import pytest
import shapely

from orbiflow.errors import CertificationError
from orbiflow.studio.pulled_tiles import PullSpace, pulled
from orbiflow.studio.shapes import SIZE, shape_tile
from orbiflow.tiles import ISOHEDRAL_TYPES, EscherTile, IsohedralClass

PULL = np.array([0.2, 0.35])  # in units of which a shape has a hundred
VERTICES = (3, 7, 11, 23)


@pytest.mark.parametrize("kind", ISOHEDRAL_TYPES.values(), ids=list(ISOHEDRAL_TYPES))
def test_shape_of_each_type_is_a_tile_that_can_be_pulled(kind: IsohedralClass) -> None:
    tile = shape_tile(kind)
    assert tile.certificate.valid
    space = PullSpace(tile)
    check_that_rounding_decides_nothing(tile, space)
    assert any(nudged(tile, space, vertex) > 0.1 for vertex in VERTICES)


def nudged(tile: EscherTile, space: PullSpace, vertex: int) -> float:
    """Return how far a tile's outline moves, certified, when a vertex is pulled; 0 if it cannot."""
    rows = space.matrix[2 * vertex : 2 * vertex + 2]
    step = np.linalg.pinv(rows) @ PULL
    try:
        found = pulled(tile, space.start + step)
    except CertificationError:
        return 0.0
    assert found.certificate.valid
    return float(abs(found.tile.polygon - space.first.polygon).max())


def check_that_rounding_decides_nothing(tile: EscherTile, space: PullSpace) -> None:
    # a vertex may move this far, in the shape's size, before the outline may touch itself
    assert shapely.minimum_clearance(shapely.Polygon(tile.tile.polygon)) > 0.0099 * SIZE
    outline = space.first.polygon  # its sides are divided, so that those about a tip are shorter
    assert shapely.minimum_clearance(shapely.Polygon(outline)) > 0.003 * SIZE
    free = space.matrix.shape[1] - len(space.outline.maps) - 2  # the group stays where it is
    matrix = np.where(abs(space.matrix) > 1e-9, space.matrix, 0.0)  # rounding moves nothing
    matrix = matrix[:, :free]
    way = 0.001 * SIZE * np.array([0.6, 0.8])
    steps = np.linalg.pinv(matrix.reshape(len(outline), 2, -1), rcond=1e-9) @ way
    moved = outline + (steps @ matrix.T).reshape(len(outline), -1, 2)
    assert shapely.is_valid(shapely.polygons(moved)).all()
    # all move but those at centres of rotation, and at corners of mirrors
    shifts = np.linalg.norm(moved - outline, axis=2).max(axis=1)
    assert np.mean(shifts > 0.0001 * SIZE) > 0.9
