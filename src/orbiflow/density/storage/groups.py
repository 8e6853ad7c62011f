"""A group as JSON, and whether two are the same: saved parameters are coordinates in its basis."""

from __future__ import annotations

from typing import Any

import numpy as np

from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup

TOLERANCE = 1e-9
"""Of matrices and translations that are read as equal."""


def group_header(group: CrystallographicGroup) -> dict[str, Any]:
    """Lattice (columns are basis vectors) and coset representatives, ready for JSON."""
    return {
        "lattice": group.lattice.tolist(),
        "linear": group.linear_parts.tolist(),
        "translations": group.translations.tolist(),
    }


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
