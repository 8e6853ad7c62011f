"""What moves in an animation, before it is a file of any format."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbiflow.symmetry.isometry import Array


class Places(NamedTuple):
    """Where M copies of an outline are: linear[m] p + offset[m]; (M, 2, 2) and (M, 2), in pixels."""

    linear: Array
    offset: Array


@dataclass(frozen=True, eq=False)
class Motion:
    """An outline that changes, and M copies of it.

    All in pixels, y down, by the progress of the animation, 0 to 1.

    - `width`, `height`: of the picture.
    - `outline`: (N, 2) about a point of its own, always with as many vertices.
    - `places`: of its copies; the first is the tile itself.
    - `colours`: (M,) numbers of the palette's fills.
    - `births`: (M, 2) from which progress to which each copy grows; before 0 for those always there.
    - `steady`: whether the places stay what they are.
    - `keys`: values of the progress between which the outline moves along straight lines, near enough.
    - `what`: in words, for titles.
    """

    width: int
    height: int
    outline: Callable[[float], Array]
    places: Callable[[float], Places]
    colours: NDArray[np.int64]
    births: Array
    steady: bool
    keys: tuple[float, ...]
    what: str

    def grown(self, progress: float) -> Array:
        """(M,) size of each copy, 0 to 1."""
        start, end = self.births.T
        share = np.clip((progress - start) / (end - start), 0, 1)
        return share * share * (3 - 2 * share)

    def rings(self, progress: float) -> Iterator[tuple[Array, int, bool]]:
        """Every copy (N, 2) that is to be seen, the number of its colour, and whether it is whole."""
        outline, (linear, offset) = self.outline(progress), self.places(progress)
        size = self.grown(progress)
        for k in np.flatnonzero(size > 0):
            yield size[k] * outline @ linear[k].T + offset[k], int(self.colours[k]), size[k] == 1


ALWAYS = (-1.0, -0.5)
"""Birth of what is there from the start."""
