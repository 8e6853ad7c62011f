"""Whether two groups are written alike: saved parameters are coordinates in a group's basis."""

from __future__ import annotations

from typing import Any

import numpy as np

from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.symmetry.header import group_header

__all__ = ["check_group", "group_header", "is_same_group"]

TOLERANCE = 1e-9
"""Of matrices and translations that are read as equal."""


def is_same_group(one: CrystallographicGroup, other: CrystallographicGroup) -> bool:
    """Whether lattice *basis* and coset representatives agree.

    Another basis of the same lattice numbers the frequencies otherwise: the same parameters would be
    another field.
    """
    return (
        one.lattice.shape == other.lattice.shape
        and one.order == other.order
        and np.allclose(one.lattice, other.lattice, rtol=0, atol=TOLERANCE)
        and all(other.contains(coset, TOLERANCE) for coset in one.cosets)
    )


def check_group(header: Any, group: CrystallographicGroup) -> None:
    """
    Raises:
        OrbiflowError: if `header`, from `group_header`, is of another group.
    """
    try:
        tables = [np.array(header[name], dtype=float) for name in group_header(group)]
        lattice, linear, translations = tables
        same = (
            lattice.shape == group.lattice.shape
            and linear.shape == group.linear_parts.shape
            and translations.shape == group.translations.shape
            and np.allclose(lattice, group.lattice, rtol=0, atol=TOLERANCE)
            and np.allclose(linear, group.linear_parts, rtol=0, atol=TOLERANCE)
            and np.allclose(translations, group.translations, rtol=0, atol=TOLERANCE)
        )
    except (KeyError, TypeError, ValueError, OverflowError):
        same = False
    if not same:
        raise OrbiflowError(f"its group is not {group!r}, which its space has here")
