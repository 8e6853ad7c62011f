"""A group as JSON, number for number: saved parameters are coordinates in its basis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from orbiflow.errors import GroupError
from orbiflow.symmetry.group import CrystallographicGroup
from orbiflow.symmetry.isometry import Isometry

MAX_ORDER, MAX_DIM, MAX_NAME = 2048, 64, 200


def group_header(group: CrystallographicGroup) -> dict[str, Any]:
    """Lattice (columns are basis vectors) and coset representatives, ready for JSON."""
    return {
        "lattice": group.lattice.tolist(),
        "linear": group.linear_parts.tolist(),
        "translations": group.translations.tolist(),
    }


def group_from_header(header: Mapping[str, Any], name: str = "") -> CrystallographicGroup:
    """The group of `group_header`, with the same basis and representatives, bit for bit.

    Raises:
        GroupError: for what is no group.
    """
    try:
        lattice, linear, shifts = (
            np.array(header[key], dtype=np.float64) for key in ("lattice", "linear", "translations")
        )
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise GroupError(f"a group without its numbers: {error}") from error
    d, order = len(np.atleast_1d(lattice)), len(np.atleast_1d(linear))
    shapes = (lattice.shape, linear.shape, shifts.shape)
    if shapes != ((d, d), (order, d, d), (order, d)) or not (d <= MAX_DIM and order <= MAX_ORDER):
        raise GroupError(f"a group of tables {', '.join(map(str, shapes))}")
    cosets = tuple(Isometry(*parts) for parts in zip(linear, shifts, strict=True))
    if not order or not cosets[0].is_close(Isometry(np.eye(d), np.zeros(d))):
        raise GroupError("a group whose first coset is not the identity's")
    closed = CrystallographicGroup.generate(lattice)
    chosen: list[Isometry] = []
    for coset in cosets:  # each that is new at least doubles the order
        if not closed.contains(coset):
            chosen.append(coset)
            closed = CrystallographicGroup.generate(lattice, chosen, max_order=order)
    if closed.order != order:
        raise GroupError(f"{order} cosets, of which {closed.order} differ")
    return CrystallographicGroup(closed.lattice, cosets, str(name)[:MAX_NAME])
