"""How faithful a bent outline is to its silhouette, as people judge it, point by point.

The mark that people would give is predicted from seven measures (docs/likeness.md has the evidence):

- `pieces`: how well short and long pieces of the outline are kept, each compared after its own best
  motion (Procrustes; Gower, 1975), by the mean of the roots: a few pieces may be lost, the rest should
  be exact. Short pieces show corners and limbs, long ones a head with its neck, or two legs. The weight
  of a piece is the root of the body's thickness there, larger for a head than for a leg.
- `stretched`: how unevenly the outline is stretched: shrunken limbs, and bodies that have grown.
- `thickness`: where limbs and bodies have become thin or fat, by the largest disc inside that touches
  the outline (the medial axis).
- `blunted`: how much of its turning the outline has lost: corners that are round now, and curves that
  are straight.
- `moved`: how far the outline is from its place, after the best motion of the whole: the pose.
- `merged`: where gaps have closed, so that parts have come together, by the largest disc outside.

Outlines correspond point by point: this compares a shape with the one that was bent into it.
"""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

import math
from bisect import bisect_left
from dataclasses import dataclass

import numpy as np
import shapely

from orbiflow.arrays import Array, Complex
from orbiflow.tiles.geometry import arc_lengths, complex_points, resampled
from orbiflow.tiles.likeness.measures import Measures

# Values of two pieces, `stretched`, `thickness`, `blunted`, `moved` and `merged`: those below which
# differences matter little, those of a tile of medium likeness, and the marks that a unit of their
# logarithms costs
NEGLIGIBLE_VALUES = (0.05, 0.05, 0.02, 0.02, 2.0, 0.002, 0.1)
USUAL_VALUES = (0.137, 0.12, 0.021, 0.105, 7.5, 0.0048, 0.15)
WEIGHTS = (1.3, 1.65, 0.27, 0.45, 0.5, 0.27, 0.25)
# Rough outlines forgive more: marks for the logarithm of the outline's length, and lengths, in square
# roots of the area: the usual one, and the extremes of those that were marked
LENGTH_WEIGHT, USUAL_LENGTH, LENGTHS = 2.0, 6.5, (4.2, 10.9)
USUAL_MARK = 5.8  # of a tile with usual values and of usual length
# The predicted mark at which half of the people find a tile good, 6.5 or more, and how fast their log
# odds grow with it
GOOD_MARK, STEEPNESS = 6.1, 1.6
# What has happened where each of the measures costs marks
LOSS_WORDS = (
    "small parts such as ears and feet have lost their shapes",
    "heads and limbs are bent",
    "some parts have shrunk while others have grown",
    "limbs or body have become thinner or thicker",
    "corners have become round",
    "limbs, or the whole, have left their pose",
    "parts have come together, or run into each other",
)


@dataclass(frozen=True)
class Fidelity:
    """How much of an outline is kept in its bending. Values are from 0; smaller is better.

    - `pieces`: The misfits of pieces of two lengths, short and long.
    - `stretched`: The mean square of the logarithm of the outline's stretch.
    - `thickness`: The mean square of the logarithm by which the inside became thinner or thicker.
    - `blunted`: The sum of the angles by which chords of the outline turn less than they did, in
      radians.
    - `moved`: The mean square of the distance from the outline at rest, after the best similarity, over
      its area.
    - `merged`: The mean square of the logarithm by which gaps between parts became narrower.
    - `cost`: The cost of bending (`Elastic.cost`). It has no part in the mark.
    - `length`: The length of the silhouette's outline, in square roots of its area.
    """

    pieces: tuple[float, float]
    stretched: float
    thickness: float
    blunted: float
    moved: float
    merged: float
    cost: float
    length: float

    @property
    def losses(self) -> tuple[float, ...]:
        """The marks lost by each measure, two of them by pieces; below 0, better than usual."""
        others = self.stretched, self.thickness, self.blunted, self.moved, self.merged
        values = (*self.pieces, *others)
        parts = zip(WEIGHTS, values, USUAL_VALUES, NEGLIGIBLE_VALUES, strict=True)
        return tuple(w * math.log((least + x) / (least + usual)) for w, x, usual, least in parts)

    @property
    def lost(self) -> list[str]:
        """What is worse than usual, in words: at most two things, the worst first."""
        worst = sorted(zip(self.losses, LOSS_WORDS, strict=True), reverse=True)[:2]
        return [words for loss, words in worst if loss > 0]

    @property
    def mark(self) -> float:
        """The mark that people would give on a scale from 0 to 10, not cut at its ends."""
        length = min(max(self.length, LENGTHS[0]), LENGTHS[1])
        easier = LENGTH_WEIGHT * math.log(length / USUAL_LENGTH)
        return USUAL_MARK + easier - sum(self.losses)

    @property
    def score(self) -> float:
        """How probably people call it a good likeness, 0 to 1: a mark of 6.5 or more."""
        return score_of(self.mark)


def score_of(mark: float) -> float:
    """Return how probably people call what has this mark a good likeness, 0 to 1."""
    return 1 / (1 + math.exp(min(STEEPNESS * (GOOD_MARK - mark), 700.0)))


def fidelity(rest: Complex, bent: Complex, cost: float) -> Fidelity:
    """Compare an outline with what it was bent from, at a cost `Elastic.cost`.

    Outlines (n,) x + iy are counter-clockwise and nearly evenly spaced, and their points correspond.

    >>> square = np.array([0, 1, 2, 2 + 1j, 2 + 2j, 1 + 2j, 2j, 1j])
    >>> fidelity(square, 3 * square * 1j + 7, 0.0).score > 0.99
    True
    """
    return kept_of(Measures(rest), bent, cost)


def kept_of(measures: Measures, bent: Complex, cost: float) -> Fidelity:
    """Return the `fidelity` of an outline (n,) to the one that is measured against."""
    return _kept(measures, measures.values(bent), cost)


ORIGINAL_POINTS = 480  # on the outline that was there before thin parts were rounded off


def fidelity_to_original(
    original: Array, rest: Array, bent: Array, near: float, cost: float
) -> Fidelity:
    """Return what is left of an outline whose thin parts were rounded off before it was bent.

    What lies within a distance `near` of the outline at rest was bent with it. Limbs that are gone are
    where they began, so they count as shrunken to nothing.

    Args:
        original: The outline (m, 2) before, a counter-clockwise ring of area 1.
        rest: The rounded outline (n, 2), which lies over it.
        bent: The points (n, 2) that its points were bent to.
        near: A distance.
        cost: What bending cost.
    """
    points = resampled(original, ORIGINAL_POINTS)
    line, dots = shapely.LinearRing(rest), np.asarray(shapely.points(points))
    places = np.asarray(shapely.line_locate_point(line, dots))
    gaps = np.asarray(shapely.distance(line, dots))
    # from the point that moved least, once around
    first, length = int(np.argmin(gaps)), float(line.length)
    close = np.flatnonzero(np.roll(gaps, -first) <= near)
    along = (np.roll(places, -first)[close] - places[first]) % length
    kept = _longest_increasing(along)
    knots, values = np.append(close[kept], len(points)), np.append(along[kept], length)
    at: Array = np.interp(np.arange(len(points)), knots, values) + places[first]
    share: Array = np.interp(at % length, arc_lengths(rest), np.arange(len(rest) + 1))
    closed = complex_points(np.vstack([bent, bent[:1]]))
    ends: Complex = np.interp(share, np.arange(len(closed)), closed)
    return fidelity(np.roll(complex_points(points), -first), ends, cost)


def _longest_increasing(values: Array) -> list[int]:
    """Return the indices of the longest part of a sequence that increases (Schensted, 1961)."""
    tails: list[float] = []
    last: list[int] = []
    before = [-1] * len(values)
    for k, value in enumerate(values.tolist()):
        place = bisect_left(tails, value)
        before[k] = last[place - 1] if place else -1
        tails[place : place + 1], last[place : place + 1] = [value], [k]
    chain = [last[-1]] if last else []
    while chain and before[chain[-1]] >= 0:
        chain.append(before[chain[-1]])
    return chain[::-1]


def mark_gradient(measures: Measures, bent: Complex) -> tuple[float, Complex]:
    """Return the mark of an outline (n,), and its gradient in the points, as of `Measures`."""
    values, along = measures.gradients(bent)
    steep = [
        w / (least + x) for w, x, least in zip(WEIGHTS, values, NEGLIGIBLE_VALUES, strict=True)
    ]
    return _kept(measures, values, 0.0).mark, -np.array(steep) @ along


def _kept(measures: Measures, values: Array, cost: float) -> Fidelity:
    short, long, stretched, thickness, blunted, moved, merged = values.tolist()
    others = stretched, thickness, blunted, moved, merged
    return Fidelity((short, long), *others, cost, measures.length)
