"""Parametric families as fits of their own: parameters, intervals, and how well the family suits."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import torch
from numpy.typing import ArrayLike
from scipy import special
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.data import alongside, group_numbers
from orbiflow.density.fitting.forms import FORMS, Cloud
from orbiflow.density.fitting.goodness import DRAWS, smooth_test
from orbiflow.density.fitting.intervals import (
    LEVEL,
    MAX_CONCENTRATION,
    Writing,
    concentration_interval,
    direction_parameters,
    shape_parameters,
)
from orbiflow.density.fitting.likelihood import training
from orbiflow.density.fitting.maximum import Local, at_maximum, covariance
from orbiflow.density.fitting.parameters import Goodness, Parameter, ParametricFit
from orbiflow.density.fitting.repeats import places
from orbiflow.density.fitting.report import FitReport, mean_nll, own_points
from orbiflow.density.fitting.rows import (
    Rows,
    effective_rows,
    lone_groups_note,
    weighed,
    weights_note,
)
from orbiflow.density.models import AdaptiveKernels, Density, images_of, moments
from orbiflow.density.spaces import RotationSpace, Space, Torus
from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.typed_torch import linalg

MOST_WIDTH = 16
"""Coordinates of unit vectors up to which a family has a frame of axes."""

MIN_ROWS = 40
"""Rows below which intervals are rough."""

ANGLES, SINE, DIRECTIONS = "von-mises", "von-mises-sine", "von-mises-fisher"
"""The families of angles, of two that depend on each other, and of directions in any dimension."""

AXES = ("bingham", "angular-central-gaussian")
"""The families with a frame of axes."""


class Side(NamedTuple):
    """A factor of the space: what it is called, its rows, the family there, and how that is written.

    There are as many `writings` as the family has directions, or one for all.
    """

    name: str
    cloud: Cloud
    local: Local
    writings: tuple[Writing, ...]


def families_of(space: Space) -> tuple[str, ...]:
    """Return the parametric families that there are on a space, by name.

    >>> from orbiflow.density import make_space
    >>> families_of(make_space("rotation-space"))
    ('bingham', 'angular-central-gaussian', 'watson', 'matrix-fisher')
    """
    if space.is_of_angles:
        return (ANGLES, SINE) if space.dim == 2 else (ANGLES,)
    try:
        images = images_of(space)
    except OrbiflowError:
        return ()
    width = space.dim + 1
    axes = (*(AXES if width <= MOST_WIDTH else ()), "watson")
    if isinstance(space, RotationSpace):
        return (*axes, "matrix-fisher")
    if images == 2:
        return axes
    return (DIRECTIONS, *(("kent",) if width == 3 else ()), *axes)


def require_family(space: Space, name: str) -> None:
    """Check that a family is one of a space's."""
    there = families_of(space)
    if name not in there:
        which = f"choose {' or '.join(there)}" if there else "there is no parametric family"
        if name in AXES and space.is_round and space.dim >= MOST_WIDTH:
            which = f"it is for unit vectors of {MOST_WIDTH} coordinates at most"
        raise OrbiflowError(f"there is no {name} density on the {space.name}: {which}")


def fit_density_of(space: Space, name: str, rows: Rows) -> Density:
    """Return the density of a family that is likeliest for some rows."""
    return _density(space, name, _sides(space, name, rows, None))


@training()
def fit_parametric(
    space: Space,
    points: Tensor,
    name: str,
    *,
    weights: Any = None,
    groups: ArrayLike | None = None,
    columns: Sequence[str] | None = None,
    seed: int = 0,
) -> tuple[Density, FitReport]:
    """Fit a parametric family by maximum likelihood, with intervals of its parameters.

    There are von-mises on tori, one for each angle; von-mises-fisher, kent, watson, bingham and
    angular-central-gaussian on spheres; the last three of axes; and matrix-fisher of rotations. The
    parameters, with standard errors and intervals, are `report.parametric`. Rows of one group are not
    independent.

    Args:
        space: The space.
        points: Points (N, d) of its chart.
        name: The family.
        weights: How much each row counts (N,); only ratios matter.
        groups: A label (N,) for each row.
        columns: Names of the data's columns, for those of the parameters.
        seed: Seed of the draws of the test of the family.

    Raises:
        OrbiflowError: If there is no such family on the space, or no likeliest parameters.

    >>> from orbiflow.density import make_space
    >>> space = make_space("sphere")
    >>> points = space.to_chart([[50.0, 10.0], [55, 20], [45, 12], [52, 5], [48, 14]])
    >>> density, report = fit_parametric(space, points, "von-mises-fisher")
    >>> [one.name for one in report.parametric.parameters]
    ['mean_lat', 'mean_lon', 'concentration']
    """
    points, weights, groups = alongside(points=points, weights=weights, groups=groups)
    canonical = own_points(space, points)
    labels = None if groups is None else torch.as_tensor(group_numbers(groups, len(canonical)))
    rows = weighed(canonical, weights, labels)
    if rows.groups is not None:  # numbered anew, without rows of no weight
        rows = Rows(
            rows.points,
            rows.weights,
            torch.as_tensor(group_numbers(rows.groups.numpy(), len(rows))),
        )
    sides = _sides(space, name, rows, columns)
    density = _density(space, name, sides)
    fit = _parametric(space, name, rows, sides, density, seed)
    counts, _ = places(rows.points)
    train = mean_nll(density, rows.points, rows.weights)
    report = FitReport(
        points=len(rows),
        duplicates=len(rows) - len(counts),
        train=len(rows),
        validation=0,
        start_nll=train + fit.gain,
        train_nll=train,
        validation_nll=train + fit.free / fit.rows,
        stages=(),
        steps=1,
        mass=1.0 if space.dim == 2 else None,
        integration_error=0.0,
        effective=None if rows.weights is None else effective_rows(rows.weights),
        parametric=fit,
        notes=(*weights_note(rows), *lone_groups_note(rows.groups)),
    )
    return density, report


def _sides(space: Space, name: str, rows: Rows, columns: Sequence[str] | None) -> list[Side]:
    """Return the family at its maximum on each factor of the space: each angle of a torus is one."""
    require_family(space, name)
    sides: list[Side] = []
    for title, vectors, writings in _factors(space, name, rows.points, columns):
        cloud = Cloud(vectors, rows.weights)
        if len(vectors) <= cloud.width:
            raise OrbiflowError(
                f"{len(vectors)} rows are too few for a {name} density: there must be more than "
                f"{cloud.width}"
            )
        form = FORMS[DIRECTIONS if name == ANGLES else name]
        local = at_maximum(form, cloud)
        if form.name != DIRECTIONS and float(local.at.shape.abs().max()) > MAX_CONCENTRATION:
            raise OrbiflowError(
                f"the rows are so close together that the {name} density would have a concentration "
                f"above {MAX_CONCENTRATION:g}, for which there are too few digits"
            )
        sides.append(Side(title, cloud, local, writings))
    return sides


def _factors(
    space: Space, name: str, points: Tensor, columns: Sequence[str] | None
) -> list[tuple[str, Tensor, tuple[Writing, ...]]]:
    """Return the unit vectors (N, p) of each factor of the space, and how directions are written."""
    names = tuple(columns or space.columns)
    if len(names) != len(space.columns):
        raise SettingError(
            f"{{columns}} must name the {len(space.columns)} columns of the space, got {len(names)}"
        )
    if not isinstance(space, Torus):
        unit = _unit_of(space)
        limits = tuple(_largest(column, unit) for column in space.columns)
        writing = Writing(partial(_written, space), names, space.periods, limits, unit)
        return [("", space.features(points)[0], (writing,))]
    factors: list[tuple[str, Tensor, tuple[Writing, ...]]] = []
    for axis, column in enumerate(names):
        angles = 2 * math.pi * points[:, axis]
        vectors = torch.stack([angles.cos(), angles.sin()], dim=1)
        write = partial(_written_angle, space, axis, 2 * axis * (name == SINE))
        writing = Writing(
            write, (column,), space.periods[axis : axis + 1], (math.inf,), str(space.unit)
        )
        factors.append((column, vectors, (writing,)))
    if name == SINE:
        _, vectors, writings = zip(*factors, strict=True)
        return [("", torch.cat(vectors, dim=1), sum(writings, ()))]
    return factors


def _largest(column: str, unit: str) -> float:
    """Return the largest absolute value of a number of a direction."""
    return 90.0 if column == "lat" else math.inf if unit else 1.0


def _unit_of(space: Space) -> str:
    """Return the unit in which a space writes directions, empty for coordinates."""
    if "lat" in space.columns:
        return "degrees"
    if isinstance(space, RotationSpace) and space.form not in ("quaternion", "matrix"):
        return space.angle_unit
    return ""


def _written(space: Space, vector: Tensor) -> Array:
    return space.from_chart(space.from_features(vector[None]))[0]


def _written_angle(space: Torus, axis: int, place: int, vector: Tensor) -> Array:
    row = torch.zeros(1, space.dim, dtype=torch.float64)
    row[0, axis] = torch.atan2(vector[place + 1], vector[place]) / (2 * math.pi)
    return space.from_chart(space.project(row))[0, axis : axis + 1]


def _density(space: Space, name: str, sides: list[Side]) -> Density:
    if name not in (ANGLES, DIRECTIONS):
        local = sides[0].local
        return local.form.density(space, local.at)
    means = torch.stack([side.local.at.frame[0] for side in sides])
    kappa = torch.stack([side.local.at.shape[0] for side in sides])[None]
    if name == ANGLES:
        centers = space.project(torch.atan2(means[:, 1], means[:, 0])[None] / (2 * math.pi))
    else:
        centers = space.from_features(means)
    return AdaptiveKernels(space, centers, kappa, torch.ones(1, dtype=torch.float64))


def _parametric(
    space: Space, name: str, rows: Rows, sides: list[Side], density: Density, seed: int
) -> ParametricFit:
    even = rows.weights is None and rows.groups is None
    count = float(len(rows)) if rows.weights is None else effective_rows(rows.weights)
    parameters: list[Parameter] = []
    cones: dict[str, float | None] = {}
    free = 0
    for side in sides:
        local = side.local
        spread = covariance(local, side.cloud, count, rows.groups, rows.weights is None)
        free += len(spread)
        for k, (label, number) in enumerate(local.form.directions(local.width)):
            writing = side.writings[k % len(side.writings)]
            coordinates, cone = direction_parameters(label, number, local, spread, writing)
            parameters += coordinates
            cones[f"{label}_{side.name}" if side.name else label] = cone
        shapes = shape_parameters(local, spread)
        if local.form.name == DIRECTIONS and even:
            shapes = [_inverted(shapes[0], side.cloud, count)]
        ending = f"_{side.name}" if side.name else ""
        parameters += [replace(shape, name=f"{shape.name}{ending}") for shape in shapes]
    if name == SINE:
        parameters = [_of_columns(parameter, sides[0].writings) for parameter in parameters]
    if name in (ANGLES, SINE):
        cones = {}  # the interval of an angle says it
    mean = float(rows.mean(density.log_prob(rows.points, measure="natural")))
    uniform = -math.log(space.volume)
    gain = mean - uniform
    goodness = None
    if even:
        goodness = _goodness(space, name, sides, density, torch.Generator().manual_seed(seed))
    notes = _notes(sides, count, rows.groups, free)
    if 2 * count * gain < float(special.chdtri(free, 1 - LEVEL)):
        notes.append(
            "the rows cannot tell this density from the uniform one: its directions and intervals mean "
            "little"
        )
    total = count * mean
    return ParametricFit(
        name, tuple(parameters), cones, LEVEL, count, free, total,
        2 * free - 2 * total, math.log(count) * free - 2 * total, gain, goodness, tuple(notes),
    )  # fmt: skip


def _notes(sides: list[Side], count: float, groups: Tensor | None, free: int) -> list[str]:
    """Return what to keep in mind of the estimates."""
    notes: list[str] = []
    local = sides[0].local
    if local.form.name == "kent" and 2 * float(local.at.shape[1]) > float(local.at.shape[0]):
        notes.append("the ovalness is more than half the concentration: the density has two modes")
    what, units = "rows", count
    if groups is not None:
        what, units = "groups", float(groups.max() + 1)
    if groups is not None and units <= free / len(sides):
        notes.append(f"{units:.0f} groups are too few for intervals of {free} parameters")
    elif units < MIN_ROWS:
        notes.append(
            f"intervals are rough with fewer than {MIN_ROWS} {what}, there are {units:.0f}"
        )
    return notes


def _of_columns(one: Parameter, writings: tuple[Writing, ...]) -> Parameter:
    """Return a parameter named for a column instead of by its number."""
    for k, writing in enumerate(writings, 1):
        one = replace(
            one, name=re.sub(f"^concentration_{k}$", f"concentration_{writing.names[0]}", one.name)
        )
    return one


def _inverted(one: Parameter, cloud: Cloud, count: float) -> Parameter:
    """Return a concentration with the interval that its estimate's distribution has."""
    length = linalg.vector_norm(cloud.mean)
    chords = cloud.weights @ ((cloud.vectors - cloud.mean / length) ** 2).sum(dim=1)
    low, high = concentration_interval(float(chords) / 2, count, cloud.width)
    kappa = torch.tensor(one.value, dtype=torch.float64)
    error = (count * float(moments(kappa, cloud.width).along)) ** -0.5
    return replace(one, error=error, low=low, high=high)


def _goodness(
    space: Space, name: str, sides: list[Side], density: Density, generator: torch.Generator
) -> Goodness | None:
    draws = density.sample((DRAWS,), generator)
    factors = _factors(space, name, draws, None)
    seen = [
        (side.local, side.cloud.vectors[:DRAWS], vectors)
        for side, (_, vectors, _) in zip(sides, factors, strict=True)
    ]
    return smooth_test(seen, generator)
