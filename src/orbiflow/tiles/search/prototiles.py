"""Start tiles: polygons of a class in its group's own frame, and where they are placed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.tiles.geometry import subdivided
from orbiflow.tiles.search.tile_space import NearestTiles
from orbiflow.tiles.tilings import IsohedralClass


@dataclass(frozen=True, eq=False)
class Prototiles:
    """S tiles of one class with as many vertices, any of which a flow can start from.

    - `vertices`: (S, N, 2), in the group's own frame; those of identified edges correspond.
    - `corners`: (S, K) index of the vertex at each of the template's corners, increasing from 0.
    - `angle`, `log_scale`, `offset`, `stretch`, `mirrored`: the pose, as in `TileModel`; (S,), (S,),
      (S, 2), (S, stretch_dim) and (S,).
    """

    vertices: Array
    corners: NDArray[np.int64]
    angle: Array
    log_scale: Array
    offset: Array
    stretch: Array
    mirrored: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.vertices)

    def take(self, indices: Sequence[int]) -> Prototiles:
        """Those at `indices`."""
        return Prototiles(*(getattr(self, f.name)[list(indices)] for f in fields(self)))

    @staticmethod
    def joined(parts: Sequence[Prototiles]) -> Prototiles:
        """All of `parts` in one; they have as many vertices."""
        return Prototiles(
            *(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Prototiles))
        )

    @classmethod
    def of(
        cls, kind: IsohedralClass, tiles: NearestTiles, count: int, *, mirrored: bool
    ) -> Prototiles:
        """Turn placed polygons into start tiles.

        Args:
            kind: their class.
            tiles: whose `linear` keeps orientation.
            count: vertices of each start tile, a multiple of the polygons' own number: each of their
                sides is divided evenly.
            mirrored: whether the polygons belong to the target's mirror image in the x axis; the
                start tiles are placed on the target itself.
        """
        placed = np.stack([tiles.vertices.real, tiles.vertices.imag], axis=-1)
        inverse = np.linalg.inv(tiles.linear)
        own = (placed - tiles.offset[:, None]) @ np.swapaxes(inverse, 1, 2)
        pieces = count // placed.shape[1]
        angle, log_scale, stretch = _pose(kind, tiles.linear)
        return cls(
            subdivided(own, pieces),
            tiles.corners * pieces,
            -angle if mirrored else angle,
            log_scale,
            tiles.offset * (1.0, -1.0) if mirrored else tiles.offset,
            stretch,
            np.full(len(own), mirrored),
        )


def _pose(kind: IsohedralClass, linear: Array) -> tuple[Array, Array, Array]:
    """Angle, log of the scale and stretch parameters: linear = scale rotation(angle) stretch."""
    log_scale = np.log(np.linalg.det(linear)) / 2
    unit = linear * np.exp(-log_scale)[:, None, None]
    u, _, v = np.linalg.svd(unit)  # the polar decomposition
    rotation = u @ v
    angle = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
    symmetric = np.swapaxes(rotation, 1, 2) @ unit
    values, vectors = np.linalg.eigh(symmetric)
    logarithm = np.einsum("cij,cj,ckj->cik", vectors, np.log(values), vectors)
    entries = logarithm[:, 0, :] if kind.stretch_dim == 2 else logarithm[:, 0, : kind.stretch_dim]
    return angle, log_scale, entries
