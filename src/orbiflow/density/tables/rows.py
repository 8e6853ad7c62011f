"""The rows of a file that a density is fitted to or compared with, read as the settings say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from orbiflow.density.data import (
    Declaration,
    MissingCellsError,
    TableRows,
    asked_roles,
    checked_rows,
    choose,
    conditions_of,
    found_column,
    fraction_doubts,
    in_file,
    rows_of,
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
    fitted: Declaration | None = None,
    given: Sequence[str] = (),
) -> TableRows:
    """Return the rows of a table, and tell what was decided.

    Args:
        path: The file.
        settings: Which columns and rows are read.
        tell: Hears notes.
        where: The space of the rows, of a table that is fitted to.
        fitted: The columns of a model, of a table that it is asked about.
        given: Columns on which a density may depend.

    Raises:
        InputFileError: For a table that cannot be read as the settings say.
    """
    table = read_table(
        path, has_header=settings.header, decimal=settings.decimal, codes=settings.missing_codes
    )
    declared = asked_roles(settings.columns)
    may_lack = isinstance(settings, RowSettings) and settings.missing == "marginalise"
    drops = settings.drop_missing or (
        isinstance(settings, RowSettings) and settings.missing == "drop"
    )
    missing = "drop" if drops else "keep" if may_lack else "refuse"
    try:
        named = {found_column(table, key) for key in declared}
        columns = {name: found_column(table, name) for name in conditions_of(settings.where)}
        apart = [name for name, column in columns.items() if column not in named]
        if where is None:
            said = replace(fitted or Declaration("torus"), asked=declared)
            others = {found_column(table, name) for name in (*given, *apart)}
            chosen = choose(table, said, others)
            rows = rows_of(table, chosen, missing=missing, where=settings.where, given=given)
        else:
            widths = None if where.width is None else (where.width,)
            rows = checked_rows(
                table, Declaration(where.space, declared, where.unit, widths, where.rotation_form),
                given=given, apart=apart, missing=missing, where=settings.where,
            )  # fmt: skip
    except SettingError as error:
        refusal = in_file(error, table.where)
        if isinstance(error, MissingCellsError) and where and where.space == "torus":
            refusal.template += " (on tori {missing} marginalise counts them by what they have)"
        raise refusal from error
    for note in (*rows.notes, *(_space_notes(where) if where else ())):
        tell(Note(note))
    doubts = rows.doubts
    if where is not None and where.cell is not None and not where.fractional:
        doubts += (*fraction_doubts(rows.values[:, : where.width], where.cell[: where.width]),)
    for doubt in doubts:
        words = literal(doubt).replace("(fractional)", "({fractional})")
        tell(Note(Advice(f"WARNING: {words}")))
    return rows


def _space_notes(where: SpaceSettings) -> list[str]:
    """Return in which setting a space group is, and that a cell was not given.

    Data of another size would be folded into it.
    """
    if where.space in SPACES:
        return []
    notes, group = list[str](), group_of(where.space, where.cell)
    if group.dim == 3 and group.name.replace(" ", "") != where.space.replace(" ", ""):
        notes.append(f"{where.space} is read as {group.name}")  # say, of several axes or cells
    if where.cell is None:
        notes.append("no cell was given: its lengths are taken to be about 1, in the data's unit")
    return notes
