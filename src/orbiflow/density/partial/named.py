"""Angles by the names of their columns, in the unit of the data."""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable, Sequence
from typing import Any

import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.density.arguments import float_tensor
from orbiflow.density.partial.axes import check_torus
from orbiflow.density.spaces.space import Space
from orbiflow.errors import OrbiflowError


def axes_named(wanted: Sequence[str | int], names: Sequence[str]) -> list[int]:
    """Numbers, from 0, of angles by their columns' names, or by those numbers.

    Raises:
        OrbiflowError: for a name that no column has, or several.

    >>> axes_named(["psi", 0], ["phi", "psi"])
    [1, 0]
    """
    return [_axis(one, list(names)) for one in wanted]


def _axis(wanted: Any, names: list[str]) -> int:
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
    """What `conditional` takes: values in turns by numbers, from values in the space's unit by columns.

    Raises:
        OrbiflowError: for another space, unknown columns, one that is given twice, or values that are
            no finite numbers.
    """
    torus = check_torus(space, "conditional densities")
    found: dict[int, float] = {}
    for key, value in given:
        axis = _axis(key, list(names))
        if axis in found:
            raise OrbiflowError(f"{names[axis]!r} is given twice")
        real = not isinstance(value, bool) and isinstance(value, numbers.Real)
        if not real or not math.isfinite(float(value)):
            raise OrbiflowError(f"{names[axis]!r} must be given as a finite number, got {value!r}")
        found[axis] = float(value) / torus.period
    return found


def chart_of_observed(space: Space, data: ArrayLike) -> Tensor:
    """Angles (N, k) in the space's unit, missing ones NaN, to canonical points (N, k) of the torus.

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
