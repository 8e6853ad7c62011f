"""A sketch of the rows that a density was fitted to, by which it knows them again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbiflow.arguments import is_a
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError

KEPT = 2048
"""Hashes of a sketch at most."""

PLACES = 1e7
"""Parts of a turn, or of the sphere's radius, within which points are the same."""

BITS = 53
"""Of a hash: whole numbers that every reader of JSON has exactly."""


@dataclass(frozen=True, eq=False)
class RowSketch:
    """The smallest hashes of the different rows (Broder, On the resemblance and containment of
    documents, 1997).

    Rows whose hash is at most the largest one kept can be looked up exactly, and they are a random
    part of any table: all of it where no hash was left out.

    - `rows`: that were fitted. `hashes`: sorted. `whole`: whether all are kept.

    >>> from orbiflow.density import make_space
    >>> torus, rng = make_space("torus"), np.random.default_rng(0)
    >>> sketch = RowSketch.of(torus, rng.uniform(size=(100, 2)))
    >>> sketch.known(torus, np.random.default_rng(0).uniform(size=(300, 2)))
    (100, 300)
    """

    rows: int
    hashes: NDArray[np.uint64]
    whole: bool

    @classmethod
    def of(cls, space: Space, data: ArrayLike) -> RowSketch:
        """Of data (N, k) in the space's own units."""
        found = np.unique(row_hashes(space, data))
        return cls(len(np.asarray(data)), found[:KEPT], len(found) <= KEPT)

    def known(self, space: Space, data: ArrayLike) -> tuple[int, int]:
        """How many of the rows that can be looked up are among those fitted, and how many can be."""
        found = row_hashes(space, data)
        if not self.whole:
            found = found[found <= self.hashes[-1]]
        return int(np.isin(found, self.hashes).sum()), len(found)

    def to_json(self) -> dict[str, Any]:
        """An object for `json.dumps`."""
        return {"rows": self.rows, "whole": self.whole, "hashes": self.hashes.tolist()}

    @classmethod
    def from_json(cls, document: object) -> RowSketch:
        """What `to_json` gave.

        Raises:
            OrbiflowError: if it is no sketch.
        """
        try:
            assert is_a(document, Mapping)
            given = cast(Mapping[str, Any], document)
            hashes = np.array(given["hashes"], dtype=np.uint64)
            if hashes.ndim != 1 or not 0 < len(hashes) <= KEPT or (hashes[1:] <= hashes[:-1]).any():
                raise ValueError("hashes out of order")
            return cls(int(given["rows"]), hashes, bool(given["whole"]))
        except (AssertionError, KeyError, TypeError, ValueError, OverflowError) as error:
            raise OrbiflowError(f"not a sketch of rows: {error}") from error


def row_hashes(space: Space, data: ArrayLike) -> NDArray[np.uint64]:
    """A number (N,) below 2^53 for each row of data (N, k), the same for the same point.

    Of the point, not of how it is written: turns of a torus, and vectors beside degrees, are seen
    through. It does not depend on how the space is turned in front of its chart.
    """
    points = space.to_chart(data)
    images = space.features(points) if space.is_round else points[None]
    cells = np.rint(images[0].numpy() * PLACES).astype(np.int64)
    if not space.is_round:
        cells %= int(PLACES)
    elif len(images) > 1:  # an axis has two ends
        first = np.argmax(cells != 0, axis=1)
        cells *= np.sign(cells[np.arange(len(cells)), first])[:, None]
    found = np.zeros(len(cells), dtype=np.uint64)
    for column in cells.T:
        found = _mixed(found + np.uint64(0x9E3779B97F4A7C15) + column.astype(np.uint64))
    return found >> np.uint64(64 - BITS)


def _mixed(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """A bijection of 64 bits that leaves no pattern (Steele, Lea and Flood, Fast splittable
    pseudorandom number generators, 2014)."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))
