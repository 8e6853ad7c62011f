"""Carving: the outline of a bent tile moves to the highest mark among the tiles of its placement.

Bending spreads what must change over the whole outline, as its energy is quadratic. Eyes would rather
have a few places changed and the rest exact: that is what the mark says (`likeness.faithful`). So the
best tile of a class climbs from where bending leaves it, by L-BFGS (Liu and Nocedal, On the limited
memory BFGS method for large scale optimization, 1989) in the linear space of its placement's tiles,
with the body's stiffness as the metric. The mark does not see wrinkles, so these cost something, too.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.optimize

from orbiflow.arrays import Array, Complex
from orbiflow.tiles.likeness import Elastic, mark_gradient
from orbiflow.tiles.search.co_deformation import BentTiles
from orbiflow.tiles.search.tile_space import TileSpace

STEPS = 60  # the largest number of steps
WRINKLE_COST = 0.12  # in marks a radian
FOLLOWED = 3  # the number of times that the inside follows the outline


def carved(body: Elastic, space: TileSpace, z: Complex) -> BentTiles:
    """Return the tile of the highest mark near a tile (N,) of the space's only placement.

    It may cross itself.
    """
    condensed, n = body.condensed, body.size
    real, imaginary = space.matrices(0)
    columns = real + 1j * imaginary
    stiff = real.T @ (condensed.outline @ real) + imaginary.T @ (condensed.outline @ imaginary)
    stiff[np.diag_indices_from(stiff)] += 1e-6 * np.trace(stiff) / len(stiff)
    root = scipy.linalg.cholesky(stiff, lower=True, check_finite=False)
    basis: Complex = scipy.linalg.solve_triangular(root, columns.T, lower=True).T
    adjoint = basis.conj().T

    def lost(parameters: Array) -> tuple[float, Array]:
        outline = basis @ parameters
        mark, rise = mark_gradient(body.measures, outline)
        wrinkles, along = body.measures.wrinkles(outline)
        down = WRINKLE_COST * along - rise
        return WRINKLE_COST * wrinkles - mark, (adjoint @ down).real

    whole = np.concatenate([basis.real, basis.imag])
    start = scipy.linalg.lstsq(whole, np.concatenate([z[:n].real, z[:n].imag]))[0]
    best = scipy.optimize.minimize(
        lost, start, jac=True, method="L-BFGS-B", options={"maxiter": STEPS, "maxcor": 20}
    ).x
    outline = (basis @ best)[:, None]
    points = z[:, None]
    for _ in range(FOLLOWED):
        points = condensed.whole(outline, body.forces(points))
    own = scipy.linalg.solve_triangular(root, best, lower=True, trans="T")
    linear, offset = space.group(0, own)
    turned = space.placements._replace(turns=space.turns)
    return BentTiles(points, linear[None], offset[None], turned)
