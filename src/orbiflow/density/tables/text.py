"""Tables in text files, read in two passes.

The first looks at 100 rows to find the delimiter, the header and the columns of numbers. The second
turns blocks of cells into numbers, and only a block that fails is searched cell by cell for the one
at fault. Memory holds the numbers and one block of text.
"""

from __future__ import annotations

import math
import re
from array import array
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np

from orbiflow.density.tables import table as tables
from orbiflow.density.tables.cells import (
    COMPASS,
    OTHER,
    Marks,
    bare,
    is_time,
    kind_of,
    plain,
    unit_of_cell,
)
from orbiflow.density.tables.layout import (
    Layout,
    and_others,
    check_lengths,
    layout_of,
    split_line,
    text_lines,
)
from orbiflow.density.tables.table import (
    BLOCK,
    Reading,
    Table,
    TableError,
    check_count,
    listing,
    quote,
)
from orbiflow.errors import literal

DEGREES = "write decimal degrees, negative in the south and in the west"
_IN_DEGREES = re.compile(r"\d.*[°'\"NSEWO]\s*$|^[NSEWO]\s*\d")
HOURS = "convert it to decimal degrees: 15 for each hour of a time, 1 for each degree of an angle"


def read_text(path: Path, reading: Reading) -> Table:
    """Read a table from a text file."""
    layout = layout_of(path, reading.columns, reading.has_header, reading.decimal)
    picked, notes = tables.choose(path, layout.names, layout.numeric, reading)
    for column, cell in layout.marks.doubtful:
        if column in picked:
            raise _two_ways(path, layout.names[column], cell)
    names = tuple(layout.names[i] for i in picked)
    numbers = _Numbers(path, names, tuple(layout.units[i] for i in picked), layout.marks)
    values, lines, comments = array("d"), array("q"), 0
    cells: list[str] = []
    every = text_lines(path)
    for number, line, is_comment in every:
        if is_comment or number == layout.header_line:
            comments += is_comment and number != layout.header_line
            continue
        row = split_line(path, number, line, layout.delimiter)
        if len(row) != len(layout.names):
            rest = ((n, split_line(path, n, own, layout.delimiter)) for n, own, c in every if not c)
            rows = chain([(number, row)], rest)
            check_lengths(path, rows, layout.first, len(layout.names), layout.delimiter)
        lines.append(number)
        cells.extend([row[i] for i in picked])
        if len(cells) >= BLOCK * len(picked):
            values.extend(numbers.of(cells, lines))
            cells.clear()
            check_count(path, len(lines), reading.max_rows, "rows")
    values.extend(numbers.of(cells, lines))
    check_count(path, len(lines), reading.max_rows, "rows")
    rows, at = np.frombuffer(values).reshape(-1, len(picked)), np.frombuffer(lines, dtype=np.int64)
    whole = Table(rows, names, at, tuple(notes), **layout.of_table())
    table = tables.finished(path, whole, reading)
    return replace(table, notes=(*table.notes, *_notes(layout, reading, names, comments)))


def _notes(layout: Layout, reading: Reading, names: Sequence[str], comments: int) -> list[str]:
    """Return how the cells and lines of the columns that were taken were read, in words."""
    notes: list[str] = []
    if layout.decimal == ",":
        notes.append("read decimal commas")
    if layout.marks.parted:
        value = float(plain(layout.marks.parted, layout.decimal))
        notes.append(f"read thousands: {layout.marks.parted} as {value:.10g}")
    own = {name: unit for name, unit in zip(layout.names, layout.units, strict=True) if unit}
    for unit in sorted({own[name] for name in names if name in own}):
        listed = listing([name for name in names if own.get(name) == unit])
        words = "compass words as degrees, north 0 and clockwise" if unit == COMPASS else unit
        notes.append(f"read {words}, as the cells say: {listed}")
    if not reading.columns:
        notes += [
            f"WARNING: left out {name!r}, whose name is an angle's: {quote(cell)} is no number"
            for name, cell in layout.spoiled.items()
        ]
    if layout.header is not None and layout.header_line is not None:
        is_comment = layout.header_line < layout.first
        where = "comment line" if is_comment else "line"
        notes.append(f"took {where} {layout.header_line} as the header: {listing(layout.header)}")
    if comments:
        notes.append(f"skipped {comments} comment line{'s' * (comments > 1)}")
    return notes


def _two_ways(path: Path, name: str, cell: str) -> TableError:
    """Return what to say of a number that may have decimals or thousands."""
    mark = "," if "," in cell else "."
    right, other = cell.replace(mark, ""), cell.replace(mark, ".")
    return TableError(
        literal(f"{path}: column {quote(name)}: {cell!r} may be {right} or {other}")
        + "; specify with {decimal} which mark is before decimals, . or ,"
    )


@dataclass(frozen=True)
class _Numbers:
    """Cells of the columns of these names and units as numbers."""

    path: Path
    names: tuple[str, ...]
    units: tuple[str | None, ...]
    marks: Marks

    def of(self, cells: list[str], lines: array[int]) -> list[float]:
        """Return the cells of the last of `lines`, row after row, as floats; NaN for missing ones."""
        text, decimal = "".join(cells), self.marks.decimal
        if "_" not in text and text.isascii() and (decimal == "." or "." not in text):
            # float takes 1_000 and other digits than ASCII's
            plainly = cells if decimal == "." else [cell.replace(",", ".") for cell in cells]
            if not any(self.units):
                with suppress(ValueError):
                    return list(map(float, plainly))
        k, start = len(self.names), len(lines) - len(cells) // len(self.names)
        found, faults = list[float](), list[TableError]()
        for i, cell in enumerate(cells):
            try:
                found.append(self._one(lines[start + i // k], i % k, cell))
            except TableError as error:
                faults.append(error)
        if faults:
            raise self._of_all(faults)
        return found

    def _of_all(self, faults: Sequence[TableError]) -> TableError:
        """Return the first of errors, which tells of the others."""
        head, mark, cure = faults[0].template.partition(";")
        begin = literal(f"{self.path}: ")
        others = [own.template.partition(";")[0].removeprefix(begin) for own in faults[1:]]
        of_cells = [other for other in others if other.startswith("line ")]
        return TableError(head + and_others(of_cells) + mark + cure)

    def _one(self, line: int, column: int, cell: str) -> float:
        decimal, other = self.marks.decimal, OTHER[self.marks.decimal]
        bared = bare(cell, self.units[column])
        number = plain(bared, decimal)
        kind = kind_of(number)
        if kind == "missing":
            return math.nan
        if kind == "number":
            self._check_unit(line, column, cell)
            either = bared.count(other) == 1 and decimal not in bared
            if either and self.marks.parted is None and not self.marks.is_asked:
                # the first rows have shown nothing of the kind
                raise _two_ways(self.path, self.names[column], bared)
            return float(number)
        raise TableError(
            literal(f"{self._place(line, column)}: {quote(cell)} is not a number; ")
            + _cure(cell, decimal)
        )

    def _check_unit(self, line: int, column: int, cell: str) -> None:
        """Refuse a cell in another unit than others of its column."""
        unit = self.units[column]
        if unit not in (None, COMPASS) and (own := unit_of_cell(cell)) != unit:
            what = "has no unit" if own is None else f"is in {own}"
            raise TableError(
                literal(
                    f"{self._place(line, column)}: {quote(cell)} {what} and others are in {unit}; "
                    "write all in one"
                )
            )

    def _place(self, line: int, column: int) -> str:
        return f"{self.path}: line {line}: column {quote(self.names[column])}"


def _cure(cell: str, decimal: str) -> str:
    """Return what to do with a cell that is no number."""
    if kind_of(plain(cell, OTHER[decimal])) == "number":
        right, wrong = ("points", "commas") if decimal == "." else ("commas", "points")
        return (
            f"write decimal {right}, not {wrong}, or specify with {{decimal}} that they are {wrong}"
        )
    if is_time(cell):
        return HOURS
    return DEGREES if _IN_DEGREES.search(cell) else "correct it or drop the line"
