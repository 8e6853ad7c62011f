"""Which columns, in which order, a space takes by their names: one answer for all doors."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from orbiflow.density.data.column_names import (
    FROM_POLE,
    UNITS,
    foreign_unit,
    pairs_of,
    unit_named,
    words_of,
)
from orbiflow.errors import SettingError, literal

DIRECTIONS = ("sphere", "projective-plane")
CRYSTALS = ("cubic-orientations", "hexagonal-orientations")
ROTATIONS = ("rotation-space", *CRYSTALS)
ANGULAR = ("torus", "klein-bottle")
VECTORS = (*DIRECTIONS, "hypersphere", "projective-space")


class Arrangement(NamedTuple):
    """Columns, from 0, in the order that a space takes, and what they are.

    - `words`: What they are, as in "latitude and longitude".
    - `note`: What to keep in mind of such data.
    - `form`: How they write rotations, as `RotationSpace` names it.
    """

    columns: tuple[int, ...]
    words: str
    note: str = ""
    form: str = ""


def arrangements(space: str, names: Sequence[str], width: int | None = None) -> list[Arrangement]:
    """Return every way in which some of the names say what a space's columns are.

    Args:
        space: The name of the space, or of a group.
        names: Names of columns.
        width: The number of columns that a group's space takes.

    >>> [found.columns for found in arrangements("sphere", ["lon", "lat", "mag"])]
    [(1, 0)]
    >>> [found.columns for found in arrangements("rotation-space", ["w", "x", "y", "z"])]
    [(1, 2, 3, 0)]
    """
    if space in DIRECTIONS:
        return _directions(names)
    if space in ROTATIONS:
        return _rotations(names)
    if space == "klein-bottle":
        return _named_so(names, ("theta", "phi"), "theta and phi")
    if space == "torus" or space in VECTORS:
        return []
    letters = [own for own in ("xyz", "xy") if width in (None, len(own))]
    return _lettered(names, letters, "coordinates")  # of a quotient


def _directions(names: Sequence[str]) -> list[Arrangement]:
    pairs = pairs_of(names)
    if pairs:
        words = "latitude and longitude"
        return [Arrangement((own.north, own.east), words, note=own.family.note) for own in pairs]
    return _lettered(names, ("xyz",), "unit vectors")


def _stemmed(names: Sequence[str]) -> dict[str, dict[str, int]]:
    """Return by the beginnings of names the columns (from 0) of each last letter, digit or word."""
    found: dict[str, dict[str, int]] = {}
    for column, name in enumerate(names):
        *first, last = [word for word in words_of(name) if word not in UNITS] or [""]
        if not first and len(last) > 1 and last not in _SCALARS:
            first, last = [last[:-1]], last[-1]
        found.setdefault("".join(first), {})[last] = column
    return found


_SCALARS = frozenset({"w", "s", "0", "r", "real", "scalar", "re"})


def _lettered(names: Sequence[str], letters: Sequence[str], words: str) -> list[Arrangement]:
    """Return columns that differ in their last letter alone, such as nx, ny, nz."""
    for own in letters:
        ends = [columns for columns in _stemmed(names).values() if set(own) <= columns.keys()]
        if ends:
            return [Arrangement(tuple(columns[c] for c in own), words) for columns in ends]
    return []


def _rotations(names: Sequence[str]) -> list[Arrangement]:
    """Return the columns that are rotations, by the first form that names say."""
    vector = _lettered(names, ("xyz",), "a rotation vector")
    every = {
        "ZXZ": _euler(names),
        "rodrigues": _rodrigues(names),
        "quaternion": _quaternions(names),
        "matrix": _matrices(names),
        "vector": vector,
    }
    return next(
        ([one._replace(form=form) for one in own] for form, own in every.items() if own),
        list[Arrangement](),
    )


def _rodrigues(names: Sequence[str]) -> list[Arrangement]:
    """Return Rodrigues' vectors: rodrigues1 to 3, or rodrigues_x, y, z."""
    words = "Rodrigues' vector"
    every = (_named_so(names, [f"rodrigues{e}" for e in ends], words) for ends in ("123", "xyz"))
    return next(filter(None, every), list[Arrangement]())


def _quaternions(names: Sequence[str]) -> list[Arrangement]:
    """Return quaternions: w,x,y,z, q0..q3, qw.., scalar,i,j,k, in any order of the columns."""
    found: list[Arrangement] = []
    for columns in _stemmed(names).values():
        scalars = [columns[end] for end in columns if end in _SCALARS]
        for ends in ("xyz", "ijk", "123"):
            if len(scalars) == 1 and set(ends) <= columns.keys():
                order = (*(columns[end] for end in ends), scalars[0])
                found.append(Arrangement(order, "a quaternion with its scalar last"))
    return found


def _matrices(names: Sequence[str]) -> list[Arrangement]:
    """Return rotation matrices r11 to r33, or m00 to m22, row by row."""
    stems: dict[str, dict[str, int]] = {}
    for column, name in enumerate(names):
        if found := re.fullmatch(r"(.*?)([0-3])[ _,]?([0-3])", name.strip().casefold()):
            stems.setdefault(found[1], {})[found[2] + found[3]] = column
    return [
        Arrangement(tuple(columns[place] for place in places), "a rotation matrix, row by row")
        for columns in stems.values()
        for places in ([i + j for i in own for j in own] for own in ("123", "012"))
        if set(places) == columns.keys()
    ]


def _euler(names: Sequence[str]) -> list[Arrangement]:
    """Return Bunge's Euler angles: phi1, Phi, phi2, or three numbered ones."""
    words = "Bunge's Euler angles"
    wanted = [("phi1", "phi", "phi2")]
    wanted += [tuple(f"{stem}{k}" for k in "123") for stem in ("euler", "eulerangle", "bunge")]
    return next(filter(None, (_named_so(names, own, words) for own in wanted)), list[Arrangement]())


def _named_so(names: Sequence[str], wanted: Sequence[str], words: str) -> list[Arrangement]:
    """Return the columns that have these names, whatever their case, marks and units."""
    own = ["".join(word for word in words_of(name) if word not in UNITS) for name in names]
    own = [name.replace("φ", "phi").replace("ϕ", "phi").replace("θ", "theta") for name in own]
    if any(own.count(name) != 1 for name in wanted):
        return []
    return [Arrangement(tuple(own.index(name) for name in wanted), words)]


def chosen_arrangement(
    space: str, names: Sequence[str], width: int | None = None
) -> Arrangement | None:
    """Return the columns that a space takes of a table, or None if names do not say.

    Raises:
        SettingError: If several columns may be meant.
    """
    found = arrangements(space, names, width)
    if len(found) > 1:
        ways = " or ".join(",".join(names[k] for k in one.columns) for one in found[:4])
        raise SettingError(
            literal(f"several columns may be {found[0].words}: {ways}") + "; choose with {columns}"
        )
    return found[0] if found else None


def check_columns(space: str, names: Sequence[str]) -> Arrangement | None:
    """Check that the names of a space's columns do not contradict their order, and say what they are.

    >>> check_columns("sphere", ["lat", "lon"]).words
    'latitude and longitude'
    >>> check_columns("sphere", ["Longitude (deg)", "Latitude (deg)"])
    Traceback (most recent call last):
    ...
    orbiflow.errors.SettingError: the columns are Longitude (deg), Latitude (deg), and the sphere \
takes latitude and longitude in the order Latitude (deg), Longitude (deg); give columns \
'Latitude (deg),Longitude (deg)'
    """
    _check_forms(space, names)
    found = [one for one in arrangements(space, names) if len(one.columns) == len(names)]
    if not found:
        return None
    best = found[0]
    right = [names[k] for k in best.columns]
    if right != list(names):
        raise SettingError(
            literal(
                f"the columns are {', '.join(names)}, and the {space} takes {best.words} in the order "
                f"{', '.join(right)}; give "
            )
            + "{columns} "
            + literal(f"'{','.join(right)}'")
        )
    return best


def _check_forms(space: str, names: Sequence[str]) -> None:
    """Refuse columns whose names say that they must be converted first."""
    split = [set(words_of(name)) for name in names]
    wrong: list[tuple[str, str]] = []
    if space in DIRECTIONS and len(names) == 2:
        for name, words in zip(names, split, strict=True):
            if words & FROM_POLE:
                wrong.append((name, "is the angle from the pole: give the latitude, 90 less it"))
            if (foreign := foreign_unit(name)) is not None:
                wrong.append(
                    (name, f"is in a unit of {foreign:g} to a turn: convert it to degrees")
                )
            if unit_named(name) not in (None, "degrees"):
                wrong.append((name, f"is in {unit_named(name)}: convert it to degrees"))
    if space in DIRECTIONS and len(names) > 2 and (pairs := pairs_of(names)):
        pair = f"{names[pairs[0].north]},{names[pairs[0].east]}"
        wrong.append((", ".join(names), f"are too many columns: give '{pair}' alone"))
    for name, how in wrong:
        raise SettingError(literal(f"{name} {how}"))


COUNTS_OF_COLUMNS = {"quaternion": 4, "scalar-first": 4, "matrix": 9}
"""Columns of rotations in each form; others have three."""


def rotation_form(
    space: str, names: Sequence[str] | None, width: int, form: str | None = None
) -> str | None:
    """Return in which form columns write rotations; None if nothing says it.

    Quaternions whose names say which is the scalar are "quaternion": they are read with it last.

    Args:
        space: The name of a space of rotations.
        names: Names of the columns, if they have names.
        width: The number of columns.
        form: The form that was asked for.

    Raises:
        SettingError: For a form of another number of columns, and if names leave it open.

    >>> rotation_form("rotation-space", ["Euler1", "Euler2", "Euler3"], 3)
    'ZXZ'
    >>> rotation_form("rotation-space", ["q1", "q2", "q3", "q4"], 4)
    Traceback (most recent call last):
    ...
    orbiflow.errors.SettingError: q1, q2, q3, q4: names do not say which is the quaternion's scalar; \
give form quaternion if it is the last, or scalar-first
    """
    if form is not None and COUNTS_OF_COLUMNS.get(form, 3) != width:
        count = COUNTS_OF_COLUMNS.get(form, 3)
        text = f"{{form}} {literal(form)} takes {count} columns, and there are {width}; choose "
        raise SettingError(text + "{columns}, or another form")
    named = names is not None and not all(re.fullmatch(r"column\d+", name) for name in names)
    known = [one for one in arrangements(space, names or ()) if len(one.columns) == width]
    if known and known[0].form == "quaternion":
        return "quaternion"
    if form is not None or known:
        return form or known[0].form
    if not named or width == 9:
        return None
    listed = literal(", ".join(names or ()))
    if width == 4:
        raise SettingError(
            f"{listed}: names do not say which is the quaternion's scalar; give {{form}} quaternion if "
            "it is the last, or scalar-first"
        )
    if any(
        {"roll", "pitch", "yaw", "heading"}.intersection(words_of(name)) for name in names or ()
    ):
        raise SettingError(
            f"{listed} are Euler angles: give {{form}} with the axes in the order of the columns, such "
            "as ZYX for yaw, pitch, roll"
        )
    raise SettingError(
        f"{listed}: names do not say how they write rotations; give {{form}} bunge (phi1, Phi, phi2), "
        "vector (axis times angle) or rodrigues"
    )


def check_form(space: str, names: Sequence[str], form: str) -> None:
    """Refuse columns whose names say that they write rotations in another form than `form`.

    Three Euler angles may be about any axes.
    """
    found = check_columns(space, names)
    are_euler = found is not None and found.form == "ZXZ" and len(form) == len("ZXZ")
    if found is not None and found.form != form and not are_euler:
        raise SettingError(
            literal(f"{', '.join(names)} are {found.words}, by their names, and ")
            + f"rotations of the form {form} are wanted: convert them"
        )
