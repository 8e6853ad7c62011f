"""A density estimator with scikit-learn's interface, for data in the units that people have."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import torch
from numpy.typing import ArrayLike

from orbiflow.arrays import Array
from orbiflow.density.data import (
    OUTPUTS,
    DataTable,
    Declaration,
    TableRows,
    alongside,
    asked_roles,
    choose,
    frame_of,
    is_declared,
    rows_of,
    runs_of_draws,
)
from orbiflow.density.fitting import (
    ChosenFit,
    DensitySettings,
    FitReport,
    Parameter,
    Progress,
    check_missing,
    fit_chosen,
    fit_conditional,
    refuse_flow_settings,
    weighted_mean,
)
from orbiflow.density.given_covariates import GivenCovariates
from orbiflow.density.inference import (
    at_observed,
    axes_named,
    chart_of_rows,
    chosen_columns,
    conditional,
    data_doubts,
    given_doubts,
    given_named,
    marginal,
)
from orbiflow.density.models import Density, flow_obstacle, log_density_gradient
from orbiflow.density.random_state import RandomState, seed_of
from orbiflow.density.spaces import DataColumns, Space, check_measure
from orbiflow.errors import DataWarning, OrbiflowError
from orbiflow.settings import as_choice, as_instance, as_whole, check_names, fields_of, refusal


def _refuse_targets(y: object) -> None:
    """Refuse what is not used: a density has no targets."""
    if y is not None:
        raise refusal("y", "None", y, "weights are given as sample_weight, covariates as given")


def _signature() -> inspect.Signature:
    """The constructor's parameters, which include all settings by name."""
    first = {"columns": None, "unit": None, "missing": "refuse"}
    others = first | {entry.name: entry.default for entry in fields_of(DensitySettings)}
    kinds = inspect.Parameter
    return inspect.Signature(
        [kinds("space", kinds.POSITIONAL_OR_KEYWORD, default="torus")]
        + [kinds(name, kinds.KEYWORD_ONLY, default=value) for name, value in others.items()]
    )


class DensityEstimator(GivenCovariates):
    """Exact, normalised density of angles, directions, axes or Klein-bottle coordinates.

    Follows scikit-learn's conventions: works in a `GridSearchCV` and a `Pipeline`.

    Args:
        space: "torus", "sphere" and other names that `make_space` takes; the name of a group, such as
            "p4m", "hantzsche-wendt" or "P 21 21 21"; or a `Space`, such as `QuotientSpace(group)`.
        columns: What the columns are, in the words of the command line: roles by names, or by numbers
            from 0, {"dir": "angle:degrees", "speed": "positive"}; or "dir=angle:degrees,speed".
            Of a data frame, columns whose names say it need no role, and others are asked for; those of
            weights, counts and groups are named here, too. Of an array they may name the columns, which
            are angles in radians unless declared.
        unit: The unit of angles that name none: "radians", "degrees" or "turns".
        missing: "refuse" rows that lack an angle (NaN), or, on tori, "marginalise": fit kernels and
            mixtures to them, and score them, by the density of the angles that they have.
        settings: Those of `DensitySettings`, by name: `components`, `repeats`, `max_frequency`,
            `effort`, `seed` and others. They are checked by `fit`.

    On tori of four or more angles and on spaces of unit vectors there is no flow, and its settings
    must be left at their defaults.

    After `fit`: `space_`, `density_` (a `Density`), `report_` (a `FitReport`), of covariates what is
    `given` in both,
    `n_features_in_`, and `feature_names_in_` where the data, a data frame, name their columns.

    >>> rng = np.random.default_rng(0)
    >>> angles = rng.vonmises([0.0, 1.0], 4.0, (200, 2))
    >>> estimator = DensityEstimator("torus", max_frequency=2, segments=2, iterations=5).fit(angles)
    >>> estimator.score_samples([[0.0, 1.0]]).shape
    (1,)
    """

    density_: Density
    report_: FitReport
    feature_names_in_: np.ndarray
    __signature__ = _signature()

    def __init__(
        self,
        space: str | Space = "torus",
        *,
        columns: Any = None,
        unit: str | None = None,
        missing: str = "refuse",
        **settings: Any,
    ) -> None:
        self.space = space
        self.columns = columns
        self.unit = unit
        self.missing = missing
        check_names(settings, fields_of(DensitySettings), "DensityEstimator")
        defaults = {entry.name: entry.default for entry in fields_of(DensitySettings)}
        vars(self).update({**defaults, **settings})

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...  # each setting, by its name

    def fit(
        self,
        X: ArrayLike | TableRows,
        y: object = None,
        sample_weight: ArrayLike | None = None,
        *,
        given: Any = None,
        groups: ArrayLike | None = None,
        progress: Progress | None = None,
    ) -> Self:
        """Fit to data (N, k) in the space's own units; there is no `y` but None.

        Data are an array or a data frame (pandas, polars, pyarrow, xarray) whose columns are as
        declared, or draws of a sampler (ArviZ's InferenceData, an xarray.Dataset along chain and draw).
        Of a frame whose columns have names, later frames are read by these names. What is doubtful is a
        `DataWarning`.

        Args:
            sample_weight: of the rows (N,), at least 0: how much each counts in everything that is
                fitted and judged. Only ratios count, equal ones are none.
            given: what is known of each row, on which the density may depend: columns of the frame X
                with their roles, {"hour": "cycle:24", "site": "word"}, or columns of their own: a data
                frame, a mapping {"name": values}, or an array (N, c), whose columns are called x1, x2
                and so on. Text is words; numbers have the role of their name, others are asked for in
                data frames, and real in arrays.
            groups: a label (N,) a row: rows of one are held out together where parts are chosen, for
                densities of new groups (proteins, stations, fires). Default: none, of draws in chains
                the tenths of each chain, because neighbouring draws are alike.

        Raises:
            UndeclaredError: for columns of a frame of which nothing says what they are; `proposal` is
                what may be declared.
            OrbiflowError: for data that are not of the space or contradict what is declared; covariates
                that lack values or have one alone, and fewer than 30 rows of them; too few
                points, weights that are none, a setting out of range, or one that has no meaning on a
                torus of so many angles.
        """
        _refuse_targets(y)
        beside = {} if given is None or is_declared(given) else {"given": given}
        _, sample_weight, groups, *aligned = alongside(
            X=X, sample_weight=sample_weight, groups=groups, **beside
        )
        read = None if given is None else self._read_given(X, aligned[0] if aligned else given)
        rows = self.read_rows(X) if read is None else read[0]
        sample_weight, groups = rows.beside(sample_weight, groups)
        if groups is None and read is None and not self.settings().flow_alone:
            groups = runs_of_draws(X)
        how: dict[str, Any] = {"weights": sample_weight, "groups": groups, "progress": progress}
        pooled = self._fit(rows, **how)
        if read is not None:
            points = self._chart(rows.values)
            self.report_ = fit_conditional(pooled, points, *read[1:], self.settings(), **how)
        return self

    def read_rows(self, X: Any, others: Sequence[str] = (), apart: Sequence[str] = ()) -> TableRows:
        """The rows that `fit` reads; sets their space.

        Columns `others` are kept as what is given; roles of the names `apart` are of no data.
        """
        columns = self._columns(apart)
        rows = X if isinstance(X, TableRows) else columns.read(X, others)
        self.space_ = columns.of(rows)
        return rows

    def _fit(self, read: TableRows, groups: ArrayLike | None, **how: Any) -> ChosenFit:
        """Fit to data that were read; `how` are weights and progress."""
        settings, points = self.settings(), self._chart(read.values)
        if flow_obstacle(self.space_):
            refuse_flow_settings(settings, self.space_)
        settings.check_rows(self.missing, None if groups is None else "groups")
        names = read.columns if read.source.is_named else None
        how |= {"groups": groups, "missing": self.missing, "columns": names}
        fit = fit_chosen(self.space_, points, settings, **how)
        self._keep(fit, read)
        return fit

    def _keep(self, found: ChosenFit, read: TableRows) -> None:
        """Set what there is after a fit to data."""
        self.density_, self.report_ = found.density, found.report
        self.n_features_in_ = read.values.shape[1]
        if read.source.is_named:
            self.feature_names_in_ = np.array(read.columns, dtype=object)
        elif hasattr(self, "feature_names_in_"):
            del self.feature_names_in_  # of an earlier fit

    def settings(self) -> DensitySettings:
        """Return the settings of a fit, which are checked here."""
        return DensitySettings(**self._changed(entry.name for entry in fields_of(DensitySettings)))

    def parameters(self) -> dict[str, Parameter]:
        """Estimates with standard errors and intervals, by name, of a parametric family alone.

        What else is known of the fit is `report_.parametric`.

        Raises:
            OrbiflowError: before `fit`, or for another density.

        >>> angles = np.random.default_rng(0).vonmises(0, 2, (60, 1))
        >>> fit = DensityEstimator("torus", columns="phi", components="von-mises").fit(angles)
        >>> list(fit.parameters())
        ['mean_phi', 'concentration_phi']
        """
        self._fitted()
        report = getattr(self, "report_", None)
        if report is None or report.parametric is None:
            raise OrbiflowError(
                'this density is of no parametric family alone: fit one, such as components="kent"'
            )
        return {parameter.name: parameter for parameter in report.parametric.parameters}

    def marginal(self, *columns: str | int) -> DensityEstimator:
        """An estimator of some of the columns alone, by their columns' names or numbers from 0.

        Raises:
            OrbiflowError: before `fit`, for other spaces than tori and unknown columns; see
                `orbiflow.density.marginal`.

        >>> angles = np.random.default_rng(0).vonmises([0.0, 1.0], 4.0, (60, 2))
        >>> fit = DensityEstimator("torus", components="kernels").fit(angles)
        >>> fit.marginal("angle2").score_samples([[1.0]]).shape
        (1,)
        """
        density, names = self._fitted(), self._column_names()
        kept, axes = chosen_columns(self.space_, axes_named(columns, names), len(names))
        return self._of(marginal(density, axes), [names[column] for column in kept])

    def conditional(
        self, given: Mapping[str | int, float] | None = None, /, **angles: float
    ) -> DensityEstimator:
        """An estimator of the other angles where some are known, in the data's unit.

        Args:
            given: values by the columns' names or numbers from 0.
            angles: as well, by names: `conditional(psi=-45)`.

        Raises:
            OrbiflowError: before `fit`, for other spaces than tori and unknown columns; see
                `orbiflow.density.conditional`.
        """
        density, names = self._fitted(), self._column_names()
        both: list[tuple[str | int, float]] = [*(given or {}).items(), *angles.items()]
        fixed = given_named(self.space_, both, names)
        columns = axes_named([name for name, _ in both], names)
        values = {names[k]: float(value) for k, (_, value) in zip(columns, both, strict=True)}
        for doubt in given_doubts(self.space_, values, names):
            warnings.warn(doubt, DataWarning, stacklevel=2)
        left = [k for k in range(len(names)) if k not in columns]
        kept, axes = chosen_columns(self.space_, left, len(names))
        return self._of(conditional(density, fixed, axes), [names[k] for k in kept])

    def at(self, given: Mapping[str, Any] | None = None, /, **values: Any) -> DensityEstimator:
        """The density where covariates have some values: `at(temperature=295, residue="GLY")`."""
        return self._of(self._density_at({**(given or {}), **values}), self._column_names())

    @classmethod
    def fitted(
        cls,
        density: Density,
        report: FitReport | None = None,
        columns: Sequence[str] | None = None,
        **params: Any,
    ) -> DensityEstimator:
        """An estimator of a density that is there already, such as one that was read from a file.

        Without the report of its fit there is no `report_`, without columns no `feature_names_in_`;
        `params` are those of the constructor, for fits to come.
        """
        as_instance(density, Density, "density")
        made = cls(density.space).set_params(**params)
        made.space_, made.density_ = density.space, density
        if report is not None:
            made.report_ = report
        if columns:
            made.feature_names_in_ = np.array(list(columns), dtype=object)
        made.n_features_in_ = len(density.space.columns)
        return made

    def score_samples(self, X: ArrayLike, *, given: Any = None, measure: str = "natural") -> Array:
        """Log densities (N,) in nats at data (N, k), with respect to `measure` (see `MEASURES`).

        Where covariates are `given`, as to `fit`, each where its own are; without, of all rows.

        Of rows that lack angles (NaN), with `missing="marginalise"`, of the angles that they have. The
        columns of a data frame are found by the names that `fit` has seen. Data that are likelier in
        another unit than the fit's are a `DataWarning`.

        Raises:
            OrbiflowError: before `fit`, and for data that are not of its space and columns, or have
                codes for missing values.
        """
        check_measure(measure, self._fitted().space)
        if given is None:
            points = self._chart(self._checked(X))
            return at_observed(self.density_, points, measure=measure).numpy()
        if is_declared(given):
            given = X
        else:
            _, given = alongside(X=X, given=given)
        return self._log_prob_given(self.points_of(X), given, measure).numpy()

    def points_of(self, X: ArrayLike) -> torch.Tensor:
        """Points (N, d) of the chart at data (N, k), which are read as `score_samples` reads them."""
        return self._chart(self._checked(X))

    def score_gradient(self, X: ArrayLike) -> Array:
        """Gradients (N, k) of the log density in natural measure, in the data's own coordinates.

        In nats per unit of each angle; per degree of latitude and longitude; of unit vectors the
        tangent vector that points uphill, per radian. See `log_density_gradient`.
        """
        return log_density_gradient(self._fitted(), self._checked(X))[1]

    def score(
        self,
        X: ArrayLike,
        y: object = None,
        sample_weight: ArrayLike | None = None,
        *,
        given: Any = None,
    ) -> float:
        """Mean log density of data (N, k), weighted, in natural measure; there is no `y` but None."""
        _refuse_targets(y)
        beside = {} if given is None or is_declared(given) else {"given": given}
        _, sample_weight, *aligned = alongside(X=X, sample_weight=sample_weight, **beside)
        given = aligned[0] if aligned else given
        if given is None:  # not by `score_samples`: warnings name the caller's line
            points = self._chart(self._checked(X))
            scores = at_observed(self._fitted(), points, measure="natural")
        else:
            scores = torch.as_tensor(self.score_samples(X, given=given))
        return weighted_mean(scores, sample_weight)

    def sample(
        self, n_samples: int = 1, random_state: RandomState = None, *, given: Any = None
    ) -> Any:
        """New data (n_samples, k) in the space's own units: an array, or what `set_output` asked for.

        Args:
            random_state: as scikit-learn has it. None: other points at every call, from NumPy's
                global state, which `np.random.seed` sets. An integer: always the same points. A
                NumPy `RandomState` or `Generator`: the next ones from it.
            given: the covariates: one value for each name, or as many rows as samples, of which each
                has one. A single value among columns is that of all rows.

        Raises:
            OrbiflowError: before `fit`, for fewer than one sample, or another random state.
        """
        density = self._fitted()
        count = as_whole(n_samples, "n_samples", 1)
        generator = torch.Generator().manual_seed(seed_of(random_state))
        if given is None:
            points = density.sample((count,), generator)
        else:
            points = self._samples_given(count, given, generator)
        rows = self.space_.from_chart(points)
        return frame_of(rows, self._column_names(), getattr(self, "output_", "default"))

    def set_output(self, *, transform: str | None = None) -> Self:
        """Choose what `sample` returns: "default", an array, or a frame of "pandas" or "polars".

        None changes nothing, as in scikit-learn.
        """
        if transform is not None:
            self.output_ = as_choice(transform, OUTPUTS, "transform")
        return self

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The constructor's arguments, by name."""
        del deep
        return {name: getattr(self, name) for name in self._names()}

    def set_params(self, **params: Any) -> Self:
        """Change constructor arguments."""
        for name, value in params.items():
            if name not in self._names():
                raise OrbiflowError(f"no parameter {name!r}; there are {', '.join(self._names())}")
            setattr(self, name, value)
        return self

    def __sklearn_tags__(self) -> Any:
        # asked for by scikit-learn alone, which is therefore there
        from sklearn.utils import Tags, TargetTags  # pyright: ignore[reportMissingImports, reportMissingTypeStubs]

        return Tags(
            estimator_type="density_estimator",
            target_tags=TargetTags(required=False),
            transformer_tags=None,
            regressor_tags=None,
            classifier_tags=None,
        )

    def __repr__(self) -> str:
        shown = [f"{name}={value!r}" for name, value in self._changed(self._names()).items()]
        return f"{type(self).__name__}({', '.join(shown)})"

    @classmethod
    def _names(cls) -> list[str]:
        return list(inspect.signature(cls).parameters)

    def _changed(self, names: Iterable[str]) -> dict[str, Any]:
        """Parameters that are not at their defaults."""
        defaults = inspect.signature(type(self)).parameters
        values = {name: getattr(self, name) for name in names}
        return {name: v for name, v in values.items() if v != defaults[name].default}

    def _columns(self, apart: Sequence[str] = ()) -> DataColumns:
        lower = {name.casefold() for name in apart}
        roles = asked_roles(self.columns)
        of_data = {key: role for key, role in roles.items() if str(key).casefold() not in lower}
        return DataColumns(self.space, self.unit, of_data, self.settings().seed)

    def _checked(self, X: ArrayLike) -> Array:
        """Return data in the order of the fit; warn of those that seem to be in another unit."""
        density, data = self._fitted(), self._in_order(X)
        names = getattr(self, "feature_names_in_", None)
        for doubt in data_doubts(density, data, names):
            warnings.warn(doubt, DataWarning, stacklevel=3)
        return data

    def _in_order(self, X: ArrayLike) -> Array:
        """Return data with the columns of a frame in the order in which `fit` has seen them."""
        table, space = DataTable.of(X), self.space_
        names = tuple(str(name) for name in getattr(self, "feature_names_in_", ()))
        said = Declaration(space.data_name, widths=space.widths, roles=space.roles, names=names)
        chosen = choose(table, said)
        for note in chosen.notes if table.is_named else ():
            warnings.warn(note, DataWarning, stacklevel=4)
        return rows_of(table, chosen).values

    def _chart(self, data: np.ndarray) -> torch.Tensor:
        """Points of data (N, k); with missing angles where they may be."""
        may_lack = check_missing(self.missing) == "marginalise" and self.space_.is_torus
        return chart_of_rows(self.space_, data, may_lack=may_lack)

    def _column_names(self) -> list[str]:
        return [str(name) for name in getattr(self, "feature_names_in_", self.space_.columns)]

    def _of(self, density: Density, names: list[str]) -> DensityEstimator:
        """A fitted estimator of a density that was derived."""
        params = {n: v for n, v in self.get_params().items() if n not in ("space", "columns")}
        return DensityEstimator.fitted(density, columns=names, **params)

    def _fitted(self) -> Density:
        if not hasattr(self, "density_"):
            raise OrbiflowError("this estimator is not fitted yet: call fit first")
        return self.density_
