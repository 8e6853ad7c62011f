"""Does the pose of limbs tell more of what people see than the order of tiles does?

    python benchmarks/likeness_pose.py

Two measures of pose are taken from the published marks and outlines (48 points each), and put beside
the seven measures of the order:

- `limbs`: how far limbs are turned against the body: the mean angle, weighted by their lengths. A
  limb is a piece of the outline that is at least 2.2 times as long as the gap between its ends, and at
  most a quarter of the outline; the longest for its gap come first, and none shares points with
  another.
- `pieces`: how far pieces of 18 % of the outline are turned against the body: the mean angle, at most
  .7, weighted by the root of the body's thickness.

Of each, weights fitted to all other silhouettes of the part "learn" order each one's tiles; then those
fitted to "learn" order the part "test". The last column is twice the standard error of the difference
of the correlations from that of the seven measures alone.
"""

from __future__ import annotations

import json
from typing import NamedTuple

import numpy as np
from common import Ring
from likeness_pool_marks import MARKS, Marked
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.stats import spearmanr

from orbiflow.tiles import complex_points
from orbiflow.tiles.likeness import Measures

Complex = NDArray[np.complex128]

PIECE, MOST_TURN, NEGLIGIBLE = 0.18, 0.7, (0.1, 0.05)
LIMB, LONGEST, SHORTEST = 2.2, 0.25, 0.05


class Case(NamedTuple):
    """A silhouette's tiles: their measures (T, 9), the order's seven and those of pose, and marks."""

    measures: Ring
    marks: Ring


def outline(thousandths: list[int]) -> Complex:
    """Return an outline (n,) x + iy as it was published, of area about 1."""
    return complex_points(np.array(thousandths).reshape(-1, 2) / 1000)


def limbs(rest: Complex) -> list[NDArray[np.int64]]:
    """Return the points of each limb, from one end to the other."""
    n, around = len(rest), np.concatenate([rest, rest])
    along = np.concatenate([[0], np.cumsum(abs(np.diff(around)))])
    found: list[tuple[float, NDArray[np.int64]]] = []
    for first in range(n):
        for count in range(3, n // 2):
            piece, arc = around[first : first + count + 1], along[first + count] - along[first]
            gap, apart = abs(piece[-1] - piece[0]), abs(piece - (piece[0] + piece[-1]) / 2).max()
            inside = (np.conj(piece) * np.roll(piece, -1)).imag.sum() > 0
            fits = SHORTEST < arc / along[n] < LONGEST and arc > LIMB * gap
            if inside and fits:
                found.append((-apart / np.sqrt(gap), (first + np.arange(count + 1)) % n))
    free, chosen = np.ones(n, dtype=bool), []
    for _, own in sorted(found, key=lambda one: one[0]):
        if free[own[1:-1]].all():
            free[own[1:-1]] = False
            chosen.append(own)
    return chosen


def motions(rest: Complex, bent: Complex, pieces: list[NDArray[np.int64]]) -> Complex:
    """Return the turn of each piece, a complex unit, in its best motion."""
    found: Complex = np.empty(len(pieces), dtype=complex)
    for k, own in enumerate(pieces):
        a, b = rest[own] - rest[own].mean(), bent[own] - bent[own].mean()
        found[k] = (np.conj(a) * b).sum()
    return np.exp(1j * np.angle(found))


def turns(rest: Complex, bent: Complex, found: list[NDArray[np.int64]]) -> tuple[float, float]:
    """Return the mean turns of limbs and of pieces against the body."""
    n, root = len(rest), np.sqrt(Measures(rest).thick)
    half = round(PIECE * n / 2)
    around = [(np.arange(k - half, k + half + 1)) % n for k in range(n)]
    own = motions(rest, bent, around)
    body = np.conj((own * root).sum())
    pieces = float(np.average(np.minimum(abs(np.angle(own * body)), MOST_TURN), weights=root))
    if not found:
        return 0.0, pieces
    length = [abs(rest[limb] - (rest[limb[0]] + rest[limb[-1]]) / 2).max() for limb in found]
    return float(
        np.average(abs(np.angle(motions(rest, bent, found) * body)), weights=length)
    ), pieces


def cases(part: str) -> list[Case]:
    """Return the silhouettes of a part."""
    found = []
    for own in json.loads(MARKS.read_text())["silhouettes"].values():
        if own["part"] == part:
            rest, marked = outline(own["rest"]), Marked(own["tiles"])
            parts = limbs(rest)
            pose = [turns(rest, outline(tile["outline"]), parts) for tile in own["tiles"]]
            measures = np.column_stack([marked.losses, np.log(np.array(pose) + NEGLIGIBLE)])
            found.append(Case(measures, marked.marks))
    return found


def fitted(learn: list[Case], columns: list[int]) -> Ring:
    """Return the weights of measures that foretell marks best, less each silhouette's mean."""
    measures = np.concatenate([one.measures - one.measures.mean(axis=0) for one in learn])
    marks = np.concatenate([one.marks - one.marks.mean() for one in learn])
    return nnls(-measures[:, columns], marks)[0]


def against(one: Case, columns: list[int], weights: Ring) -> tuple[float, float]:
    """Return the correlation of ranks, and what the mark of the first lacks to the best."""
    order = -one.measures[:, columns] @ weights
    lacks = one.marks.max() - one.marks[np.argmax(order)]
    return float(spearmanr(order, one.marks).statistic), float(lacks)


def main() -> None:
    """Print both parts, with and without each measure of pose."""
    learn, test = cases("learn"), cases("test")
    seven = list(range(7))
    rows = {"the order's seven": seven, "and limbs": [*seven, 7], "and pieces": [*seven, 8]}
    print(f"{'':24}rank correlation   less than the best   twice the error")
    for part, own in (("learn, held out", learn), ("test", test)):
        usual: Ring | None = None
        for name, columns in rows.items():
            found = np.array(
                [
                    against(one, columns, fitted([o for o in learn if o is not one], columns))
                    for one in own
                ]
            )
            usual = found if usual is None else usual
            error = 2 * (found - usual)[:, 0].std() / np.sqrt(len(found))
            mean = found.mean(axis=0)
            print(f"{name:24}{mean[0]:16.3f}{mean[1]:21.2f}{error:18.3f}   {part}")


if __name__ == "__main__":
    main()
