"""The operations that compare: fitted densities at held-out rows, two data sets, samples by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from orbiflow import runtime
from orbiflow.density import comparing, tables
from orbiflow.density.comparing import ComparisonSettings, DataComparisonSettings, NamedTestSettings
from orbiflow.density.data import asked_roles
from orbiflow.density.operations.fitting import space_of
from orbiflow.density.tables import SpaceSettings, TableSettings
from orbiflow.errors import OrbiflowError, SettingError, literal
from orbiflow.settings import DefaultText, Ending, Option, Repeated

if TYPE_CHECKING:
    from orbiflow.arrays import Array
    from orbiflow.density.data import TableRows
    from orbiflow.density.operations.saved import SavedDensity

DataSets = Annotated[tuple[Path, ...], Option("-d"), Repeated()]
Out = Annotated[
    Path | None, Option("-o"), Ending(".json", ".csv"), DefaultText("nothing is written")
]

MOST_SAMPLES = 50
"""Data sets that a column of one table may name."""

FITTED_SHARE, MIN_LOOKED_UP = 0.5, 5
"""Share of the rows that a model knows, and rows that must have been looked up, for a warning."""


@runtime.operation("density compare")
def compare(
    settings: ComparisonSettings = ComparisonSettings(),
    table: TableSettings = TableSettings(),
    *,
    models: Annotated[tuple[Path, ...], Option("--model", "-m"), Repeated()],
    data: Annotated[Path, Option("-d")],
    out: Out = None,
    on_event: runtime.Sink = runtime.ignore,
    cancel: runtime.Cancel = runtime.Cancel(),
) -> runtime.Outcome:
    """Which fitted density suits held-out rows better? With its uncertainty.

    Args:
        models: Folder that `fit` wrote; give it twice or more.
        data: Table of rows that none of them was fitted to.
        out: A .json or .csv for the result.
    """
    if not models[1:]:
        raise SettingError("{models} must be given twice or more, to be compared")
    if len(set(models)) < len(models):
        raise SettingError("{models} names one folder twice: give each once")
    if out is not None:
        runtime.check_output_file(out, *models, data)

    from orbiflow.density.operations.saved import SavedDensity

    with runtime.one_thread():
        progress = runtime.progress_events(on_event, cancel)
        saved = dict(zip(_names(models), map(SavedDensity.read, models), strict=True))
        comparing.require_one_space({name: model.density.space for name, model in saved.items()})
        columns = _columns_of_models(saved, table)
        scores: dict[str, Array] = {}
        notes: list[str] = []
        rows: TableRows | None = None
        for k, (name, model) in enumerate(saved.items()):
            tell = runtime.ignore if rows is not None else on_event
            rows = model.rows(data, table.replace(columns=columns[name]), tell)
            if not rows.source.is_named and len(set(columns.values())) > 1:
                raise OrbiflowError(
                    f"{data} does not name its columns, and the models have them in other orders: "
                    "give it a header"
                )
            scores[name] = comparing.scores_of(
                model.density,
                rows.values,
                lambda share, k=k: progress((k + share) / len(saved), "scoring"),
            )
            notes += _notes_on_known_rows(name, model, rows.values)
        assert rows is not None
        answer = comparing.compare_scores(
            scores, settings, groups=rows.labels, weights=rows.weights
        )
    return _shown(replace(answer, notes=(*notes, *answer.notes)), out, on_event, cancel)


@runtime.operation("density compare-data")
def compare_data(
    where: SpaceSettings,
    settings: DataComparisonSettings = DataComparisonSettings(),
    table: TableSettings = TableSettings(),
    *,
    data: DataSets,
    out: Out = None,
    on_event: runtime.Sink = runtime.ignore,
    cancel: runtime.Cancel = runtime.Cancel(),
) -> runtime.Outcome:
    """Do two data sets come from one density? How far apart are they?

    Args:
        data: Table of a data set; give it twice.
        out: A .json or .csv for the result.
    """
    if len(data) != 2:
        raise SettingError("{data} must be given twice; `density test` takes several")
    samples, space = _samples(data, None, where, table, out, on_event)
    progress = runtime.progress_events(on_event, cancel)
    with runtime.one_thread():
        answer = comparing.compare_samples(samples, space, settings, progress=progress)
    return _shown(answer, out, on_event, cancel)


@runtime.operation("density test")
def sample_tests(
    where: SpaceSettings,
    settings: NamedTestSettings = NamedTestSettings(),
    table: TableSettings = TableSettings(),
    *,
    data: DataSets,
    by: str | None = None,
    out: Out = None,
    on_event: runtime.Sink = runtime.ignore,
    cancel: runtime.Cancel = runtime.Cancel(),
) -> runtime.Outcome:
    """Test by name whether samples have equal means, concentrations or distributions.

    Args:
        data: Table of a sample; give it twice or more, or once with `by`.
        by: Column that says which sample each row of one table belongs to.
        out: A .json or .csv for the result.
    """
    if by is None and len(data) < 2:
        raise SettingError("{data} must be given twice or more, or one table and {by}")
    if by is not None and len(data) > 1:
        raise SettingError("{by} divides the rows of one {data}: give one table, or leave it out")
    samples, space = _samples(data, by, where, table, out, on_event)
    with runtime.one_thread():
        answer = comparing.named_tests(samples, space, settings)
    return _shown(answer, out, on_event, cancel)


def _shown(
    found: runtime.Answer, out: Path | None, tell: runtime.Sink, cancel: runtime.Cancel
) -> runtime.Outcome:
    runtime.emit(found, tell, cancel, out)
    file = None if out is None else str(out)
    return runtime.Outcome({"file": file, "comparison": runtime.to_json(found)})


def _samples(
    data: Sequence[Path],
    by: str | None,
    where: SpaceSettings,
    table: TableSettings,
    out: Path | None,
    tell: runtime.Sink,
) -> tuple[dict[str, TableRows], Any]:
    """Return the rows of samples by their names, and what is known of their space."""
    import numpy as np

    from orbiflow.density.data import words_of_cells

    if len({path.resolve() for path in data}) < len(data):
        raise SettingError("{data} names one file twice: give two data sets")
    if out is not None:
        runtime.check_output_file(out, *data)
    side = () if by is None else (by,)
    samples = {
        name: tables.read_rows(path, table, tell, where=where, given=side)
        for name, path in zip(_names(data), data, strict=True)
    }
    first = next(iter(samples.values()))
    if by is not None:
        labels = words_of_cells(next(iter(first.given.values())))
        names = np.unique(labels).tolist()
        if not 2 <= len(names) <= MOST_SAMPLES:
            raise SettingError(
                f"{{by}} must have 2 to {MOST_SAMPLES} values, one for each data set; "
                f"{literal(by)} has {len(names)}"
            )
        samples = {str(name): first.only(labels == name) for name in names}
    return samples, space_of(where, first.own_names, first.unit)


def _columns_of_models(
    models: Mapping[str, SavedDensity], table: TableSettings
) -> dict[str, tuple[str, ...] | None]:
    """Return what is declared of the table's columns, in the order in which each model has them."""
    fitted = {name: tuple(model.extra.get("columns") or ()) for name, model in models.items()}
    (first, wanted), *others = fitted.items()
    roles = asked_roles(table.columns)
    sides = [f"{name}={role}" for name, role in roles.items() if role and role.is_side]
    named = [str(name) for name, role in roles.items() if role is None or not role.is_side]
    if not named:
        for name, columns in others:
            if sorted(wanted) != sorted(columns):
                words = f"{first} was fitted to {', '.join(wanted)}, {name} to {', '.join(columns)}"
                raise SettingError(
                    f"{literal(words)}: are they the same quantities? Then specify with {{columns}} "
                    "which columns they are"
                )
        return dict.fromkeys(fitted, tuple(sides) or None)
    # by the order of the first; another model may have the same ones in another order
    places = dict(zip(wanted, named, strict=False))
    declared: dict[str, tuple[str, ...] | None] = {}
    for name, columns in fitted.items():
        same = len(places) == len(named) and sorted(columns) == sorted(places)
        declared[name] = (*([places[column] for column in columns] if same else named), *sides)
    return declared


def _notes_on_known_rows(name: str, model: SavedDensity, values: Array) -> list[str]:
    """Return a note if a model was, or may have been, fitted to the rows."""
    if not model.extra.get("fitted_rows"):
        return [
            f"{name} has no record of the rows that it was fitted to: make sure that none of these "
            "is one"
        ]
    sketch = runtime.from_json(comparing.RowSketch, model.extra["fitted_rows"], "fitted_rows")
    count, looked_up = sketch.known(model.density.space, values)
    note = (
        f"{count} of {looked_up} rows that were looked up equal one that {name} was fitted to: "
        "repeated values, or the same rows"
    )
    if looked_up >= MIN_LOOKED_UP and count >= FITTED_SHARE * looked_up:
        note = (
            f"WARNING: {name} seems to have been fitted to these rows ({count} of {looked_up} that "
            "were looked up): a model's score at rows that it has seen says little; compare at others"
        )
    return [note] if count else []


def _names(paths: Sequence[Path]) -> list[str]:
    """Return names of what is compared, short if that tells them apart.

    >>> _names([Path("a/x.csv"), Path("a/y.csv")]), _names([Path("a/x"), Path("b/x")])
    (['x', 'y'], ['a/x', 'b/x'])
    """
    short = [
        path.resolve().stem if path.is_file() or path.suffix else path.resolve().name
        for path in paths
    ]
    if len(set(short)) == len(short) and all(short):
        return short
    full = [str(path) for path in paths]
    if len(set(full)) == len(full):
        return full
    return [f"{k}: {path}" for k, path in enumerate(full, 1)]
