"""Covariates: columns that are known, numbers or words, and what models see of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.data import (
    as_numbers,
    cycle_named,
    doubts_of_number,
    missing_among,
    refuse_codes_of,
    word_of,
)
from orbiflow.density.spaces import Line
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_number

Values = NDArray[Any]
"""The cells (N,) of a column: numbers, or words."""

MOST_WORDS = 1_000
"""The most words of a column."""

CURE = "leave such rows out"
"""What to do with codes for missing values."""

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
    range: tuple[float, float] = (-math.inf, math.inf)
    period: float | None = None
    words: tuple[str, ...] = ()

    @classmethod
    def of(cls, name: str, cells: Values, period: float | None = None) -> Covariate:
        """Return the covariate that suits cells (N,): real numbers, or words if they are text.

        Raises `OrbiflowError` for missing values, for one value alone and for too many words.
        """
        if period is not None:
            if not as_number(period, f"the period of {name!r}") > 0:
                raise OrbiflowError(f"the period of {name!r} must be above 0, got {period}")
            return cls(name, period=float(period))
        if is_text(cells):
            words = tuple(np.unique(_text(name, cells)).tolist())
            if not 2 <= len(words) <= MOST_WORDS:
                raise OrbiflowError(
                    f"{name!r} has {len(words)} different words, and 2 to {MOST_WORDS} are taken: "
                    "leave it out"
                )
            return cls(name, words=words)
        numbers = _numbers(name, cells)
        line = Line.of(numbers, repr(name))
        return cls(name, line=line, range=(float(numbers.min()), float(numbers.max())))

    @property
    def kind(self) -> str:
        """What it is, in words."""
        if self.words:
            return f"{len(self.words)} words"
        return "real numbers" if self.period is None else f"cyclic, of period {self.period:g}"

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
        return SPREAD * self.line.share(numbers)[:, None]

    def _known(self, words: NDArray[np.str_]) -> NDArray[np.intp]:
        """Return the numbers (N,) of words; refuse those that the fit has not seen."""
        known = np.array(self.words)
        at = np.searchsorted(known, words).clip(max=len(known) - 1)
        if unknown := sorted(set(words[known[at] != words].tolist())):
            raise OrbiflowError(
                f"{self.name!r} has {_some(unknown)}, and the fit has seen {_some(self.words)}"
            )
        return at

    def refuse_codes(self, cells: Values, cure: str, *, is_new: bool) -> None:
        """Refuse numbers that seem to stand for missing ones, also beside the fit's if they are new."""
        if not self.words:
            numbers = _numbers(self.name, cells)
            if is_new and self.line is not None:
                numbers = np.append(numbers, np.linspace(*self.range, 9))
            refuse_codes_of(numbers[:, None], [self.name], [self.period], cure)

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

    columns: tuple[Covariate, ...] = field(default_factory=tuple[Covariate, ...])

    @classmethod
    def of(
        cls,
        cells: Mapping[str, Values],
        periods: Mapping[str, float | None],
        turn: float | None = None,
        cure: str = CURE,
    ) -> Covariates:
        """Return what suits columns of cells.

        Args:
            cells: The columns.
            periods: Those of cyclic ones, and None of others. What is not named is cyclic if its name
                says so and its values suit, such as hours of the day.
            turn: That of the data, if they are angles.
            cure: What to do with codes for missing values.
        """
        if not cells:
            raise OrbiflowError("given holds no column: name one or more that are known")
        if unknown := [name for name in periods if name not in cells]:
            raise OrbiflowError(f"cycles: no column {unknown[0]!r}; there are {', '.join(cells)}")
        found: list[Covariate] = []
        for name, own in cells.items():
            period = periods[name] if name in periods else _period_named(name, own, turn)
            found.append(Covariate.of(name, own, period))
            found[-1].refuse_codes(own, cure, is_new=False)
        return cls(tuple(found))

    @property
    def names(self) -> list[str]:
        """What they are called."""
        return [own.name for own in self.columns]

    def column(self, name: str) -> Covariate:
        """Return the covariate of a name."""
        return next(own for own in self.columns if own.name == name)

    @property
    def width(self) -> int:
        """The number of all features."""
        return sum(own.width for own in self.columns)

    @property
    def number(self) -> Tensor:
        """The number (width,) of the column of each feature."""
        widths = torch.tensor([own.width for own in self.columns])
        return torch.arange(len(widths)).repeat_interleave(widths)

    def features(self, cells: Mapping[str, Values]) -> Tensor:
        """Return what models see of cells, in float64: (N, width)."""
        return torch.cat([own.features(cells[own.name]) for own in self.columns], dim=1)

    def fit_doubts(self, cells: Mapping[str, Values]) -> list[str]:
        """Return what makes one doubt the cells of a fit."""
        lines = [own.name for own in self.columns if own.line is not None]
        return [
            d.text for name in lines for d in doubts_of_number(name, _numbers(name, cells[name]))
        ]

    def doubts(self, cells: Mapping[str, Values], cure: str = CURE) -> list[str]:
        """Return what makes one doubt of cells that the fit has not seen.

        Raises `SettingError` for codes for missing values; `cure` says what to do with them.
        """
        for own in self.columns:
            own.refuse_codes(cells[own.name], cure, is_new=True)
        return [doubt for own in self.columns if (doubt := own.doubt(cells[own.name]))]

    def to_json(self) -> list[dict[str, Any]]:
        """Return what makes them again, ready for JSON."""
        kept = ("name", "period", "words")
        return [
            {key: v for key, v in asdict(own).items() if key in kept or own.line is not None}
            for own in self.columns
        ]

    @classmethod
    def from_json(cls, entries: Any) -> Covariates:
        """Make the covariates of `to_json` again; raise `OrbiflowError` for others."""
        found: list[Covariate] = []
        for one in entries:
            words, period, line = tuple(one["words"]), one["period"], one.get("line")
            if (
                not isinstance(one["name"], str)
                or not all(isinstance(word, str) for word in words)
                or sorted(set(words)) != list(words)
                or len(words) > MOST_WORDS
                or (bool(words) + (period is not None) + (line is not None)) != 1
            ):
                raise OrbiflowError("covariates that are none")
            if period is not None and not as_number(period, "period") > 0:
                raise OrbiflowError("a period that is none")
            if line is not None:
                low, high = (as_number(end, "range") for end in one["range"])
                found.append(Covariate(one["name"], Line.checked(line), (low, high)))
            else:
                found.append(Covariate(one["name"], period=period, words=words))
        if not found or len({own.name for own in found}) < len(found):
            raise OrbiflowError("no covariates, or two of one name")
        return cls(tuple(found))


def is_text(cells: Values) -> bool:
    """Return whether cells (N,) are words rather than numbers.

    >>> is_text(np.array(["a", "b"])), is_text(np.array([1, 2])), is_text(np.array([True, False]))
    (True, False, True)
    """
    if cells.dtype.kind == "O":
        return any(isinstance(cell, str | bool) for cell in cells)
    return cells.dtype.kind in "USb"


def _text(name: str, cells: Values) -> NDArray[np.str_]:
    _refuse_missing(name, missing_among(cells))
    if cells.dtype.kind in "fO":
        return np.array([word_of(cell) for cell in cells.tolist()], dtype=str)
    return cells.astype(str)


def _period_named(name: str, cells: Values, turn: float | None) -> float | None:
    """Return the period of a column of numbers that its name says, if its values suit."""
    if is_text(cells):
        return None
    numbers, cycle = _numbers(name, cells), cycle_named(name, turn)
    if cycle is None:
        return None
    others = numbers[(numbers < cycle.least) | (numbers > cycle.most)]
    if not len(others):
        return cycle.period
    if 2 * len(others) < len(numbers):
        raise OrbiflowError(
            f"{name!r} is the name of a cycle of {cycle.period:g}, and the column has {others[0]:g} "
            f"({len(others)} such rows): leave these rows out, or say what it is: "
            f"cycles={{{name!r}: {cycle.period:g}}} or None there, {name}:{cycle.period:g} or "
            f"{name}:real on the command line"
        )
    return None


def _numbers(name: str, cells: Values) -> Array:
    numbers = as_numbers(cells, repr(name))
    _refuse_missing(name, ~np.isfinite(numbers))
    return numbers


def _refuse_missing(name: str, missing: NDArray[np.bool_]) -> None:
    at = np.flatnonzero(missing)
    if len(at):
        more = f" ({len(at)} such rows)" if len(at) > 1 else ""
        raise OrbiflowError(
            f"row {at[0] + 1} has no value of {name!r}{more}: what is given must be known, so leave "
            "such rows out"
        )


def _some(words: Sequence[str], most: int = 8) -> str:
    more = f" and {len(words) - most} more" if len(words) > most else ""
    return ", ".join(words[:most]) + more
