"""Directions and orientations in crystals: Miller indices, named orientations, fundamental sectors."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from orbiflow.arrays import Array
from orbiflow.errors import SettingError, literal

CUBIC, HEXAGONAL = frozenset("TO"), frozenset({"C3", "C6", "D3", "D3y", "D6"})
AXIAL = frozenset({"D2", "D4", "C4"})
"""Rotation groups of crystals whose axes are alike, are a1, a2 and c at 120 degrees, or are upright."""

_INDEX = re.compile(r"-?\d")


def indices_of(text: str, what: str = "pole") -> tuple[int, ...]:
    """Return Miller indices (three, or four of hexagonal crystals) that are written without spaces.

    >>> indices_of("001"), indices_of("1-11"), indices_of("{10-11}"), indices_of("1 -2 1")
    ((0, 0, 1), (1, -1, 1), (1, 0, -1, 1), (1, -2, 1))
    """
    bare = re.sub(r"[(){}\[\]<>\s]", "", text.replace("\u2212", "-"))
    parts = re.split(r"[\s_]+", text.strip("(){}[]<> ")) if " " in text.strip() else []
    if not (parts and all(re.fullmatch(r"-?\d+", part) for part in parts)):
        parts = _INDEX.findall(bare) if re.fullmatch(r"(-?\d)+", bare) else []
    found = tuple(int(part) for part in parts)
    if len(found) not in (3, 4) or not any(found) or (len(found) == 4 and sum(found[:3])):
        raise SettingError(
            f"{{{what}}} must be Miller indices such as 001, 1-11 or, of hexagonal crystals, 10-11 "
            f"(whose first three have the sum 0), got {literal(repr(text))}"
        )
    return found


def plane_normal(
    indices: Sequence[int], symmetry: str, lattice: Sequence[float] | None = None
) -> Array:
    """Return the unit normal (3,) of lattice planes in the crystal's coordinates.

    x is along a, z along c. Of triclinic and monoclinic crystals, and where there is no crystal,
    the indices are the components along x, y and z.

    Args:
        indices: Three Miller indices, or four of trigonal and hexagonal crystals.
        symmetry: The crystal's rotations, as `rotation_group_name` has them.
        lattice: Lengths a, b, c of the crystal's axes; ratios are enough.

    Raises:
        SettingError: For four indices of other crystals, and for planes that are inclined to axes of
            different lengths if there is no `lattice`.

    >>> plane_normal((1, 1, 0), "O").round(4).tolist()
    [0.7071, 0.7071, 0.0]
    >>> plane_normal((1, 0, -1, 0), "D6").round(4).tolist()
    [0.866, 0.5, 0.0]
    """
    hexagonal = symmetry in HEXAGONAL
    text = "".join(map(str, indices))
    if len(indices) == 4 and not hexagonal:
        raise SettingError(f"{{pole}} {text} has four indices: those are of hexagonal crystals")
    h, k, m = (indices[0], indices[1], indices[-1])
    a, b, c = lattice or (1.0, 1.0, 1.0)
    uneven = {
        **dict.fromkeys(HEXAGONAL | {"C4", "D4"}, bool(m and (h or k))),
        "D2": sum(map(bool, (h, k, m))) > 1,
    }
    if lattice is None and uneven.get(symmetry, False):
        raise SettingError(
            f"{{pole}} {text} is inclined to axes of different lengths: give {{lattice}} a,b,c, such "
            "as 1,1,1.587 for titanium"
        )
    if lattice is not None and symmetry in HEXAGONAL | {"C4", "D4"} and a != b:
        raise SettingError("{lattice} of such crystals must have a equal to b")
    if symmetry not in HEXAGONAL | AXIAL:
        a = b = c = 1.0
    cell: Array = np.diag([a, b, c]).astype(np.float64)
    if hexagonal:
        cell[1] = [-a / 2, a * math.sqrt(3) / 2, 0]
    normal: Array = np.linalg.solve(cell, np.array([h, k, m], dtype=np.float64))
    return normal / np.linalg.norm(normal)


SPECIMEN = {
    **dict.fromkeys(("x", "rd"), (1, 0, 0)),
    **dict.fromkeys(("y", "td"), (0, 1, 0)),
    **dict.fromkeys(("z", "nd"), (0, 0, 1)),
}
"""Directions of a specimen: its axes, and what a rolled sheet calls them."""


def specimen_direction(text: str, what: str = "inverse") -> Array:
    """Return the unit vector (3,) of a direction of the specimen, x, RD or 110.

    >>> specimen_direction("ND").tolist()
    [0.0, 0.0, 1.0]
    """
    known = SPECIMEN.get(text.strip().casefold())
    found = indices_of(text, what) if known is None else known
    if len(found) != 3:
        raise SettingError(f"{{{what}}} must be x, y, z, RD, TD, ND or three numbers such as 110")
    return np.array(found) / np.linalg.norm(found)


ORIENTATIONS: dict[str, tuple[tuple[int, int, int], tuple[int, int, int]]] = {
    "cube": ((0, 0, 1), (1, 0, 0)),
    "goss": ((0, 1, 1), (1, 0, 0)),
    "brass": ((0, 1, 1), (2, -1, 1)),
    "copper": ((1, 1, 2), (-1, -1, 1)),
    "s": ((1, 2, 3), (6, 3, -4)),
}
"""Ideal orientations of rolled cubic metals: the plane in the sheet (z), and the direction along x."""


def named_orientation(name: str) -> Rotation:
    """Return the rotation from the crystal's to the specimen's coordinates of an ideal orientation.

    >>> named_orientation("copper").as_euler("ZXZ", degrees=True).round(2).tolist()
    [90.0, 35.26, 45.0]
    """
    normal, along = (np.array(v, dtype=np.float64) for v in ORIENTATIONS[name])
    normal, along = normal / np.linalg.norm(normal), along / np.linalg.norm(along)
    return Rotation.from_matrix(np.stack([along, np.cross(normal, along), normal]))


class Sector(NamedTuple):
    """The directions of a crystal, opposite ones alike, of which no two are images of each other.

    - `corners`: Unit vectors (C, 3) of its corners in turn, joined by great circles.
    - `labels`: Their indices.
    - `whole`: Whether it is the whole hemisphere, which has no corners.
    """

    corners: Array
    labels: tuple[str, ...]
    whole: bool = False


_AZIMUTHS = {
    "C2": (0, 180), "C2y": (0, 180), "C2x": (-90, 90), "D2": (0, 90), "C4": (0, 90), "D4": (0, 45),
    "C3": (0, 120), "C6": (0, 60), "D3": (-30, 30), "D3y": (0, 60), "D6": (0, 30),
}  # fmt: skip
"""Longitudes between which directions of the upper hemisphere are all different."""

_HEXAGONAL_LABELS = {-30: "1-100", 0: "2-1-10", 30: "10-10", 60: "11-20", 120: "-12-10"}
_UPRIGHT_LABELS = {-90: "0-10", 0: "100", 45: "110", 90: "010", 180: "-100"}


def fundamental_sector(symmetry: str) -> Sector:
    """Return the sector in which inverse pole figures are drawn, by the crystal's rotations.

    >>> fundamental_sector("O").labels, fundamental_sector("D6").labels
    (('001', '101', '111'), ('0001', '2-1-10', '10-10'))
    """
    if symmetry in CUBIC:
        labels = ("001", "101", "111") + (("011",) if symmetry == "T" else ())
        corners = np.array([[int(digit) for digit in label] for label in labels], dtype=np.float64)
        return Sector(corners / np.linalg.norm(corners, axis=1, keepdims=True), labels)
    if symmetry not in _AZIMUTHS:
        return Sector(np.zeros((0, 3)), (), whole=True)
    ends = _AZIMUTHS[symmetry]
    names = _HEXAGONAL_LABELS if symmetry in HEXAGONAL else _UPRIGHT_LABELS
    top = "0001" if symmetry in HEXAGONAL else "001"
    # a wide sector has its middle as a corner, too: arcs are below half a turn
    turns = [ends[0], (ends[0] + ends[1]) / 2, ends[1]] if ends[1] - ends[0] > 90 else [*ends]
    rim = [[math.cos(math.radians(t)), math.sin(math.radians(t)), 0.0] for t in turns]
    return Sector(np.array([[0.0, 0.0, 1.0], *rim]), (top, *(names.get(int(t), "") for t in turns)))
