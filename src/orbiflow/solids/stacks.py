"""Stacks: some copies of a tile under its group, their colours, and how they are moved apart."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from orbiflow.arrays import Array
from orbiflow.drawing import Palette
from orbiflow.solids.bodies import as_body, as_mesh
from orbiflow.solids.mending import simplified
from orbiflow.solids.mesh import Mesh
from orbiflow.symmetry import CrystallographicGroup

STACK_PALETTE = Palette(
    (
        *("#e9b44c", "#2f7f86", "#d9613f", "#47689f", "#8fae6b", "#b5658c", "#ecdcb2", "#6a5878"),
        *("#5fa8a8", "#c98b3c", "#7d3f3a", "#a8b5d6"),
    ),
    "#221c18",
    "#ffffff",
)
"""The colours of copies in a stack."""

FEW_COSETS = {1: 4, 2: 2}
"""For groups with so few cosets: the number of colours that copies of each coset share."""


class StackedCopy(NamedTuple):
    """A copy of a tile in a stack: x -> linear x + shift.

    - `coset`: The number of its coset in the group.
    - `cell`: (3,) how many times each lattice vector it is from that coset's representative.
    """

    linear: Array
    shift: Array
    coset: int
    cell: tuple[int, int, int]

    @property
    def is_mirrored(self) -> bool:
        """Whether it is a mirror image of the tile."""
        return float(np.linalg.det(self.linear)) < 0

    @property
    def place(self) -> Array:
        """The matrix (3, 4) of linear part and shift."""
        return np.column_stack([self.linear, self.shift])


def stack_of(group: CrystallographicGroup, tile: Mesh, count: int) -> list[StackedCopy]:
    """Return a compact stack of so many copies of a tile, itself first.

    They are the copies whose centres of mass are nearest to a place; of several places in half a cell
    about the tile the one is taken whose copies are closest together.
    """
    source = tile.centroid
    spacing = (group.cell_volume / group.order) ** (1 / 3)
    places = source + np.array([*product((0.0, 0.25, 0.5), repeat=3)]) @ group.lattice.T
    copies, images, distances = _near(group, source, places, count, spacing)
    best, compact = np.inf, list[StackedCopy]()
    for column in np.round(distances / spacing, 6).T.tolist():
        keys = [(column[k], copy.coset, copy.cell, k) for k, copy in enumerate(copies)]
        nearest = [k for *_, k in sorted(keys)[:count]]
        spread = float(((images[nearest] - images[nearest].mean(axis=0)) ** 2).sum())
        if spread < best * (1 - 1e-9) and any(_is_itself(copies[k]) for k in nearest):
            best, compact = spread, [copies[k] for k in nearest]
    return sorted(compact, key=lambda copy: not _is_itself(copy))


def _near(
    group: CrystallographicGroup, source: Array, places: Array, count: int, spacing: float
) -> tuple[list[StackedCopy], Array, Array]:
    """Return all copies that may be among so many nearest to one of places (m, 3).

    Beside them are the images (n, 3) of the source, and how far those are from the places (n, m).
    """
    middle, radius = places.mean(axis=0), spacing * (0.8 + 0.7 * count ** (1 / 3))
    reach = float(np.linalg.norm(places - middle, axis=1).max())
    while True:
        elements = group.elements_near(middle, radius + reach, source=source)
        images = np.stack([element(source) for element in elements])
        distances = np.linalg.norm(images[:, None] - places, axis=2)
        if ((distances <= radius).sum(axis=0) >= count).all():
            break
        radius *= 1.25
    copies = [_numbered(group, element.linear, element.translation) for element in elements]
    return copies, images, distances


def _is_itself(copy: StackedCopy) -> bool:
    return copy.coset == 0 and copy.cell == (0, 0, 0)


def _numbered(group: CrystallographicGroup, linear: Array, shift: Array) -> StackedCopy:
    """Return an element of a group with the number of its coset and its cell."""
    offsets = (shift - group.translations) @ group.inverse_lattice.T
    cells = np.round(offsets)
    misfit = np.abs(offsets - cells).max(axis=1)
    misfit += np.abs(group.linear_parts - linear).max(axis=(1, 2))
    coset = int(misfit.argmin())
    i, j, k = (int(n) for n in cells[coset])
    return StackedCopy(linear, shift, coset, (i, j, k))


def colour_number(group: CrystallographicGroup, copy: StackedCopy) -> int:
    """Return the number of a copy's colour: one for each coset, more where there are few cosets."""
    share = FEW_COSETS.get(group.order, 1)
    return copy.coset * share + _turn(copy, share)


def copy_colour(group: CrystallographicGroup, copy: StackedCopy) -> str:
    """Return the colour of a copy, #rrggbb; copies of one coset side by side have two shades."""
    colour = STACK_PALETTE.fill(colour_number(group, copy))
    if group.order in FEW_COSETS or _turn(copy, 2) == 0:
        return colour
    channels = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
    return "#" + "".join(f"{round(0.86 * channel):02x}" for channel in channels)


def _turn(copy: StackedCopy, count: int) -> int:
    """Return a number below 1, 2 or 4 that differs, as far as it can, for cells side by side."""
    i, j, k = copy.cell
    return (i + 2 * j + 3 * k) % 4 if count == 4 else (i + j + k) % count


def copy_centers(tile: Mesh, copies: Sequence[StackedCopy]) -> Array:
    """Return the centres of mass (n, 3) of copies of a tile."""
    center = tile.centroid
    return np.stack([copy.linear @ center + copy.shift for copy in copies])


def lighter(mesh: Mesh, most: int) -> Mesh:
    """Return a closed mesh of at most `most` triangles that looks the same from afar."""
    return mesh if len(mesh.faces) <= most else as_mesh(simplified(as_body(mesh), most))
