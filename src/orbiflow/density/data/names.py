"""Which columns, in which order, a space takes by their names: one table."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from itertools import islice, product
from typing import NamedTuple

from orbiflow.density.data.units import (
    DIRECTIONS,
    FOREIGN,
    ROTATIONS,
    UNITS,
    VECTORS,
    foreign_unit,
    unit_named,
    words_of,
)
from orbiflow.errors import SettingError, literal


class NamedColumns(NamedTuple):
    """Columns that a space takes together.

    - `slots`: The words for each of them, in the order that the space takes.
    - `words`: What they are, as in "latitude and longitude".
    - `form`: How they write rotations, as `RotationSpace` names it.
    - `stems`: What else their names may say, the same in all of them. None: anything.
    - `is_axial`: Whether the words say a line without an arrow.
    - `note`: What to keep in mind of such data.
    - `columns`: Those of a table, from 0.
    """

    slots: tuple[frozenset[str], ...]
    words: str
    form: str = ""
    stems: Collection[str] | None = None
    is_axial: bool = False
    note: str = ""
    columns: tuple[int, ...] = ()


def _slots(*words: str) -> tuple[frozenset[str], ...]:
    return tuple(frozenset(text.split()) for text in words)


_LAT = "lat lats latitude latitudes latitud latitudine breite breitengrad"
_LON = "lon lons long lng longitude longitudes longitud longitudine länge laenge längengrad laengengrad"
LATITUDES, LONGITUDES = _slots(_LAT, _LON)
_DEC = "dec decl declination déclinaison declinaison deklination"
_AZIMUTH = "az azi azim azimuth azimut azimuthal"
_SCALAR = "w s 0 r real scalar re"
_DIPS = (
    "these are the lines of dip; for the poles of the planes, give latitude 90 - dip and longitude dip "
    "direction + 180, or strike - 90"
)
_BUNGE, _QUATERNION = "Bunge's Euler angles", "a quaternion with its scalar last"
_RODRIGUES, _MATRIX = "Rodrigues' vector", "a rotation matrix, row by row"
_PLACE = "latitude and longitude"

PLACES = (
    NamedColumns(_slots(_LAT, _LON), _PLACE),
    NamedColumns(_slots(f"{_DEC} de dej", "ra raj rektaszension"), _PLACE),
    NamedColumns(_slots("inc incl inclination inclinaison inklination", _DEC), _PLACE),
    NamedColumns(_slots("alt altitude el elev elevation", _AZIMUTH), _PLACE),
    NamedColumns(_slots("plunge plg", f"{_AZIMUTH} trend trd bearing"), _PLACE, is_axial=True),
    NamedColumns(_slots("dip", f"{_AZIMUTH} dipdir strike"), _PLACE, is_axial=True, note=_DIPS),
)
"""A declination is a latitude in astronomy and a longitude in palaeomagnetism: its partner decides."""

EULER = (
    NamedColumns(_slots("phi1", "phi", "phi2"), _BUNGE, "ZXZ", ("",)),
    NamedColumns(_slots(*"123"), _BUNGE, "ZXZ", ("euler", "eulerangle", "bunge")),
)
RODRIGUES = tuple(
    NamedColumns(_slots(*ends), _RODRIGUES, "rodrigues", ("rodrigues",)) for ends in ("123", "xyz")
)
QUATERNIONS = tuple(
    NamedColumns(_slots(*ends, _SCALAR), _QUATERNION, "quaternion")
    for ends in ("xyz", "ijk", "123")
)
MATRICES = tuple(
    NamedColumns(_slots(*(i + j for i in ends for j in ends)), _MATRIX, "matrix")
    for ends in ("123", "012")
)


def _lettered(letters: str, words: str, form: str = "") -> tuple[NamedColumns]:
    return (NamedColumns(_slots(*letters), words, form),)


_FORMATS, _NO_DATA, FROM_POLE = _slots(
    "decimal dd wgs wgs84 gps j2000 2000 icrs epoch h",
    "err error errors std sd sigma se unc uncertainty var pm res residual bin count",
    "colat colatitude zenith kolatitude polardistance sza vza polar",
)
"""Words that say in which form a column is written; that it says how well another is known; and that it
is the angle from the pole, which is 90 degrees less the latitude."""

_IGNORED = _FORMATS | UNITS.keys() | FOREIGN.keys()

_GREEK = str.maketrans({"φ": "phi", "ϕ": "phi", "θ": "theta"})

MOST_WAYS = 5
"""Ways to arrange columns that are looked at: of two, one must choose."""


def arrangements(space: str, names: Sequence[str], width: int | None = None) -> list[NamedColumns]:
    """Return every way in which some of the names say what a space's columns are.

    Args:
        space: The name of the space, or of a group.
        names: Names of columns.
        width: The number of columns that a group's space takes.

    >>> [way.columns for way in arrangements("sphere", ["lon", "lat", "mag"])]
    [(1, 0)]
    >>> [way.columns for way in arrangements("rotation-space", ["w", "x", "y", "z"])]
    [(1, 2, 3, 0)]
    """
    if space in DIRECTIONS:
        kinds = (PLACES, _lettered("xyz", "unit vectors"))
    elif space == ROTATIONS:
        vector = _lettered("xyz", "a rotation vector", "vector")
        kinds = (EULER, RODRIGUES, QUATERNIONS, MATRICES, vector)
    elif space == "klein-bottle":
        kinds = ((NamedColumns(_slots("theta", "phi"), "theta and phi", stems=("",)),),)
    elif space == "torus" or space in VECTORS:
        kinds = ()
    else:  # of a quotient
        kinds = [
            _lettered(xyz, "coordinates") for xyz in ("xyz", "xy") if width in (None, len(xyz))
        ]
    split = [[w.translate(_GREEK) for w in words_of(n) if w not in _IGNORED] for n in names]
    for alike in kinds:
        ways = {frozenset(way.columns): way for kind in alike for way in _ways(kind, split)}
        if ways:
            return list(ways.values())
    return []


def _ways(kind: NamedColumns, names: Sequence[Sequence[str]]) -> Iterator[NamedColumns]:
    """Yield the columns, by the words of their names, that are an arrangement of a kind."""
    by_stem: list[dict[str, list[int]]] = []
    for slot in kind.slots:
        by_stem.append({})
        for column, words in enumerate(names):
            stem = None if _NO_DATA.intersection(words) else _stem(words, slot)
            if stem is not None and (kind.stems is None or stem in kind.stems):
                by_stem[-1].setdefault(stem, []).append(column)
    for stem in by_stem[0]:
        places = product(*(columns.get(stem, ()) for columns in by_stem))
        for columns in islice((way for way in places if len(set(way)) == len(way)), MOST_WAYS):
            yield kind._replace(columns=columns)


def _stem(words: Sequence[str], slot: frozenset[str]) -> str | None:
    """Return what words say besides one of a slot, None if it is not among them."""
    joined = "".join(words)
    if joined in slot:
        return ""
    for k, word in enumerate(words):
        if word in slot:
            return "".join([*words[:k], *words[k + 1 :]])
    ends = [word for word in slot if joined.endswith(word)]
    return joined[: -len(max(ends, key=len))] if ends else None


def chosen_arrangement(
    space: str, names: Sequence[str], width: int | None = None
) -> NamedColumns | None:
    """Return the columns that a space takes of a table, or None if names do not say.

    Raises:
        SettingError: If several columns may be meant.
    """
    ways = arrangements(space, names, width)
    if len(ways) > 1:
        listed = " or ".join(",".join(names[k] for k in way.columns) for way in ways[:4])
        raise SettingError(
            literal(f"several columns may be {ways[0].words}: {listed}") + "; choose with {columns}"
        )
    return ways[0] if ways else None


def check_columns(space: str, names: Sequence[str]) -> NamedColumns | None:
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
    ways = arrangements(space, names)
    if space in DIRECTIONS and len(names) == 2:
        for name in names:
            turn, unit = foreign_unit(name), unit_named(name)
            words = [word.translate(_GREEK) for word in words_of(name)]
            if FROM_POLE.intersection(words):
                raise SettingError(
                    literal(f"{name} is from the pole: give the latitude, 90 less it")
                )
            if "theta" in words:
                raise SettingError(
                    literal(
                        f"{name} may be from the pole or around it: give columns that are called "
                    )
                    + "lat and lon, where lat is 90 less the angle from the pole"
                )
            if turn is not None or unit not in (None, "degrees"):
                unit = unit or f"a unit of {turn:g} to a turn"
                raise SettingError(literal(f"{name} is in {unit}: convert it to degrees"))
    elif space in DIRECTIONS and ways and len(ways[0].columns) == 2:
        pair = ",".join(names[k] for k in ways[0].columns)
        raise SettingError(literal(f"{', '.join(names)} are too many: give '{pair}' alone"))
    whole = next((way for way in ways if len(way.columns) == len(names)), None)
    if whole is not None and list(whole.columns) != sorted(whole.columns):
        right = [names[k] for k in whole.columns]
        raise SettingError(
            literal(
                f"the columns are {', '.join(names)}, and the {space} takes {whole.words} in the "
            )
            + literal(f"order {', '.join(right)}; give ")
            + "{columns} "
            + literal(f"'{','.join(right)}'")
        )
    return whole


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
    count = COUNTS_OF_COLUMNS.get(form or "", 3)
    if form is not None and count != width:
        raise SettingError(
            f"{{form}} {literal(form)} takes {count} columns, and there are {width}; choose "
            "{columns}, or another form"
        )
    by_name = [way.form for way in arrangements(space, names or ()) if len(way.columns) == width]
    if "quaternion" in by_name:
        return "quaternion"
    if form is not None or by_name:
        return form or by_name[0]
    if names is None or width == 9 or all(is_number_name(name) for name in names):
        return None
    if width == 4:
        cure = (
            ": names do not say which is the quaternion's scalar; give {form} quaternion if it is "
        )
        cure += "the last, or scalar-first"
    elif {"roll", "pitch", "yaw", "heading"}.intersection(words_of(" ".join(names))):
        cure = (
            " are Euler angles: give {form} with the axes in the order of the columns, such as ZYX "
        )
        cure += "for yaw, pitch, roll"
    else:
        cure = ": names do not say how they write rotations; give {form} bunge (phi1, Phi, phi2), "
        cure += "vector (axis times angle) or rodrigues"
    raise SettingError(literal(", ".join(names)) + cure)


def check_form(space: str, names: Sequence[str], form: str) -> None:
    """Refuse columns whose names say that they write rotations in another form than `form`.

    Three Euler angles may be about any axes.
    """
    way = check_columns(space, names)
    are_euler = way is not None and way.form == "ZXZ" and len(form) == len("ZXZ")
    if way is not None and way.form != form and not are_euler:
        raise SettingError(
            literal(f"{', '.join(names)} are {way.words}, by their names, and ")
            + f"rotations of the form {form} are wanted: convert them"
        )


def is_number_name(name: str) -> bool:
    """Return whether a column is called after its number, as one without a name is.

    >>> is_number_name("column3"), is_number_name("phi")
    (True, False)
    """
    return re.fullmatch(r"(column|angle)\d+", name) is not None
