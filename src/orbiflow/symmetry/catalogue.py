"""Groups by name: wallpaper groups, those of the four identification spaces, flat 3-manifolds.

Space groups have a file of their own.
"""

import re
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arrays import Array
from orbiflow.errors import GroupError, NotAnIsometryError
from orbiflow.settings import as_array, refusal
from orbiflow.symmetry.group import CrystallographicGroup, checked_lattice
from orbiflow.symmetry.isometry import Isometry, Line, rotation, transflection
from orbiflow.symmetry.triplets import cell_lattice, group_from_operators

LATTICES: dict[str, list[list[float]]] = {
    "oblique": [[1.0, 0.3], [0.0, 1.1]],
    "rectangular": [[1.0, 0.0], [0.0, 1.2]],
    "rhombic": [[0.8, 0.8], [0.6, -0.6]],
    "square": [[1.0, 0.0], [0.0, 1.0]],
    "hexagonal": [[1.0, -0.5], [0.0, 0.8660254037844386]],
}
"""A default lattice of each system, with basis vectors as columns."""


class WallpaperGroup(NamedTuple):
    """A row of the table: lattice system, order of the point group, generators.

    A generator ((a, b, c, d), (u, v)) is x' = a x + b y + u, y' = c x + d y + v in fractional
    coordinates. cm and cmm are given on their primitive (rhombic) cell, whose vectors are
    (a + b) / 2 and (a - b) / 2.
    """

    system: str
    order: int
    generators: tuple[tuple[tuple[int, int, int, int], tuple[float, float]], ...]


_TURN2 = ((-1, 0, 0, -1), (0.0, 0.0))
_TURN3 = ((0, -1, 1, -1), (0.0, 0.0))
_TURN4 = ((0, -1, 1, 0), (0.0, 0.0))
_TURN6 = ((1, -1, 1, 0), (0.0, 0.0))
_MIRROR = ((-1, 0, 0, 1), (0.0, 0.0))
_SWAP = ((0, 1, 1, 0), (0.0, 0.0))
_ANTISWAP = ((0, -1, -1, 0), (0.0, 0.0))

WALLPAPER_GROUPS: dict[str, WallpaperGroup] = {
    "p1": WallpaperGroup("oblique", 1, ()),
    "p2": WallpaperGroup("oblique", 2, (_TURN2,)),
    "pm": WallpaperGroup("rectangular", 2, (_MIRROR,)),
    "pg": WallpaperGroup("rectangular", 2, (((-1, 0, 0, 1), (0.0, 0.5)),)),
    "cm": WallpaperGroup("rhombic", 2, (_ANTISWAP,)),
    "pmm": WallpaperGroup("rectangular", 4, (_TURN2, _MIRROR)),
    "pmg": WallpaperGroup("rectangular", 4, (_TURN2, ((-1, 0, 0, 1), (0.5, 0.0)))),
    "pgg": WallpaperGroup("rectangular", 4, (_TURN2, ((-1, 0, 0, 1), (0.5, 0.5)))),
    "cmm": WallpaperGroup("rhombic", 4, (_TURN2, _ANTISWAP)),
    "p4": WallpaperGroup("square", 4, (_TURN4,)),
    "p4m": WallpaperGroup("square", 8, (_TURN4, _MIRROR)),
    "p4g": WallpaperGroup("square", 8, (_TURN4, ((-1, 0, 0, 1), (0.5, 0.5)))),
    "p3": WallpaperGroup("hexagonal", 3, (_TURN3,)),
    "p3m1": WallpaperGroup("hexagonal", 6, (_TURN3, _ANTISWAP)),
    "p31m": WallpaperGroup("hexagonal", 6, (_TURN3, _SWAP)),
    "p6": WallpaperGroup("hexagonal", 6, (_TURN6,)),
    "p6m": WallpaperGroup("hexagonal", 12, (_TURN6, _ANTISWAP)),
}
"""Generators after International Tables for Crystallography, volume A, plane groups."""

_OTHER_SYMBOLS = {
    **{"o": "p1", "2222": "p2", "**": "pm", "xx": "pg", "*x": "cm", "*2222": "pmm", "22*": "pmg"},
    **{"22x": "pgg", "2*22": "cmm", "442": "p4", "*442": "p4m", "4*2": "p4g", "333": "p3"},
    **{"*333": "p3m1", "3*3": "p31m", "632": "p6", "*632": "p6m", "p211": "p2", "p1m1": "pm"},
    **{"p1g1": "pg", "c1m1": "cm", "p2mm": "pmm", "p2mg": "pmg", "p2gg": "pgg", "c2mm": "cmm"},
    **{"p4mm": "p4m", "p4gm": "p4g", "p6mm": "p6m"},
}

_TURNED = {"p11m": "pm", "p11g": "pg", "c11m": "cm", "p2gm": "pmg"}
"""Symbols in the setting with exchanged axes."""


def _plane_symbol(name: str) -> str:
    """Return the short symbol of a wallpaper group, a key of `_TURNED`, or another name as it is."""
    plain = str(name).replace("×", "x").replace(" ", "").strip("$")
    is_known = plain in WALLPAPER_GROUPS or plain in _TURNED
    return plain if is_known else _OTHER_SYMBOLS.get(plain, name)


def wallpaper_group(name: str, lattice: ArrayLike | None = None) -> CrystallographicGroup:
    """Return the wallpaper group `name`, one of `WALLPAPER_GROUPS`.

    The full symbol of the IUC ("p2mg" or "p 2 m g") and the orbifold's ("22*") name the same group as
    the short one. "p11m", "p11g", "c11m" and "p2gm" are pm, pg, cm and pmg with exchanged axes: the
    mirror of pm, pg and cm maps the first axis a to -a, that of the others b to -b. Letters may be
    large.
    The lattice has basis vectors as columns, (2, 2); by default it is one of the group's system. That
    of cm and cmm is primitive: its vectors are (a + b) / 2 and (a - b) / 2.
    Raises `GroupError` for an unknown name, or a lattice that is not of the group's system.

    >>> wallpaper_group("p6m").order
    12
    """
    symbol = _plane_symbol(str(name).lower())
    name = _TURNED.get(symbol, symbol)
    if name not in WALLPAPER_GROUPS:
        raise GroupError(
            f"unknown wallpaper group {name!r}; the 17 are {', '.join(WALLPAPER_GROUPS)}"
        )
    row = WALLPAPER_GROUPS[name]
    basis = np.asarray(LATTICES[row.system] if lattice is None else lattice, dtype=np.float64)
    if checked_lattice(basis).shape != (2, 2):
        raise GroupError(f"a wallpaper group needs a (2, 2) lattice, got shape {basis.shape}")
    generated_on = basis
    if symbol in _TURNED:  # b comes before a: in a centred cell, b - a is in the place of a - b
        generated_on = basis * [1, -1] if row.system == "rhombic" else basis[:, ::-1]
    inverse = np.linalg.inv(generated_on)
    try:
        generators = [
            Isometry(
                generated_on @ np.reshape(linear, (2, 2)) @ inverse, generated_on @ np.array(shift)
            )
            for linear, shift in row.generators
        ]
    except NotAnIsometryError as error:
        raise GroupError(
            f"{name} needs a {row.system} lattice, got basis columns {basis.T.tolist()}"
        ) from error
    return CrystallographicGroup.generate(basis, generators, name=name)


class IdentificationSpace(NamedTuple):
    """A row of the paper's table of identification spaces (design point 12).

    The space is the plane modulo the group; its canonical square is [0, 1]^2.
    """

    group: str
    lattice: tuple[tuple[float, float], tuple[float, float]]
    generators: tuple[Isometry, ...]


_HORIZONTAL_GLIDE = transflection(Line((0.0, 0.5), (1.0, 0.0)), 1.0)
_VERTICAL_GLIDE = transflection(Line((0.5, 0.0), (0.0, 1.0)), 1.0)

IDENTIFICATION_SPACES: dict[str, IdentificationSpace] = {
    "torus": IdentificationSpace("p1", ((1.0, 0.0), (0.0, 1.0)), ()),
    "sphere": IdentificationSpace("p4", ((2.0, 0.0), (0.0, 2.0)), (rotation((1.0, 1.0), 4),)),
    "klein-bottle": IdentificationSpace("pg", ((1.0, 0.0), (0.0, 2.0)), (_VERTICAL_GLIDE,)),
    "projective-plane": IdentificationSpace(
        "pgg", ((2.0, 0.0), (0.0, 2.0)), (_HORIZONTAL_GLIDE, _VERTICAL_GLIDE)
    ),
}


def identification_group(space: str) -> CrystallographicGroup:
    """Return the group of an identification space, with canonical square [0, 1]^2.

    Raises `GroupError` for an unknown space.
    """
    if space not in IDENTIFICATION_SPACES:
        raise GroupError(
            f"unknown space {space!r}; the four are {', '.join(IDENTIFICATION_SPACES)}"
        )
    row = IDENTIFICATION_SPACES[space]
    return CrystallographicGroup.generate(np.array(row.lattice).T, row.generators, name=row.group)


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
    plain_name = ALIASES.get(name, name)
    if plain_name not in FLAT_MANIFOLDS:
        names = ", ".join((*FLAT_MANIFOLDS, *ALIASES))
        raise GroupError(f"unknown flat manifold {name!r}; there are {names}")
    if cell is None:
        cell = (1, 1, 1, 90, 90, 120 if plain_name in ("tricosm", "hexacosm") else 90)
    return group_from_operators(FLAT_MANIFOLDS[plain_name], cell_lattice(cell), name=name)


SYMBOL = re.compile(r"[PABCFIR] ?[-1-6mabcden].*|[1-9]\d{0,2}(?::[12HR])?|Hall:.*")
"""What the names of space groups look like."""


def is_group_name(name: object) -> bool:
    """Return whether `group_by_name` may know a name: it need not be one of a space group.

    >>> [is_group_name(name) for name in ("p4m", "tricosm", "P 21 21 21", "torus")]
    [True, True, True, False]
    """
    if not isinstance(name, str):
        return False
    tables = (WALLPAPER_GROUPS, _TURNED, FLAT_MANIFOLDS, ALIASES)
    return any(_plane_symbol(name) in table for table in tables) or bool(SYMBOL.fullmatch(name))


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
    plane = _plane_symbol(name)
    if (row := WALLPAPER_GROUPS.get(_TURNED.get(plane, plane))) is not None:
        return wallpaper_group(plane, None if cell is None else _plane_lattice(row.system, cell))
    if name in FLAT_MANIFOLDS or name in ALIASES:
        return flat_manifold(name, cell)
    from orbiflow.symmetry.space_groups import space_group

    return space_group(name, cell)


def _plane_lattice(system: str, cell: ArrayLike) -> Array:
    """Return the primitive lattice (2, 2) of the conventional cell of a plane group."""
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
