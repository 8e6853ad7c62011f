"""What can be asked for of a cross-validation, and of one of its fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from orbiflow.jobs.batch_requests import check_workers
from orbiflow.jobs.density_requests import (
    PARTS,
    DensityFitRequest,
    Missing,
    SpaceName,
    Unit,
    columns_named,
)
from orbiflow.jobs.request import Request, in_range
from orbiflow.runtime import RecordError

DEFAULT, UNIFORM = "default", "uniform"
"""Names of settings: what a fit chooses by itself, and the density that is the same everywhere."""

MOST_FOLDS, MOST_TIMES = 1000, 100


@dataclass(frozen=True)
class DensityFoldRequest(Request):
    """Fit a density to all rows of a table but those of one fold, and score that fold.

    - `data`: the table. `held`: the column that says the fold of each row; `fold`: the one held out.
    - `out`: folder for the scores and the report.
    - `columns`, `header`, `missing`, `weights`, `group`, `unit`, `parts`, `repeats`, `seed`: as for a
      fit.
    """

    KIND = "density-fold"

    data: Path
    space: SpaceName
    fold: int
    columns: tuple[str, ...]
    held: str = "fold"
    out: Path = Path("fold")
    header: bool | None = None
    missing: Missing = "refuse"
    weights: str | None = None
    group: str | None = None
    unit: Unit | None = None
    parts: tuple[str, ...] | None = None
    repeats: Literal["places", "rounding"] = "places"
    seed: int = 0

    def check(self) -> None:
        self.fit()

    def fit(self) -> DensityFitRequest:
        """The fit, which is given the rows of the other folds.

        Raises:
            RecordError: for a field that cannot be used, by its name.
        """
        return _fit_of(self, group=self.group)


@dataclass(frozen=True)
class DensityCvRequest(Request):
    """Cross-validate densities of one table; see `orbiflow density cv --help`.

    - `data`: the table. `out`: folder for the results; an earlier cross-validation there is gone on
      with.
    - `folds`: of a split. `times`: splits, each of its own.
    - `group`: the column that says which rows belong together: on one side of every split.
    - `columns`, `header`, `drop_missing`, `missing`, `weights`, `unit`, `parts`, `repeats`: as for a
      fit.
    - `against`: other settings at the same folds: parts with commas between, "default" for what a fit
      chooses by itself, "uniform" for the density that is the same everywhere. None: "kernels".
    - `level`, `bootstrap`: of the intervals, and resamples.
    - `workers`, `scheduler`, `retry_failed`: as for a batch.
    - `seed`: of splits, fits and resamples.
    """

    KIND = "density-cv"

    data: Path
    space: SpaceName
    out: Path = Path("cv")
    folds: int = 10
    times: int = 1
    group: str | None = None
    columns: tuple[str, ...] | None = None
    header: bool | None = None
    drop_missing: bool = False
    missing: Missing = "refuse"
    weights: str | None = None
    unit: Unit | None = None
    parts: tuple[str, ...] | None = None
    against: tuple[str, ...] | None = None
    repeats: Literal["places", "rounding"] = "places"
    level: float = 0.95
    bootstrap: int = 2000
    workers: int | None = None
    scheduler: str | None = None
    retry_failed: bool = False
    seed: int = 0

    def check(self) -> None:
        columns_named(self.columns)
        check_workers(self)
        in_range(self, "folds", 2, MOST_FOLDS)
        in_range(self, "times", 1, MOST_TIMES)
        in_range(self, "level", 0.5, 0.999)
        in_range(self, "bootstrap", 100, 1_000_000)
        in_range(self, "seed", 0, 2**63 - 1)
        self._check_against()
        self.whole_fit()

    def _check_against(self) -> None:
        name, _ = setting_of(self.parts, "parts")
        if name in [_setting_in(text)[0] for text in self.against or () if text != UNIFORM]:
            raise RecordError(
                f"{{parts}} and {{against}} are both {name}: compare it with others, or with uniform"
            )

    def settings(self) -> dict[str, tuple[str, ...] | None]:
        """Parts by the name of each setting that is fitted; the first is the one in question."""
        found = dict([setting_of(self.parts, "parts")])
        for text in self.against or (() if self.against == () else ("kernels",)):
            if text != UNIFORM:
                found.setdefault(*_setting_in(text))
        return found

    @property
    def beside_uniform(self) -> bool:
        """Whether the uniform density is compared as well: if asked for, or if there is no other."""
        return UNIFORM in (self.against or ()) or len(self.settings()) == 1

    def whole_fit(self) -> DensityFitRequest:
        """A fit to all rows, with the first setting.

        Raises:
            RecordError: for a field that cannot be used, by its name.
        """
        # groups make the folds: a flow alone is split by them, too, and would refuse them in a fit
        return _fit_of(self, drop_missing=self.drop_missing)


def _fit_of(
    request: DensityFoldRequest | DensityCvRequest,
    *,
    group: str | None = None,
    drop_missing: bool = False,
) -> DensityFitRequest:
    """A fit with what both requests have.

    Raises:
        RecordError: for a field that cannot be used, by its name.
    """
    return DensityFitRequest(
        data=request.data,
        space=request.space,
        out=request.out,
        columns=request.columns,
        header=request.header,
        drop_missing=drop_missing,
        missing=request.missing,
        weights=request.weights,
        group=group,
        unit=request.unit,
        parts=request.parts,
        repeats=request.repeats,
        seed=request.seed,
    )


def setting_of(parts: Sequence[str] | None, field: str) -> tuple[str, tuple[str, ...] | None]:
    """The name of a setting, and its parts in one order.

    Raises:
        RecordError: for parts that there are not, by the field's name.

    >>> setting_of(["mixture", "kernels"], "parts")
    ('kernels+mixture', ('kernels', 'mixture'))
    """
    if parts is None:
        return DEFAULT, None
    unknown = [part for part in parts if part not in PARTS]
    if unknown or not parts:
        # what the user wrote must not be taken for a field's name
        said = ", ".join(unknown).replace("{", "(").replace("}", ")")
        raise RecordError(
            f"{{{field}}} must be of {', '.join(PARTS)} with commas between"
            f"{', default or uniform' if field == 'against' else ''}, got {said!r}"
        )
    own = tuple(part for part in PARTS if part in parts)
    return (DEFAULT, None) if own == PARTS else ("+".join(own), own)


def _setting_in(text: str) -> tuple[str, tuple[str, ...] | None]:
    """Of a word of `against`."""
    return setting_of(None if text == DEFAULT else parts_in(text), "against")


def parts_in(text: str) -> list[str]:
    """
    >>> parts_in("chains, mixture")
    ['chains', 'mixture']
    """
    return [piece.strip() for piece in text.replace("+", ",").split(",") if piece.strip()]
