"""Summaries of angles, directions and axes: means with their uncertainty, spread, correlations, tests.

Angles are unit vectors (n, 2) here and directions (n, 3), so that one formula serves both. Rows may
have weights. Rows of one group are not independent: errors and tests then count groups, and tests of
which only the form for independent rows is known are left out (None).

Sources: Fisher, Statistical Analysis of Circular Data (1993); Fisher, Lewis and Embleton, Statistical
Analysis of Spherical Data (1987); Mardia and Jupp, Directional Statistics (2000); Jammalamadaka and
SenGupta, Topics in Circular Statistics (2001).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from orbiflow.arrays import Array
from orbiflow.density.data import alongside, written_from_zero
from orbiflow.density.fitting import SAME, concentration
from orbiflow.density.spaces import DataColumns, to_latlon, to_vectors, whole_turn
from orbiflow.density.uniformity import bingham_p, kuiper_p, rao_p, rayleigh_p, watson_p
from orbiflow.density.weighed_rows import WeighedRows, chosen_rows, half_angle, principal_axes, tail
from orbiflow.errors import OrbiflowError

MIN_ROWS = 25
"""Rows or groups below which an interval is rough (Fisher, 1993, section 4.4.4)."""

CLOSE = 1e-6
"""How far a resultant is below 1, where that is taken from differences."""


@dataclass(frozen=True)
class AngleSummary:
    """A column of angles, in its unit.

    - `rows`: Number of rows that have a value and a weight.
    - `mean`, `half_width`: Mean direction, and what to add on both sides for its interval. None where
      the resultant is too short to tell (Fisher, 1993, equation 4.22). The mean is written
      as the column is: from 0 to one turn, or to half a turn either way.
    - `resultant`: Mean resultant length, from 0 (no direction) to 1.
    - `concentration`: Likeliest concentration of a von Mises distribution, None if all rows are equal.
    - `deviation`: Circular standard deviation, sqrt(-2 log resultant), None without a resultant.
    - `rayleigh_p`, `kuiper_p`, `watson_p`, `rao_p`: Probabilities of such data if all angles are
      equally likely. Rayleigh's test looks for one mode, the others for anything, Rao's for uneven
      gaps; it is None where many angles are equal.
    """

    name: str
    rows: int
    mean: float | None
    half_width: float | None
    resultant: float
    concentration: float | None
    deviation: float | None
    rayleigh_p: float | None
    kuiper_p: float | None
    watson_p: float | None
    rao_p: float | None = None


@dataclass(frozen=True)
class Correlation:
    """How two columns of angles depend on each other, from -1 to 1.

    - `sine`: The correlation of sines about the mean directions (Jammalamadaka and SenGupta, 2001,
      section 8.2). It means little if a column has no mean direction.
    - `sine_p`: Probability of one so far from 0 if the columns are independent.
    - `pairs`: Fisher and Lee's correlation of differences between rows (Fisher, 1993, section 6.3.3),
      which needs no mean directions.
    """

    first: str
    second: str
    rows: int
    sine: float | None
    sine_p: float | None
    pairs: float | None


@dataclass(frozen=True)
class DirectionSummary:
    """Directions on the sphere; angles are in degrees.

    - `mean`: Mean direction as the data write it, latitude and longitude or a vector.
    - `cone`: Half the angle of a cone about it that holds the true one, without a model of the data.
    - `resultant`: Mean resultant length. `concentration`: The likeliest one of a Fisher distribution.
    - `k`, `fisher_cone`: (n - 1) / (n - R) and the half angle (alpha95 at a level of 95 %) of a Fisher
      distribution (Fisher, 1953); None with weights or groups.
    - `rayleigh_p`: Probability of such data if all directions are equally likely.
    """

    rows: int
    mean: tuple[float, ...] | None
    cone: float | None
    resultant: float
    concentration: float | None
    k: float | None
    fisher_cone: float | None
    rayleigh_p: float | None


@dataclass(frozen=True)
class AxisSummary:
    """Axes, by their orientation tensor, the mean of the products of their components.

    - `eigenvalues`: The three eigenvalues, largest first; their sum is 1.
    - `principal`: The axis about which they crowd, as the data write it, at its northern end.
    - `cone`: Half the angle in degrees of a cone about it that holds the true one.
    - `pole`: The axis of the least eigenvalue, the pole of a girdle.
    - `bingham_p`: Probability of such data if all axes are equally likely.
    """

    rows: int
    eigenvalues: tuple[float, ...]
    principal: tuple[float, ...]
    cone: float | None
    pole: tuple[float, ...]
    bingham_p: float | None


def summarize_angles(
    data: ArrayLike,
    *,
    columns: Any = None,
    unit: str | None = None,
    weights: ArrayLike | None = None,
    groups: ArrayLike | None = None,
    level: float = 0.95,
) -> tuple[list[AngleSummary], list[Correlation]]:
    """Summarise columns of angles, and each pair of columns.

    Args:
        data: Angles (n, d); a row counts in the columns in which it has a number.
        columns: What the columns are, as `DensityEstimator` takes it.
        unit: The unit of angles that name none; those of arrays are in radians.
        weights: How much each row counts (n,); only ratios matter.
        groups: What each row belongs to, (n,); rows of one group are not independent.
        level: Level of the intervals.

    >>> one, _ = summarize_angles([43, 45, 52, 61, 75, 88, 88, 279, 357], unit="degrees")
    >>> round(one[0].mean), round(one[0].resultant, 3)  # Mardia and Jupp, example 1.1
    (51, 0.711)
    """
    data, weights, groups = alongside(data=data, weights=weights, groups=groups)
    if not hasattr(data, "columns") and np.ndim(data) == 1:
        data = np.asarray(data)[:, None]
    read = DataColumns("torus", unit, columns).read(data, stacklevel=3)
    weights, groups = read.beside(weights, groups)
    if wrong := [str(role) for role in read.roles if role is None or role.kind != "angle"]:
        raise OrbiflowError(f"a summary is of angles, and a column is {wrong[0]}: leave it out")
    if len({role.unit for role in read.roles if role is not None}) > 1:
        raise OrbiflowError("the columns are angles in several units: convert them to one")
    values, names = read.values, read.columns
    turn = whole_turn(read.unit or "radians")
    summaries: list[AngleSummary] = []
    for name, column in zip(names, values.T, strict=True):
        angles, rows = chosen_rows(column[:, None], weights, groups, level)
        summaries.append(_angle_summary(name, angles[:, 0] / turn, turn, rows))
    pairs: list[Correlation] = []
    for i, j in combinations(range(len(names)), 2):
        angles, rows = chosen_rows(values[:, [i, j]], weights, groups, level)
        pairs.append(_correlation(names[i], names[j], angles * (2 * np.pi / turn), rows))
    return summaries, pairs


def _angle_summary(name: str, turns: Array, turn: float, rows: WeighedRows) -> AngleSummary:
    angles = 2 * np.pi * turns
    vectors = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    mean, resultant, spread = _mean_direction(vectors, rows)
    below = _shortfall(vectors, mean, resultant, rows)
    per_radian = turn / (2 * np.pi)
    middle = deviation = None
    if mean is not None:
        middle = math.atan2(mean[1], mean[0]) * per_radian
        middle += turn * (middle < 0 and bool(written_from_zero(turns[:, None], 1.0)))
        deviation = math.sqrt(-2 * math.log1p(-below)) * per_radian
    return AngleSummary(
        name=name,
        rows=len(turns),
        mean=middle,
        half_width=None if spread is None else spread * per_radian,
        resultant=resultant,
        concentration=concentration(resultant, 2, below),
        deviation=deviation,
        rayleigh_p=rayleigh_p(vectors, rows),
        kuiper_p=kuiper_p(turns) if rows.alike else None,
        watson_p=watson_p(turns) if rows.alike else None,
        rao_p=rao_p(turns) if rows.alike else None,
    )


def _mean_direction(vectors: Array, rows: WeighedRows) -> tuple[Array | None, float, float | None]:
    """Return the mean direction (p,) of unit vectors (n, p), the resultant and the half angle."""
    total = rows.mean(vectors)
    resultant = min(1.0, float(np.linalg.norm(total)))
    if resultant < 1e-12:
        return None, 0.0, None
    mean = total / resultant
    across = vectors - (vectors @ mean)[:, None] * mean
    return mean, resultant, half_angle(across / resultant, rows)


def _shortfall(vectors: Array, mean: Array | None, resultant: float, rows: WeighedRows) -> float:
    """Return 1 less the resultant of unit vectors (n, p), to all digits where they are close."""
    if mean is None:
        return 1.0
    # 1 - cos is half the square of the chord
    near = float(rows.mean(((vectors - mean) ** 2).sum(axis=1))) / 2
    return near if near < CLOSE else max(0.0, 1 - resultant)


def _correlation(first: str, second: str, angles: Array, rows: WeighedRows) -> Correlation:
    """Return the correlations of angles (n, 2) in radians."""
    p, q = np.sin(angles - np.angle(rows.mean(np.exp(1j * angles)))).T
    a, b = angles.T
    below = math.sqrt(float(rows.mean(p * p) * rows.mean(q * q)))
    sine = float(rows.mean(p * q)) / below if below > 0 else None
    sine_p = None if sine is None else _sine_p(p * q, rows)
    return Correlation(first, second, len(angles), sine, sine_p, _fisher_lee(a, b, rows))


def _sine_p(products: Array, rows: WeighedRows) -> float | None:
    """Return how likely so large a mean of products (n,) is if the columns are independent.

    For independent rows it is Jammalamadaka and SenGupta (2001), equation 8.2.5.
    """
    sums = rows.sums(products[:, None])[:, 0]
    size = math.sqrt(float(sums @ sums))
    if size == 0 or len(sums) < 2:
        return None
    score = abs(float(sums.sum())) / size
    if rows.groups is None:
        return math.erfc(score / math.sqrt(2))
    return tail(special.fdtrc, 1, len(sums) - 1, score**2)


def _fisher_lee(a: Array, b: Array, rows: WeighedRows) -> float | None:
    """Return Fisher and Lee's correlation, by sums over rows (Fisher, 1993, equation 6.36)."""
    sums = [complex(rows.mean(np.exp(1j * x))) for x in (a - b, a + b, 2 * a, 2 * b)]
    minus, plus, first, two = (abs(s) ** 2 for s in sums)
    below = math.sqrt(max(0.0, (1 - first) * (1 - two)))
    return (minus - plus) / below if below > 1e-12 else None


def summarize_directions(
    data: ArrayLike,
    *,
    columns: Any = None,
    unit: str | None = None,
    weights: ArrayLike | None = None,
    groups: ArrayLike | None = None,
    level: float = 0.95,
) -> DirectionSummary:
    """Summarise directions, (n, 2) of latitude and longitude in degrees or (n, 3) of unit vectors.

    `unit` is "degrees" for those that could be taken for radians, which are refused otherwise.
    `columns`, `weights`, `groups` and `level` are those of `summarize_angles`.
    """
    data, weights, groups = alongside(data=data, weights=weights, groups=groups)
    read = DataColumns("sphere", unit, columns).read(data, stacklevel=3)
    weights, groups = read.beside(weights, groups)
    table = read.values
    vectors, rows = chosen_rows(to_vectors(table), weights, groups, level)
    mean, resultant, cone = _mean_direction(vectors, rows)
    count, k, fisher_cone = len(vectors), None, None
    below = _shortfall(vectors, mean, resultant, rows)
    if rows.alike and count > 1 and below > SAME:
        k = (count - 1) / (count * below)
        fall = below / max(resultant, 1e-300) * ((1 - level) ** (-1 / (count - 1)) - 1)
        fisher_cone = math.degrees(2 * math.asin(math.sqrt(fall / 2))) if fall < 2 else None
    return DirectionSummary(
        count, None if mean is None else _written(mean, table), _degrees(cone), resultant,
        concentration(resultant, 3, below), k, fisher_cone, rayleigh_p(vectors, rows),
    )  # fmt: skip


def summarize_axes(
    data: ArrayLike,
    *,
    columns: Any = None,
    unit: str | None = None,
    weights: ArrayLike | None = None,
    groups: ArrayLike | None = None,
    level: float = 0.95,
) -> AxisSummary:
    """Summarise axes, either end of each as in `summarize_directions`."""
    data, weights, groups = alongside(data=data, weights=weights, groups=groups)
    read = DataColumns("projective-plane", unit, columns).read(data, stacklevel=3)
    weights, groups = read.beside(weights, groups)
    table = read.values
    vectors, rows = chosen_rows(to_vectors(table), weights, groups, level)
    values, axes, cone = principal_axes(vectors, rows)
    return AxisSummary(
        len(vectors), tuple(values.tolist()), _written(axes[0], table, end=True), _degrees(cone),
        _written(axes[2], table, end=True),
        bingham_p(vectors, rows),
    )  # fmt: skip


def _written(vector: Array, table: Array, *, end: bool = False) -> tuple[float, ...]:
    """Return a direction as the data are written; of an axis its northern end."""
    x, y, z = -vector if end and vector[2] < 0 else vector
    if table.shape[1] == 3:
        return float(x), float(y), float(z)
    lat, lon = to_latlon(
        np.array([[x, y, z]]), from_zero=bool(written_from_zero(table[:, 1:], 360.0))
    )[0].tolist()
    return lat, lon


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else math.degrees(angle)
