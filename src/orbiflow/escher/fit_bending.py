"""The whole fit of one class by co-deformation: from a silhouette to start tiles of a flow."""

from __future__ import annotations

import numpy as np
import scipy.optimize

from orbiflow.escher.bending import Bent
from orbiflow.escher.prototiles import Prototiles
from orbiflow.escher.tile_space import NearestTiles
from orbiflow.geometry import complex_points, plane_points
from orbiflow.likeness.overlap import Overlap
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings import IsohedralClass


def placed(bent: Bent, overlap: Overlap) -> tuple[complex, complex]:
    """The similarity z -> factor z + shift of a bent tile with the largest IoU.

    From the one that lays the bent points nearest to where they were, by L-BFGS on exact gradients.

    Args:
        bent: a tile.
        overlap: with the silhouette that was bent: mirrored if the hand is.
    """
    rest, points = bent.hand.fine.rest, bent.points
    center = points.mean()
    moved = points - center
    factor = np.vdot(moved, rest - rest.mean()) / np.vdot(moved, moved).real
    ring = bent.points[: bent.hand.fine.size] - center

    def loss(x: Array) -> tuple[float, Array]:
        own = factor * complex(np.exp(x[0] + 1j * x[1])) * ring
        place = own + rest.mean() + x[2] + 1j * x[3]
        value, slope = overlap.iou(plane_points(place))
        pull = complex_points(slope)
        turned = np.conj(own) * pull
        gradient = [turned.real.sum(), turned.imag.sum(), pull.real.sum(), pull.imag.sum()]
        return -value, -np.array(gradient)

    found = scipy.optimize.minimize(
        loss, np.zeros(4), jac=True, method="L-BFGS-B", options={"maxiter": 40}
    )
    scale = factor * np.exp(found.x[0] + 1j * found.x[1])
    return complex(scale), complex(rest.mean() + found.x[2] + 1j * found.x[3] - scale * center)


def prototile(kind: IsohedralClass, bent: Bent, factor: complex, shift: complex) -> Prototiles:
    """A bent tile under a similarity as a start tile, placed on the target."""
    placement = bent.placement
    n = bent.hand.fine.size
    order = (np.arange(n) + placement.starts[0]) % n
    turn = np.array([[factor.real, -factor.imag], [factor.imag, factor.real]])
    offset = turn @ bent.offset + [shift.real, shift.imag]
    tiles = NearestTiles(
        (factor * bent.points[:n] + shift)[order][None],
        (turn @ bent.linear)[None],
        offset[None],
        np.cumsum(placement.lengths, axis=1) - placement.lengths,
        np.zeros(1),
    )
    return Prototiles.of(kind, tiles, n, mirrored=bent.hand.mirrored)
