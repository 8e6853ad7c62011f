"""Where an outline comes too near to itself or crosses itself, and which way leads out of it.

Two parts of an outline are apart by a signed distance: below 0 where one lies beyond the other, as in
a limb that has run into its neighbour, or a neck whose sides have changed places. A point of an outline
is beyond another part exactly if the side on which nothing should be is inside by the rule of even and
odd crossings.
"""

import numpy as np
import scipy.sparse

from orbiflow.arrays import Array, Complex
from orbiflow.tiles.likeness.necks import MIN_OUTLINE

REACH = 2.0  # widths up to which parts are near each other: they may come nearer
OFFSET = 1e-7  # how far beside the outline its outer side is tried, in square roots of the area


class Gaps:
    """How much is missing to a width everywhere, near a ring (n,) x + iy, counter-clockwise.

    This is the sum over the points of h(d), where d is how much nearer than the `width` the nearest
    other part is, in widths; h(d) is d^2 up to 1, and 2 d - 1 beyond. Other parts are those that are
    at least `MIN_OUTLINE` away along the outline. Which parts are near which, and which way leads
    apart, is as it is on this ring, so that the sum is smooth on others. The unit is that of a ring
    of area 1.
    """

    def __init__(self, ring: Complex, width: float) -> None:
        self.width, n = width, len(ring)
        steps = np.roll(ring, -1) - ring
        beyond = _is_beyond(ring)
        index, other, share = _nearest_others(ring, steps, beyond, REACH * width)
        towards = ring[other] + share * steps[other] - ring[index]
        sign = np.where(beyond[index], -1.0, 1.0)
        self._way = sign * towards / np.maximum(abs(towards), 1e-12)
        rows = np.tile(np.arange(len(index)), 3)
        columns = np.concatenate([index, other, (other + 1) % n])
        parts = np.concatenate([np.full(len(index), -1.0), 1 - share, share])
        self._differences = scipy.sparse.csr_array((parts, (rows, columns)), shape=(len(index), n))

    def missing(self, ring: Complex) -> tuple[float, Complex]:
        """Return what is missing on a ring (n,), and its gradient (n,) in the points.

        The gradient of f is the g for which f grows by Re(conj(g) dz).
        """
        apart: Complex = np.asarray(self._differences @ ring)
        gap: Array = (np.conj(self._way) * apart).real
        missing = np.maximum(1 - gap / self.width, 0.0)
        steep = -2 * np.minimum(missing, 1.0) / self.width * self._way
        total = np.where(missing < 1, missing**2, 2 * missing - 1).sum()
        return float(total), np.asarray(self._differences.T @ steep)


def _is_beyond(ring: Complex) -> Array:
    """Return which points (n,) have the inside on their outer side."""
    outward = -1j * (np.roll(ring, -1) - np.roll(ring, 1))
    tried = ring + OFFSET * outward / np.maximum(abs(outward), 1e-300)
    low, high = ring, np.roll(ring, -1)
    passed = (low.imag <= tried.imag[:, None]) != (high.imag <= tried.imag[:, None])
    index, side = np.nonzero(passed)
    rise = high.imag[side] - low.imag[side]
    share = (tried.imag[index] - low.imag[side]) / np.where(rise == 0, 1.0, rise)
    right = low.real[side] + share * (high.real[side] - low.real[side]) > tried.real[index]
    return np.bincount(index[right], minlength=len(ring)) % 2 == 1


def _nearest_others(
    ring: Complex, steps: Complex, beyond: Array, width: float
) -> tuple[Array, Array, Array]:
    """Return points, the sides nearest to them of those far along the outline, and where on these.

    Of points that are not `beyond`, only those with a side within `width` are among them.
    """
    n = len(ring)
    lengths = np.maximum(abs(steps), 1e-12)
    knots = np.concatenate([[0.0], np.cumsum(lengths)])
    near = abs(ring[:, None] - ring) < width + lengths
    index, other = np.nonzero(near | beyond[:, None])
    way = abs(knots[index] - knots[other])
    # the side ends one step on: what counts is its nearer end
    after = abs(knots[index] - knots[other + 1])
    total = knots[n]
    way = np.minimum(np.minimum(way, total - way), np.minimum(after, total - after))
    far = way >= MIN_OUTLINE
    index, other = index[far], other[far]
    share = (np.conj(steps[other]) * (ring[index] - ring[other])).real / lengths[other] ** 2
    share = np.clip(share, 0.0, 1.0)
    apart = abs(ring[other] + share * steps[other] - ring[index])
    order = np.lexsort((apart, index))
    first = np.unique(index[order], return_index=True)[1]
    best = order[first]
    return index[best], other[best], share[best]
