"""What the name of a column says: a latitude, an angle, a unit, a count, or no angle at all."""

from __future__ import annotations

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

# fmt: off
FOREIGN = {
    "gon": "gon", "gons": "gon", "grads": "gon", "gradian": "gon", "gradians": "gon",
    "arcmin": "arcminutes", "arcmins": "arcminutes", "arcminute": "arcminutes",
    "arcminutes": "arcminutes", "arcsec": "arcseconds", "arcsecs": "arcseconds",
    "arcsecond": "arcseconds", "arcseconds": "arcseconds", "mrad": "milliradians",
    "mrads": "milliradians", "milliradian": "milliradians", "milliradians": "milliradians",
    "mil": "mils, 6400 to a turn", "mils": "mils, 6400 to a turn", "cycles": "cycles",
}
# fmt: on
"""Such units by the words of names; "grad" is gon in English and degrees in German."""

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

FROM_VERTICAL = frozenset({"tilt", "inc", "incl", "inclination", "incidence", "neigung"})
"""Words for an angle that, beside an azimuth, is counted from the vertical as a rule."""

HOURS = frozenset({"h", "hr", "hrs", "hour", "hours", "hms"})

# fmt: off
ANGLES = frozenset((
    "phi", "psi", "chi", "omega", "theta", "alpha", "beta", "gamma", "delta", "epsilon", "zeta",
    "angle", "angles", "winkel", "dihedral", "torsion", "phase", "argument", "tilt", "roll",
    "pitch", "yaw", "direction", "dir", "wdir", "wd", "heading", "bearing", "course", "cog",
    "aspect", "strike", "trend", "rotation", "twist", "richtung", "windrichtung",
)) | AZIMUTHS
# fmt: on
"""Words for angles in general."""

AXIAL = frozenset(
    {"strike", "strikes", "orientation", "orientations", "axis", "axes", "axial", "fibre", "fibres"}
    | {"fiber", "fibers", "lineation", "lineations", "lineament", "lineaments"}
)
"""Words for lines without an arrow, whose angles come back after half a turn."""

# fmt: off
OTHERS = frozenset((
    "temp", "temperature", "temperatur", "length", "len", "distance", "dist", "radius", "mass",
    "speed", "spd", "sknt", "windspeed", "velocity", "wspd", "ws", "gust", "pressure", "humidity",
    "rain", "precipitation",
    "depth", "height", "width", "size", "area", "volume", "resolution", "occupancy", "bfactor",
    "score", "energy", "charge", "magnitude", "mag", "price", "year", "month", "date", "time",
    "timestamp", "hour", "hours", "day", "weekday", "doy", "age", "probability", "pvalue",
    "density", "log_prob", "hdr", "id", "ids", "idx", "index", "resid", "resi", "resseq", "resnum",
    "residue", "serial", "chain", "draw", "iteration", "lp",
))
# fmt: on
"""Words for quantities and numbers that do not come back to themselves after a turn."""

# fmt: off
COUNTS = frozenset((
    "count", "counts", "n", "num", "nobs", "freq", "frequency", "frequencies", "weight", "weights",
    "anzahl", "häufigkeit", "haeufigkeit", "gewicht", "effectif", "hits", "events",
))
# fmt: on
"""Words for how often a row was seen, or how much it counts."""

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


def foreign_unit(name: str) -> str | None:
    """Return the unit that a name says and that is not read, or None.

    >>> foreign_unit("azimuth [gon]"), foreign_unit("phi_deg")
    ('gon', None)
    """
    return next((FOREIGN[word] for word in words_of(name) if word in FOREIGN), None)


def is_angle_named(name: str) -> bool:
    """Return whether a name says that a column holds angles.

    >>> is_angle_named("chi1"), is_angle_named("bond length"), is_angle_named("a")
    (True, False, False)
    """
    words = set(words_of(name))
    known = ANGLES | LATITUDES | LONGITUDES | set(UNITS)
    return bool(words & known) or any(word.endswith(("angle", "winkel")) for word in words)


CYCLES = {
    "hour": (24.0, 0.0, 24.0), "hours": (24.0, 0.0, 24.0), "hr": (24.0, 0.0, 24.0),
    "month": (12.0, 1.0, 12.0), "weekday": (7.0, 0.0, 7.0),
    "doy": (365.25, 0.0, 366.0), "yday": (365.25, 0.0, 366.0), "dayofyear": (365.25, 0.0, 366.0),
}  # fmt: skip
"""Periods of columns by their names, and the least and the largest value that they then have."""


class Cycle(NamedTuple):
    """The period that a column has by its name, and the least and the largest value it then has."""

    period: float
    least: float
    most: float


def cycle_named(name: str, turn: float | None) -> Cycle | None:
    """Return the cycle that a column has by its name; None if it says none.

    `turn` is that of angles, if there are any.

    >>> cycle_named("hour", None), cycle_named("temperature", 360.0)
    (Cycle(period=24.0, least=0.0, most=24.0), None)
    """
    words = words_of(name)
    if turn is not None and set(words) & ANGLES:
        return Cycle(turn, -1.001 * turn, 1.001 * turn)
    own = ("".join(words), *words)
    return next((Cycle(*CYCLES[one]) for one in own if one in CYCLES), None)


def is_other_quantity(name: str) -> bool:
    """Return whether a name says that a column holds no angles but another quantity.

    >>> is_other_quantity("bond length"), is_other_quantity("bond angle"), is_other_quantity("x")
    (True, False, False)
    """
    return bool(OTHERS.intersection(words_of(name))) and not is_angle_named(name)


def is_count_named(name: str) -> bool:
    """Return whether a name says how often a row was seen, or how much it counts.

    >>> is_count_named("count"), is_count_named("n"), is_count_named("county")
    (True, True, False)
    """
    return bool(COUNTS.intersection(words_of(name))) and not is_angle_named(name)


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
