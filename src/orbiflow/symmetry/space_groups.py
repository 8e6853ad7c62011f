"""The 230 space groups by number, Hermann-Mauguin or Hall symbol, or from a CIF; their CIF again."""

import importlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arguments import described
from orbiflow.errors import GroupError, OrbiflowError
from orbiflow.symmetry.cells import cell_lattice, default_lattice
from orbiflow.symmetry.group import CrystallographicGroup
from orbiflow.symmetry.triplets import group_from_operators, parse_operator

MAX_SYMBOL = 80


def space_group(name: int | str, cell: ArrayLike | None = None) -> CrystallographicGroup:
    """Return a space group by its number or symbol, on its primitive lattice.

    Needs the package gemmi, whose tables have 564 settings: `pip install "orbiflow[crystals]"`.

    Args:
        name: A number from 1 to 230; a Hermann-Mauguin symbol, short or full ("P 21 21 21", "P21/c"),
            with the choice of origin or axes where there are two ("F d -3 m:2", "R -3 m:R"); or a
            Hall symbol ("-P 2ybc"). A symbol that could be either is the Hermann-Mauguin one; write
            "Hall: P 2" for the other. A number, or a symbol without a choice, means origin 1,
            hexagonal axes and the unique axis b.
        cell: The conventional cell as a, b, c and alpha, beta, gamma in degrees, as lengths alone if
            the angles are right, or as a lattice (3, 3) with basis vectors as columns. Default: one of
            the group's system with a = 1.

    Raises `GroupError` for an unknown name, or a cell that the group does not fit.

    >>> space_group("P 21 21 21", (5.0, 6.0, 7.0)).order
    4
    >>> diamond = space_group(227)
    >>> diamond.name, diamond.order, diamond.cell_volume
    ('F d -3 m:1', 48, 0.25)
    """
    label, operators = _operators(name)
    if cell is None:
        cell = default_lattice(np.array([parse_operator(text, 3)[0] for text in operators]))
    return group_from_operators(operators, cell_lattice(cell), name=label)


def _operators(name: int | str) -> tuple[str, list[str]]:
    """Return the name that a group goes by, and all its operators in the conventional cell."""
    gemmi = _gemmi()
    text = str(name)[: MAX_SYMBOL + 1].strip()
    if not text.isprintable() or len(text) > MAX_SYMBOL:
        text = ""
    if text.isdecimal():
        known = gemmi.find_spacegroup_by_number(int(text)) if 1 <= int(text) <= 230 else None
    else:
        known = gemmi.find_spacegroup_by_name(text)
    if known is not None:
        return known.xhm(), [op.triplet() for op in known.operations()]
    try:
        hall = text.removeprefix("Hall:").strip()
        return hall, [op.triplet() for op in gemmi.symops_from_hall(hall)]
    except (RuntimeError, ValueError) as error:
        raise GroupError(
            f"unknown space group {described(name)}: give a number from 1 to 230, a Hermann-Mauguin "
            'symbol such as "P 21 21 21" or "R -3 m:H", or a Hall symbol such as "-P 2ybc"'
        ) from error


def _gemmi() -> Any:
    try:
        return importlib.import_module("gemmi")
    except ImportError as error:
        raise OrbiflowError(
            'space groups by name and CIFs need the package gemmi: pip install "orbiflow[crystals]"'
        ) from error
