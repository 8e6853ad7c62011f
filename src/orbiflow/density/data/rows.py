"""Rows of a table: its columns as declared, what rows weigh and belong to, and what they are given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.density.data.declaration import Chosen
from orbiflow.density.data.roles import Role
from orbiflow.density.data.row_labels import missing_among, word_of
from orbiflow.density.data.source import Source, found_column, listing
from orbiflow.errors import InputFileError, OrbiflowError, SettingError, literal
from orbiflow.settings import is_a

MAX_ROWS = 20_000_000
"""The most rows that counts may make."""

MOST_LISTED = 12
"""Values of a column that a message names at most."""


class TableError(SettingError, InputFileError):
    """A table that cannot be read as the settings say; the message names those in braces."""


class MissingCellsError(TableError):
    """An error for cells that are empty, NaN or infinite in rows that must be complete."""


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
    - `notes`: What was decided.
    """

    source: Source
    numbers: NDArray[np.int64]
    values: Array
    columns: tuple[str, ...]
    roles: tuple[Role | None, ...]
    unit: str | None = None
    weights: Array | None = None
    labels: NDArray[np.str_] | None = None
    given: Mapping[str, NDArray[Any]] = field(default_factory=dict[str, NDArray[Any]])
    notes: tuple[str, ...] = ()

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
        found = np.logical_and.reduce(np.isfinite(self.values), axis=1)
        return found if found.any() else np.ones_like(found)

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
        words = [
            name if role is None else f"{name}={role}"
            for name, role in zip(self.columns, self.roles, strict=True)
        ]
        return ",".join(words)

    def beside(self, weights: Any, groups: Any) -> tuple[Any, Any]:
        """Return the weights and groups of the rows, from columns or as they are given.

        Raises `OrbiflowError` if both are there.
        """
        for name, own, given in (("weight", self.weights, weights), ("group", self.labels, groups)):
            if own is not None and given is not None:
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


def rows_of(
    source: Source,
    chosen: Chosen,
    *,
    missing: str = "keep",
    codes: Sequence[str] = (),
    where: Sequence[str] = (),
    given: Sequence[str | int] = (),
) -> TableRows:
    """Return the rows of a table with the columns that were chosen.

    Args:
        source: The table.
        chosen: Its columns.
        missing: What is done with rows that lack a value of the data: "keep", "drop" or "refuse". Rows
            that lack a weight, a count or what is given are dropped or refused.
        codes: What stands for a missing value, numbers or words.
        where: Conditions on cells of other columns, such as "phase=1".
        given: Columns on which a density may depend.

    Raises:
        TableError: For values that are missing or infinite, columns without values, and labels, weights
            or counts that are none.
    """
    notes = list(chosen.notes)
    numbers = {k: _without(source.numbers(k), codes) for k in chosen.own}
    values = np.stack([numbers[k] for k in chosen.own], axis=1)
    names = tuple(source.names[k] for k in chosen.own)
    side = {
        kind: _without(source.numbers(k), codes)
        for kind, k in chosen.side.items()
        if kind != "group"
    }
    beside = [found_column(source, name) for name in given]
    known = {source.names[k]: _cells(source, k, codes) for k in beside}
    labels = None
    if "group" in chosen.side:
        labels = words_of_cells(source.cells(chosen.side["group"]))
    kept = np.ones(len(values), dtype=bool)
    if where:
        kept = rows_where(source, where)
        notes.append(f"read {kept.sum()} of {len(kept)} rows: those of {', '.join(where)}")
    _refuse_empty(source, values[kept], names)
    lost = {
        f"column {name!r}": np.isnan(column) for name, column in zip(names, values.T, strict=True)
    }
    must = {
        f"column {source.names[chosen.side[kind]]!r}": np.isnan(own) for kind, own in side.items()
    }
    must |= {f"column {name!r}": missing_among(own) for name, own in known.items()}
    must |= {} if missing == "keep" else lost
    gone = np.zeros(len(values), dtype=bool)
    for own in must.values():
        gone |= own
    gone &= kept
    if missing == "drop" and gone.any():
        first = source.place(int(np.flatnonzero(gone)[0]))
        some = f"{int(gone.sum())} row{'s' * (int(gone.sum()) > 1)}"
        notes.append(f"left out {some} with missing values, the first in {first}")
        kept &= ~gone
        if not kept.any():
            raise TableError(
                literal(source.where) + "every row lacks a value; choose others with {columns}"
            )
    elif gone.any():
        _refuse_missing(source, must, kept)
    wrong = np.logical_or.reduce(np.isinf(values), axis=1) & kept
    if wrong.any():
        row = int(np.flatnonzero(wrong)[0])
        name = names[int(np.flatnonzero(np.isinf(values[row]))[0])]
        raise MissingCellsError(
            literal(f"{source.where}{source.place(row)}: column {name!r} is infinite")
            + "; correct it, or leave such rows out with {missing_codes} inf {drop_missing}"
        )
    if labels is not None and (labels[kept] == "").any():
        row = int(np.flatnonzero((labels == "") & kept)[0])
        raise TableError(
            literal(f"{source.where}{int((labels[kept] == '').sum())} rows have no ")
            + literal(f"{source.names[chosen.side['group']]!r}, the first in {source.place(row)}; ")
            + "fill it in"
        )
    at = np.flatnonzero(kept)
    found = TableRows(
        source, np.arange(len(values), dtype=np.int64), values, names, chosen.roles, chosen.unit,
        side.get("weight"), labels, known, tuple(notes),
    ).only(at)  # fmt: skip
    return found if "count" not in side else _repeated(found, side["count"][at])


def _without(column: Array, codes: Sequence[str]) -> Array:
    """Return numbers (N,) with NaN for those that stand for missing values."""
    values = [value for code in codes if (value := _number(code)) is not None]
    return np.where(np.isin(column, values), np.nan, column) if values else column


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _cells(source: Source, column: int, codes: Sequence[str]) -> NDArray[Any]:
    """Return cells (N,): numbers, or words, empty where they are missing."""
    if source.is_numeric(column):
        return _without(source.numbers(column), codes)
    cells = source.cells(column)
    lost = missing_among(cells)
    codes = [code.casefold() for code in codes]
    found = [
        None if gone or str(cell).strip().casefold() in codes else cell
        for cell, gone in zip(cells.tolist(), lost.tolist(), strict=True)
    ]
    return np.array([*found, None], dtype=object)[:-1]


def words_of_cells(cells: NDArray[Any]) -> NDArray[np.str_]:
    """Return cells (N,) as words, empty where they are missing; 2.0 is the word 2."""
    lost: list[bool] = missing_among(cells).tolist()
    pairs = zip(cells.tolist(), lost, strict=True)
    return np.array(["" if gone else word_of(cell).strip() for cell, gone in pairs], dtype=str)


def _refuse_empty(source: Source, values: Array, names: Sequence[str]) -> None:
    """Refuse columns without a value in any row."""
    if not len(values) and source.where:
        raise TableError(literal(f"{source.where}holds no rows of numbers; export it again"))
    empty = [
        name
        for name, bare in zip(names, np.logical_and.reduce(np.isnan(values)), strict=True)
        if bare
    ]
    if empty and len(values):
        several = len(empty) > 1
        have = "have" if several else "has"
        raise MissingCellsError(
            literal(
                f"{source.where}column{'s' * several} {listing(empty)} {have} no value in any row; "
            )
            + "choose others with {columns}"
        )


def _refuse_missing(
    source: Source, lost: Mapping[str, NDArray[np.bool_]], kept: NDArray[np.bool_]
) -> None:
    """Refuse cells that are missing."""
    count = sum(int((own & kept).sum()) for own in lost.values())
    row, what = min(
        (int(np.flatnonzero(own & kept)[0]), name)
        for name, own in lost.items()
        if (own & kept).any()
    )
    raise MissingCellsError(
        literal(
            f"{source.where}{count} cell{'s' * (count > 1)} empty or NaN, the first in "
            f"{source.place(row)}, {what}"
        )
        + "; fill them in or leave their rows out with {drop_missing}"
    )


def _repeated(rows: TableRows, counts: Array) -> TableRows:
    """Return each row as often as it was seen, counts (N,)."""
    wrong = np.flatnonzero((counts < 0) | (counts != np.round(counts)))
    if len(wrong) or not 0 < counts.sum() <= MAX_ROWS:
        what = f"{counts[wrong[0]]:g}" if len(wrong) else f"{counts.sum():g} in all"
        raise TableError(
            "{columns}: counts must be whole numbers from 0 on, "
            f"{MAX_ROWS} in all at most, got {what}; declare another column as count, or this one as "
            "weight"
        )
    return rows.only(np.arange(len(counts)).repeat(counts.astype(np.int64)))


def conditions_of(where: Sequence[str]) -> dict[str, list[str]]:
    """Return the values that rows may have, by columns.

    >>> conditions_of(["phase=1", "phase=2", "site = north"])
    {'phase': ['1', '2'], 'site': ['north']}
    """
    found: dict[str, list[str]] = {}
    for text in where:
        column, sign, value = (part.strip() for part in text.partition("="))
        if not (column and sign and value):
            raise SettingError(
                f"{{where}} must hold columns with values, such as phase=1, got {literal(repr(text))}"
            )
        found.setdefault(column, []).append(value)
    return found


def rows_where(source: Source, where: Sequence[str]) -> NDArray[np.bool_]:
    """Return which rows (N,) of a table have one of the values asked for, in each column.

    Numbers are compared as numbers, so 1 is 1.0. Raises TableError if there is no such row.
    """
    kept: NDArray[np.bool_] | None = None
    for column, values in conditions_of(where).items():
        own = source.cells(found_column(source, column))
        kinds, numbers = np.unique(words_of_cells(own), return_inverse=True)
        pairs = [any(_are_equal(kind, value) for value in values) for kind in kinds.tolist()]
        chosen = np.array(pairs, dtype=bool)
        if not chosen.any():
            there = [kind for kind in kinds.tolist() if kind]
            rest = f" and {len(there) - MOST_LISTED} others" if len(there) > MOST_LISTED else ""
            raise TableError(
                literal(f"{source.where}no row has {column} {' or '.join(values)}; there are ")
                + literal(f"{listing(there[:MOST_LISTED])}{rest}")
                + ": change {where}"
            )
        mask = chosen[numbers.reshape(-1)]
        kept = mask if kept is None else kept & mask
    if kept is None or not kept.any():
        raise TableError(
            literal(f"{source.where}no row has all of {', '.join(where)}: change ") + "{where}"
        )
    return kept


def _are_equal(cell: str, value: str) -> bool:
    if cell == value:
        return True
    first, other = _number(cell), _number(value)
    return first is not None and first == other


def is_declared(given: Any) -> bool:
    """Return whether what is given names columns with their roles, rather than holding cells.

    >>> is_declared({"hour": "cycle:24"}), is_declared({"hour": [1.0, 2.0]}), is_declared(["hour"])
    (True, False, True)
    """
    if is_a(given, str):
        return True
    if is_a(given, Mapping):
        return all(value is None or is_a(value, str | Role) for value in given.values())
    return is_a(given, list | tuple) and all(is_a(value, str) for value in given)
