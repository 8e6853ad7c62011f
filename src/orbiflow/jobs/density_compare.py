"""Models at held-out rows, and two data sets: the job of a `DensityCompareRequest`."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from orbiflow.density import (
    DataComparison,
    Density,
    ModelComparison,
    RowSketch,
    Table,
    column_names,
    compare_samples,
    compare_scores,
    read_labels,
    require_one_space,
    scores_of,
)
from orbiflow.density.operations import check_fits, model_at
from orbiflow.density.tables import angle_unit
from orbiflow.errors import OrbiflowError
from orbiflow.jobs.density_compare_requests import DensityCompareRequest
from orbiflow.jobs.density_data import (
    read_data,
    same_columns,
)
from orbiflow.jobs.place import check_place
from orbiflow.jobs.run import Sink
from orbiflow.runtime import (
    Cancel,
    Finished,
    Note,
    Progress,
    RecordError,
    Written,
    one_thread,
    write_atomic,
)

SEEMS_FITTED, LEAST_LOOKED_UP = 0.5, 5
"""Share of the rows that a model knows, and rows that must have been looked up, to be warned."""


@one_thread()
def density_compare(request: DensityCompareRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Compare, say what came of it, and write it if asked to.

    Returns:
        `summary`: `file` (or None) and `comparison`, what was written.

    Raises:
        OrbiflowError: for anything that the user can mend.
        Cancelled: if it was told to stop; nothing is written.
    """
    if request.out is not None:
        check_place(request.out, *request.models, *request.data)
    compare = _compare_models if request.models else _compare_data
    found = compare(request, tell, cancel)
    document = found.to_json()
    cancel.check()
    for line in [*found.words(), *found.notes]:
        tell(Note(line))
    if request.out is not None:
        as_csv = request.out.suffix.lower() == ".csv"
        text = _csv(found) if as_csv else json.dumps(document, allow_nan=False, indent=1)
        write_atomic(request.out, text)
        tell(Written(request.out))
        tell(Note(f"written to {request.out}"))
    file = None if request.out is None else str(request.out)
    return Finished("done", {"file": file, "comparison": document})


def _compare_models(request: DensityCompareRequest, tell: Sink, cancel: Cancel) -> ModelComparison:
    data = request.data[0]
    read = [model_at(path) for path in request.models]
    names = _names(request.models)
    models = {name: density for name, (density, _) in zip(names, read, strict=True)}
    require_one_space({name: density.space for name, density in models.items()})
    columns = _columns_of_models(request, names, [extra for _, extra in read], tell)
    tables: dict[tuple[str, ...] | None, Table] = {}
    scores: dict[str, Any] = {}
    notes: list[str] = []
    for k, (name, own, (density, extra)) in enumerate(zip(names, columns, read, strict=True)):
        if own not in tables:
            told_once: Sink = (lambda _: None) if tables else tell
            tables[own] = _table(request, data, own, told_once)
            check_fits(data, tables[own], density.space, extra, told_once)
        values = tables[own].values

        def told(share: float, k: int = k) -> None:
            cancel.check()
            tell(Progress((k + share) / len(names), "scoring"))

        scores[name] = scores_of(density, values, told)
        notes += _seen(name, density, extra, values)
    table = next(iter(tables.values()))
    groups = None
    if request.group is not None:
        groups = read_labels(data, request.group, table, has_header=request.header)
    found = compare_scores(
        scores, groups=groups, resamples=request.bootstrap, level=request.level, seed=request.seed
    )
    return replace(found, notes=(*notes, *found.notes))


def _compare_data(request: DensityCompareRequest, tell: Sink, cancel: Cancel) -> DataComparison:
    assert request.space is not None
    if request.data[0].resolve() == request.data[1].resolve():
        raise RecordError("{data} names one file twice: give two data sets")
    names = _names(request.data)
    columns = request.columns or _common_columns(request)
    tables = [_table(request, data, columns, tell) for data in request.data]
    groups = None
    if request.group is not None:
        groups = {
            name: read_labels(data, request.group, table, has_header=request.header)
            for name, data, table in zip(names, request.data, tables, strict=True)
        }
    both = (
        replace(tables[0], values=np.concatenate([table.values for table in tables]))
        if len({table.values.shape[1] for table in tables}) == 1
        else tables[0]
    )
    unit = angle_unit(request.space, request.unit, both, tell)

    def told(share: float, what: str) -> None:
        cancel.check()
        tell(Progress(min(1.0, share), what))

    return compare_samples(
        {name: table.values for name, table in zip(names, tables, strict=True)},
        request.space,
        unit=unit,
        groups=groups,
        permutations=request.permutations,
        resamples=request.bootstrap,
        level=request.level,
        seed=request.seed,
        progress=told,
    )


def _table(
    request: DensityCompareRequest, data: Path, columns: tuple[str, ...] | None, tell: Sink
) -> Table:
    """Numbers, less the column of groups where columns are not named."""
    table = read_data(data, columns, tell, header=request.header, drop_missing=request.drop_missing)
    if columns is not None or request.group is None:
        return table
    wanted = request.group.strip().casefold()
    at = [k for k, name in enumerate(table.columns) if name.casefold() == wanted]
    return table.without(at[0]) if at else table


def _columns_of_models(
    request: DensityCompareRequest,
    names: Sequence[str],
    extras: Sequence[dict[str, Any]],
    tell: Sink,
) -> list[tuple[str, ...] | None]:
    """Of the table, in the order in which each model was fitted to them."""
    own = [tuple(extra.get("columns") or ()) for extra in extras]
    if request.columns is None:
        first, *others = own
        for name, other in zip(names[1:], others, strict=True):
            if sorted(first) != sorted(other):
                raise OrbiflowError(
                    f"{names[0]} was fitted to {', '.join(first)}, {name} to {', '.join(other)}: are "
                    "they the same quantities? Then say with --columns which columns they are"
                )
        found = [
            same_columns(request.data[0], extra, tell, has_header=request.header)
            for extra in extras[:1]
        ]
        if found[0] is None:
            if len(set(own)) > 1:
                raise OrbiflowError(
                    f"{request.data[0]} does not name its columns, and the models have them in other "
                    "orders: give it a header"
                )
            return [None] * len(own)
        return list(own)
    places = {name: k for k, name in enumerate(own[0])}
    if len(places) != len(request.columns):
        return [request.columns] * len(own)
    # by the order of the first; another model may have the same ones in another order
    return [
        tuple(request.columns[places[name]] for name in other)
        if sorted(other) == sorted(own[0])
        else request.columns
        for other in own
    ]


def _common_columns(request: DensityCompareRequest) -> tuple[str, ...] | None:
    """Columns of the first file in whose order the second, which has others, is to be read."""
    one, other = (column_names(data, has_header=request.header) for data in request.data)
    if one is None or other is None or one == other:
        return None
    shared = [name for name in one if name.casefold() in {n.casefold() for n in other}]
    if sorted(n.casefold() for n in one) != sorted(n.casefold() for n in other):
        raise OrbiflowError(
            f"{request.data[0]} has the columns {', '.join(one)}, {request.data[1]} "
            f"{', '.join(other)}: say with --columns which to compare"
        )
    group = (request.group or "").strip().casefold()
    return tuple(name for name in shared if name.casefold() != group)


def _seen(name: str, density: Density, extra: dict[str, Any], values: np.ndarray) -> list[str]:
    """Whether a model knows the rows."""
    if not extra.get("fitted_rows"):
        return [
            f"{name} has no record of the rows that it was fitted to: see that none of these is one"
        ]
    known, looked_up = RowSketch.from_json(extra["fitted_rows"]).known(density.space, values)
    if not known:
        return []
    if looked_up >= LEAST_LOOKED_UP and known >= SEEMS_FITTED * looked_up:
        return [
            f"WARNING: {name} seems to have been fitted to these rows ({known} of {looked_up} that "
            "were looked up): of rows that it has seen, a model's score says little; compare at others"
        ]
    return [
        f"{known} of {looked_up} rows that were looked up equal one that {name} was fitted to: "
        "repeated values, or the same rows"
    ]


def _names(paths: Sequence[Path]) -> list[str]:
    """Of what is compared: short, if that tells them apart.

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
    return (
        full if len(set(full)) == len(full) else [f"{k}: {path}" for k, path in enumerate(full, 1)]
    )


def _csv(found: ModelComparison | DataComparison) -> str:
    """The differences, or the figures, a row each."""
    rows: list[Mapping[str, Any]]
    if isinstance(found, ModelComparison):
        rows = found.to_json()["differences"]
    else:
        rows = [{"figure": "p", "value": found.test.p, "error": None, "low": None, "high": None}]
        divergence: dict[str, Any] = found.to_json()["divergence"] or {}
        rows += [{"figure": name, **estimate} for name, estimate in divergence.items()]
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
