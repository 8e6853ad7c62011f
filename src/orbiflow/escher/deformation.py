"""What bending a silhouette into a tile costs, for tiles of any search: one measure for all."""

from __future__ import annotations

from dataclasses import replace

from orbiflow.escher.hands import Hand
from orbiflow.escher.result import TileResult
from orbiflow.geometry import orient
from orbiflow.likeness.laid import laid_on
from orbiflow.symmetry.isometry import Array


def deformation(hand: Hand, ring: Array) -> float:
    """What it costs to bend a silhouette until its outline is a ring: as `Elastic.cost`.

    The forgiving energy in areas of the bent silhouette, and its displacement, at the best laying
    that `likeness.laid.laid_on` finds: outline points correspond by dynamic programming, four times
    with other weights, and slide along the ring, which may change its size, while the energy falls.
    So it is an upper bound of the least cost, as the search's own cost of a tile that it found is.

    Args:
        hand: the silhouette as it is, not mirrored.
        ring: (M, 2) simple, in the normal form, laid over the silhouette.
    """
    body = hand.fine
    z = laid_on(body, orient(ring, counter_clockwise=True))
    return float(body.cost(z[:, None])[0])


def measured(result: TileResult, hand: Hand) -> TileResult:
    """A tile with its deformation, the least that is known; without one if it crosses itself."""
    if not result.certificate.simple:
        return result
    found = deformation(hand, result.normal_tile.polygon)
    known = result.deformation
    return replace(result, deformation=found if known is None else min(found, known))
