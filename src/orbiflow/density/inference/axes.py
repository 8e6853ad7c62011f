"""Which angles of a torus users mean: kept, given or missing, by number or by name."""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arguments import is_a
from orbiflow.density.arguments import float_tensor
from orbiflow.density.spaces import Space, Torus
from orbiflow.errors import OrbiflowError


def check_torus(space: Space, what: str) -> Torus:
    """Return the space if it is a torus."""
    if isinstance(space, Torus):
        return space
    if space.is_round:
        why = "its coordinates are no angles that could be parted from each other"
    else:
        why = (
            "(theta + pi, pi - phi) is the same place as (theta, phi), so that neither angle has a "
            "meaning without the other"
        )
    raise OrbiflowError(f"{what} are of angles on a torus; on the {space.name} {why}")


def kept_axes(axes: Iterable[int] | int, dim: int) -> tuple[int, ...]:
    """Return the numbers of the angles to keep, 0 to dim - 1, each once."""
    listed: Any = [axes] if isinstance(axes, numbers.Integral) else axes
    try:
        found = tuple(_axis(axis, dim) for axis in listed)
    except TypeError:
        raise OrbiflowError(f"axes must be numbers of angles, got {axes!r}") from None
    if not found or len(set(found)) < len(found):
        raise OrbiflowError(f"axes must name one angle or more, each once, got {axes!r}")
    return found


def given_axes(given: Mapping[int, float], dim: int) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Return the numbers of the angles that are known, and their values."""
    if not is_a(given, Mapping) or not given:
        raise OrbiflowError(f"given must hold known angles, such as {{1: 0.25}}, got {given!r}")
    axes = tuple(_axis(axis, dim) for axis in given)
    if len(axes) == dim:
        raise OrbiflowError(f"all {dim} angles are given: nothing is left to have a density")
    for axis, value in zip(axes, given.values(), strict=True):
        real = not isinstance(value, bool) and isinstance(value, numbers.Real)
        if not real or not math.isfinite(float(value)):
            raise OrbiflowError(f"angle {axis} must be given as a finite number, got {value!r}")
    return axes, tuple(float(value) for value in given.values())


def _axis(axis: Any, dim: int) -> int:
    whole = not isinstance(axis, bool) and isinstance(axis, numbers.Integral)
    if not whole or not 0 <= int(axis) < dim:
        raise OrbiflowError(f"axes are numbers of angles from 0 to {dim - 1}, got {axis!r}")
    return int(axis)


def axes_named(wanted: Sequence[str | int], names: Sequence[str]) -> list[int]:
    """Return the numbers, from 0, of angles that are given by column names or by those numbers.

    Raises:
        OrbiflowError: for a name that no column has, or several.

    >>> axes_named(["psi", 0], ["phi", "psi"])
    [1, 0]
    """
    return [_named_axis(one, list(names)) for one in wanted]


def _named_axis(wanted: Any, names: list[str]) -> int:
    if not isinstance(wanted, bool) and isinstance(wanted, numbers.Integral):
        return int(wanted)
    hits = [i for i, name in enumerate(names) if name == wanted]
    if not hits and isinstance(wanted, str):
        hits = [i for i, name in enumerate(names) if name.casefold() == wanted.casefold()]
    if len(hits) == 1:
        return hits[0]
    listed = ", ".join(names)
    if hits:
        raise OrbiflowError(f"several columns are called {wanted!r} ({listed}): say their number")
    raise OrbiflowError(f"no column {wanted!r}; there are {listed}")


def given_named(
    space: Space, given: Iterable[tuple[str | int, float]], names: Sequence[str]
) -> dict[int, float]:
    """Return values in turns by numbers of angles, from values in the space's unit by columns.

    Raises:
        OrbiflowError: for another space, unknown columns, one that is given twice, or values that are
            no finite numbers.
    """
    torus = check_torus(space, "conditional densities")
    found: dict[int, float] = {}
    for key, value in given:
        axis = _named_axis(key, list(names))
        if axis in found:
            raise OrbiflowError(f"{names[axis]!r} is given twice")
        real = not isinstance(value, bool) and isinstance(value, numbers.Real)
        if not real or not math.isfinite(float(value)):
            raise OrbiflowError(f"{names[axis]!r} must be given as a finite number, got {value!r}")
        found[axis] = float(value) / torus.period
    return found


def chart_of_observed(space: Space, data: ArrayLike) -> Tensor:
    """Return angles (N, k) in the space's unit, missing ones NaN, as points (N, k) of the torus.

    Raises:
        OrbiflowError: for another space or shape, or infinite angles.
    """
    torus = check_torus(space, "densities of rows that lack angles")
    values = float_tensor(data, "data").double()
    if values.dim() != 2 or values.shape[1] != torus.dim:
        raise OrbiflowError(f"expected data (N, {torus.dim}), got {tuple(values.shape)}")
    if bool(values.isinf().any()):
        raise OrbiflowError("angles may be missing (NaN), but not infinite")
    return torus.project(torch.as_tensor(values / torus.period))
