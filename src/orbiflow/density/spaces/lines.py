"""Real columns as lines that close at infinity: all reals, those above 0, or those between two ends."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import logsigmoid

from orbiflow.arrays import Array
from orbiflow.density.data import Role
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_array, is_a

SCALES = 2.5
"""The scale of a line, in deviations of its data: what is normal is then nearly von Mises."""

LEAST_REST = 1e-12
"""The least 1 - v^2, with v = z / sqrt(4 + z^2): a million scales from the centre."""

MIDDLE = 0.6827
"""The share of normal data that lie within one deviation of the middle."""

LARGE = 1e9
"""Numbers from here on may differ by less than is seen beside them."""

MOST_LOG = math.log(np.finfo(np.float64).max) - 1
"""The largest logarithm of a number."""

KINDS = ("linear", "positive", "bounded")


class Line(NamedTuple):
    """A real column: the value at the middle of its circle, and how far a quarter of it is.

    Both are along the line: the column's own values, of positive ones their logarithms, of bounded ones
    the logarithms of (y - low) / (high - y). So nothing is where no value can be, and tails decay as
    those of the logarithms do.

    - `kind`: One of `KINDS`; `low`, `high`: the ends of a bounded one.
    """

    centre: float
    scale: float
    kind: str = "linear"
    low: float = 0.0
    high: float = 1.0

    @classmethod
    def checked(cls, own: Any) -> Line:
        """Return a line of two numbers, the second above 0, and its kind and ends, if it has them."""
        numbers, kind, ends = own, "linear", ()
        if is_a(own, list | tuple) and len(own) > 2:
            numbers, kind, ends = own[:2], own[2], own[3:]
        values = as_array(numbers, "the centre and scale of a real column", (2,)).tolist()
        if not (math.isfinite(values[0]) and 0 < values[1] < math.inf):
            raise OrbiflowError(f"a real column needs a centre and a scale above 0, got {values}")
        if kind not in KINDS or len(ends) not in (0, 2):
            raise OrbiflowError(f"a real column is {', '.join(KINDS)}, got {own!r}")
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
        known = values[np.isfinite(values)]
        along = cls(0.0, 1.0, kind, *ends).along(torch.tensor(known)).numpy()
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


def turns_at(share: Tensor) -> Tensor:
    """Return the turns of shares v of `Line.share`, below 1: Student's distribution function."""
    turns = 0.5 + (3 * share - share**3) / 4
    return turns.clamp(max=1 - torch.finfo(turns.dtype).eps / 2)  # 1 would be 0 again


def share_at(turns: Tensor) -> Tensor:
    """Return v = z / sqrt(4 + z^2) for u = F(z) in [0, 1): the root of 3 v - v^3 = 2 (2 u - 1)."""
    return 2 * ((2 * turns - 1).asin() / 3).sin()
