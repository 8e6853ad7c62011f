"""Settings of a search for solids whose copies fill space."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.settings import (
    Count,
    DefaultText,
    FileSettings,
    Length,
    LengthOrZero,
    OnlyWith,
    Parsed,
    Range,
    Repeated,
    Seed,
    Settings,
)

if TYPE_CHECKING:
    from orbiflow.arrays import Array

MOST_WEIGHT = 100.0
DEFAULT_WEIGHT = 5.0


class EmphasisSphere(NamedTuple):
    """A part of a solid that matters more, in the coordinates of its file.

    - `center`: (x, y, z), and `radius`.
    - `weight`: How much more it matters than the rest.
    """

    center: tuple[float, float, float]
    radius: float
    weight: float = DEFAULT_WEIGHT

    def weights(self, points: Array) -> Array:
        """Return how much more points (n, 3) matter (n,): less and less near the sphere's edge."""
        import numpy as np

        away = np.linalg.norm(points - self.center, axis=1) / self.radius
        return 1 + (self.weight - 1) / (1 + np.exp((away - 1) / 0.1))


class Painted(NamedTuple):
    """What is painted on a mesh, and how much more it matters than the rest."""

    weight: float = DEFAULT_WEIGHT


def emphasised(text: str) -> EmphasisSphere | Painted:
    """Return what a text emphasises: x, y, z and the radius of a sphere, or painted; perhaps a weight.

    >>> emphasised("0, 10, 2, 4")
    EmphasisSphere(center=(0.0, 10.0, 2.0), radius=4.0, weight=5.0)
    >>> emphasised("painted, 8")
    Painted(weight=8.0)
    """
    words = re.split(r"[,\s]+", text.strip())
    painted = words[0].lower() == "painted"
    try:
        values = [float(word) for word in words[painted:]]
    except ValueError:
        values = [math.nan]
    if len(values) not in ((0, 1) if painted else (4, 5)) or not all(map(math.isfinite, values)):
        raise OrbiflowError(
            f"{text!r} is neither a sphere nor painted; write x,y,z,radius in the file's coordinates, "
            "or painted, and perhaps a weight"
        )
    *place, weight = values if len(values) in (1, 5) else [*values, DEFAULT_WEIGHT]
    if not 1 / MOST_WEIGHT <= weight <= MOST_WEIGHT or (place and place[3] <= 0):
        raise OrbiflowError(
            f"{text!r}: the radius must be above 0, and the weight from {1 / MOST_WEIGHT:g} to "
            f"{MOST_WEIGHT:g}"
        )
    return (
        EmphasisSphere((place[0], place[1], place[2]), place[3], weight)
        if place
        else Painted(weight)
    )


def group_names(text: str) -> tuple[str, ...]:
    """Return the space groups that a text names, between commas.

    >>> group_names("P-1, P 21 21 21,19")
    ('P-1', 'P 21 21 21', '19')
    """
    return tuple(name for part in text.split(",") if (name := part.strip()))


class FillSettings(Settings, group="Search"):
    """Which solids that fill space are looked for, and for how long.

    >>> FillSettings(effort="fast").effort
    'fast'
    """

    groups: Annotated[
        tuple[str, ...] | None,
        Parsed(group_names, "space groups such as 'P-1,P 21 21 21' or 2,19", "GROUPS"),
        DefaultText("those that usually give the best solids"),
    ] = None
    """Space groups by number or symbol, between commas. Those with mirrors are refused: a mirror would
    cut each solid flat."""

    effort: Literal["fast", "normal"] = "normal"
    """How long the search takes: a minute or two, or some five."""

    method: Literal["bending", "flow"] = "bending"
    """How what is left between bent copies is divided: cell by cell, or by a symmetric flow of a simple
    solid, which is always one piece (needs torch)."""

    separable: bool = False
    """Look only for solids that come apart: each can be drawn out of a stack by a straight move. In P 1
    and P -1."""

    size: Annotated[Length | None, DefaultText("that of the file, in mm")] = None
    """Longest side of the target's box."""

    emphasis: Annotated[tuple[str, ...], Repeated()] = ()
    """What matters five times as much as the rest, or as a last number says: the inside of a sphere
    x,y,z,radius in the coordinates of the file; or painted, all that is painted on the mesh in another
    colour than most of it. May be repeated."""

    up: Annotated[
        Literal["x", "y", "z"] | None, DefaultText("y of an OBJ or glTF, z of other files")
    ] = None
    """The axis of the file that points up in pictures."""

    tiles: Annotated[int, Range(1, 20)] = 3
    """Number of solids that are kept, of different groups."""

    detail: Annotated[int, Range(5_000, 400_000)] = 60_000
    """Number of small cells that a solid is made of, before it is smoothed."""

    seed: Seed = 0
    """Moves the places that are tried first."""

    workers: Annotated[Count | None, DefaultText("one per core")] = None
    """Number of processes."""

    @property
    def emphasised(self) -> tuple[EmphasisSphere | Painted, ...]:
        """What matters more."""
        return tuple(map(emphasised, self.emphasis))

    def check(self) -> None:
        super().check()
        if self.separable and self.method == "flow":
            raise SettingError("{separable} solids are made by {method} 'bending' only")
        try:
            _ = self.emphasised
        except OrbiflowError as error:
            raise SettingError(f"{{emphasis}} {error}") from error


class BuildSettings(FileSettings, group="Pieces"):
    """What is made of a solid that fills space, to hold in the hand; lengths in mm.

    >>> BuildSettings(kind="stack").copies
    8
    """

    kind: Literal["tile", "stack", "block", "puzzle"] = "tile"
    """One solid; a stack of copies in colours; a block with a flat bottom to start a stack on; a puzzle
    of copies in an open box."""

    format: Annotated[Literal["stl", "3mf"] | None, DefaultText("3mf")] = None
    """Format of the file. A 3MF has colours; parts beside each other are objects of their own."""

    size: Annotated[Length | None, DefaultText("as the search made it")] = None
    """Longest side of the solid's box."""

    copies: Annotated[int, Range(2, 200), OnlyWith(kind=("stack", "puzzle"))] = 8
    """Number of copies."""

    clearance: LengthOrZero = 0.25
    """Gap between copies that are put together."""

    wall: Annotated[Length, OnlyWith(kind=("block", "puzzle"))] = 3.0
    """Thickness of the walls of a block or box."""

    floor: Annotated[Length, OnlyWith(kind=("block", "puzzle"))] = 2.0
    """Thickness of its floor."""

    nozzle: Annotated[Length, OnlyWith(kind="tile")] = 0.4
    """Width of the printer's line: notes say where the solid is thinner."""

    assembled: Annotated[bool, OnlyWith(kind="puzzle")] = False
    """Leave the pieces in the box, to look at; else they lie beside it, to print."""

    @property
    def usual_format(self) -> str:
        """3MF: it has colours."""
        return "3mf"
