"""Some of a torus' angles: which are meant, and log densities of rows that lack the others."""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.density.models import Density, UniformDensity
from orbiflow.density.spaces import CHART, Space, Torus
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import one_thread
from orbiflow.settings import as_instance, as_number, as_tensor, as_whole, is_a
from orbiflow.typed_torch import listed, unique


class Chosen(NamedTuple):
    """Some of a density's columns, by their numbers from 0, and their coordinates in the chart.

    Of a space beside other columns they are all of its own, first, or none.
    """

    columns: list[int]
    axes: list[int]


def chosen_columns(space: Space, columns: Sequence[int], width: int) -> Chosen:
    """Return some of so many columns with their coordinates.

    Raises `OrbiflowError` if these have no meaning without the others.
    """
    first = space.together and width - space.chart_dim + space.together
    of_base = sorted(column for column in columns if column < first)
    rest = [column for column in columns if column >= first]
    if of_base and (of_base != list(range(first)) or first == width):
        space.of_axes([0])  # which says why not
    every = range(space.together) if of_base else ()
    return Chosen([*of_base, *rest], [*every, *(c - first + space.together for c in rest)])


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
    several: Any = [axes] if isinstance(axes, numbers.Integral) else axes
    try:
        kept = tuple(as_whole(axis, "axes", 0, dim - 1) for axis in several)
    except TypeError:
        raise OrbiflowError(f"axes must be numbers of angles, got {axes!r}") from None
    if not kept or len(set(kept)) < len(kept):
        raise OrbiflowError(f"axes must name one angle or more, each once, got {axes!r}")
    return kept


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
    axes = [_named_axis(name, names) for name in wanted]
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
    """Return chart coordinates by their numbers, from values in the data's units by columns."""
    by_column: dict[int, float] = {}
    for key, value in given:
        column = _named_axis(key, names)
        if column in by_column:
            raise OrbiflowError(f"{names[column]!r} is given twice")
        by_column[column] = as_number(value, repr(names[column]))
    columns, axes = chosen_columns(space, list(by_column), len(names))
    values = [by_column[column] for column in columns]
    alone = [axis for axis in axes if axis >= space.together]
    whole = values[: len(values) - len(alone)]
    coordinates: dict[int, float] = {}
    if whole:
        coordinates |= enumerate(listed(space.parts[0].cover([whole])[0]))
    for axis, value in zip(alone, values[len(whole) :], strict=True):
        number = torch.tensor(value, dtype=torch.float64)
        coordinates[axis] = float(lines_of(space).axes[axis - space.together].turns(number))
    return coordinates


def lines_of(space: Space) -> Torus:
    """Return the torus of the columns that have a meaning alone."""
    return check_torus(space.parts[-1] if space.parts else space, "marginal densities")


def log_prob_observed(density: Density, points: Tensor, *, measure: str = CHART) -> Tensor:
    """Return log densities (N,) at chart points (N, d) some of whose coordinates are missing (NaN).

    The density of a row is that of the coordinates that it has, such as angles of a torus, integrated
    over the others, with respect to `measure` of those. Of a row that has none its logarithm is 0.
    """
    space = as_instance(density, Density, "density").space
    return at_observed(density, observed_rows(points, "points", space), measure=measure)


def observed_rows(values: Any, name: str, space: Space) -> Tensor:
    """Return a float64 table of coordinates (N, d), some of which may be missing."""
    rows = as_tensor(values, name).double()
    if rows.dim() != 2 or rows.shape[1] != space.chart_dim:
        raise OrbiflowError(f"expected {name} (N, {space.chart_dim}), got {tuple(rows.shape)}")
    if bool(rows.isinf().any()):
        raise OrbiflowError("angles may be missing (NaN), but not infinite")
    return rows


@one_thread()
@torch.no_grad()
def at_observed(density: Density, points: Tensor, *, measure: str = CHART) -> Tensor:
    """Return what `log_prob_observed` does, at points (N, d) of any space if none lacks anything."""
    if not bool(points.isnan().any()):
        return density.log_prob(points, measure=measure)
    logs = torch.zeros(len(points), dtype=torch.float64)
    patterns, number = unique(~points.isnan(), dim=0, return_inverse=True)
    for k, pattern in enumerate(patterns):
        observed: list[int] = listed(torch.nonzero(pattern)[:, 0])
        rows = torch.nonzero(number == k)[:, 0]
        if not observed:
            continue
        some = points[rows][:, observed]
        space = density.space.of_axes(observed)
        whole = len(observed) == density.space.chart_dim
        value = density.log_prob(some) if whole else density.log_marginal(some, observed)
        logs[rows] = value + space.log_density_factor(some, measure)
    return logs


def chart_of_rows(space: Space, data: ArrayLike, *, may_lack: bool) -> Tensor:
    """Return data (N, k) as points; on tori they `may_lack` angles, which are NaN."""
    if not may_lack:
        return space.to_chart(data)
    torus = check_torus(space, "densities of rows that lack angles")
    rows = observed_rows(data, "data", torus)
    turns = [axis.turns(column) for axis, column in zip(torus.axes, rows.mT, strict=True)]
    return torus.project(torch.stack(turns, dim=1))


def uniform_logs(space: Space, data: ArrayLike) -> Tensor:
    """Return log densities (N,) in natural measure of the uniform distribution at data (N, k).

    Of rows that lack angles they are those of whole ones; beside real columns, of what the rows have.
    """
    table = np.asarray(data, dtype=np.float64)
    if math.isfinite(space.volume):
        return torch.full((len(table),), -math.log(space.volume), dtype=torch.float64)
    points = chart_of_rows(space, table, may_lack=bool(space.axes))
    return at_observed(UniformDensity(space), points, measure="natural")
