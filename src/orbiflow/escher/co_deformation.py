"""Co-deformation: a silhouette bends, as rigidly as it can, until it is a tile (design point 15).

Hundreds of placements side by side. First springs draw each outline to the nearest tile of its class,
which is taken anew after every step, and tighten; one factorization serves all placements and all
classes. Then each outline is held in the linear space of its placement's tiles and the energy is
minimised there: rotations in turn with one small linear system.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg

from orbiflow.escher.placements import Complex, Placements
from orbiflow.escher.tile_space import TileSpace
from orbiflow.likeness.elastic import Elastic
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings import IsohedralClass

TIGHTER = tuple(np.geomspace(1.2, 3000.0, 9))
"""Strengths of the springs, stage by stage."""

ROUNDS = 3
"""Steps of each stage."""


class BentTiles(NamedTuple):
    """C bent silhouettes that are tiles.

    - `points`: (N, C) of the body; the first n rows are the tile's vertices.
    - `linear`, `offset`: (C, 2, 2) and (C, 2), the map from the group's own frame.
    - `placements`: C of them, with the glide axes' final turns.
    """

    points: Complex
    linear: Array
    offset: Array
    placements: Placements


def drawn_to_tiles(
    body: Elastic,
    kind: IsohedralClass,
    placements: Placements,
    *,
    strengths: tuple[float, ...] = TIGHTER,
    rounds: int = ROUNDS,
) -> tuple[Complex, TileSpace]:
    """Bend a body towards tiles of a class by springs that tighten.

    Args:
        body: whose outline has as many points as the placements have steps.
        kind: the class.
        placements: C of them.
        strengths: of the springs, stage by stage.
        rounds: steps of each stage.

    Returns:
        Shapes (N, C), nearly tiles, and the space of tiles with the glide axes turned to suit them.
    """
    space = TileSpace(kind, placements)
    z = np.repeat(body.rest[:, None], space.count, axis=1)
    for strength in strengths:
        space.turn(space.best_turns(z[: body.size].T))
        for _ in range(rounds):
            tiles = space.nearest(z[: body.size].T)
            z = body.pulled(z, space.in_order(tiles.vertices).T, strength, 1)
    return z, space


def held_on_tiles(body: Elastic, space: TileSpace, z: Complex, rounds: int) -> BentTiles:
    """Minimise the energy among tiles: the outline moves in the space of its placement's tiles.

    Args:
        body: the silhouette.
        space: of tiles, C placements.
        z: shapes (N, C) to start from.
        rounds: of choosing rotations and solving.
    """
    condensed = body.condensed
    low = condensed.low
    parts = [_Reduced(condensed.outline, low, *space.matrices(k)) for k in range(space.count)]
    outline = np.empty((body.size, space.count), dtype=complex)
    for _ in range(rounds):
        forces = body.forces(z)
        own = condensed.forces(forces)
        for k, part in enumerate(parts):
            outline[:, k] = part.solve(own[:, k])
        z = condensed.whole(outline, forces)
    groups = [space.group(k, part.parameters) for k, part in enumerate(parts)]
    return BentTiles(
        z,
        np.array([linear for linear, _ in groups]).reshape(-1, 2, 2),
        np.array([offset for _, offset in groups]).reshape(-1, 2),
        space.placements._replace(turns=space.turns),
    )


class _Reduced:
    """The outline's equations in the parameters of one placement's tiles."""

    def __init__(self, matrix: Array, low: Complex | None, real: Array, imaginary: Array) -> None:
        self.real, self.imaginary = real, imaginary
        own = real.T @ (matrix @ real) + imaginary.T @ (matrix @ imaginary)
        if low is not None:
            less = low.conj().T @ (real + 1j * imaginary)
            own -= (less.conj().T @ less).real
        # IH1 does not care about the offset
        own[np.diag_indices_from(own)] += 1e-10 * np.trace(own) / len(own)
        self.factor = scipy.linalg.cho_factor(own, overwrite_a=True, check_finite=False)
        self.parameters = np.zeros(len(own))

    def solve(self, force: Complex) -> Complex:
        right = self.real.T @ force.real + self.imaginary.T @ force.imag
        self.parameters = scipy.linalg.cho_solve(self.factor, right, check_finite=False)
        return self.real @ self.parameters + 1j * (self.imaginary @ self.parameters)
