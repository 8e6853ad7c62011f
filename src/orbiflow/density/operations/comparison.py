"""The operation that compares fitted densities at held-out rows, or two tables."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from orbiflow import runtime
from orbiflow.batch import csv_bytes
from orbiflow.density import comparing, tables
from orbiflow.density.comparing import ComparisonSettings
from orbiflow.density.data import Unit, asked_roles
from orbiflow.density.operations.drawing import require_ending
from orbiflow.density.operations.fitting import columns_of
from orbiflow.density.run_folder import write_file
from orbiflow.density.tables import RotationForm, SpaceSettings, TableSettings
from orbiflow.errors import OrbiflowError, SettingError, literal
from orbiflow.settings import DefaultText, Option, Repeated

if TYPE_CHECKING:
    from orbiflow.arrays import Array
    from orbiflow.density.comparing import DataComparison, ModelComparison, SampleTests
    from orbiflow.density.data import TableRows
    from orbiflow.density.models import Density
    from orbiflow.density.spaces import Space

Columns = tuple[str, ...] | None

MOST_SAMPLES = 50
"""Data sets that a column of one table may name."""

FITTED_SHARE, MIN_LOOKED_UP = 0.5, 5
"""Share of the rows that a model knows, and rows that must have been looked up, for a warning."""


@runtime.operation("density compare")
def compare(
    settings: ComparisonSettings = ComparisonSettings(),
    table: TableSettings = TableSettings(),
    *,
    data: Annotated[tuple[Path, ...], Option("-d"), Repeated()],
    models: Annotated[tuple[Path, ...] | None, Option("--model", "-m"), Repeated()] = None,
    space: str | None = None,
    cell: tuple[float, ...] | None = None,
    unit: Annotated[Unit | None, DefaultText("radians, if no value is beyond 2 pi")] = None,
    crystal: str | None = None,
    specimen: str | None = None,
    form: RotationForm | None = None,
    passive: bool = False,
    by: str | None = None,
    out: Annotated[Path | None, Option("-o"), DefaultText("nothing is written")] = None,
    on_event: runtime.Sink = runtime.ignore,
    cancel: runtime.Cancel = runtime.Cancel(),
) -> runtime.Outcome:
    """Which model suits held-out rows better, or do two data sets differ? With its uncertainty.

    Models: -m A -m B -d held-out.csv. Data sets: -d a.csv -d b.csv --space sphere. Of three or more, or
    with --tests, tests by name: equal means, concentrations, distributions.

    Args:
        data: Table of held-out rows for models; or give it twice or more, for so many data sets.
        models: Folder that `fit` wrote; give it twice or more.
        space: Where two data sets live, as `fit` takes it.
        cell: Lengths and angles in degrees of the cell of two data sets on a group's quotient.
        unit: Unit of angles in two data sets.
        crystal: Symmetry of the crystals whose orientations two data sets have, as `fit` takes it.
        specimen: Symmetry of their specimen.
        form: How columns of two data sets write rotations, as `fit` takes it.
        passive: Whether they are the inverse rotations.
        by: Column that says which data set each row of one table belongs to, for tests by name.
        out: A .json or .csv for the result.
    """
    models = models or ()
    require_ending(out, (".json", ".csv"))
    asked: dict[str, Any] = {"space": space, "cell": cell, "unit": unit, "crystal": crystal}
    asked |= {"specimen": specimen, "form": form, "passive": passive or None}
    given = {name: value for name, value in asked.items() if value is not None}
    named = settings.tests is not None or by is not None or bool(data[2:])
    if models:
        _check_models(data, models, {**given, "by": by, "tests": settings.tests})
    else:
        _check_data(data, given, by)
    if out is not None:
        runtime.check_output_file(out, *models, *data)
    read = _Reader(table, on_event, runtime.progress_events(on_event, cancel))
    where = None if models else SpaceSettings(**given)
    with runtime.one_thread():
        if where is None:
            found = _compare_models(data[0], models, read, settings)
        elif named:
            found = _test_data(data, by, where, read, settings)
        else:
            found = _compare_data(data, where, read, settings)
    document = found.to_json()
    cancel.check()
    if isinstance(found, comparing.SampleTests):
        on_event(_table(found))
    for line in [*found.words(), *found.notes]:
        on_event(runtime.Note(line))
    if out is not None:
        as_csv = out.suffix.lower() == ".csv"
        text = _csv(found) if as_csv else json.dumps(document, allow_nan=False, indent=1)
        write_file(out, text, on_event, f"written to {out}")
    return runtime.Outcome({"file": None if out is None else str(out), "comparison": document})


def _check_models(data: Sequence[Path], models: Sequence[Path], others: Mapping[str, Any]) -> None:
    """Check that there are models and a table, and nothing that is of data sets."""
    wrong = {
        "{models} must be given twice or more, to be compared; or give two {data}": not models[1:],
        "{models} names one folder twice: give each once": len(set(models)) < len(models),
        "models are compared at one {data}, rows that none was fitted to": len(data) != 1,
        **{
            f"{{{name}}} is that of the models: leave it out": value is not None
            for name, value in others.items()
        },
    }
    _refuse(wrong)


def _check_data(data: Sequence[Path], where: Mapping[str, Any], by: str | None) -> None:
    """Check that there are tables, or one with a column that divides it, and a space."""
    wrong = {
        "give two {models} or more and one {data} to compare models, or two {data} and their "
        "{space} to compare data": by is None and len(data) < 2,
        "{by} divides the rows of one {data}: give one table, or leave it out": by is not None
        and len(data) > 1,
        "two {data} need their {space}": "space" not in where,
        "{data} names one file twice: give two data sets": len({own.resolve() for own in data})
        < len(data),
    }  # fmt: skip
    _refuse(wrong)


def _refuse(wrong: Mapping[str, bool]) -> None:
    for message, is_wrong in wrong.items():
        if is_wrong:
            raise SettingError(message)


class _Reader(NamedTuple):
    """How tables are read, who is told, and who hears of the progress."""

    settings: TableSettings
    tell: runtime.Sink
    progress: Callable[[float, str], None]

    def rows(self, data: Path, where: SpaceSettings, by: str | None = None) -> TableRows:
        """Return rows of a data set, given a column that divides them."""
        beside = () if by is None else (by,)
        return tables.read_rows(data, self.settings, self.tell, where=where, given=beside)


def _compare_models(
    data: Path, paths: Sequence[Path], read: _Reader, settings: ComparisonSettings
) -> ModelComparison:
    from orbiflow.density.operations.saved import model_at, rows_of_model

    names = _names(paths)
    models = dict(zip(names, map(model_at, paths), strict=True))
    comparing.require_one_space({name: density.space for name, (density, _) in models.items()})
    columns = _columns_of_models({name: extra for name, (_, extra) in models.items()}, read)
    found: dict[tuple[Columns, Columns], TableRows] = {}
    scores: dict[str, Array] = {}
    notes: list[str] = []
    for k, (name, (density, extra)) in enumerate(models.items()):
        own = columns[name], tuple(extra.get("columns") or ())
        if own not in found:
            tell_once = runtime.ignore if found else read.tell
            asked = read.settings.replace(columns=own[0])
            found[own] = rows_of_model(data, asked, density, extra, tell_once)
            if len(found) > 1 and own[0] is None and not found[own].source.is_named:
                raise OrbiflowError(
                    f"{data} does not name its columns, and the models have them in other orders: give "
                    "it a header"
                )
        values = found[own].values

        def told(share: float, k: int = k) -> None:
            read.progress((k + share) / len(models), "scoring")

        scores[name] = comparing.scores_of(density, values, told)
        notes += _notes_on_known_rows(name, density, extra, values)
    rows = next(iter(found.values()))
    made = comparing.compare_scores(scores, settings, groups=rows.labels, weights=rows.weights)
    return replace(made, notes=(*notes, *made.notes))


def _compare_data(
    data: Sequence[Path], where: SpaceSettings, read: _Reader, settings: ComparisonSettings
) -> DataComparison:
    found = _tables(data, where, read)
    groups = _groups(found)
    values = {name: rows.values for name, rows in found.items()}
    space = _space_of(found, where)
    return comparing.compare_samples(values, space, settings, groups=groups, progress=read.progress)


def _groups(found: Mapping[str, TableRows]) -> dict[str, Any] | None:
    """Return what the rows of data sets belong to, if columns say it."""
    labels = {name: rows.labels for name, rows in found.items()}
    if all(own is None for own in labels.values()):
        return None
    return dict(labels)


def _space_of(found: Mapping[str, TableRows], where: SpaceSettings) -> Space:
    """Return the space that suits the rows of all data sets."""
    import numpy as np

    first = next(iter(found.values()))
    values = np.concatenate([rows.values for rows in found.values()])
    numbers = np.zeros(len(values), dtype=np.int64)
    every = replace(first, numbers=numbers, values=values, weights=None, labels=None, given={})
    columns = columns_of(where, every)
    return columns.of(every)


def _test_data(
    data: Sequence[Path],
    by: str | None,
    where: SpaceSettings,
    read: _Reader,
    settings: ComparisonSettings,
) -> SampleTests:
    import numpy as np

    from orbiflow.density.data import words_of_cells

    found = _tables(data, where, read, by)
    values = {name: rows.values for name, rows in found.items()}
    groups = _groups(found)
    columns, space = next(iter(found.values())).columns, _space_of(found, where)
    if by is not None:
        (rows,) = found.values()
        labels = words_of_cells(next(iter(rows.given.values())))
        names = np.unique(labels).tolist()
        if not 2 <= len(names) <= MOST_SAMPLES:
            raise SettingError(
                f"{{by}} must have 2 to {MOST_SAMPLES} values, one for each data set; "
                f"{literal(by)} has {len(names)}"
            )
        values = {str(name): rows.values[labels == name] for name in names}
        own = rows.labels
        groups = None if own is None else {str(name): own[labels == name] for name in names}
    return comparing.named_tests(values, space, settings, columns=columns, groups=groups)


def _tables(
    data: Sequence[Path], where: SpaceSettings, read: _Reader, by: str | None = None
) -> dict[str, TableRows]:
    """Return the rows of tables by the tables' names, whose columns must be the same."""
    found = {
        name: read.rows(path, where, by) for name, path in zip(_names(data), data, strict=True)
    }
    (first, one), *others = found.items()
    if one.weights is not None:
        raise SettingError(comparing.UNWEIGHTED)
    for name, other in others:
        if [str(role) for role in one.roles] != [str(role) for role in other.roles]:
            raise SettingError(
                literal(f"{first} has {one.declaration}, and {name} {other.declaration}: ")
                + "specify with {columns} which to compare"
            )
        if one.source.is_named and other.source.is_named and one.columns != other.columns:
            if sorted(one.columns) == sorted(other.columns):
                order = [other.columns.index(column) for column in one.columns]
                found[name] = replace(other, values=other.values[:, order], columns=one.columns)
            elif where.space == "torus":
                raise SettingError(
                    literal(
                        f"{first} has the columns {', '.join(one.columns)}, {name} "
                        f"{', '.join(other.columns)}: "
                    )
                    + "specify with {columns} which to compare"
                )
    return found


def _table(found: SampleTests) -> runtime.Table:
    """Return tests by name, a line for each."""
    return runtime.Table(
        "Tests by name",
        ("test", "column", "statistic", "df", "p", "by"),
        tuple(
            (
                one.name,
                one.column or "all",
                f"{one.statistic:.5g}",
                ", ".join(f"{own:g}" for own in one.degrees) or "-",
                f"{one.p:.2g}" if one.p > 1e-300 else "< 1e-300",
                one.by,
            )
            for one in found.tests
        ),
    )


def _columns_of_models(
    extras: Mapping[str, Mapping[str, Any]], read: _Reader
) -> dict[str, Columns]:
    """Return the table's columns in the order in which each model was fitted to them."""
    own = {name: tuple(extra.get("columns") or ()) for name, extra in extras.items()}
    (first, wanted), *others = own.items()
    roles = asked_roles(read.settings.columns)
    asked = [str(name) for name, role in roles.items() if role is None or not role.is_side]
    sides = [f"{name}={role}" for name, role in roles.items() if str(name) not in asked]
    if asked:
        places = {name: k for k, name in enumerate(wanted)}
        same = {name: sorted(other) == sorted(wanted) for name, other in own.items()}
        # by the order of the first; another model may have the same ones in another order
        return {
            name: (
                *(
                    (asked[places[column]] for column in other)
                    if same[name] and len(places) == len(asked)
                    else asked
                ),
                *sides,
            )
            for name, other in own.items()
        }
    for name, other in others:
        if sorted(wanted) != sorted(other):
            fitted = f"{first} was fitted to {', '.join(wanted)}, {name} to {', '.join(other)}"
            raise SettingError(
                f"{literal(fitted)}: are they the same quantities? Then specify with {{columns}} which "
                "columns they are"
            )
    return dict.fromkeys(own, tuple(sides) or None)


def _notes_on_known_rows(
    name: str, density: Density, extra: Mapping[str, Any], values: Array
) -> list[str]:
    """Return a note if a model was, or may have been, fitted to the rows."""
    if not extra.get("fitted_rows"):
        return [
            f"{name} has no record of the rows that it was fitted to: make sure that none of these "
            "is one"
        ]
    sketch = comparing.RowSketch.from_json(extra["fitted_rows"])
    known, looked_up = sketch.known(density.space, values)
    note = (
        f"{known} of {looked_up} rows that were looked up equal one that {name} was fitted to: "
        "repeated values, or the same rows"
    )
    if looked_up >= MIN_LOOKED_UP and known >= FITTED_SHARE * looked_up:
        note = (
            f"WARNING: {name} seems to have been fitted to these rows ({known} of {looked_up} that "
            "were looked up): a model's score at rows that it has seen says little; compare at others"
        )
    return [note] if known else []


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


def _csv(found: ModelComparison | DataComparison | SampleTests) -> bytes:
    """Return the differences of models, the figures of data sets, or their tests, a row each."""
    document = found.to_json()
    if "tests" in document:
        lines = [
            {**own, "degrees": " ".join(f"{k:g}" for k in own["degrees"])}
            for own in document["tests"]
        ]
        return csv_bytes(list(lines[0]), [list(line.values()) for line in lines])
    figures: dict[str, dict[str, Any]] = document.get("divergence") or {}
    rows: list[dict[str, Any]] = document.get("differences") or [
        {"figure": "p", "value": document["test"]["p"], "error": None, "low": None, "high": None},
        *({"figure": name, **own} for name, own in figures.items()),
    ]
    return csv_bytes(list(rows[0]), [list(row.values()) for row in rows])
