"""Types of space groups, told from operators about any origin, and in part along any axes."""

from collections import Counter
from collections.abc import Iterable, Iterator
from functools import lru_cache
from typing import Any

import numpy as np

from orbiflow.arrays import Array
from orbiflow.symmetry.group import CrystallographicGroup
from orbiflow.symmetry.triplets import operators, parse_operator

SAME_SHIFT = 1e-5  # of a lattice's step: shifts that differ by no more are one
_UNIT = 24  # gemmi's matrices and shifts are whole numbers of so manieth parts
_Turn = tuple[int, ...]
_Axes = tuple[frozenset[_Turn], frozenset[_Turn]]


def number_about_any_origin(gemmi: Any, group: CrystallographicGroup, basis: Array) -> int | None:
    """Return the number of a group along the axes of a setting in gemmi's tables, wherever its origin.

    None is returned where no table has such axes. The columns of `basis` are the cell's edges.
    """
    tables = [parse_operator(text, 3) for text in operators(group, basis)]
    turns = [np.round(table[:, :3]).astype(int) for table in tables]
    centring = [
        np.round(table[:, 3] % 1 * _UNIT).astype(int) % _UNIT
        for table, turn in zip(tables, turns, strict=True)
        if (turn == np.eye(3)).all()
    ]
    axes = frozenset(map(_key, turns)), frozenset(map(_key, centring))
    shifts = {_key(turn): table[:, 3] for turn, table in zip(turns, tables, strict=True)}
    to_primitive = group.inverse_lattice @ basis
    for row in _rows_by_axes(gemmi).get(axes, ()):
        apart = [(turn, shifts[_key(turn)] - shift) for turn, shift in _operations(row)]
        if _is_moved(apart, to_primitive):
            return int(row.number)
    return None


def _is_moved(apart: Iterable[tuple[Array, Array]], to_primitive: Array) -> bool:
    """Return whether one move of the origin makes all these differences of shifts.

    A move x changes the shift of an element R by (1 - R) x, and shifts that differ by a step of the
    lattice are one: whole rows of these equations are added to one another until three at most have
    unknowns, which can always be solved, and the others none.
    """
    back = np.linalg.inv(to_primitive)
    rows = [
        (np.round(np.eye(3) - to_primitive @ turn @ back).astype(int), to_primitive @ shift)
        for turn, shift in apart
    ]
    unknowns, shifts = np.concatenate([a for a, _ in rows]), np.concatenate([b for _, b in rows])
    for column in range(3):
        while len(left := np.flatnonzero(unknowns[:, column])) > 1:
            pivot = left[np.argmin(abs(unknowns[left, column]))]
            others = left[left != pivot]
            times = unknowns[others, column] // unknowns[pivot, column]
            unknowns[others] -= times[:, None] * unknowns[pivot]
            shifts[others] -= times * shifts[pivot]
        unknowns, shifts = np.delete(unknowns, left, axis=0), np.delete(shifts, left)
    return bool((abs(shifts - np.round(shifts)) < SAME_SHIFT).all())


@lru_cache(maxsize=1)
def _rows_by_axes(gemmi: Any) -> dict[_Axes, list[Any]]:
    """Return gemmi's settings by their rotations and reflections, and their centring."""
    table: dict[_Axes, list[Any]] = {}
    for row in gemmi.spacegroup_table():
        turns = frozenset(_key(turn) for turn, _ in _operations(row))
        centring = frozenset(tuple(shift) for shift in row.operations().cen_ops)
        table.setdefault((turns, centring), []).append(row)
    return table


def _operations(row: Any) -> Iterator[tuple[Array, Array]]:
    for op in row.operations().sym_ops:
        yield np.array(op.rot) // _UNIT, np.array(op.tran) / _UNIT


def _key(numbers: Array) -> _Turn:
    return tuple(numbers.ravel().tolist())


def element_counts(group: CrystallographicGroup) -> Counter[tuple[int, int, int, float]]:
    """Return how many cosets have a determinant, a trace, a screw or glide of an order, and a pitch.

    The order is how often the element is repeated until it equals one without a shift along itself.
    All four are the same in every right-handed basis and for every origin; only the pitch tells
    enantiomorphs apart.
    """
    counts: Counter[tuple[int, int, int, float]] = Counter()
    shifts = group.translations @ group.inverse_lattice.T
    nearby = np.stack(np.meshgrid(*[np.arange(-3, 4)] * 3), axis=-1).reshape(-1, 3)
    elements = zip(group.integral_parts, group.linear_parts, shifts, strict=True)
    for linear, turn, shift in elements:
        along = np.mean([np.linalg.matrix_power(linear, k) for k in range(12)], axis=0)
        apart = [abs((nearby - n * shift % 1) @ along.T).max(axis=1).min() for n in range(1, 7)]
        orders = (n for n, distance in enumerate(apart, start=1) if distance < 1e-6)
        pitch = _pitch(turn, group.lattice @ along @ shift, group.lattice @ along @ nearby.T)
        counts[round(np.linalg.det(linear)), round(np.trace(linear)), next(orders, 0), pitch] += 1
    return counts


def _pitch(turn: Array, shift: Array, steps: Array) -> float:
    """Return how far a rotation goes along its axis, as a share of the lattice's step there.

    The axis points to where the rotation is counter-clockwise. It is 0 for what has no such axis.
    """
    around = turn - turn.T
    axis = np.array([around[2, 1], around[0, 2], around[1, 0]])
    if np.linalg.det(turn) < 0 or np.linalg.norm(axis) < 1e-6:
        return 0.0
    heights = abs(axis @ steps)
    share = float(axis @ shift / heights[heights > 1e-6 * heights.max()].min())
    return round(share, 3) % 1
