"""The rows of a table that a density is fitted to or compared with, read as the settings say."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.density.data import (
    DIP_DIRECTION,
    DIRECTIONS,
    ROTATIONS,
    Doubt,
    Unit,
    check_values,
    chosen_arrangement,
    dip_direction_among,
    dip_directions,
    doubts_of_line,
    fraction_doubts,
    is_angle_named,
    is_count_named,
    is_identifier,
    is_other_quantity,
    refuse_codes_of,
    seeming_unit,
    strike_beside_dip,
    strike_note,
    unit_named,
)
from orbiflow.density.tables.conditions import conditions_of, rows_where
from orbiflow.density.tables.files import column_names, read_labels, read_table
from orbiflow.density.tables.guesses import check_hemispheres, tell_of_calm, tell_of_counts
from orbiflow.density.tables.settings import (
    SPACES,
    RowSettings,
    SpaceSettings,
    TableSettings,
    group_of,
)
from orbiflow.density.tables.table import MissingCellsError, Table, TableError, find, listing, quote
from orbiflow.errors import Advice, SettingError, literal
from orbiflow.runtime import Note, Sink

MAX_ROWS = 20_000_000
"""The most rows that counts may make."""


@dataclass(frozen=True, eq=False)
class TableRows:
    """The rows of a table, what each weighs, and the column that names what rows belong to.

    - `weights`: How much each row counts, (N,). None: all the same.
    - `header`: Whether the first line of the file names the columns, None to look.
    """

    path: Path
    table: Table
    weights: Array | None
    group: str | None
    header: bool | None

    def only(self, kept: NDArray[np.bool_]) -> TableRows:
        """Return the rows of a mask (N,)."""
        weights = None if self.weights is None else self.weights[kept]
        return TableRows(self.path, self.table.only(kept), weights, self.group, self.header)

    def repeated(self, counts: Array) -> TableRows:
        """Return each row as often as it was seen, counts (N,)."""
        wrong = np.flatnonzero((counts < 0) | (counts != np.round(counts)))
        if len(wrong) or not 0 < counts.sum() <= MAX_ROWS:
            what = f"{counts[wrong[0]]:g}" if len(wrong) else f"{counts.sum():g} in all"
            raise TableError(
                f"{{counts}} must be whole numbers from 0 on, {MAX_ROWS} in all at most, got {what}"
            )
        each = counts.astype(np.int64)
        table = replace(
            self.table,
            values=self.table.values.repeat(each, axis=0),
            lines=self.table.lines.repeat(each),
        )
        weights = None if self.weights is None else self.weights.repeat(each)
        return TableRows(self.path, table, weights, self.group, self.header)

    @property
    def whole(self) -> NDArray[np.bool_]:
        """Which rows (N,) lack no value, or all, if none is whole: others have another unit."""
        found = np.logical_and.reduce(np.isfinite(self.table.values), axis=1)
        return found if found.any() else np.ones_like(found)

    @cached_property
    def labels(self) -> NDArray[np.str_] | None:
        """What each row belongs to, (N,), or None if no column says so."""
        if self.group is None:
            return None
        return read_labels(self.path, self.group, self.table, has_header=self.header)


def read_rows(
    path: Path,
    settings: TableSettings,
    tell: Sink,
    *,
    space: str | None = None,
    width: int | None = None,
    group: str | None = None,
    model_space: str | None = None,
    beside: Sequence[str] = (),
    given: Sequence[str] = (),
) -> TableRows:
    """Return the rows of a table of `width` columns, and tell what was decided for the user.

    Without `columns` in the settings, those are taken whose names say that they are what the `space`
    takes, in its order. If no name says so, all columns of numbers are taken but those that number
    the rows, those of weights, counts, groups and what is `given` and, on a torus, those that are no
    angles by name. Columns `beside` these, real ones or with periods of their own, are taken as well;
    on other spaces than tori they come last.
    Strikes beside dips become directions of dip on this space or on `model_space`, that of a model.
    """
    rows = settings if isinstance(settings, RowSettings) else RowSettings(**settings.to_json())
    reader = _Reader(path, rows, tell, space, width, tuple(beside))
    weighing, counting = map(reader.column, (rows.weights, getattr(rows, "counts", None)))
    others = [name for own in (weighing, counting) if own is not None for name in own.columns]
    for name in (group, *given, *conditions_of(rows.where)):
        if name is not None and rows.columns is None:
            others.append(_name(path, name, rows.header))
    try:
        table = reader.data(others)
    except MissingCellsError as error:
        if rows is not settings:  # the command has no way to keep them
            raise
        raise TableError(
            f"{error.template} (on tori {{missing}} marginalise keeps them)"
        ) from error
    for note in table.notes:
        tell(Note(note))
    table = _with_dip_directions(table, rows, space or model_space, tell)
    own = without_columns(table, beside, path)
    _check_width(path, own, space, width, others)
    if beside and space != "torus":
        table = table.in_order([*own.columns, *columns_among(table.columns, beside)])
    if space in DIRECTIONS:
        check_hemispheres(path, own, rows.header)
    if space in ROTATIONS:
        _tell_of_phases(path, table, rows.header, tell)
    if space == "torus" and own.columns:
        tell_of_calm(path, own, rows, tell)
    if weighing is not None:
        _tell_of_weights(weighing, tell)
    elif counting is None and space == "torus" and hasattr(rows, "counts"):
        tell_of_counts(path, table, rows.header, tell)
    return _weighed(TableRows(path, table, None, group, rows.header), weighing, counting)


@dataclass(frozen=True)
class _Reader:
    """A table, how it is read, who is told, and the space that takes it with its number of columns."""

    path: Path
    rows: RowSettings
    tell: Sink
    space: str | None
    width: int | None
    beside: tuple[str, ...] = ()

    @property
    def missing(self) -> dict[str, Any]:
        """What `read_table` does with rows that lack a value."""
        dropped = self.rows.drop_missing or self.rows.missing == "drop"
        return {"drop_missing": dropped, "keep_missing": self.rows.missing == "marginalise"}

    def read(self, columns: Sequence[str] | None, width: int | None, **missing: Any) -> Table:
        """Read columns of numbers."""
        how: dict[str, Any] = {"has_header": self.rows.header, "decimal": self.rows.decimal}
        if not self.rows.where:
            return read_table(self.path, columns=columns, width=width, **how, **missing)
        # other rows may lack what those asked for have
        every = read_table(self.path, columns=columns, width=width, **how, keep_missing=True)
        kept = rows_where(self.path, every, self.rows.where, has_header=self.rows.header)
        words = f"read {kept.sum()} of {len(kept)} rows: those of {', '.join(self.rows.where)}"
        chosen = replace(every.only(kept), notes=(*every.notes, words))
        return chosen.complete(self.path, **missing)

    def column(self, name: str | None) -> Table | None:
        """Return a column of weights or counts, if one was named."""
        return None if name is None else self.read([name], 1, **self.missing)

    def data(self, others: Sequence[str]) -> Table:
        """Return the columns that were asked for, or those that the space takes beside `others`."""
        names, columns = self.names(), self.rows.columns
        if columns is None and self.space is not None:
            more = _beside(names, self.beside, self.path) if names else []
            left = [name for name in names if name not in others and name not in more]
            columns = self._by_name(self.space, left)
            columns = columns and (*columns, *more)
        if columns is None:
            return self._all(others)
        codes = self.rows.missing_codes
        return self.read(columns_in(names, columns), None, **self.missing, missing_codes=codes)

    def names(self) -> tuple[str, ...]:
        """Return the names of all columns, if they have names."""
        return column_names(self.path, has_header=self.rows.header) or ()

    def _all(self, others: Sequence[str]) -> Table:
        """Return all columns of numbers but those that are no data; then look at what is missing."""
        width = None if others or self.beside else self.width
        try:
            table = self.read(None, width, keep_missing=True)
        except TableError as error:
            # one more than wanted may be an identifier
            table = self.read(None, None, keep_missing=True) if width is not None else None
            if table is None or len((table := self._data_alone(table)).columns) != width:
                raise error
        for other in others:
            if other in table.columns and len(table.columns) > 1:
                table = table.without(table.columns.index(other))
        if width is None:
            table = self._data_alone(table)
        if self.space == "torus":
            table = _angles_alone(table, self.tell, self.beside)
            _tell_of_names(without_columns(table, self.beside, self.path), self.tell)
        return table.complete(self.path, **self.missing, missing_codes=self.rows.missing_codes)

    def _by_name(self, space: str, names: Sequence[str]) -> tuple[str, ...] | None:
        """Return the columns that a space takes, in its order, if names say which they are."""
        try:
            found = chosen_arrangement(space, names, self.width)
        except SettingError as error:
            raise TableError(literal(f"{self.path}: ") + error.template) from error
        if found is None:
            return None
        chosen = tuple(names[k] for k in found.columns)
        if chosen != tuple(names):
            self.tell(Note(f"took {', '.join(chosen)} as {found.words}"))
        return chosen

    def _data_alone(self, table: Table) -> Table:
        """Return a table without the columns that number the rows."""
        for column in reversed(range(len(table.columns))):
            name = table.columns[column]
            # what the header leaves empty is called "column1" by now
            given = name if table.header is None or name in table.header else ""
            known = table.values[~np.isnan(table.values[:, column]), column]
            real = name in columns_among(table.columns, self.beside)
            if len(table.columns) > 1 and not real and is_identifier(given, known):
                table = table.without(column)
                text = f"left out the column {name!r}, which numbers the rows; name all to keep it"
                self.tell(Note(text))
        return table


def columns_in(names: Sequence[str], wanted: Sequence[str]) -> tuple[str, ...]:
    """Return the columns to read for those that are wanted: a strike for a direction of dip.

    >>> columns_in(["strike", "dip"], ["dip", "dip_direction"])
    ('dip', 'strike')
    """
    return tuple(dip_direction_among(name, names) or name for name in wanted)


def _with_dip_directions(table: Table, rows: RowSettings, space: str | None, tell: Sink) -> Table:
    """Return a table whose strikes beside dips are directions of dip, where that is what is wanted."""
    strike = strike_beside_dip(table.columns)
    is_asked = (
        rows.columns is not None
        and dip_direction_among(rows.columns[-1], table.columns) is not None
    )
    if not strike or not (space in DIRECTIONS or is_asked):  # before its dip it will be refused
        return table
    tell(Note(strike_note(table.columns[strike])))
    values = table.values.copy()
    values[:, strike] = dip_directions(values[:, strike])
    columns = (*table.columns[:strike], DIP_DIRECTION, *table.columns[strike + 1 :])
    return replace(table, values=values, columns=columns)


def columns_among(names: Sequence[str], asked: Sequence[str]) -> list[str]:
    """Return the columns, by their names, that were asked for by name or number.

    >>> columns_among(["Phi", "Length", "column3"], ["length", "3"])
    ['Length', 'column3']
    """
    wanted = {own.casefold() for own in asked} | {f"column{own}" for own in asked}
    return [name for name in names if name.casefold() in wanted]


def _beside(names: Sequence[str], asked: Sequence[str], path: Path) -> list[str]:
    """Return the columns that are asked for beside others; refuse those that a table lacks."""
    found = columns_among(names, asked)
    if len(found) != len(set(asked)):
        raise TableError(
            literal(f"{path}: the columns are {listing(names)}")
            + ", and {linear} and {period} name "
            + literal(listing(asked))
            + "; give the names of the table"
        )
    return found


def without_columns(table: Table, beside: Sequence[str], path: Path) -> Table:
    """Return a table without columns that are beside others; refuse those that it lacks."""
    found = _beside(table.columns, beside, path)
    for name in found:
        table = table.without(table.columns.index(name))
    return table


def _angles_alone(table: Table, tell: Sink, beside: Sequence[str] = ()) -> Table:
    """Return a table without the columns that are no angles by their names."""
    named = table.header is not None or table.delimiter is None
    counts_first = sorted(table.columns, key=lambda name: not is_count_named(name))
    real = columns_among(table.columns, beside)
    for name in (name for name in counts_first if named and name not in real):
        is_count = is_count_named(name)
        if (is_count or is_other_quantity(name)) and len(table.columns) > 1:
            table = table.without(table.columns.index(name))
            why = "which says how much or how often each row counts; {weights} or {counts} uses it"
            other = "which is no angle, by its name; name all columns to keep it"
            left_out = literal(f"left out the column {name!r}")
            tell(Note(Advice(f"{left_out}, {why if is_count else other}")))
    return table


def _tell_of_names(table: Table, tell: Sink) -> None:
    """Tell which columns were taken as angles though their names do not say so."""
    named = table.header is not None or table.delimiter is None
    unknown = [name for name in table.columns if not is_angle_named(name)]
    if named and any(re.fullmatch(r"column\d+", name) is None for name in unknown):
        tell(Note(f"took {listing(unknown)} as angle{'s' * (len(unknown) > 1)}"))


def _tell_of_phases(path: Path, table: Table, header: bool | None, tell: Sink) -> None:
    """Warn of orientations of several phases, whose crystals may have other symmetries."""
    names = column_names(path, has_header=header) or ()
    column = next((name for name in names if name.casefold() == "phase"), None)
    if column is None:
        return
    phases, counts = np.unique(
        read_labels(path, column, table, has_header=header), return_counts=True
    )
    if len(phases) > 1:
        pairs = zip(phases.tolist(), counts.tolist(), strict=True)
        listed = ", ".join(f"{phase} ({count} rows)" for phase, count in pairs)
        text = literal(f"WARNING: {column} has {listed}: keep the rows of one phase, such as ")
        one = max(zip(counts.tolist(), phases.tolist(), strict=True))[1]
        tell(Note(Advice(f"{text}{{where}} {literal(f'{column}={one}')}")))


def _tell_of_weights(weighing: Table, tell: Sink) -> None:
    """Tell that weights may be counts: only their ratios matter, and tests would find fewer rows."""
    (name,), values = weighing.columns, weighing.values[:, 0]
    whole = bool((values == np.round(values)).all()) and float(np.ptp(values)) > 0
    if whole and is_count_named(name) and "weight" not in name.casefold():
        text = (
            f"of weights only the ratios matter: if {literal(repr(name))} says how many rows are "
            f"alike, give {{counts}} {literal(name)}, for intervals and tests that know of all of them"
        )
        tell(Note(Advice(text)))


def _check_width(
    path: Path, table: Table, space: str | None, width: int | None, others: Sequence[str]
) -> None:
    """Refuse a table that has other columns than the space takes."""
    count = len(table.columns)
    if others and width not in (None, count):
        raise TableError(
            literal(
                f"{path}: {width} columns must be taken beside {' and '.join(map(quote, others))}, "
                f"there are {', '.join(table.columns)}"
            )
            + "; choose with {columns}"
        )
    if space in DIRECTIONS and count not in (2, 3):
        raise TableError(
            literal(
                f"{path}: the {space} takes a latitude and a longitude, or unit vectors x,y,z, and the "
                f"columns of numbers are {listing(table.columns)}"
            )
            + "; choose with {columns}"
        )


def _weighed(rows: TableRows, weighing: Table | None, counting: Table | None) -> TableRows:
    """Return the rows that have a weight and a count, with weights, as often as they are counted."""
    for own in filter(None, (weighing, counting)):
        if own.columns[0] in rows.table.columns:
            name = own.columns[0]
            raise TableError(
                literal(
                    f"{rows.path}: {name!r} holds the rows' weights and cannot be a column of the "
                )
                + "data as well; leave it out of {columns}"
            )
        rows = replace(rows, table=rows.table.only(np.isin(rows.table.lines, own.lines)))
    at = rows.table.lines
    if weighing is not None:
        rows = replace(rows, weights=weighing.values[np.isin(weighing.lines, at), 0])
    if counting is None:
        return rows
    return rows.repeated(counting.values[np.isin(counting.lines, at), 0])


def _name(path: Path, column: str, header: bool | None) -> str:
    """Return what a table calls a column that is given by its name or number."""
    names = column_names(path, wanted=[column], has_header=header)
    if names is None:
        number = column.strip()
        return f"column{int(number)}" if number.isdecimal() else number
    return names[find(path, names, column)]


def angle_unit(where: SpaceSettings, table: Table, tell: Sink) -> Unit:
    """Return the unit of angles, and tell the user of doubts about a space's data.

    The user is also told in which setting a space group is, and of a cell that was not given: data of
    another size would be folded into it.
    """
    space = where.space
    doubts: list[Doubt] = []
    for name, turn in [*((name, None) for name in where.linear), *where.periods.items()]:
        for own in columns_among(table.columns, [name]):
            column = table.values[:, table.columns.index(own)]
            refuse_codes_of(column[:, None], [own], [turn], CURE)
            doubts += doubts_of_line(own, column) if turn is None else []
    table = without_columns(table, where.beside, Path("the table"))
    if not table.columns:
        _tell_doubts(doubts, tell)
        return where.unit or "radians"
    if space not in SPACES:
        group = group_of(space, where.cell)
        if group.dim == 3 and group.name.replace(" ", "") != space.replace(" ", ""):
            tell(Note(f"{space} is read as {group.name}"))  # say, of several axes or cells
        if where.cell is None:
            words = (
                "no cell was given: its lengths are taken to be about 1, in the unit of the data"
            )
            tell(Note(words))
    asked, form = _asked_unit(where, table), where.rotation_form(table.columns)
    unit, more = check_values(space, table.values, table.columns, asked, CURE, form)
    doubts += more
    doubts += _doubts_of_units(table)
    if where.cell is not None and not where.fractional:
        doubts += fraction_doubts(table.values, where.cell[: len(table.columns)])
    _tell_doubts(doubts, tell)
    return unit


def _tell_doubts(doubts: Iterable[Doubt], tell: Sink) -> None:
    for doubt in doubts:
        words = literal(doubt.text).replace("(fractional)", "({fractional})")
        tell(Note(Advice(f"WARNING: {words}" if doubt.is_serious else words)))


def _doubts_of_units(table: Table) -> list[Doubt]:
    """Return a doubt if cells of some columns write a unit, and those of others may have another."""
    plain = [name for name in table.columns if name not in table.units and not unit_named(name)]
    if table.unit != "degrees" or not plain:
        return []
    values = table.values[:, [table.columns.index(name) for name in plain]]
    text = f"{listing(plain)}: no unit in the cells, read as degrees as the others are"
    return [Doubt(text, seeming_unit(values, "degrees") is not None)]


def _asked_unit(where: SpaceSettings, table: Table) -> str | None:
    """Return the unit that is asked for or, of angles, else what the cells say; refuse two."""
    said = table.unit if where.space in SPACES else None
    if said is not None and where.unit not in (None, said):
        raise TableError(
            literal(f"the cells of {listing(table.columns)} are in {said}")
            + f" and {{unit}} {where.unit} was asked for: leave it out"
        )
    return where.unit or said


CURE = (
    "say so with {missing_codes}, and leave their rows out with {drop_missing}; or make these cells "
    "empty"
)
"""What to do with codes for missing values."""
