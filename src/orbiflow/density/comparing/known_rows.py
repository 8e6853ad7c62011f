"""A sketch of the rows that a density was fitted to, from which they are recognised."""

from __future__ import annotations

import operator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError

MAX_HASHES = 2048
"""Hashes in a sketch at most."""

CELLS_PER_TURN = 1e7
"""Cells in a turn, or in the sphere's radius, within which points are the same."""

HASH_BITS = 53
"""Bits of a hash: such whole numbers are exact for every reader of JSON."""


@dataclass(frozen=True)
class RowSketch:
    """The smallest hashes of a table's different rows.

    Rows whose hash is at most the largest one kept can be looked up exactly, and they are a random
    part of any table, or all of it if no hash was left out (Broder, On the resemblance and containment
    of documents, 1997).

    - `rows`: Number of rows that were fitted.
    - `hashes`: The hashes, sorted. `whole`: Whether all are kept.

    >>> from orbiflow.density import make_space
    >>> torus, rng = make_space("torus"), np.random.default_rng(0)
    >>> sketch = RowSketch.of(torus, rng.uniform(size=(100, 2)))
    >>> sketch.known(torus, np.random.default_rng(0).uniform(size=(300, 2)))
    (100, 300)
    """

    rows: int
    hashes: tuple[int, ...]
    whole: bool

    def __post_init__(self) -> None:
        ends = (-1, *self.hashes, 2**HASH_BITS)
        ordered = all(map(operator.lt, ends, ends[1:]))
        if not ordered or not 0 < len(self.hashes) <= MAX_HASHES:
            raise OrbiflowError(f"a sketch has 1 to {MAX_HASHES} hashes of rows in order")

    @classmethod
    def of(cls, space: Space, data: ArrayLike) -> RowSketch:
        """Return the sketch of data (N, k) in the space's own units."""
        hashes = np.unique(row_hashes(space, data))
        kept = tuple(hashes[:MAX_HASHES].tolist())
        return cls(len(np.asarray(data)), kept, len(hashes) <= MAX_HASHES)

    def known(self, space: Space, data: ArrayLike) -> tuple[int, int]:
        """Return how many of the rows that can be looked up were fitted, and how many can be."""
        hashes = row_hashes(space, data)
        if not self.whole:
            hashes = hashes[hashes <= self.hashes[-1]]
        return int(np.isin(hashes, np.array(self.hashes, dtype=np.uint64)).sum()), len(hashes)


def row_hashes(space: Space, data: ArrayLike) -> NDArray[np.uint64]:
    """Return a number (N,) below 2^53 for each row of data (N, k), the same for the same point.

    It depends on the point alone: not on whole turns of a torus, on whether a direction is a vector or
    in degrees, nor on how the space is rotated in front of its chart.
    """
    points = space.to_chart(data)
    images = space.features(points) if space.is_round else points[None]
    cells = np.rint(images[0].numpy() * CELLS_PER_TURN).astype(np.int64)
    if not space.is_round:
        cells %= int(CELLS_PER_TURN)
    elif len(images) > 1:  # an axis has two ends
        first = np.argmax(cells != 0, axis=1)
        cells *= np.sign(cells[np.arange(len(cells)), first])[:, None]
    hashes = np.zeros(len(cells), dtype=np.uint64)
    for column in cells.T:
        hashes = _mixed(hashes + np.uint64(0x9E3779B97F4A7C15) + column.astype(np.uint64))
    return hashes >> np.uint64(64 - HASH_BITS)


def _mixed(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Mix 64 bits by a bijection (Steele, Lea and Flood, Fast splittable generators, 2014)."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))
