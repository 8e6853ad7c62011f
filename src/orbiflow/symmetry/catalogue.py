"""The 17 wallpaper groups and the groups of the four identification spaces, as tables."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.errors import GroupError, NotAnIsometryError
from orbiflow.symmetry.group import CrystallographicGroup, checked_lattice
from orbiflow.symmetry.isometry import Isometry, Line, rotation, transflection

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
    coordinates. cm and cmm are given on their primitive (rhombic) cell.
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
    "cm": WallpaperGroup("rhombic", 2, (_SWAP,)),
    "pmm": WallpaperGroup("rectangular", 4, (_TURN2, _MIRROR)),
    "pmg": WallpaperGroup("rectangular", 4, (_TURN2, ((-1, 0, 0, 1), (0.5, 0.0)))),
    "pgg": WallpaperGroup("rectangular", 4, (_TURN2, ((-1, 0, 0, 1), (0.5, 0.5)))),
    "cmm": WallpaperGroup("rhombic", 4, (_TURN2, _SWAP)),
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

_TURNED = {"p11m": "pm", "p11g": "pg", "p2gm": "pmg"}
"""Symbols in the setting with exchanged axes."""


def short_symbol(name: str) -> str:
    """Return the short symbol of a wallpaper group, and any other name as it is."""
    plain = str(name).replace("×", "x").replace(" ", "").strip("$")
    return plain if plain in WALLPAPER_GROUPS else _OTHER_SYMBOLS.get(plain, name)


def wallpaper_group(name: str, lattice: ArrayLike | None = None) -> CrystallographicGroup:
    """Return the wallpaper group `name`, one of `WALLPAPER_GROUPS`.

    The full symbol of the IUC ("p2mg" or "p 2 m g") and the orbifold's ("22*") name the same group as
    the short one. "p11m", "p11g" and "p2gm" are pm, pg and pmg with the other axis first. Letters may
    be large.
    The lattice has basis vectors as columns, (2, 2); by default it is one of the group's system.
    Raises `GroupError` for an unknown name, or a lattice that is not of the group's system.

    >>> wallpaper_group("p6m").order
    12
    """
    name = short_symbol(str(name).lower())
    turned = _TURNED.get(name.replace(" ", ""))
    if turned is not None:
        name = turned
    if name not in WALLPAPER_GROUPS:
        raise GroupError(
            f"unknown wallpaper group {name!r}; the 17 are {', '.join(WALLPAPER_GROUPS)}"
        )
    row = WALLPAPER_GROUPS[name]
    basis = np.asarray(LATTICES[row.system] if lattice is None else lattice, dtype=np.float64)
    if checked_lattice(basis).shape != (2, 2):
        raise GroupError(f"a wallpaper group needs a (2, 2) lattice, got shape {basis.shape}")
    generated_on = basis if turned is None else basis[:, ::-1]  # the other axis comes first
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
