"""What the name of a column says: its words, its unit, and which columns are a place together."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

UNITS = {
    "deg": "degrees", "degs": "degrees", "degree": "degrees", "degrees": "degrees", "°": "degrees",
    "rad": "radians", "rads": "radians", "radian": "radians", "radians": "radians",
    "turn": "turns", "turns": "turns",
}  # fmt: skip
"""Words for units of angles."""

FOREIGN = {
    **dict.fromkeys(("gon", "gons", "grads", "gradian", "gradians"), 400.0),
    **dict.fromkeys(("arcmin", "arcmins", "arcminute", "arcminutes"), 21_600.0),
    **dict.fromkeys(("arcsec", "arcsecs", "arcsecond", "arcseconds"), 1_296_000.0),
    **dict.fromkeys(("mrad", "mrads", "milliradian", "milliradians"), 2000 * math.pi),
    **dict.fromkeys(("mil", "mils"), 6400.0),
    **dict.fromkeys(("cycles", "rev", "revs"), 1.0),
    **dict.fromkeys(("hour", "hours", "hr", "hrs", "hms"), 24.0),
}
"""Other units by the words of names, and a turn in each: such a column is declared as a cycle."""

_FORMATS = frozenset({"decimal", "dd", "wgs", "wgs84", "gps", "j2000", "2000", "icrs", "epoch"})
"""Words that say in which form a place is written, and not which place it is."""

LATITUDES = frozenset(
    {"lat", "lats", "latitude", "latitudes", "latitud", "latitudine", "breite", "breitengrad"}
)
LONGITUDES = frozenset(
    {"lon", "lons", "long", "lng", "longitude", "longitudes", "longitud", "longitudine"}
) | {"länge", "laenge", "längengrad", "laengengrad"}
_DECLINATIONS = frozenset(
    {"dec", "decl", "declination", "déclinaison", "declinaison", "deklination"}
)
AZIMUTHS = frozenset({"az", "azi", "azim", "azimuth", "azimut", "azimuthal"})


class Family(NamedTuple):
    """Words for the angle towards the pole, and for that around it, which belong together.

    - `is_axial`: Whether they say a line without an arrow.
    - `note`: What to keep in mind of such data.
    """

    north: frozenset[str]
    east: frozenset[str]
    is_axial: bool = False
    note: str = ""


FAMILIES = (
    Family(LATITUDES, LONGITUDES),
    Family(_DECLINATIONS | {"de", "dej"}, frozenset({"ra", "raj", "rektaszension"})),
    Family(frozenset({"inc", "incl", "inclination", "inclinaison", "inklination"}), _DECLINATIONS),
    Family(frozenset({"alt", "altitude", "el", "elev", "elevation"}), AZIMUTHS),
    Family(frozenset({"plunge", "plg"}), AZIMUTHS | {"trend", "trd", "bearing"}, is_axial=True),
    Family(
        frozenset({"dip"}),
        AZIMUTHS | {"dipdir", "strike"},
        is_axial=True,
        note="these are the lines of dip; for the poles of the planes, give latitude 90 - dip and "
        "longitude dip direction + 180, or strike - 90",
    ),
)
"""A declination is a latitude in astronomy and a longitude in palaeomagnetism: its partner decides."""

_NOT_PLACES = frozenset(
    {"err", "error", "errors", "std", "sd", "sigma", "se", "unc", "uncertainty", "var", "pm", "res"}
    | {"residual", "bin", "count"}
)
"""Words of columns that say how well a place is known, or else about it."""

FROM_POLE = frozenset(
    {"colat", "colatitude", "zenith", "kolatitude", "polardistance"}
    | {"sza", "vza", "polar", "polarwinkel"}
)
"""Words for the angle from the pole, which is 90 degrees less the latitude."""

HOURS = frozenset({"h", "hr", "hrs", "hour", "hours", "hms"})

_TOKEN = re.compile(r"°|[A-Z]+(?![a-zß-ÿ])|[A-Z]?[^\W\d_A-Z]+|\d+")
_RUN_TOGETHER = re.compile(r"(?<=[A-Z])(?=(?:deg|rad|hms|dms)$)")


def words_of(name: str) -> list[str]:
    """Return the words of a name in lower case, apart where it is underscored or in camel case.

    >>> words_of("decimalLatitude"), words_of("pole_lat"), words_of("RAdeg"), words_of("wind dir (°)")
    (['decimal', 'latitude'], ['pole', 'lat'], ['ra', 'deg'], ['wind', 'dir', '°'])
    >>> words_of("Right Ascension"), words_of("dipDirection")
    (['ra'], ['dipdir'])
    """
    text = " ".join(_TOKEN.findall(_RUN_TOGETHER.sub(" ", name))).casefold()
    text = re.sub(r"\bright ascension\b", "ra", text)
    return re.sub(r"\bdip (dir|direction|azimuth|azi|az)\b", "dipdir", text).split()


def unit_named(name: str) -> str | None:
    """Return the unit of angles that a name says, or None.

    >>> unit_named("phi (deg)"), unit_named("lat_rad"), unit_named("radius")
    ('degrees', 'radians', None)
    """
    return next((UNITS[word] for word in words_of(name) if word in UNITS), None)


def foreign_unit(name: str) -> float | None:
    """Return a turn in the unit that a name ends in, where that is none of `UNITS`, or None.

    >>> foreign_unit("azimuth [gon]"), foreign_unit("ra_hours"), foreign_unit("hour")
    (400.0, 24.0, None)
    """
    words = words_of(name)
    return FOREIGN.get(words[-1]) if len(words) > 1 else None


class Pair(NamedTuple):
    """The columns, from 0, of an angle towards the pole and of that around it."""

    north: int
    east: int
    family: Family


def pairs_of(names: Sequence[str]) -> list[Pair]:
    """Return the columns that are a latitude and a longitude by their names, each pair once.

    >>> [pair[:2] for pair in pairs_of(["pickup_longitude", "pickup_latitude", "fare"])]
    [(1, 0)]
    >>> [pair[:2] for pair in pairs_of(["ra", "dec"]) + pairs_of(["dec", "inc"])]
    [(1, 0), (1, 0)]
    """
    split = [words_of(name) for name in names]
    found: list[Pair] = []
    lone: list[Pair] = []
    for family in FAMILIES:
        norths, easts = _rest(split, family.north), _rest(split, family.east)
        taken = {frozenset(pair[:2]) for pair in found}
        for i, j in product(norths, easts):
            if i != j and norths[i] == easts[j] and frozenset((i, j)) not in taken:
                found.append(Pair(i, j, family))
        if len(norths) == 1 == len(easts) and norths.keys() != easts.keys():
            lone.append(Pair(next(iter(norths)), next(iter(easts)), family))
    known = {column for pair in found for column in pair[:2]}
    found += [pair for pair in _run_together(names) if not known & set(pair[:2])]
    return found or lone[:1]


def _rest(split: Sequence[list[str]], words: frozenset[str]) -> dict[int, tuple[str, ...]]:
    """Return by column, of those with one of the words, what else their names say."""
    found: dict[int, tuple[str, ...]] = {}
    for column, own in enumerate(split):
        if words.intersection(own) and not _NOT_PLACES.intersection(own):
            skipped = words | _FORMATS | set(UNITS) | HOURS
            found[column] = tuple(word for word in own if word not in skipped)
    return found


def _run_together(names: Sequence[str]) -> list[Pair]:
    """Return pairs such as plat and plon, glat and glon."""
    lower = ["".join(words_of(name)) for name in names]
    ends = {name: k for k, name in enumerate(lower)}
    return [
        Pair(ends[name], ends[name[:-3] + east], FAMILIES[0])
        for name in ends
        for east in ("lon", "lng", "long")
        if len(name) > 3 and name.endswith("lat") and name[:-3] + east in ends
    ]
