"""Rotation groups of crystals and of specimens, by the names that crystallographers give them."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from orbiflow.errors import SettingError, literal
from orbiflow.settings import is_a

NAMES: dict[str, str] = {
    "C1": "1 -1 Ci triclinic",
    "C2": "112 112/m 11m",
    "C2x": "211 2/m11 m11",
    "C2y": "121 12/m1 1m1",
    "C3": "3 -3 C3i S6",
    "C4": "4 -4 4/m C4h S4",
    "C6": "6 -6 6/m C6h C3h",
    "D2": "222 mmm mm2 m2m 2mm D2h C2v orthorhombic orthotropic",
    "D3": "32 -3m 3m 321 -3m1 3m1 D3d C3v trigonal",
    "D3y": "312 -31m 31m",
    "D4": "422 4/mmm 4mm -42m -4m2 D4h C4v D2d tetragonal",
    "D6": "622 6/mmm 6mm -6m2 -62m D6h C6v D3h hexagonal",
    "T": "23 m-3 m3 Th",
    "O": "432 m-3m m3m -43m Oh Td cubic",
    "I": "532 235 Ih icosahedral",
}
"""Rotation groups as Schoenflies wrote them, and the point groups whose Laue class has these rotations.

Axes of the highest order are along z, and those of order two of D2 to D6 along x; a last letter says
another axis: C2x and C2y have theirs along x and y, D3y has one along y and none along x.
"""

_FIRST = {name: words.split()[0] for name, words in NAMES.items()}
_KNOWN = {word.casefold(): name for name, words in NAMES.items() for word in (name, *words.split())}
_MONOCLINIC = frozenset({"2", "m", "2/m", "cs", "c2h", "monoclinic"})


def rotation_group_name(name: str, what: str = "symmetry") -> str:
    """Return the rotations of a symmetry in the notation of Schoenflies.

    Args:
        name: The name of a rotation group ("432", "O"), of a point group or Laue class ("m-3m", "Oh"),
            or of a crystal system ("cubic"). A group with reflections stands for the rotations of its
            Laue class, as diffraction has them.
        what: What the symmetry is in a message: the name of an argument.

    Raises:
        SettingError: For an unknown name, and for monoclinic groups that do not say their axis.

    >>> rotation_group_name("m-3m"), rotation_group_name("6/mmm"), rotation_group_name("orthotropic")
    ('O', 'D6', 'D2')
    """
    word = name.strip().replace(" ", "").casefold() if is_a(name, str) else ""
    if word in _MONOCLINIC:
        raise SettingError(
            f"{{{what}}} {literal(name)} does not say its axis: 112 has it along z, 121 along y, 211 "
            "along x"
        )
    if word not in _KNOWN:
        systems = "triclinic, orthorhombic, tetragonal, trigonal, hexagonal, cubic"
        raise SettingError(
            f"{{{what}}} must be a point group such as 432, m-3m or 6/mmm, or one of {systems}, "
            f"got {literal(repr(name))}"
        )
    return _KNOWN[word]


def international_name(name: str) -> str:
    """Return what crystallographers call a rotation group of `rotation_group_name`.

    >>> international_name("O"), international_name("C2y")
    ('432', '121')
    """
    return _FIRST[name]


def rotations_of(name: str) -> Rotation:
    """Return the rotations of a group of `rotation_group_name`, the identity first."""
    group: Any = Rotation.create_group  # of which any order is good
    if name == "D3y":  # a quarter turn about z takes the axes along x to y
        quarter = Rotation.from_euler("z", 90, degrees=True)
        turns: Rotation = quarter * group("D3") * quarter.inv()
    else:
        turns = group(name.rstrip("xy"), {"x": "X", "y": "Y"}.get(name[-1], "Z"))
    return turns[np.argsort(turns.magnitude(), kind="stable")]
