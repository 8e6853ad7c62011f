"""Covariates: columns that are known, numbers or words, and what models see of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.data import (
    Checked,
    Role,
    as_numbers,
    check_real,
    check_turn,
    missing_among,
    refuse_codes,
    word_of,
)
from orbiflow.density.spaces.axes import Line
from orbiflow.density.spaces.checked import row_count
from orbiflow.errors import OrbiflowError

Values = NDArray[Any]
"""The cells (N,) of a column: numbers, or words."""

MOST_WORDS = 1_000
"""The most words of a column."""

SPREAD = 5.0
"""The feature of a real number is about its distance from the middle in deviations, this at most."""

FAR = 0.5
"""How far beyond the range of the fit, in ranges, a value is far from all that was seen."""


@dataclass(frozen=True)
class Covariate:
    """A column that is known.

    - `line`: Of a real column, the centre and scale by which it is seen.
    - `range`: Of a real column, the least and the largest value of the fit.
    - `period`: Of a cyclic column, after what it begins again, such as 24 hours.
    - `words`: Of a column of words, those of the fit.
    """

    name: str
    line: Line | None = None
    range: tuple[float, float] = (0.0, 0.0)
    period: float | None = None
    words: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if (
            sorted(set(self.words)) != list(self.words)
            or len(self.words) > MOST_WORDS
            or bool(self.words) + (self.period is not None) + (self.line is not None) != 1
            or not (self.period is None or 0 < self.period < math.inf)
        ):
            raise OrbiflowError(f"{self.name!r} is no covariate: words, a period or a line")
        if self.line is not None:
            Line.checked(list(self.line))

    @classmethod
    def of(cls, name: str, cells: Values, role: Role) -> Covariate:
        """Return the covariate that cells (N,) of a role are.

        Raises `OrbiflowError` for missing values, values that contradict the role, one value alone and
        too many words.
        """
        if role.kind == "word":
            words = tuple(np.unique(_text(name, cells)).tolist())
            if not 2 <= len(words) <= MOST_WORDS:
                raise OrbiflowError(
                    f"{name!r} has {len(words)} different words, and 2 to {MOST_WORDS} are taken: "
                    "leave it out"
                )
            return cls(name, words=words)
        numbers = _numbers(name, cells)
        column = Checked(name, numbers)
        if role.turn is not None:
            check_turn(column, role.turn, role.kind)
            return cls(name, period=role.turn)
        check_real(column, role)
        line = Line.of(numbers, repr(name), role)
        return cls(name, line=line, range=(float(numbers.min()), float(numbers.max())))

    @property
    def role(self) -> Role:
        """What the column is."""
        if self.words:
            return Role("word")
        return Role("cycle", period=self.period) if self.line is None else self.line.role

    @property
    def width(self) -> int:
        """The number of its features."""
        return len(self.words) or (1 if self.period is None else 2)

    def features(self, cells: Values) -> Tensor:
        """Return what models see (N, width): bounded numbers, cosine and sine, or marks of words."""
        if self.words:
            return torch.tensor(np.eye(len(self.words))[self._known(_text(self.name, cells))])
        numbers = torch.tensor(_numbers(self.name, cells))
        if self.period is not None:
            angle = 2 * math.pi * numbers / self.period
            return torch.stack([angle.cos(), angle.sin()], dim=1)
        assert self.line is not None
        check_real(Checked(self.name, numbers.numpy()), self.role)
        return SPREAD * self.line.share(numbers)[:, None]

    def _known(self, words: NDArray[np.str_]) -> NDArray[np.intp]:
        """Return the numbers (N,) of words; refuse those that the fit has not seen."""
        every = np.array(self.words)
        at = np.searchsorted(every, words).clip(max=len(every) - 1)
        if unknown := sorted(set(words[every[at] != words].tolist())):
            raise OrbiflowError(
                f"{self.name!r} has {_some(unknown)}, and the fit has seen {_some(self.words)}"
            )
        return at

    def check(self, cells: Values) -> None:
        """Refuse new numbers that contradict what the column is, or stand apart from the fit's."""
        if self.words:
            return
        column = Checked(self.name, _numbers(self.name, cells))
        if self.period is not None:
            check_turn(column, self.period, "angle")
        elif self.line is not None and self.line.kind == "linear":
            refuse_codes(column, np.append(column.values, np.linspace(*self.range, 9)))

    def doubt(self, cells: Values) -> str | None:
        """Return what makes one doubt of cells: that the fit has seen nothing like them."""
        if self.line is None:
            return None
        low, high = self.range
        numbers = _numbers(self.name, cells)
        far = np.maximum(low - numbers, numbers - high) > FAR * (high - low)
        if not far.any():
            return None
        count = int(far.sum())
        return (
            f"{self.name!r} has {numbers[far][0]:g}, far beyond the fit's {low:g} to {high:g}"
            + f" ({count} such values)" * (count > 1)
            + ": nothing is known of the density there"
        )


@dataclass(frozen=True)
class Covariates:
    """All columns that are known."""

    columns: tuple[Covariate, ...]

    def __post_init__(self) -> None:
        if not self.columns or len(set(self.names)) < len(self.columns):
            raise OrbiflowError("given holds no column, or two of one name: name what is known")

    @classmethod
    def of(cls, cells: Mapping[str, Values], roles: Mapping[str, Role]) -> Covariates:
        """Return the covariates that columns of cells are, each of its role."""
        return cls(tuple(Covariate.of(name, column, roles[name]) for name, column in cells.items()))

    @property
    def names(self) -> list[str]:
        """What they are called."""
        return [column.name for column in self.columns]

    def column(self, name: str) -> Covariate:
        """Return the covariate of a name."""
        return next(column for column in self.columns if column.name == name)

    @property
    def width(self) -> int:
        """The number of all features."""
        return sum(column.width for column in self.columns)

    @property
    def number(self) -> Tensor:
        """The number (width,) of the column of each feature."""
        widths = torch.tensor([column.width for column in self.columns])
        return torch.arange(len(widths)).repeat_interleave(widths)

    @property
    def declaration(self) -> str:
        """What they are, in the words of the command line."""
        return ",".join(f"{column.name}={column.role}" for column in self.columns)

    def features(self, cells: Mapping[str, Values], rows: int | None = None) -> Tensor:
        """Return what models see of cells, in float64: (N, width); check the number of `rows`."""
        x = torch.cat([column.features(cells[column.name]) for column in self.columns], dim=1)
        if rows is not None and len(x) != rows:
            raise OrbiflowError(f"given: expected {rows} rows, as the data have, got {len(x)}")
        return x

    def fit_doubts(self, cells: Mapping[str, Values]) -> list[str]:
        """Return what makes one doubt the cells of a fit."""
        lines = [column for column in self.columns if column.line is not None]
        return [
            doubt
            for column in lines
            for doubt in check_real(
                Checked(column.name, _numbers(column.name, cells[column.name])), column.role
            )
        ]

    def doubts(self, cells: Mapping[str, Values]) -> list[str]:
        """Return what makes one doubt of cells that the fit has not seen.

        Raises `SettingError` for values that contradict what the columns are.
        """
        for column in self.columns:
            column.check(cells[column.name])
        return [doubt for column in self.columns if (doubt := column.doubt(cells[column.name]))]


def _text(name: str, cells: Values) -> NDArray[np.str_]:
    _refuse_missing(name, missing_among(cells))
    if cells.dtype.kind in "fO":
        return np.array([word_of(cell) for cell in cells.tolist()], dtype=str)
    return cells.astype(str)


def _numbers(name: str, cells: Values) -> Array:
    numbers = as_numbers(cells, repr(name))
    _refuse_missing(name, ~np.isfinite(numbers))
    return numbers


def _refuse_missing(name: str, missing: NDArray[np.bool_]) -> None:
    at = np.flatnonzero(missing)
    if len(at):
        raise OrbiflowError(
            f"row {at[0] + 1} has no value of {name!r}{row_count(len(at))}: what is given must be "
            "known, so leave such rows out"
        )


def _some(words: Sequence[str], most: int = 8) -> str:
    more = f" and {len(words) - most} more" if len(words) > most else ""
    return ", ".join(words[:most]) + more
