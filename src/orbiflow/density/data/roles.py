"""What columns are, in a word each: angle:degrees, axial, cycle:24, positive, word, weight, ignore.

A column that is not declared has the role of its name, by one table, and the unit in which it ends.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

from orbiflow.density.data.units import TURNS, Unit, foreign_unit, number_of, unit_named, words_of
from orbiflow.errors import SettingError, literal
from orbiflow.settings import is_a

WORDS = (
    "angle:UNIT", "axial:UNIT", "cycle:PERIOD", "linear", "positive", "bounded:LOW:HIGH", "word",
    "weight", "count", "group", "ignore",
)  # fmt: skip
"""The words for what a column is; a unit is degrees, radians or turns."""

KINDS = tuple(word.partition(":")[0] for word in WORDS)
SIDES = ("weight", "count", "group", "ignore")
"""What says something of rows and is no data."""

REAL = ("linear", "positive", "bounded")


@dataclass(frozen=True)
class Role:
    """What a column is.

    - `kind`: One of `KINDS`.
    - `unit`: That of an angle or of an axis, None if it was not said.
    - `period`: After what a cycle begins again.
    - `low`, `high`: The ends between which a bounded column lies.

    >>> str(Role.of("axial:degrees")), Role.of("cycle:24").turn
    ('axial:degrees', 24.0)
    """

    kind: str
    unit: str | None = None
    period: float | None = None
    low: float = 0.0
    high: float = math.inf

    @classmethod
    def of(cls, text: Any, name: str = "") -> Role:
        """Return the role that a word says; `name` is the column's, for messages.

        Raises `SettingError` for other words.
        """
        if is_a(text, Role):
            return text
        kind, *rest = str(text).strip().casefold().split(":")
        if kind in ("angle", "axial") and (not rest or (len(rest) == 1 and rest[0] in TURNS)):
            return cls(kind, rest[0] if rest else None)
        numbers = [number_of(part) for part in rest]
        if kind == "cycle" and len(numbers) == 1 and 0 < numbers[0] < math.inf:
            return cls(kind, period=numbers[0])
        ends = len(numbers) == 2 and -math.inf < numbers[0] < numbers[1] < math.inf
        if kind == "bounded" and ends:
            return cls(kind, low=numbers[0], high=numbers[1])
        if kind in KINDS and kind not in ("cycle", "bounded") and not rest:
            return cls(kind)
        of = f" of the column {name!r}" if name else ""
        raise SettingError(
            f"{{columns}}: {literal(repr(text))}{literal(of)} is no role; the roles are "
            f"{', '.join(WORDS)}, with units {', '.join(get_args(Unit))}"
        )

    def __str__(self) -> str:
        if self.kind == "bounded":
            return f"bounded:{self.low:.15g}:{self.high:.15g}"
        rest = self.unit if self.period is None else f"{self.period:.15g}"
        return self.kind if rest is None else f"{self.kind}:{rest}"

    @property
    def is_real(self) -> bool:
        """Whether the column is of real numbers, which do not come back."""
        return self.kind in REAL

    @property
    def is_round(self) -> bool:
        """Whether the column comes back to itself: an angle, an axis or a cycle."""
        return self.kind in ("angle", "axial", "cycle")

    @property
    def is_side(self) -> bool:
        """Whether the column is no data."""
        return self.kind in SIDES

    @property
    def turn(self) -> float | None:
        """After what the column begins again, in its own unit; None of others and without a unit."""
        if self.kind in ("angle", "axial") and self.unit is not None:
            return TURNS[self.unit] / (2 if self.kind == "axial" else 1)
        return self.period

    @property
    def lacks_unit(self) -> bool:
        """Whether it is an angle or an axis of no unit."""
        return self.kind in ("angle", "axial") and self.unit is None

    def with_unit(self, unit: str | None) -> Role:
        """Return the role with a unit, if it lacks one."""
        return Role(self.kind, unit) if self.lacks_unit else self


Asked = Mapping[str | int, Role | None]
"""The columns that were named, in their order, by name or number: with their roles, if said."""


def asked_roles(columns: Any) -> dict[str | int, Role | None]:
    """Return what a declaration says of columns, in its order.

    Args:
        columns: Roles by names or numbers, {"dir": "angle:degrees", "speed": None}; or a text or a list
            of texts, "dir=angle:degrees,speed". None: nothing.

    Raises:
        SettingError: For words that are no roles, and a column that is named twice.

    >>> {name: str(role) for name, role in asked_roles("dir=angle:degrees, speed").items()}
    {'dir': 'angle:degrees', 'speed': 'None'}
    """
    if columns is None:
        return {}
    pairs: Any = columns.items() if is_a(columns, Mapping) else None
    if pairs is None:
        texts = columns.split(",") if is_a(columns, str) else columns
        if not is_a(texts, Sequence) or not all(is_a(text, str | int) for text in texts):
            raise SettingError(
                "{columns} must be roles by columns, such as {{'dir': 'angle:degrees'}}, or names with "
                f"roles, such as 'dir=angle:degrees,speed=positive'; got {literal(repr(columns))}"
            )
        pairs = map(_pair, texts)
    roles: dict[str | int, Role | None] = {}
    for key, word in pairs:
        name = key.strip() if isinstance(key, str) else key
        if name in roles:
            raise SettingError(
                f"{{columns}} names {literal(repr(name))} twice: name each column once"
            )
        roles[name] = None if word is None else Role.of(word, str(name))
    return roles


def _pair(text: str | int) -> tuple[str | int, str | None]:
    name, sign, role = str(text).rpartition("=")
    return (name, role) if sign else (text, None)


# fmt: off
ROLES: dict[str, tuple[str, ...]] = {
    "angle": (
        "angle", "angles", "phi", "psi", "chi", "omega", "theta", "alpha", "beta", "gamma", "delta",
        "epsilon", "zeta", "dihedral", "torsion", "phase", "direction", "dir", "wdir", "heading",
        "bearing", "course", "cog", "aspect", "azimuth", "az", "trend", "rotation", "roll", "pitch",
        "yaw", "tilt", "twist", "winkel", "richtung",
    ),
    "cycle:24": ("hour", "hours", "hr"),
    "cycle:12": ("month",),
    "cycle:7": ("weekday",),
    "cycle:365.25": ("doy", "yday", "dayofyear"),
    "ignore": ("id", "ids", "idx", "index", "row", "unnamed", "resid", "resseq",
        "chain", "draw", "iteration"),
}
# fmt: on
"""The table of names: the role of a column by a word of its name.

Which columns a sphere, axes, rotations and quotients take is in `names.py`.
"""

AXIAL = frozenset(
    {"strike", "strikes", "orientation", "orientations", "axis", "axes", "axial", "fibre", "fibres"}
    | {"fiber", "fibers", "lineation", "lineations", "lineament", "lineaments"}
)
"""Words for lines without an arrow, whose angles come back after half a turn: such a column is asked
for, whatever its unit."""

_BY_WORD = {word: role for role, words in ROLES.items() for word in words}


def role_named(name: str) -> Role | None:
    """Return the role that the name of a column says, or None.

    The table of names says what it is, and the name's end in which unit; a name in another unit says
    nothing.

    >>> [str(role_named(name)) for name in ("phi_deg", "chi1", "x (rad)", "hour", "speed", "az_gon")]
    ['angle:degrees', 'angle', 'angle:radians', 'cycle:24', 'None', 'None']
    >>> role_named("fibre orientation (deg)")  # of an axis, or of an arrow
    """
    words, unit = words_of(name), unit_named(name)
    if foreign_unit(name) is not None or AXIAL.intersection(words):
        return None
    word = next((_BY_WORD[key] for key in ["".join(words), *words] if key in _BY_WORD), None)
    role = Role.of(word or "angle")
    if unit is not None:
        return Role("angle", unit)
    return role if word is not None else None
