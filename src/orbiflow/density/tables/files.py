"""Reading tables of any kind of file, and writing them."""

from __future__ import annotations

import importlib
import io
import math
from collections.abc import Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbiflow.density.tables import text
from orbiflow.density.tables.cells import Mark
from orbiflow.density.tables.layout import is_utf16, layout_of, split_line, text_lines
from orbiflow.density.tables.table import (
    BLOCK,
    MAX_COLUMNS,
    Reading,
    Table,
    check_count,
    choose,
    find,
    finished,
    quote,
)
from orbiflow.errors import InputFileError
from orbiflow.settings import naming_extras

MAX_BYTES = 2 * 2**30
_MAGIC = {"npy": b"\x93NUMPY", "parquet": b"PAR1"}
_TEXT = frozenset({".csv", ".tsv", ".txt"})


def read_table(
    path: str | Path,
    *,
    columns: Sequence[str] | None,
    width: int | None,
    max_rows: int = 20_000_000,
    has_header: bool | None = None,
    drop_missing: bool = False,
    keep_missing: bool = False,
    missing_codes: Sequence[float] = (),
    decimal: Mark | None = None,
) -> Table:
    """Read columns of finite numbers from a text, `.npy` or Parquet file.

    In text, cells are separated by tabs, semicolons, commas or whitespace, and a quoted cell may not
    run over a line's end. Blank lines and lines that begin with # are skipped; the first other line is
    a header if a cell in it is neither a number nor a missing value, or else the last of those above
    it if it has a word for each column. Numbers may have a unit of angles, such as 70.3°, and compass
    words are bearings in degrees. Decimal commas and parted
    thousands are read where the numbers of the file tell which is which; `decimal` says so otherwise.
    `.npy` files hold a 2-dimensional array of numbers or a 1-dimensional structured one.

    Columns are wanted in their order: each by its name (exactly, or else without regard to case), or by
    its number from 1 as text ("3"). None takes all columns of numbers; `width` says how many there must
    be. Rows that lack a value are refused, left out or kept with NaN; `missing_codes` are numbers that
    stand for a missing value.
    """
    path = Path(path)
    read = {"text": text.read_text, "npy": read_npy, "parquet": read_parquet}[kind_of_file(path)]
    how = (columns, width, max_rows, has_header, drop_missing, keep_missing, missing_codes, decimal)
    return read(path, Reading(*how))


def append_columns(
    table: Table, path_of_source: str | Path, columns: Mapping[str, ArrayLike]
) -> bytes:
    """Return the source file with more columns, as UTF-8 text that ends its lines with a newline.

    Values are written with 10 significant digits. A text file keeps its delimiter, its other columns
    and its comments, and loses its blank lines; it gets the new names only if it has a header. Rows
    that were left out get an empty cell. From npy and Parquet files the table's columns are written,
    as CSV. A name that is taken gets a number: "density_2".
    """
    values = [np.asarray(column, dtype=np.float64) for column in columns.values()]
    for column in values:
        if column.shape != table.lines.shape:
            raise ValueError(f"values must have shape {table.lines.shape}, not {column.shape}")
    if table.delimiter is None:
        names = _free_names(columns, table.columns)
        return to_csv((*table.columns, *names), np.column_stack([table.values, *values]))
    path, end, done, out = Path(path_of_source), table.delimiter, 0, bytearray()
    lines = [*table.lines.tolist(), -1]
    changed = InputFileError(f"{path}: the file changed after it was read; run this again")
    for number, line, is_comment in text_lines(path):
        if number == table.header_line:
            cells = [_name_cell(name, end) for name in _free_names(columns, table.header or ())]
            if is_comment and end not in line:  # of other marks than the rows
                line, cells = " ".join([line, *cells]), []
        elif is_comment:
            cells = []
        elif number in table.dropped:
            cells = ["nan" if end == " " else ""] * len(values)
        elif lines[done] == number:
            numbers = (f"{column[done]:.10g}".replace(".", table.decimal) for column in values)
            cells = [f'"{cell}"' if table.decimal == end else cell for cell in numbers]
            done += 1
        else:
            raise changed
        out += f"{end.join([line, *cells])}\n".encode()
    if done < len(table.lines):
        raise changed
    return bytes(out)


def renamed_columns(table: Table, names: Iterable[str]) -> dict[str, str]:
    """Return what `append_columns` calls columns whose names the file has already."""
    taken = table.columns if table.delimiter is None else table.header or ()
    wanted = list(names)
    pairs = zip(wanted, _free_names(wanted, taken), strict=True)
    return {name: free for name, free in pairs if name != free}


def to_csv(columns: Sequence[str], values: ArrayLike) -> bytes:
    """Return values (N, k) as UTF-8 CSV under a header of k names, with 10 significant digits.

    >>> to_csv(["lat", "lon"], [[0.1, 2], [1e-20, 1 / 3]]).decode().splitlines()
    ['lat,lon', '0.1,2', '1e-20,0.3333333333']
    """
    values = np.asarray(values, dtype=np.float64)
    if values.ndim != 2 or values.shape[1] != len(columns):
        raise ValueError(f"values must have shape (N, {len(columns)}), not {values.shape}")
    out, head = io.BytesIO(), ",".join(_name_cell(name, ",") for name in columns)
    np.savetxt(out, values, fmt="%.10g", delimiter=",", header=head, comments="", encoding="utf-8")
    return out.getvalue()


def _free_names(wanted: Iterable[str], taken: Sequence[str]) -> list[str]:
    found, used = list[str](), {name.casefold() for name in taken}
    for name in wanted:
        free = chain([name], (f"{name}_{i}" for i in count(2)))
        found.append(next(text for text in free if text.casefold() not in used))
        used.add(found[-1].casefold())
    return found


def _name_cell(name: str, delimiter: str) -> str:
    words = name.split()
    if delimiter == " ":
        return "_".join(words)
    name = " ".join(words)
    if name.startswith("#") or delimiter in name or '"' in name:
        return '"' + name.replace('"', '""') + '"'
    return name


def kind_of_file(path: Path) -> str:
    """Return "text", "npy" or "parquet", by the first bytes, which must agree with the extension."""
    try:
        size, is_file, head = path.stat().st_size, path.is_file(), b""
        if is_file:
            with path.open("rb") as file:
                head = file.read(4096)
    except FileNotFoundError as exc:
        raise InputFileError(f"{path}: no such file; check the path") from exc
    except (OSError, ValueError) as exc:  # ValueError: a null byte in the name
        raise InputFileError(f"{path}: cannot be read ({exc}); check it") from exc
    if not is_file:
        raise InputFileError(f"{path}: is a folder or a device; give a file")
    if size > MAX_BYTES:
        raise InputFileError(
            f"{path}: {size / 2**30:.1f} GiB, at most {MAX_BYTES / 2**30:g} are read; split the "
            "file or draw a sample of its rows"
        )
    if not head:
        raise InputFileError(f"{path}: the file is empty; export or download it again")
    for kind, magic in _MAGIC.items():
        if head.startswith(magic) and path.suffix.lower() not in _TEXT:
            return kind
        if path.suffix.lower() == f".{kind}":
            raise InputFileError(f"{path}: does not begin as a .{kind} file does; save it again")
    if b"\0" in head and not is_utf16(head):
        raise InputFileError(f"{path}: binary data, not a table; save it as CSV in UTF-8")
    return "text"


def column_names(
    path: str | Path, *, wanted: Sequence[str] | None = None, has_header: bool | None = None
) -> tuple[str, ...] | None:
    """Return the names of all columns of a file, or None; `wanted` help to tell a header from a row."""
    path = Path(path)
    kind = kind_of_file(path)
    if kind == "text":
        return layout_of(path, wanted, has_header).header
    return _npy_header(path)[1].names if kind == "npy" else _parquet_names(path)


def read_labels(
    path: str | Path,
    column: str,
    table: Table,
    *,
    has_header: bool | None = None,
    empty: bool = False,
) -> NDArray[np.str_]:
    """Return the cells (N,) of a file's column, numbers or not, for the rows of its table.

    Cells may be missing if `empty`: then they are empty.
    """
    path = Path(path)
    kind = kind_of_file(path)
    found: dict[int, str] = {}
    if kind == "npy":
        numbers = read_table(path, columns=[column], width=1, keep_missing=True)
        cells = ["" if cell != cell else str(cell) for cell in numbers.values[:, 0].tolist()]
        found = dict(zip(numbers.lines.tolist(), cells, strict=True))
    elif kind == "parquet":
        names = _parquet_names(path)
        with _parquet(path) as file:
            batches = file.iter_batches(BLOCK, columns=[names[find(path, names, column)]])
            cells = [cell for batch in batches for cell in batch.column(0).to_pylist()]
        found = {k: "" if c is None else str(c).strip() for k, c in enumerate(cells, start=1)}
    else:
        layout = layout_of(path, [column], has_header)
        index = find(path, layout.names, column)
        for number, line, is_comment in text_lines(path):
            cells = [] if is_comment else split_line(path, number, line, layout.delimiter)
            found[number] = cells[index].strip() if index < len(cells) else ""
    missing = [line for line in table.lines.tolist() if not found.get(line)]
    if missing and not empty:
        raise InputFileError(
            f"{path}: {len(missing)} rows have no {column!r}, the first in line {missing[0]}; fill "
            "it in"
        )
    return np.array([found.get(line, "") for line in table.lines.tolist()])


MAX_NPY_HEADER = 10_000
"""Characters of a header, which numpy parses with `ast.literal_eval`."""


def read_npy(path: Path, reading: Reading) -> Table:
    """Read a table from an `.npy` file."""
    shape, dtype = _npy_header(path)
    check_count(path, shape[0], reading.max_rows, "rows")
    fields = dtype.names
    width = shape[1] if fields is None else len(fields)
    check_count(path, width, MAX_COLUMNS, "columns")
    names = fields or tuple(f"column{i}" for i in range(1, width + 1))
    types = [dtype] * width if fields is None else [dtype[name] for name in fields]
    numeric = [kind.kind in "fiu" for kind in types]
    picked, notes = choose(path, names, numeric, reading, types)
    try:
        data = np.load(path, mmap_mode="r", allow_pickle=False, max_header_size=MAX_NPY_HEADER)
        with np.errstate(over="ignore"):
            parts = [data[names[i]] if fields is not None else data[:, i] for i in picked]
            values = np.stack([part.astype(np.float64) for part in parts], axis=1)
    except (OSError, ValueError, TypeError, IndexError, OverflowError) as exc:
        raise _damaged(path, exc) from exc
    lines = np.arange(1, len(values) + 1, dtype=np.int64)
    table = Table(values, tuple(names[i] for i in picked), lines, tuple(notes))
    return finished(path, table, reading)


def _npy_header(path: Path) -> tuple[tuple[int, ...], np.dtype]:
    """Return shape and dtype, once they are known to be a table's and to fit into the file."""
    form = np.lib.format
    try:
        with path.open("rb") as file:
            version = form.read_magic(file)
            read = {(1, 0): form.read_array_header_1_0, (2, 0): form.read_array_header_2_0}[version]
            shape, _, dtype = read(file, max_header_size=MAX_NPY_HEADER)
            left = path.stat().st_size - file.tell()
    except Exception as exc:  # numpy's parser of headers raises many types
        raise _damaged(path, exc) from exc
    if dtype.hasobject:
        raise InputFileError(
            f"{path}: holds Python objects, which are never read; save the array as float64"
        )
    if len(shape) != (1 if dtype.names is not None else 2) or min(shape) < 0:
        raise InputFileError(
            f"{path}: an array of shape {quote(str(shape))} and type {quote(str(dtype))}; save "
            "one of shape (N, k), or (N,) with named fields"
        )
    if math.prod(shape) * dtype.itemsize > left:
        raise InputFileError(
            f"{path}: its header promises {math.prod(shape) * dtype.itemsize} bytes of numbers and "
            f"{left} follow; the file is cut short or damaged: save it again"
        )
    return shape, dtype


@contextmanager
def _parquet(path: Path) -> Generator[Any]:
    """Open a Parquet file; whatever goes wrong inside is its damage."""
    with naming_extras(f"{path}: reading Parquet"):
        arrow, parquet = map(importlib.import_module, ("pyarrow", "pyarrow.parquet"))
    try:
        with parquet.ParquetFile(path) as file:
            yield file
    except InputFileError:
        raise
    except (arrow.ArrowException, OSError, ValueError, KeyError, MemoryError) as exc:
        raise _damaged(path, exc) from exc


def _parquet_names(path: Path) -> tuple[str, ...]:
    with _parquet(path) as file:
        return tuple(file.schema_arrow.names)


def read_parquet(path: Path, reading: Reading) -> Table:
    """Read a table from a Parquet file."""
    with _parquet(path) as file:
        check_count(path, file.metadata.num_rows, reading.max_rows, "rows")
        schema = file.schema_arrow
        check_count(path, len(schema.names), MAX_COLUMNS, "columns")
        kinds = importlib.import_module("pyarrow").types
        tests = kinds.is_integer, kinds.is_floating, kinds.is_decimal
        numeric = [any(test(kind) for test in tests) for kind in schema.types]
        picked, notes = choose(path, schema.names, numeric, reading, schema.types)
        names = tuple(schema.names[i] for i in picked)
        for name in names:  # Parquet columns are read by name alone
            find(path, schema.names, name)
        blocks = [np.empty((0, len(names)))]
        for batch in file.iter_batches(BLOCK, columns=list(names)):
            cast = [batch.column(name).cast("float64", safe=False) for name in names]
            blocks.append(np.stack([c.to_numpy(zero_copy_only=False) for c in cast], axis=1))
    values = np.concatenate(blocks)
    lines = np.arange(1, len(values) + 1, dtype=np.int64)
    return finished(path, Table(values, names, lines, tuple(notes)), reading)


def holds_words(path: str | Path, column: str) -> bool:
    """Return whether a column of a file is words by its type, whatever is in its cells.

    Raises `InputFileError` for times.
    """
    if kind_of_file(path := Path(path)) != "parquet":
        return False
    with _parquet(path) as file:
        schema = file.schema_arrow
        number = find(path, schema.names, column)
        types, kind = importlib.import_module("pyarrow").types, schema.types[number]
        if types.is_temporal(kind):
            raise InputFileError(
                f"{path}: column {quote(column)} holds times ({kind}); save numbers, such as hours "
                "since a first moment"
            )
        if not any(test(kind) for test in (types.is_integer, types.is_floating, types.is_decimal)):
            return True
        # Parquet has categories of words alone, pandas notes others
        noted: Any = schema.pandas_metadata or {"columns": []}
        own = {one["field_name"]: one["pandas_type"] for one in noted["columns"]}
        return own.get(schema.names[number]) == "categorical"


def _damaged(path: Path, exc: Exception) -> InputFileError:
    return InputFileError(f"{path}: damaged or of an unknown kind ({quote(str(exc))}); save again")
