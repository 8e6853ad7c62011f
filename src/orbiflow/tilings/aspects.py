"""The tiles of a lattice cell, and which of them a group element makes of a prototile."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from orbiflow.arguments import instance
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup, Isometry
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings.stabiliser import Stabiliser

Integers: TypeAlias = NDArray[np.int64]

Cell: TypeAlias = tuple[int, int]
"""Coordinates of a lattice vector over the basis of the group's lattice."""


@dataclass(frozen=True, eq=False)
class Aspects:
    """The A tiles of a tiling up to translations: pairs of a prototile and a coset of the lattice.

    Elements that differ by an element of a prototile's stabiliser make the same tile of it; the coset
    of an aspect is the first of those that do. With trivial stabilisers and one prototile aspects are
    cosets.

    - `prototiles`, `cosets`: (A,).
    - `table`: (K, |G|) the aspect of coset i's image of prototile k.
    - `steps`: (K, |G|, 2) and the lattice cell in which that aspect is.
    - `turns`: (K, |G|) which element s of the stabiliser comes before: coset i is the aspect's
      representative, in that cell, after s.
    """

    prototiles: Integers
    cosets: Integers
    table: Integers
    steps: Integers
    turns: Integers

    def __len__(self) -> int:
        return len(self.cosets)

    @classmethod
    def of(cls, group: CrystallographicGroup, stabilisers: Sequence[Stabiliser]) -> Aspects:
        """Of prototiles with these stabilisers."""
        count, order = len(stabilisers), group.order
        if all(own.order == 1 for own in stabilisers):
            return cls._of_all(count, order)
        table = np.zeros((count, order), dtype=np.int64)
        steps = np.zeros((count, order, 2), dtype=np.int64)
        turns = np.zeros((count, order), dtype=np.int64)
        prototiles: list[int] = []
        cosets: list[int] = []
        for k, own in enumerate(stabilisers):
            first = np.arange(order)
            if own.order > 1:
                first, steps[k], turns[k] = _first_cosets(group, own)
            kept, number = np.unique(first, return_inverse=True)
            table[k] = len(cosets) + number
            prototiles += [k] * len(kept)
            cosets += kept.tolist()
        return cls(np.array(prototiles), np.array(cosets), table, steps, turns)

    @classmethod
    def _of_all(cls, count: int, order: int) -> Aspects:
        """Of prototiles without symmetry: every pair."""
        none = np.zeros((count, order), dtype=np.int64)
        table = np.arange(count * order).reshape(count, order)
        prototiles, cosets = np.divmod(table.ravel(), order)
        return cls(prototiles, cosets, table, np.zeros((count, order, 2), dtype=np.int64), none)

    def find(
        self, group: CrystallographicGroup, element: Isometry, prototile: int
    ) -> tuple[int, Cell, int]:
        """(aspect, cell, turn) of the tile that `element` makes of a prototile.

        Raises:
            OrbiflowError: for an isometry that is not in the group.
        """
        coset, (first, second) = coset_and_cell(group, element)
        step = self.steps[prototile, coset]
        cell = first + int(step[0]), second + int(step[1])
        return int(self.table[prototile, coset]), cell, int(self.turns[prototile, coset])


def _first_cosets(
    group: CrystallographicGroup, own: Stabiliser
) -> tuple[Integers, Integers, Integers]:
    """Per coset: the first that makes the same tile, in which cell, after which element."""
    first = np.arange(group.order)
    steps = np.zeros((group.order, 2), dtype=np.int64)
    turns = np.zeros(group.order, dtype=np.int64)
    for i, g in enumerate(group.cosets):
        for s in own.elements[1:]:
            coset, cell = coset_and_cell(group, g @ s)
            if coset < first[i]:  # g s = (translation) h, so g = (translation) h s^-1
                first[i], steps[i], turns[i] = coset, cell, _inverse(own.elements, s)
    return first, steps, turns


def _inverse(elements: tuple[Isometry, ...], s: Isometry) -> int:
    errors = [np.abs(s.linear @ t.linear - np.eye(2)).max() for t in elements]
    return int(np.argmin(errors))


def coset_and_cell(group: CrystallographicGroup, element: Isometry) -> tuple[int, Cell]:
    """(i, n) with element = translation by B n after the i-th coset representative.

    Raises:
        OrbiflowError: for an isometry that is not in the group.
    """
    instance(element, Isometry, "an element of the group")
    steps = (element.translation - group.translations) @ group.inverse_lattice.T
    error = np.abs(steps - np.round(steps)).max(axis=1)
    error += np.abs(group.linear_parts - element.linear).max(axis=(1, 2))
    coset = int(error.argmin())
    if error[coset] > 1e-6:
        raise OrbiflowError(f"{element!r} is not an element of {group!r}")
    nearest: Array = steps[coset]
    first, second = np.round(nearest).astype(int)
    return coset, (int(first), int(second))
