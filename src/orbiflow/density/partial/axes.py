"""Which angles of a torus are kept, which are given, and which are integrated out."""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from orbiflow.arguments import is_a
from orbiflow.density.spaces.flat import Torus
from orbiflow.density.spaces.space import Space
from orbiflow.errors import OrbiflowError


@dataclass(frozen=True)
class Split:
    """The angles of a torus in three.

    - `dim`: angles of the torus.
    - `kept`: numbers of those of the density that is asked for, in its order.
    - `given`: numbers of those that are known; `values`: where, in turns.

    The others are integrated out.
    """

    dim: int
    kept: tuple[int, ...]
    given: tuple[int, ...] = ()
    values: tuple[float, ...] = ()

    @property
    def observed(self) -> tuple[int, ...]:
        """Kept, then given."""
        return (*self.kept, *self.given)

    def located(self, points: Tensor) -> Tensor:
        """Kept angles (N, r) and the given ones: (N, r + g)."""
        given = points.new_tensor(self.values).expand(len(points), -1)
        return torch.cat([points, given], dim=1)


def check_torus(space: Space, what: str) -> Torus:
    """
    Raises:
        OrbiflowError: unless `space` is a torus; says why others have no `what`.
    """
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
    """Numbers of the angles to keep, 0 to dim - 1, each once.

    Raises:
        OrbiflowError: for others, or none.
    """
    listed: Any = [axes] if isinstance(axes, numbers.Integral) else axes
    try:
        found = tuple(_axis(axis, dim) for axis in listed)
    except TypeError:
        raise OrbiflowError(f"axes must be numbers of angles, got {axes!r}") from None
    if not found or len(set(found)) < len(found):
        raise OrbiflowError(f"axes must name one angle or more, each once, got {axes!r}")
    return found


def given_axes(given: Mapping[int, float], dim: int) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Numbers of the angles that are known, and where.

    Raises:
        OrbiflowError: if there are none or no others, or for values that are not finite.
    """
    if not is_a(given, Mapping) or not given:
        raise OrbiflowError(f"given must say what is known, such as {{1: 0.25}}, got {given!r}")
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
