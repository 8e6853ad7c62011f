"""The axes of a torus: circles, and real columns as lines that close at infinity."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import logsigmoid

from orbiflow.arrays import Array
from orbiflow.density.data import TURNS, Role
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_array, as_choice, as_number, is_a

SCALES = 2.5
"""The scale of a line, in deviations of its data: what is normal is then nearly von Mises."""

LEAST_REST = 1e-12
"""The least 1 - v^2, with v = z / sqrt(4 + z^2): a million scales from the centre."""

MIDDLE = 0.6827
"""The share of normal data that lie within one deviation of the middle."""

WIDE = 0.5
"""Deviation of logarithms from which a column is too skew to be drawn over four on each side."""

LARGE = 1e9
"""Numbers from here on may differ by less than is seen beside them."""

MOST_LOG = math.log(np.finfo(np.float64).max) - 1
"""The largest logarithm of a number."""

KINDS = ("linear", "positive", "bounded")


class Circle(NamedTuple):
    """An angle, or a column with a period of its own.

    - `period`: A whole turn, in the column's unit.
    - `unit`: The unit of an angle; empty for a column with a period of its own.
    - `from_zero`: Whether it is written from 0 to a whole turn, otherwise from minus half a turn.
    """

    period: float
    unit: str = ""
    from_zero: bool = False

    is_real = False

    @property
    def is_angle(self) -> bool:
        """Whether it is an angle."""
        return bool(self.unit)

    @property
    def first_turn(self) -> float:
        """The turn at which the column begins."""
        return 0.0 if self.from_zero else -0.5

    @property
    def side(self) -> float:
        """A turn, in the column's unit."""
        return self.period

    @property
    def role(self) -> Role:
        """What the column is."""
        return Role("angle", self.unit) if self.is_angle else Role("cycle", period=self.period)

    def turns(self, values: Tensor) -> Tensor:
        """Return the chart coordinates of values, in any shape."""
        return values / self.period

    def values(self, turns: Tensor) -> Tensor:
        """Return the values at chart coordinates, in any shape."""
        return turns * self.period

    def log_stretch(self, turns: Tensor) -> Tensor:
        """Return the logarithms of the derivatives of values by turns."""
        return torch.full_like(turns, math.log(self.period))

    def even(self, count: int) -> Array:
        """Return even values (count,), from the first turn on."""
        return (np.arange(count) / count + self.first_turn) * self.period

    def to_json(self) -> float | None:
        """Return what `axis_of` makes it of again."""
        return None if self.is_angle else self.period


class Line(NamedTuple):
    """A real column: the value at the middle of its circle, and how far a quarter of it is.

    A value y is at F((y - centre) / scale) of the circle, with F the distribution function of Student's
    t with four degrees of freedom, so that densities on the circle are densities on the line, exactly
    normalised over all that the column can be. The circle's uniform distribution is that Student's t,
    whose tails are heavy enough for most data and whose variance is finite.

    Centre and scale are along the line: the column's own values, of positive ones their logarithms, of
    bounded ones the logarithms of (y - low) / (high - y). So nothing is where no value can be, and
    tails decay as those of the logarithms do.

    - `kind`: One of `KINDS`; `low`, `high`: the ends of a bounded one.
    """

    centre: float
    scale: float
    kind: str = "linear"
    low: float = 0.0
    high: float = 1.0

    is_real = True
    is_angle = False
    from_zero = False
    period = 0.0
    first_turn = 0.0

    @classmethod
    def checked(cls, numbers: Any) -> Line:
        """Return a line of two numbers, the second above 0, and its kind and ends, if it has them."""
        middle, kind, ends = numbers, "linear", ()
        if is_a(numbers, list | tuple) and len(numbers) > 2:
            middle, kind, ends = numbers[:2], numbers[2], numbers[3:]
        values = as_array(middle, "the centre and scale of a real column", (2,)).tolist()
        if not (math.isfinite(values[0]) and 0 < values[1] < math.inf):
            raise OrbiflowError(f"a real column needs a centre and a scale above 0, got {values}")
        if kind not in KINDS or len(ends) not in (0, 2):
            raise OrbiflowError(f"a real column is {', '.join(KINDS)}, got {numbers!r}")
        if len(ends) == 2:
            low, high = as_array(ends, "the ends of a bounded column", (2,)).tolist()
            if not -math.inf < low < high < math.inf:
                raise OrbiflowError(f"a bounded column needs two ends, got {low} and {high}")
            return cls(values[0], values[1], kind, low, high)
        return cls(values[0], values[1], kind)

    @classmethod
    def of(cls, values: Array, name: str, role: Role | None = None) -> Line:
        """Return the line that suits a column (N,) of data, by its quantiles."""
        kind = "linear" if role is None else role.kind
        ends = (0.0, 1.0) if role is None or kind != "bounded" else (role.low, role.high)
        finite = values[np.isfinite(values)]
        along = cls(0.0, 1.0, kind, *ends).along(torch.tensor(finite)).numpy()
        low, middle, high = np.quantile(along, [(1 - MIDDLE) / 2, 0.5, (1 + MIDDLE) / 2])
        spread = float(high - low) / 2 or float(along.std())
        if not spread > 1e-12 * abs(float(middle)):
            if abs(middle) < LARGE:
                raise OrbiflowError(f"{name} has one value alone: leave it out")
            raise OrbiflowError(
                f"the differences of {name} are lost beside its size, {middle:.3g}: subtract its least "
                "value first, or leave it out if it has one value alone"
            )
        return cls(float(middle), SCALES * spread, kind, *ends)

    def to_json(self) -> list[Any]:
        """Return what `checked` makes it of again."""
        if self.kind == "linear":
            return [self.centre, self.scale]
        return list(self) if self.kind == "bounded" else [self.centre, self.scale, self.kind]

    @property
    def role(self) -> Role:
        """What the column is."""
        return Role(self.kind, low=self.low, high=self.high if self.kind == "bounded" else math.inf)

    @property
    def middle(self) -> float:
        """The value at the middle."""
        return float(self.value_at(torch.tensor(self.centre, dtype=torch.float64)))

    @property
    def side(self) -> float:
        """A turn of the circle, at the middle, in the column's unit."""
        middle = torch.tensor(self.centre, dtype=torch.float64)
        return 8 / 3 * self.scale * float(self.log_slope(middle).exp())

    def turns(self, values: Tensor) -> Tensor:
        """Return the chart coordinates of values, in any shape."""
        return turns_at(self.share(values))

    def values(self, turns: Tensor) -> Tensor:
        """Return the values at chart coordinates in [0, 1), in any shape."""
        return self.value_at(self.along_turns(turns))

    def log_stretch(self, turns: Tensor) -> Tensor:
        """Return the logarithms of the derivatives of values by turns."""
        turns = turns - turns.detach().floor()
        rest = (1 - share_at(turns) ** 2).clamp_min(LEAST_REST)
        stretch = math.log(8 / 3 * self.scale) - 2.5 * rest.log()
        return (
            stretch if self.kind == "linear" else stretch + self.log_slope(self.along_turns(turns))
        )

    def even(self, count: int) -> Array:
        """Return even values (count,) over four deviations on each side of the middle.

        Of positive ones that spread over several powers of ten, over two above the middle.
        """
        deviation = self.scale / SCALES
        above = 2 if self.kind == "positive" and deviation > WIDE else 4
        ends = [self.centre - 4 * deviation, self.centre + above * deviation]
        low, high = map(float, self.value_at(torch.tensor(ends, dtype=torch.float64)))
        return np.linspace(low, high, count)

    def along(self, values: Tensor) -> Tensor:
        """Return where values (...) are along the line; infinite at its ends and beyond."""
        if self.kind == "positive":
            return values.clamp_min(0).log()
        if self.kind == "bounded":
            inside = values.clamp(self.low, self.high)
            return (inside - self.low).log() - (self.high - inside).log()
        return values

    def value_at(self, along: Tensor) -> Tensor:
        """Return the values (...) at places along the line."""
        if self.kind == "positive":
            return along.clamp(-MOST_LOG, MOST_LOG).exp()
        if self.kind == "bounded":
            return self.low + (self.high - self.low) * along.sigmoid()
        return along

    def log_slope(self, along: Tensor) -> Tensor:
        """Return the logarithms (...) of the derivatives of values by places along the line."""
        if self.kind == "positive":
            return along
        if self.kind == "bounded":
            return math.log(self.high - self.low) + logsigmoid(along) + logsigmoid(-along)
        return torch.zeros_like(along)

    def share(self, values: Tensor) -> Tensor:
        """Return v = z / sqrt(4 + z^2) of values (...), from -1 to 1, with z in scales."""
        away = (self.along(values) - self.centre) / self.scale
        return torch.where(away.isinf(), away.sign(), away / away.hypot(torch.full_like(away, 2.0)))

    def along_turns(self, turns: Tensor) -> Tensor:
        """Return the places along the line of turns (...), in [0, 1)."""
        share = share_at(turns)
        return self.centre + self.scale * 2 * share / (1 - share**2).clamp_min(LEAST_REST).sqrt()


Axis = Circle | Line


def whole_turn(unit: str) -> float:
    """Return a whole turn in a unit."""
    return TURNS[as_choice(unit, tuple(TURNS), "unit")]


def axis_of(settings: Any, unit: str) -> Axis:
    """Return an axis: of None an angle in a unit, of a number a circle of that period, else a line."""
    if isinstance(settings, Circle | Line):
        return settings
    if settings is None:
        return Circle(whole_turn(unit), unit)
    if isinstance(settings, str) or np.ndim(settings):
        return Line.checked(settings)
    period = as_number(settings, "the period of a column")
    if not 0 < period < math.inf:
        raise OrbiflowError(f"a period must be above 0, got {period}")
    return Circle(period, from_zero=True)


def turns_at(share: Tensor) -> Tensor:
    """Return the turns of shares v of `Line.share`, below 1: Student's distribution function."""
    turns = 0.5 + (3 * share - share**3) / 4
    return turns.clamp(max=1 - torch.finfo(turns.dtype).eps / 2)  # 1 would be 0 again


def share_at(turns: Tensor) -> Tensor:
    """Return v = z / sqrt(4 + z^2) for u = F(z) in [0, 1): the root of 3 v - v^3 = 2 (2 u - 1)."""
    return 2 * ((2 * turns - 1).asin() / 3).sin()
