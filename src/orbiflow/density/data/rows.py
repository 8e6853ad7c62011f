"""Rows of a table: its columns as declared, what rows weigh and belong to, and what they are given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.density.data.checks import check_values
from orbiflow.density.data.choices import ChosenColumns, Declaration, choose
from orbiflow.density.data.frames import missing_among, object_array, words_of_cells
from orbiflow.density.data.roles import Role
from orbiflow.density.data.table import (
    DataTable,
    MissingCellsError,
    found_column,
    listing,
    number_of,
)
from orbiflow.density.data.units import DIRECTIONS, words_of
from orbiflow.errors import OrbiflowError, SettingError, literal
from orbiflow.settings import is_a

MAX_ROWS = 20_000_000
"""The most rows that counts may make."""

MOST_LISTED = 12
"""Values of a column that a message names at most."""

QUARTER_TURN, TURN = 90.0, 360.0


@dataclass(frozen=True, eq=False)
class TableRows:
    """Rows of a table.

    - `source`: The table that they are of; `numbers`: which of its rows (N,), from 0.
    - `values`: The data (N, k), NaN where they are missing; `columns`: their names.
    - `roles`: What the columns are; None is a coordinate of the space.
    - `unit`: The unit of the space's angles, None if there are none or it was not said.
    - `weights`: How much each row counts, (N,). None: all the same.
    - `labels`: What each row belongs to, (N,), None if no column says so.
    - `given`: The cells (N,) of columns on which a density may depend.
    - `notes`, `doubts`: What was decided, and what may be wrong.
    """

    source: DataTable
    numbers: NDArray[np.int64]
    values: Array
    columns: tuple[str, ...]
    roles: tuple[Role | None, ...]
    unit: str | None = None
    weights: Array | None = None
    labels: NDArray[np.str_] | None = None
    given: Mapping[str, NDArray[Any]] = field(default_factory=dict[str, NDArray[Any]])
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()

    def only(self, kept: NDArray[Any]) -> TableRows:
        """Return some of the rows: those of a mask, or of their numbers."""
        return replace(
            self,
            numbers=self.numbers[kept],
            values=self.values[kept],
            weights=None if self.weights is None else self.weights[kept],
            labels=None if self.labels is None else self.labels[kept],
            given={name: cells[kept] for name, cells in self.given.items()},
        )

    @property
    def whole(self) -> NDArray[np.bool_]:
        """Which rows (N,) lack no value, or all, if none is whole: others have another unit."""
        are_whole = np.logical_and.reduce(np.isfinite(self.values), axis=1)
        return are_whole if are_whole.any() else np.ones_like(are_whole)

    @property
    def own(self) -> list[int]:
        """Which columns, from 0, are coordinates of the space."""
        return [k for k, role in enumerate(self.roles) if role is None]

    @property
    def own_names(self) -> list[str]:
        """The names of the columns that are coordinates of the space."""
        return [self.columns[k] for k in self.own]

    @property
    def declaration(self) -> str:
        """What the columns were taken for, as it may be declared."""
        pairs = zip(self.columns, self.roles, strict=True)
        return ",".join(name if role is None else f"{name}={role}" for name, role in pairs)

    def beside(self, weights: Any, groups: Any) -> tuple[Any, Any]:
        """Return the weights and groups of the rows, from columns or as they are given.

        Raises `OrbiflowError` if both are there.
        """
        both = (("weight", self.weights, weights), ("group", self.labels, groups))
        for name, column, argument in both:
            if column is not None and argument is not None:
                raise OrbiflowError(
                    f"a column is declared as {name}, and one is given: leave one out"
                )
        return (
            self.weights if weights is None else weights,
            self.labels if groups is None else groups,
        )

    def place(self, row: int) -> str:
        """Return where a row, from 0, is in the table."""
        return self.source.place(int(self.numbers[row]))


def checked_rows(
    table: DataTable,
    said: Declaration,
    *,
    given: Sequence[str] = (),
    apart: Sequence[str] = (),
    missing: str = "keep",
    where: Sequence[str] = (),
) -> TableRows:
    """Return the rows of a table as declared, once their values are known to be what is declared.

    Args:
        table: The table.
        said: What is declared of its columns.
        given: Columns on which a density may depend.
        apart: Others that are no data.
        missing: As for `rows_of`, like `where`.

    Raises:
        UndeclaredError: For columns of which nothing says what they are.
        SettingError: For values that contradict what is declared.
    """
    others = {found_column(table, name) for name in (*given, *apart)}
    chosen = choose(table, said, others)
    rows = rows_of(table, chosen, missing=missing, where=where, given=given)
    form = said.form_of(rows.own_names)
    if said.space in DIRECTIONS:
        _check_hemispheres(table, rows)
    doubts = check_values(
        said.space, rows.values, rows.columns, rows.roles, rows.unit, form=form, place=rows.place
    )
    return replace(rows, doubts=tuple(doubts))


def rows_of(
    table: DataTable,
    chosen: ChosenColumns,
    *,
    missing: str = "keep",
    where: Sequence[str] = (),
    given: Sequence[str] = (),
) -> TableRows:
    """Return the rows of a table with the columns that were chosen.

    Args:
        table: The table.
        chosen: Its columns.
        missing: What is done with rows that lack a value of the data: "keep", "drop" or "refuse". Rows
            that lack a weight, a count, a label or what is given are dropped or refused.
        where: Conditions on cells of other columns, such as "phase=1".
        given: Columns on which a density may depend.

    Raises:
        SettingError: For values that are missing or infinite, columns without values, and weights or
            counts that are none.
    """
    notes, names = list(chosen.notes), tuple(table.names[k] for k in chosen.columns)
    values = np.stack([table.numbers(k) for k in chosen.columns], axis=1)
    cells_given = {
        table.names[k]: _given_cells(table, k) for k in (found_column(table, g) for g in given)
    }
    side = {kind: table.numbers(k) for kind, k in chosen.side.items() if kind != "group"}
    kept = np.ones(len(values), dtype=bool)
    if where:
        kept = rows_where(table, where)
        notes.append(f"read {kept.sum()} of {len(kept)} rows: those of {', '.join(where)}")
    _refuse_empty(table, values[kept], names)
    lacking = {table.names[chosen.side[kind]]: np.isnan(entries) for kind, entries in side.items()}
    lacking |= {name: missing_among(cells) for name, cells in cells_given.items()}
    labels = None
    if "group" in chosen.side:
        labels = words_of_cells(table.cells(chosen.side["group"]))
        lacking[table.names[chosen.side["group"]]] = labels == ""
    if missing != "keep":
        lacking = dict(zip(names, np.isnan(values).T, strict=True)) | lacking
    gone = kept & np.logical_or.reduce([*lacking.values(), ~kept])
    if gone.any() and missing != "drop":
        _refuse_missing(table, {name: entries & kept for name, entries in lacking.items()}, names)
    elif gone.any():
        first = table.place(int(np.flatnonzero(gone)[0]))
        some = f"{int(gone.sum())} row{'s' * (int(gone.sum()) > 1)}"
        notes.append(f"left out {some} with missing values, the first in {first}")
        kept &= ~gone
        if not kept.any():
            raise SettingError("every row lacks a value; choose others with {columns}")
    cure = "; leave such rows out with {missing_codes} inf {drop_missing}" if table.is_file else ""
    for name, column in zip(names, values.T, strict=True):
        _refuse_rows(table, np.isinf(column) & kept, name, "is infinite: correct it" + cure)
    for kind, entries in side.items():
        wrong, what = entries < 0, "weights must be 0 or more"
        if kind == "count":
            wrong, what = wrong | (entries % 1 != 0), "counts must be whole numbers from 0 on"
        name, wrong = table.names[chosen.side[kind]], (wrong | np.isinf(entries)) & kept
        what = (
            f"is declared as {kind}, and {what}, got {entries[wrong.argmax()]:g}: correct it, or "
            "declare others with {columns}"
        )
        _refuse_rows(table, wrong, name, what)
    strike = _strike_beside_dip(names) if chosen.space in DIRECTIONS else None
    if strike is not None:
        column = values[:, strike]
        values[:, strike] = np.where(abs(column) > TURN, column, (column + QUARTER_TURN) % TURN)
        notes.append(
            f"took {names[strike]} by the right-hand rule, as the strike of planes that dip to its "
            "right: the direction of dip is the strike + 90"
        )
        names = (*names[:strike], "dip_direction", *names[strike + 1 :])
    rows = np.flatnonzero(kept)
    if "count" in side:
        counts = side["count"][rows]
        if not 0 < counts.sum() <= MAX_ROWS:
            raise SettingError(
                f"{{columns}}: counts must be 1 to {MAX_ROWS} in all, got {counts.sum():g}; declare "
                "another column as count, or this one as weight"
            )
        rows = rows.repeat(counts.astype(np.int64))
    return TableRows(
        table, np.arange(len(values), dtype=np.int64), values, names, chosen.roles, chosen.unit,
        side.get("weight"), labels, cells_given, tuple(notes),
    ).only(rows)  # fmt: skip


def _strike_beside_dip(names: Sequence[str]) -> int | None:
    """Return the column, from 0, of a strike if the columns are a dip and a strike."""
    split = [{"dip", "strike"}.intersection(words_of(name)) for name in names]
    strike = {"strike"}
    return split.index(strike) if split in ([{"dip"}, strike], [strike, {"dip"}]) else None


def _given_cells(table: DataTable, column: int) -> NDArray[Any]:
    """Return cells (N,): numbers, or words, None where they are missing."""
    if table.is_numeric(column):
        return table.numbers(column)
    cells, codes = table.cells(column), {code.casefold() for code in table.codes}
    pairs = zip(cells.tolist(), missing_among(cells).tolist(), strict=True)
    words = [None if gone or str(c).strip().casefold() in codes else c for c, gone in pairs]
    return object_array(words)


def _refuse_empty(table: DataTable, values: Array, names: Sequence[str]) -> None:
    """Refuse columns without a value in any row."""
    if not len(values) and table.is_file:
        raise SettingError("holds no rows of numbers; export it again")
    lost = np.flatnonzero(np.isnan(values).all(axis=0)).tolist() if len(values) else []
    empty = [repr(names[k]) for k in lost]
    if empty:
        raise MissingCellsError(
            literal(f"{', '.join(empty)}: no value in any row; ") + "choose others with {columns}"
        )


def _refuse_missing(
    table: DataTable, lacking: Mapping[str, NDArray[np.bool_]], data: Sequence[str]
) -> None:
    """Refuse cells that are missing, of columns of data and of others."""
    count = sum(int(cells.sum()) for cells in lacking.values())
    row, name = min((int(cells.argmax()), name) for name, cells in lacking.items() if cells.any())
    kind = MissingCellsError if name in data else SettingError
    cure = "; fill them in, or leave their rows out" + " with {drop_missing}" * table.is_file
    raise kind(
        literal(f"{count} cell{'s' * (count > 1)} empty or NaN, the first in {table.place(row)}, ")
        + literal(f"column {name!r}")
        + cure
    )


def _refuse_rows(table: DataTable, rows: NDArray[np.bool_], name: str, what: str) -> None:
    """Refuse some of the rows (N,), if there are any."""
    if count := int(rows.sum()):
        more = f" ({count} such rows)" * (count > 1)
        where = f"{table.place(int(rows.argmax()))}: column {name!r}{more} "
        raise SettingError(literal(where) + what)


def conditions_of(where: Sequence[str]) -> dict[str, list[str]]:
    """Return the values that rows may have, by columns.

    >>> conditions_of(["phase=1", "phase=2", "site = north"])
    {'phase': ['1', '2'], 'site': ['north']}
    """
    values: dict[str, list[str]] = {}
    for text in where:
        column, sign, value = (part.strip() for part in text.partition("="))
        if not (column and sign and value):
            raise SettingError(
                f"{{where}} must hold columns with values, such as phase=1, got {literal(repr(text))}"
            )
        values.setdefault(column, []).append(value)
    return values


def rows_where(table: DataTable, where: Sequence[str]) -> NDArray[np.bool_]:
    """Return which rows (N,) of a table have one of the values asked for, in each column.

    Numbers are compared as numbers, so 1 is 1.0. Raises `SettingError` if there is no such row.
    """
    kept = np.ones(len(table.columns[0]), dtype=bool)
    for column, values in conditions_of(where).items():
        words = words_of_cells(table.cells(found_column(table, column)))
        kinds, numbers = np.unique(words, return_inverse=True)
        wanted = {*values, *(v for v in map(number_of, values) if v == v)}
        chosen = np.array(
            [k in wanted or number_of(k) in wanted for k in kinds.tolist()], dtype=bool
        )
        if not chosen.any():
            there = [kind for kind in kinds.tolist() if kind]
            rest = f" and {len(there) - MOST_LISTED} others" if len(there) > MOST_LISTED else ""
            raise SettingError(
                literal(f"no row has {column} {' or '.join(values)}; there are ")
                + literal(f"{listing(there[:MOST_LISTED])}{rest}")
                + ": change {where}"
            )
        kept &= chosen[numbers.reshape(-1)]
    if not kept.any():
        raise SettingError(literal(f"no row has all of {', '.join(where)}: change ") + "{where}")
    return kept


_HEMISPHERES = {"N", "S", "E", "W", "NORTH", "SOUTH", "EAST", "WEST"}


def _check_hemispheres(table: DataTable, rows: TableRows) -> None:
    """Refuse degrees to the south or west that only a column of letters tells of."""
    for column, name in enumerate(table.names):
        if table.is_numeric(column) or name in rows.columns:
            continue
        letters = {str(cell).strip().upper() for cell in table.cells(column).tolist()}
        if letters <= _HEMISPHERES and letters & {"S", "W", "SOUTH", "WEST"}:
            raise SettingError(
                literal(f"column {name!r} says which rows are south or west, and it is not read: ")
                + "make their latitudes and longitudes negative"
            )


def is_declared(given: Any) -> bool:
    """Return whether what is given names columns with their roles, rather than holding cells.

    >>> is_declared({"hour": "cycle:24"}), is_declared({"hour": [1.0, 2.0]}), is_declared(["hour"])
    (True, False, True)
    """
    if is_a(given, Mapping):
        return all(value is None or is_a(value, str | Role) for value in given.values())
    return is_a(given, str) or (is_a(given, list | tuple) and all(is_a(v, str) for v in given))
