"""The whole fit of one class by co-deformation: from a silhouette to start tiles, placed on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from orbiflow.arrays import Array, Complex
from orbiflow.errors import CertificationError
from orbiflow.runtime import Cancel, one_blas_thread
from orbiflow.tiles.geometry import best_similarity, plane_points
from orbiflow.tiles.likeness import (
    Overlap,
    least_neck,
    overlaid,
)
from orbiflow.tiles.search.bending import Bent, bent_tiles
from orbiflow.tiles.search.candidates import Fit, Progress, StillTiles, silent
from orbiflow.tiles.search.co_deformation import Hand
from orbiflow.tiles.search.likeness_search import LikenessSearch
from orbiflow.tiles.search.prototiles import Prototiles
from orbiflow.tiles.search.tile_space import NearestTiles
from orbiflow.tiles.silhouette import Target
from orbiflow.tiles.tilings import IsohedralClass


class PlacedBent(NamedTuple):
    """A bent silhouette that is a tile, laid over the target by a similarity.

    - `bent`: the silhouette, in a frame of its own, mirrored if its hand is.
    - `factor`, `shift`: z -> factor z + shift, after which a mirrored one is reflected in the x axis.
    """

    bent: Bent
    factor: complex
    shift: complex

    def place(self, z: Complex) -> Array:
        """Points (...) x + iy of the bent silhouette as points (..., 2) of the normal form."""
        placed = self.factor * z + self.shift
        return plane_points(np.conj(placed) if self.bent.hand.mirrored else placed)

    @property
    def outlines(self) -> tuple[Array, Array]:
        """The outline at rest and bent near its tile, (n, 2) each, counter-clockwise, point by point.

        In the normal form, where the silhouette lies as it is.
        """
        hand = self.bent.hand
        rest = hand.samples.fine * ((1.0, -1.0) if hand.mirrored else (1.0, 1.0))
        bent = self.place(self.bent.relaxed)
        return (rest[::-1], bent[::-1]) if hand.mirrored else (rest, bent)


def fit_bending(
    target: Target,
    kind: IsohedralClass,
    settings: LikenessSearch,
    both: Sequence[Hand],
    *,
    per_class: int = 1,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Fit:
    """Fit tiles of one class to a target by letting the silhouette bend (design point 15).

    Args:
        target: the silhouette.
        kind: the class.
        settings: of the search.
        both: the target's hands, see `hands`.
        per_class: certified tiles that are wanted.
        progress: told the share of the work done.
        cancel: looked at before each step.

    Raises:
        CertificationError: if every finalist crosses itself.
        Cancelled: if it was told to stop.
    """
    with one_blas_thread():  # many small systems
        return _fit(target, kind, settings, both, per_class, progress, cancel)


def _fit(
    target: Target,
    kind: IsohedralClass,
    settings: LikenessSearch,
    both: Sequence[Hand],
    per_class: int,
    progress: Progress | None,
    cancel: Cancel | None,
) -> Fit:
    told = progress or silent
    enough = 1 if per_class == 1 else 3 * per_class
    settings = replace(settings, min_neck=least_neck(target.normal, settings.min_neck))
    found, dropped = bent_tiles(
        both,
        kind,
        settings,
        lambda share: told(0.9 * share, float("nan")),
        cancel,
        wanted=enough,
    )
    if not found:
        raise CertificationError("all tiles near the silhouette cross themselves")
    found = found[: enough + 1]  # one to spare, if one is not certified
    overlaps = [Overlap(target.normal * (1.0, -1.0 if hand.mirrored else 1.0)) for hand in both]
    placed = [placed_best(bent, overlaps[bent.hand.mirrored]) for bent in found]
    starts = Prototiles.joined([prototile(kind, one) for one in placed])
    candidates = StillTiles(kind, starts)
    return Fit(candidates, settings.placements, dropped, enough, tuple(placed))


def placed_best(bent: Bent, overlap: Overlap) -> PlacedBent:
    """Lay a bent tile over the silhouette by the similarity of largest IoU.

    From the one that lays the bent points nearest to where they were, by L-BFGS on exact gradients.

    Args:
        bent: a tile.
        overlap: with the silhouette that was bent: mirrored if the hand is.
    """
    rest, points = bent.hand.fine.rest, bent.points
    center = points.mean()
    ring = bent.points[: bent.hand.fine.size] - center
    factor, middle, _ = overlaid(ring, overlap, complex(best_similarity(points, rest)), rest.mean())
    return PlacedBent(bent, factor, complex(middle - factor * center))


def prototile(kind: IsohedralClass, placed: PlacedBent) -> Prototiles:
    """A placed bent tile as a start tile of a flow."""
    bent, factor, shift = placed
    n = bent.hand.fine.size
    order = (np.arange(n) + bent.placement.starts[0]) % n
    turn = np.array([[factor.real, -factor.imag], [factor.imag, factor.real]])
    tiles = NearestTiles(
        (factor * bent.points[:n] + shift)[order][None],
        (turn @ bent.linear)[None],
        (turn @ bent.offset + [shift.real, shift.imag])[None],
        np.cumsum(bent.placement.lengths, axis=1) - bent.placement.lengths,
        np.zeros(1),
    )
    return Prototiles.of(kind, tiles, n, mirrored=bent.hand.mirrored)
