"""Whether data, or known angles, can be in the unit of a density."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import torch

from orbiflow.arrays import Array
from orbiflow.density.data import (
    DIRECTIONS,
    TURNS,
    Checked,
    Role,
    check_real,
    check_turn,
    check_values,
    refuse_codes,
)
from orbiflow.density.inference.angles import at_observed
from orbiflow.density.models import Density
from orbiflow.density.spaces import Line, Space
from orbiflow.errors import OrbiflowError

FEW_ROWS = 10
"""Fewer may all be small by accident."""

KNOWN = 9
"""Values about the middle of a real column beside which new ones stand apart."""

MOST_ROWS = 256
"""Rows by which it is judged in which unit data are likelier."""


def data_doubts(
    density: Density,
    values: Array,
    names: Sequence[str] | None,
    place: Callable[[int], str] = lambda row: f"row {row + 1}",
) -> list[str]:
    """Return what makes one doubt that data (N, k), of which some may be missing, are a density's.

    `place` says where a row, from 0, is.

    Raises:
        SettingError: For values that contradict what the columns of the density are.
    """
    space, width = density.space, values.shape[1] if values.ndim == 2 else 0
    if values.ndim != 2 or width not in space.widths or not values.size:
        return []
    called = [f"column{k}" for k in range(1, width + 1)] if names is None else list(names)
    roles = space.roles(width)
    form = getattr(space, "form", None)
    unit = "degrees" if space.data_name in DIRECTIONS else space.data_unit(width)
    doubts = check_values(
        space.data_name, values, called, roles, unit, form=form, place=place, are_new=True
    )
    _check_beside_middle(space, values, called, place)
    angles = [k for k, role in enumerate(roles) if _is_angle(role, space, width)]
    most = float(np.nanmax(np.abs(values[:, angles]), initial=0.0))
    are_small = unit == "degrees" and most <= TURNS["radians"] * (1 + 1e-4)
    if not (angles and are_small) or len(values) < FEW_ROWS:
        return doubts
    factors = np.ones(width)
    factors[angles] = TURNS["degrees"] / TURNS["radians"]
    if not _is_likelier(density, values, factors):
        return doubts
    listed = " and ".join(called[k] for k in angles)
    return [
        *doubts,
        f"{listed}: all values are within 2 pi, and the model has degrees: if these are radians, "
        "convert them",
    ]


def _check_beside_middle(
    space: Space, values: Array, names: Sequence[str], place: Callable[[int], str]
) -> None:
    """Refuse real numbers far from the middle of the fit's, as codes for missing values are."""
    lines = space.parts[-1].axes if space.parts else space.axes
    first = values.shape[1] - len(lines)
    for axis, line in enumerate(lines):
        if not isinstance(line, Line) or line.kind != "linear":
            continue
        about_middle = line.centre + 2 * line.scale * np.linspace(-1, 1, KNOWN)
        column = Checked(str(names[first + axis]), values[:, first + axis], place)
        refuse_codes(column, np.append(column.values, about_middle))


def _is_angle(role: Role | None, space: Space, width: int) -> bool:
    """Return whether a column is an angle in the unit of a space, or a coordinate in degrees."""
    if role is not None:
        return role.kind == "angle"
    return space.data_unit(width) is not None or (space.data_name in DIRECTIONS and width == 2)


def given_doubts(space: Space, given: Mapping[str, float], names: Sequence[str]) -> list[str]:
    """Return what makes one doubt that known values, by name, are those of a torus's columns.

    Raises:
        SettingError: For values that a column cannot have.
    """
    doubts: list[str] = []
    for name, role in zip(names, space.roles(len(names)), strict=True) if space.axes else ():
        if name not in given or role is None:
            continue
        column = Checked(name, np.array([given[name]]), _given)
        if role.turn is not None:
            check_turn(column, role.turn, role.kind)
        else:
            doubts += check_real(column, role)
    return doubts


def _given(row: int) -> str:
    del row
    return "given"


def _is_likelier(density: Density, values: Array, factor: float | Array) -> bool:
    """Return whether values (N, k) are likelier as a rule if they are multiplied by factors (k,)."""
    whole = values[np.isfinite(values).all(axis=1)]
    if not len(whole):
        return False
    some = whole[:: 1 + len(whole) // MOST_ROWS]
    try:
        plain, other = (
            at_observed(density, density.space.to_chart(data), measure="uniform")
            for data in (some, some * factor)
        )
    except OrbiflowError:  # beyond what the space takes
        return False
    return float(torch.median(other - plain)) > 0
