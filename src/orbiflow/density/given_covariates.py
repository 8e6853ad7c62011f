"""What an estimator knows of covariates: their columns, and densities where they are known."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike

from orbiflow.density.data import (
    Asked,
    TableRows,
    alongside,
    asked_roles,
    cells_of,
    check_lengths,
    columns_of,
    given_roles,
    is_declared,
)
from orbiflow.density.fitting import DensitySettings, FitReport, check_complete
from orbiflow.density.inference import FittedFigures, Trend, axes_named, trend_of
from orbiflow.density.models import ConditionalDensity, Density
from orbiflow.density.spaces import Covariates, Values
from orbiflow.errors import DataWarning, OrbiflowError
from orbiflow.settings import described, is_a


class GivenCovariates(FittedFigures):
    """What an estimator tells where covariates are known.

    After a fit with `given`: `conditional_density_`, the density where covariates are known, and
    `report_.given`, which says what the covariates gain and what is chosen.
    """

    columns: Any
    unit: str | None
    missing: str
    report_: FitReport
    settings: Callable[[], DensitySettings]
    read_rows: Callable[..., TableRows]

    def _read_given(self, X: Any, given: Any) -> tuple[TableRows, dict[str, Values], Covariates]:
        """Return the rows of a fit, cells of what is given, and what they are."""
        check_complete(self.missing)
        declared = asked_roles(given) if is_declared(given) else None
        if declared is None:
            cells = columns_given(given)
            read = self.read_rows(X, apart=list(cells))
        else:
            names = [str(name) for name in declared]
            read = self.read_rows(X, others=names, apart=names)
            cells = dict(read.given)
        are_asked = declared is not None or is_frame(given)
        return read, cells, self._covariates(cells, declared or {}, are_asked)

    def _log_prob_given(self, points: torch.Tensor, given: Any, measure: str) -> torch.Tensor:
        """Return log densities (N,) at points where covariates are as given."""
        density = self.conditional_density_
        return density.log_prob(points, self._x(given, len(points)), measure=measure)

    def _samples_given(self, count: int, given: Any, generator: torch.Generator) -> torch.Tensor:
        """Return samples (n, d) where covariates are as one row or as many say."""
        density = self.conditional_density_
        cells = _rows_given(given, density.covariates.names, count)
        x = self._x(cells, len(next(iter(cells.values()))))
        points = torch.empty((count, density.space.chart_dim), dtype=torch.float64)
        _, first, number = np.unique(x.numpy(), axis=0, return_index=True, return_inverse=True)
        places = np.broadcast_to(number.ravel(), count)
        for k, row in enumerate(first.tolist()):
            those = np.flatnonzero(places == k)
            points[those] = density.at(x[row]).sample((len(those),), generator).double()
        return points

    def _density_at(self, given: Mapping[str, Any]) -> Density:
        """Return the density where covariates have the values that are given by their names."""
        density = self.conditional_density_
        if unknown := [name for name in given if name not in density.covariates.names]:
            names = ", ".join(density.covariates.names)
            raise OrbiflowError(f"no covariate {unknown[0]!r}; there are {names}")
        return density.at(self._x({name: np.array([value]) for name, value in given.items()}, 1)[0])

    def trend_along(
        self,
        along: str,
        at: ArrayLike,
        of: str | int = 0,
        *,
        given: Mapping[str, Any] | None = None,
        levels: Sequence[float] = (0.5, 0.9),
    ) -> Trend:
        """How a column goes with a covariate: its mean and intervals at values (n,) of `along`.

        The other covariates are as `given`. The intervals hold the shares `levels` of new data.
        """
        (axis,) = axes_named([of], self._column_names())
        values = np.asarray(at)
        densities = (self._density_at({**(given or {}), along: value}) for value in values)
        return trend_of(densities, axis, values, levels=levels)

    def _covariates(
        self, cells: Mapping[str, Values], declared: Asked, are_asked: bool
    ) -> Covariates:
        """Return what covariates of a fit are; warn of what is doubtful."""
        declarations = {
            **asked_roles(self.columns),
            **{k: r for k, r in declared.items() if r is not None},
        }
        roles = given_roles(list(cells), cells, declarations, self.unit, are_asked=are_asked)
        covariates = Covariates.of(cells, roles)
        for doubt in covariates.fit_doubts(cells):
            warnings.warn(doubt, DataWarning, stacklevel=3)
        return covariates

    def _x(self, given: Any, rows: int) -> torch.Tensor:
        covariates = self.conditional_density_.covariates
        cells = columns_given(given, covariates.names)
        x = covariates.features(cells, rows)
        for doubt in covariates.doubts(cells):
            warnings.warn(doubt, DataWarning, stacklevel=3)
        return x

    @property
    def conditional_density_(self) -> ConditionalDensity:
        """The density where covariates are known, of a fit with `given`."""
        density = self._fitted().given
        if density is None:
            raise OrbiflowError("no covariates are known to this estimator: call fit with given")
        return density


def is_frame(given: Any) -> bool:
    """Return whether covariates are a data frame, and no arrays with or without names."""
    is_mapping = is_a(given, Mapping) and not hasattr(given, "dims")
    return not is_mapping and columns_of(given, "given") is not None


def columns_given(given: Any, names: Sequence[str] | None = None) -> dict[str, Values]:
    """Return covariates as columns of cells (N,) by name.

    Args:
        given: A data frame, a mapping, or an array (N, c).
        names: Those that are wanted; an array's columns are in this order. Default: all there are.

    Raises `OrbiflowError` for a column that is not there and for columns of several lengths.
    """
    (given,) = alongside(given=given)
    is_mapping = is_a(given, Mapping) and not hasattr(given, "dims")
    pairs = list(given.items()) if is_mapping else columns_of(given, "given")
    if pairs is None:
        table = np.asarray(given)
        if table.ndim != 2:
            raise OrbiflowError(
                f"given: expected columns or an array (N, c), got {described(given)}"
            )
        called = names or [f"x{k}" for k in range(1, table.shape[1] + 1)]
        if len(called) != table.shape[1]:
            raise OrbiflowError(
                f"given: expected {', '.join(called)}, got {table.shape[1]} columns"
            )
        pairs = list(zip(called, table.T, strict=True))
    columns = {str(name): np.asarray(cells_of(cells)) for name, cells in pairs}
    if names is not None:
        if lacking := [name for name in names if name not in columns]:
            raise OrbiflowError(
                f"given: there is no {', '.join(lacking)} among {', '.join(columns)}"
            )
        columns = {name: columns[name] for name in names}
    check_lengths(list(columns.values()), "given")
    return columns


def _rows_given(given: Any, names: Sequence[str], count: int) -> dict[str, Values]:
    """Return covariates as columns of one cell or of `count`; a single value becomes a column."""
    if is_a(given, Mapping):
        rows = [np.atleast_1d(np.asarray(cells)) for cells in given.values()]
        most = max(map(len, rows), default=0)
        rows = [np.repeat(cells, most) if len(cells) == 1 else cells for cells in rows]
        given = dict(zip(given, rows, strict=True))
    cells = columns_given(given, names)
    rows = len(next(iter(cells.values())))
    if rows not in (1, count):
        raise OrbiflowError(
            f"given has {rows} rows, and n_samples is {count}: give one row, or one for each sample"
        )
    return cells
