"""The rows of a file that a density is fitted to or compared with, read as the settings say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from orbiflow.density.data import (
    DIRECTIONS,
    Chosen,
    MissingCellsError,
    Source,
    TableError,
    TableRows,
    asked_roles,
    check_values,
    choose,
    choose_as_fitted,
    conditions_of,
    found_column,
    fraction_doubts,
    require_unit,
    rows_of,
    with_dip_directions,
    words_of,
)
from orbiflow.density.tables.files import read_table
from orbiflow.density.tables.settings import (
    SPACES,
    RowSettings,
    SpaceSettings,
    TableSettings,
    group_of,
)
from orbiflow.errors import Advice, SettingError, literal
from orbiflow.runtime import Note, Sink


def read_rows(
    path: Path,
    settings: TableSettings,
    tell: Sink,
    *,
    where: SpaceSettings | None = None,
    fitted: Mapping[str, Any] | None = None,
    given: Sequence[str] = (),
) -> TableRows:
    """Return the rows of a table, and tell what was decided.

    Args:
        path: The file.
        settings: Which columns and rows are read.
        tell: Hears notes.
        where: The space of the rows, of a table that is fitted to.
        fitted: What a model keeps of the columns that it was fitted to, of one that it is asked about.
        given: Columns on which a density may depend.

    Raises:
        InputFileError: For a table that cannot be read as the settings say.
    """
    asked = asked_roles(settings.columns)
    named = [key for key in asked if isinstance(key, str)]
    source = read_table(
        path,
        has_header=settings.header,
        decimal=settings.decimal,
        codes=settings.missing_codes,
        wanted=[*named, *given, *conditions_of(settings.where)],
    )
    try:
        others = {found_column(source, name) for name in given}
        known = {found_column(source, key) for key in asked}
        others |= {found_column(source, name) for name in conditions_of(settings.where)} - known
        if where is not None:
            how: dict[str, Any] = {"width": where.width, "others": others}
            chosen = choose(source, where.space, asked, where.unit, **how)
        else:
            chosen = choose_as_fitted(source, fitted or {}, asked, others)
    except SettingError as error:
        if isinstance(error, TableError) or type(error) is not SettingError:
            raise
        raise TableError(error.template) from error
    missing = "drop" if settings.drop_missing else "refuse"
    if isinstance(settings, RowSettings) and not settings.drop_missing:
        missing = {"marginalise": "keep"}.get(settings.missing, settings.missing)
    try:
        rows = rows_of(
            source, chosen,
            missing=missing, codes=settings.missing_codes, where=settings.where, given=given,
        )  # fmt: skip
    except MissingCellsError as error:
        if where is None or where.space != "torus" or not isinstance(settings, RowSettings):
            raise
        raise TableError(
            f"{error.template} (on tori {{missing}} marginalise counts them by what they have)"
        ) from error
    for note in rows.notes:
        tell(Note(note))
    if where is None:
        return rows
    return _checked(rows, where, chosen, source, tell)


def _checked(
    rows: TableRows, where: SpaceSettings, chosen: Chosen, source: Source, tell: Sink
) -> TableRows:
    """Return the rows of a space, once their values are known to be what they are declared to be.

    The user is also told in which setting a space group is, and of a cell that was not given: data of
    another size would be folded into it.
    """
    space, columns = where.space, rows.own_names
    form = where.rotation_form(columns) if columns else None
    require_unit(source, space, chosen, form)
    if space in DIRECTIONS:
        _check_hemispheres(source, rows)
        rows, note = with_dip_directions(rows)
        _tell(note, tell)
    if space not in SPACES:
        group = group_of(space, where.cell)
        if group.dim == 3 and group.name.replace(" ", "") != space.replace(" ", ""):
            tell(Note(f"{space} is read as {group.name}"))  # say, of several axes or cells
        if where.cell is None:
            words = (
                "no cell was given: its lengths are taken to be about 1, in the unit of the data"
            )
            tell(Note(words))
    try:
        doubts = check_values(
            space, rows.values, rows.columns, rows.roles, rows.unit, form=form, place=rows.place
        )
    except SettingError as error:
        raise TableError(literal(source.where) + error.template) from error
    if where.cell is not None and not where.fractional:
        doubts += fraction_doubts(rows.values[:, : where.width], where.cell[: where.width])
    for doubt in doubts:
        words = literal(doubt).replace("(fractional)", "({fractional})")
        tell(Note(Advice(f"WARNING: {words}")))
    return rows


def _tell(note: str | None, tell: Sink) -> None:
    if note is not None:
        tell(Note(note))


_HEMISPHERES = {"N", "S", "E", "W", "NORTH", "SOUTH", "EAST", "WEST"}


def _check_hemispheres(source: Source, rows: TableRows) -> None:
    """Refuse degrees to the south or west that only a column of letters tells of."""
    for column, name in enumerate(source.names):
        words = {"ns", "ew", "n", "e", "hemisphere", "hemi", "dir", "direction"}
        if name in rows.columns or not words.intersection(words_of(name)):
            continue
        letters = {str(cell).strip().upper() for cell in source.cells(column).tolist()}
        if letters <= _HEMISPHERES and letters & {"S", "W", "SOUTH", "WEST"}:
            raise TableError(
                literal(
                    f"{source.where}column {name!r} says which rows are south or west, and it is not "
                    "read: make their latitudes and longitudes negative"
                )
            )
