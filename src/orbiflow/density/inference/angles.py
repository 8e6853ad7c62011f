"""Which angles of a torus are meant: by numbers, or by the names of a table's columns."""

from __future__ import annotations

import numbers
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from orbiflow.arguments import as_number, as_whole, is_a
from orbiflow.density.spaces import Space, Torus
from orbiflow.errors import OrbiflowError


def check_torus(space: Space, what: str) -> Torus:
    """Return the space if it is a torus."""
    if isinstance(space, Torus):
        return space
    raise OrbiflowError(
        f"{what} are of angles on a torus; on the {space.name} no coordinate has a meaning without the "
        "others"
    )


def kept_axes(axes: Iterable[int] | int, dim: int) -> tuple[int, ...]:
    """Return the numbers of the angles to keep, 0 to dim - 1, each once."""
    given: Any = [axes] if isinstance(axes, numbers.Integral) else axes
    try:
        found = tuple(as_whole(axis, "axes", 0, dim - 1) for axis in given)
    except TypeError:
        raise OrbiflowError(f"axes must be numbers of angles, got {axes!r}") from None
    if not found or len(set(found)) < len(found):
        raise OrbiflowError(f"axes must name one angle or more, each once, got {axes!r}")
    return found


def given_axes(given: Mapping[int, float], dim: int) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Return the numbers of the angles that are known, and their values."""
    if not is_a(given, Mapping) or not given:
        raise OrbiflowError(f"given must hold known angles, such as {{1: 0.25}}, got {given!r}")
    axes = tuple(as_whole(axis, "axes", 0, dim - 1) for axis in given)
    if len(axes) == dim:
        raise OrbiflowError(f"all {dim} angles are given: nothing is left to have a density")
    return axes, tuple(as_number(value, f"angle {axis}") for axis, value in given.items())


def axes_named(wanted: Sequence[str | int], names: Sequence[str]) -> list[int]:
    """Return the numbers, from 0, of angles that are given by column names or by those numbers.

    >>> axes_named(["psi", 0], ["phi", "psi"])
    [1, 0]
    """
    axes = [_named_axis(one, names) for one in wanted]
    for twice in [axis for k, axis in enumerate(axes) if axis in axes[:k]]:
        raise OrbiflowError(f"column {names[twice]!r} is given twice: name each once")
    return axes


def _named_axis(wanted: Any, names: Sequence[str]) -> int:
    if not isinstance(wanted, bool) and isinstance(wanted, numbers.Integral):
        if not 0 <= int(wanted) < len(names):
            raise OrbiflowError(
                f"no column {int(wanted)}: columns are numbered from 0 to {len(names) - 1} "
                f"({', '.join(names)})"
            )
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
    """Return values in turns by numbers of angles, from values in the space's unit by columns."""
    torus = check_torus(space, "conditional densities")
    found: dict[int, float] = {}
    for key, value in given:
        axis = _named_axis(key, names)
        if axis in found:
            raise OrbiflowError(f"{names[axis]!r} is given twice")
        found[axis] = as_number(value, repr(names[axis])) / torus.period
    return found
