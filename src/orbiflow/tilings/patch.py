"""Patches: the tiles that meet a window, and the aspects in which tiles occur."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orbiflow.symmetry import Isometry
from orbiflow.tilings.copies import copies_meeting
from orbiflow.tilings.placed import Placed, prototile_of
from orbiflow.tilings.tile import Tiles, as_tiling
from orbiflow.tilings.window import checked_window


def patch(tile: Tiles, window: Sequence[float]) -> list[Placed]:
    """The tiles that meet the rectangle, as elements of the group, nearest the middle first.

    Args:
        tile: a tile or a tiling, certified or not.
        window: (xmin, ymin, xmax, ymax) in the tile's units.

    Raises:
        OrbiflowError: for an empty window, or one of more than `MAX_TILES` tiles.

    >>> from orbiflow.tilings import Tile
    >>> from orbiflow.tilings.classes import isohedral_class
    >>> ih1 = isohedral_class("IH1")
    >>> len(patch(Tile(ih1.template(), ih1.group()), (-0.1, -0.1, 0.1, 0.1)))
    1
    """
    found = copies_meeting(tile, window)
    xmin, ymin, xmax, ymax = checked_window(window)
    middle = np.array([xmin + xmax, ymin + ymax]) / 2
    away = np.linalg.norm(found.centers() - middle, axis=1)
    return [found.isometry(int(k)) for k in np.argsort(away, kind="stable")]


def aspects(tile: Tiles, elements: Sequence[Isometry]) -> list[int]:
    """For each element the aspect of its tile: tiles of one aspect are translates of each other.

    Args:
        tile: a tile or a tiling.
        elements: a plain isometry carries prototile 0.

    Raises:
        OrbiflowError: for an isometry that is not in the tile's group.
    """
    tiling = as_tiling(tile)
    find, group = tiling.aspects.find, tiling.group
    return [find(group, element, prototile_of(element))[0] for element in elements]
