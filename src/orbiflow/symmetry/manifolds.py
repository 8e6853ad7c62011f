"""The ten flat 3-manifolds, and groups of any dimension by their names."""

import re

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arguments import as_array, refusal
from orbiflow.arrays import Array
from orbiflow.errors import GroupError
from orbiflow.symmetry.catalogue import WALLPAPER_GROUPS, short_symbol, wallpaper_group
from orbiflow.symmetry.cells import cell_lattice
from orbiflow.symmetry.group import CrystallographicGroup, checked_lattice
from orbiflow.symmetry.space_groups import space_group
from orbiflow.symmetry.triplets import group_from_operators

FLAT_MANIFOLDS: dict[str, tuple[str, ...]] = {
    "3-torus": (),
    "dicosm": ("-x,-y,z+1/2",),
    "tricosm": ("-y,x-y,z+1/3",),
    "tetracosm": ("-y,x,z+1/4",),
    "hexacosm": ("x-y,x,z+1/6",),
    "didicosm": ("-x+1/2,-y,z+1/2", "-x,y+1/2,-z+1/2"),
    "first-amphicosm": ("x,-y,z+1/2",),
    "second-amphicosm": ("x+1/2,y+1/2,z", "x,-y,z+1/2"),
    "first-amphidicosm": ("-x,-y,z+1/2", "x+1/2,-y,z"),
    "second-amphidicosm": ("-x,-y,z+1/2", "x+1/2,-y+1/2,z"),
}
"""Generators beside the translations of the cell, in the settings of International Tables: P1, P2_1
(axis c), P3_1, P4_1, P6_1, P2_12_12_1, Pc, Cc, Pca2_1 and Pna2_1. The first six are orientable.

Names: Conway and Rossetti, Describing the platycosms, 2003."""

ALIASES = {
    "torocosm": "3-torus",
    "half-turn": "dicosm",
    "third-turn": "tricosm",
    "quarter-turn": "tetracosm",
    "sixth-turn": "hexacosm",
    "hantzsche-wendt": "didicosm",
}
"""Other names of the orientable ones."""


def flat_manifold(name: str, cell: ArrayLike | None = None) -> CrystallographicGroup:
    """Return the group of a flat 3-manifold, one of `FLAT_MANIFOLDS` or their `ALIASES`.

    Args:
        name: Its name, such as "tricosm", "third-turn" or "hantzsche-wendt".
        cell: The cell as a, b, c and alpha, beta, gamma in degrees, as lengths alone if the angles are
            right, or as a lattice (3, 3) with basis vectors as columns. Default: all lengths 1, and
            right angles, but gamma = 120 for the third and sixth turn.

    Raises `GroupError` for an unknown name, or a cell that the group does not fit.

    >>> flat_manifold("hantzsche-wendt").order
    4
    """
    own = ALIASES.get(name, name)
    if own not in FLAT_MANIFOLDS:
        known = ", ".join((*FLAT_MANIFOLDS, *ALIASES))
        raise GroupError(f"unknown flat manifold {name!r}; there are {known}")
    if cell is None:
        cell = (1, 1, 1, 90, 90, 120 if own in ("tricosm", "hexacosm") else 90)
    return group_from_operators(FLAT_MANIFOLDS[own], cell_lattice(cell), name=name)


SYMBOL = re.compile(r"-?[PABCFIRH] ?[-1-6mabcden].*|[1-9]\d{0,2}|(?i:hall) ?[:=].*")
"""What the names of space groups look like."""


def is_group_name(name: object) -> bool:
    """Return whether `group_by_name` may know a name: it need not be one of a space group.

    >>> [is_group_name(name) for name in ("p4m", "tricosm", "P 21 21 21", "torus")]
    [True, True, True, False]
    """
    if not isinstance(name, str):
        return False
    tables = (WALLPAPER_GROUPS, FLAT_MANIFOLDS, ALIASES)
    return any(short_symbol(name) in table for table in tables) or bool(SYMBOL.fullmatch(name))


def group_by_name(name: str, cell: ArrayLike | None = None) -> CrystallographicGroup:
    """Return a plane group, the group of a flat 3-manifold, or a space group.

    Args:
        name: A symbol of `wallpaper_group`, such as "p4g" or "4*2"; a name of `flat_manifold`; or a
            number or symbol of `space_group`, where Hermann-Mauguin symbols begin with a capital.
        cell: The cell: a, b and gamma in the plane, else a, b, c and alpha, beta, gamma in degrees;
            the lengths alone, if the angles are right (120 in a hexagonal plane); or a lattice, basis
            vectors as columns. It is the conventional cell, for cm and cmm a centred rectangle.
            Default: that of `wallpaper_group`, `flat_manifold` or `space_group`.

    Raises `GroupError` for an unknown name, or a cell that the group does not fit.

    >>> round(group_by_name("cm", (2.0, 3.0)).cell_volume, 9)
    3.0
    """
    if not is_group_name(name):
        raise GroupError(
            f"unknown group {name!r}: give a plane group ({', '.join(WALLPAPER_GROUPS)}), a flat "
            f"manifold ({', '.join((*FLAT_MANIFOLDS, *ALIASES))}) or a space group, such as "
            "'P 21 21 21'"
        )
    if (plane := short_symbol(name)) in WALLPAPER_GROUPS:
        return wallpaper_group(plane, None if cell is None else _plane_lattice(plane, cell))
    if name in FLAT_MANIFOLDS or name in ALIASES:
        return flat_manifold(name, cell)
    return space_group(name, cell)


def _plane_lattice(name: str, cell: ArrayLike) -> Array:
    """Return the primitive lattice (2, 2) of a plane group's conventional cell."""
    system = WALLPAPER_GROUPS[name].system
    shape = np.shape(cell)
    if shape == (2, 2):
        return checked_lattice(as_array(cell, "cell", (2, 2)))
    if shape not in ((2,), (3,)):
        wanted = "a,b or a,b,gamma (lengths, and an angle in degrees), or a (2, 2) lattice"
        raise refusal("cell", wanted, cell)
    a, b, *angle = as_array(cell, "cell", shape)
    gamma = angle[0] if angle else 120.0 if system == "hexagonal" else 90.0
    lattice = cell_lattice((a, b, a, 90.0, 90.0, gamma))[:2, :2]
    return lattice @ np.array([[0.5, 0.5], [0.5, -0.5]]) if system == "rhombic" else lattice
