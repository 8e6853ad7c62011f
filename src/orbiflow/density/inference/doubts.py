"""What makes one doubt that data, or known angles, are in the unit of a density."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch

from orbiflow.arrays import Array
from orbiflow.density.data import (
    DIRECTIONS,
    TURN_TOLERANCE,
    TURNS,
    codes_among,
    is_angular,
    place_doubts,
    refuse_codes,
    refuse_codes_of,
    seeming_unit,
)
from orbiflow.density.inference.angles import at_observed
from orbiflow.density.models import Density
from orbiflow.density.spaces import MixedTorus, ProductSpace, Space, Torus
from orbiflow.errors import OrbiflowError, SettingError, literal

FEW_ROWS = 10
"""Fewer may all be small by accident."""

MOST_ROWS = 256
"""Rows by which it is judged in which unit data are likelier."""

WORDS = {"radians": "2 pi", "degrees": "360", "turns": "1"}
"""A turn in each unit."""


def data_doubts(
    density: Density, values: Array, names: Sequence[str] | None, cure: str
) -> list[str]:
    """Return what makes one doubt that data (N, k), of which some may be missing, are in its unit.

    One doubts if the values may be in another unit and are likelier in it, by the density, and what one
    doubts of places.

    Raises:
        SettingError: For codes for missing values; `cure` says what to do with them.
    """
    space, width = density.space, values.shape[1] if values.ndim == 2 else 0
    called = [f"column{k}" for k in range(1, width + 1)] if names is None else list(names)
    if isinstance(space, MixedTorus) and width == space.dim:
        return _mixed_doubts(density, space, values, called, cure)
    if isinstance(space, ProductSpace):
        refuse_codes_beside(space, values, called, cure)
        is_place = space.base.name in DIRECTIONS and width - space.beside.dim == 2
        return _places(space.base, values[:, :2], called[:2], cure) if is_place else []
    unit = data_unit(space, width)
    if not values.size:
        return []
    if unit is None:
        if values.ndim == 2:
            refuse_codes(space.name, values, called, "", cure)
        return []
    # a few angles in radians that go on turning may be among the codes
    read_as = unit if len(values) >= FEW_ROWS else "degrees"
    refuse_codes(space.name, values, called, read_as, cure)
    found: list[str] = []
    if not is_angular(space.name, width):
        found = [doubt.text for doubt in place_doubts(space.name, values, called, unit)]
    other = seeming_unit(values, unit)
    few = unit != "radians" and len(values) < FEW_ROWS
    if other is None or few or not _is_likelier(density, values, TURNS[unit] / TURNS[other]):
        return found
    if unit == "degrees":
        what = "angles are" if is_angular(space.name, width) else "latitudes and longitudes are"
        text = (
            f"all values are within 2 pi, and the model's {what} in degrees: if these are {other}"
        )
        return [*found, f"{text}, convert them"]
    most = np.nanmax(np.abs(values), axis=0, initial=0.0)
    return [_beyond(called[int(most.argmax())], float(most.max()), unit, other)]


def refuse_codes_beside(
    space: MixedTorus | ProductSpace, values: Array, names: Sequence[str], cure: str
) -> None:
    """Refuse data (N, k), whose last columns may be no angles, with codes for missing values there.

    Real numbers are those of the rows and some about the middle of the space's line.
    """
    beside = space if isinstance(space, MixedTorus) else space.beside
    first = values.shape[1] - beside.dim
    for axis in np.flatnonzero(~beside.is_angle).tolist():
        line, column = beside.lines[axis], first + axis
        own = values[:, [column]]
        if line is not None:
            known = line.centre + 2 * line.scale * np.linspace(-1, 1, 9)
            own = np.append(own, known[:, None], axis=0)
        refuse_codes_of(own, names[column : column + 1], [beside.period_of(axis) or None], cure)


def _places(base: Space, values: Array, names: Sequence[str], cure: str) -> list[str]:
    """Return doubts about latitudes and longitudes (N, 2) beside other columns."""
    refuse_codes(base.name, values, names, "degrees", cure)
    return [doubt.text for doubt in place_doubts(base.name, values, names, "degrees")]


def _mixed_doubts(
    density: Density, space: MixedTorus, values: Array, names: Sequence[str], cure: str
) -> list[str]:
    """Return doubts about the angles among columns of which some are real."""
    refuse_codes_beside(space, values, names, cure)
    angles: list[int] = np.flatnonzero(space.is_angle).tolist()
    own, unit = values[:, angles], str(space.unit)
    called = [names[k] for k in angles]
    refuse_codes("torus", own, called, unit if len(own) >= FEW_ROWS else "degrees", cure)
    other = seeming_unit(own, unit) if own.size else None
    if other is None or len(values) < FEW_ROWS:
        return []
    factors = np.where(space.is_angle, TURNS[unit] / TURNS[other], 1.0)
    if not _is_likelier(density, values, factors):
        return []
    return [
        f"{' and '.join(called)}: these seem to be {other}, the model's are {unit}: convert them"
    ]


def given_doubts(space: Space, given: Mapping[str, float], names: Sequence[str]) -> list[str]:
    """Return what makes one doubt that known angles, by name, are in the unit of a torus.

    Raises:
        SettingError: For a code for missing values.
    """
    if not isinstance(space, Torus):
        return []
    unit = str(space.unit)
    angles = space.is_angle if isinstance(space, MixedTorus) else [True] * space.dim
    called = {name for name, own in zip(names, angles, strict=True) if own}
    given = {name: value for name, value in given.items() if name in called}
    for name, value in given.items():
        if codes_among(np.array([value]), TURNS["degrees"]):
            text = f"{name!r} is {value:g}, which seems to stand for a missing value: leave it out"
            raise SettingError(literal(text))
    beyond = {n: v for n, v in given.items() if abs(v) > TURNS[unit] * (1 + TURN_TOLERANCE)}
    other = "radians" if unit == "turns" else "degrees"
    return [_beyond(name, value, unit, other) for name, value in beyond.items()]


def data_unit(space: Space, width: int) -> str | None:
    """Return the unit of a space's data of so many columns, None if they have none."""
    if is_angular(space.name, width, getattr(space, "form", None)):
        return str(getattr(space, "angle_unit", space.unit))
    return "degrees" if space.name in DIRECTIONS and width == 2 else None


def _beyond(name: str, value: float, unit: str, other: str) -> str:
    text = (
        f"column {name!r} has {value:g}, beyond {WORDS[unit]}, and the model's angles are in {unit}"
    )
    turn = TURNS[unit]
    return f"{text}: " + (
        f"it counts as {value % turn:g}" if other == unit else f"if these are {other}, convert them"
    )


def _is_likelier(density: Density, values: Array, factor: float | Array) -> bool:
    """Return whether values (N, k) are likelier as a rule if they are multiplied by factors (k,)."""
    whole = values[np.isfinite(values).all(axis=1)]
    if not len(whole):
        return False
    some = whole[:: 1 + len(whole) // MOST_ROWS]
    try:
        one, other = (
            at_observed(density, density.space.to_chart(data), measure="uniform")
            for data in (some, some * factor)
        )
    except OrbiflowError:  # beyond what the space takes
        return False
    return float(torch.median(other - one)) > 0
