"""Tables of any kind of file, and writing them."""

from __future__ import annotations

import importlib
import io
import math
from collections.abc import Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbiflow.arrays import Array
from orbiflow.density.data import Source, TableError, TableRows, as_numbers, short
from orbiflow.density.tables.lines import is_utf16
from orbiflow.density.tables.text import (
    MAX_COLUMNS,
    MAX_ROWS,
    TextTable,
    append_to_text,
    name_cell,
    read_text,
)
from orbiflow.errors import InputFileError, OrbiflowError, literal
from orbiflow.settings import naming_extras

MAX_BYTES = 2 * 2**30
_MAGIC = {"npy": b"\x93NUMPY", "parquet": b"PAR1"}
_TEXT = frozenset({".csv", ".tsv", ".txt"})

MAX_NPY_HEADER = 10_000
"""Characters of a header, which numpy parses with `ast.literal_eval`."""


def read_table(
    path: str | Path,
    *,
    has_header: bool | None = None,
    decimal: str | None = None,
    codes: Sequence[str] = (),
    wanted: Sequence[str] = (),
) -> Source:
    """Return the columns of a text, `.npy` or Parquet file; the options are those of `read_text`.

    `.npy` files hold a 2-dimensional array of numbers or a 1-dimensional structured one.

    Raises `InputFileError` for a file that cannot be read.
    """
    path = Path(path)
    kind = kind_of_file(path)
    if kind == "text":
        return read_text(path, has_header=has_header, decimal=decimal, codes=codes, wanted=wanted)
    return _read_npy(path) if kind == "npy" else _read_parquet(path)


def append_columns(rows: TableRows, columns: Mapping[str, ArrayLike]) -> bytes:
    """Return the file of rows with more columns (N,), as text.

    A text file is kept as it is, see `append_to_text`; from others the columns of the rows are written,
    as CSV. A name that is taken gets a number: "density_2".
    """
    values = [np.asarray(column, dtype=np.float64) for column in columns.values()]
    source = rows.source
    if isinstance(source, TextTable):
        names = free_names(columns, source.names if source.is_named else ())
        return append_to_text(source, dict(zip(names, values, strict=True)), rows.numbers)
    names = free_names(columns, rows.columns)
    return to_csv((*rows.columns, *names), np.column_stack([rows.values, *values]))


def renamed_columns(rows: TableRows, names: Iterable[str]) -> dict[str, str]:
    """Return what `append_columns` calls columns whose names the file has already."""
    source = rows.source
    taken = rows.columns
    if isinstance(source, TextTable):
        taken = source.names if source.is_named else ()
    wanted = list(names)
    pairs = zip(wanted, free_names(wanted, taken), strict=True)
    return {name: free for name, free in pairs if name != free}


def to_csv(columns: Sequence[str], values: ArrayLike) -> bytes:
    """Return values (N, k) as UTF-8 CSV under a header of k names, with 10 significant digits.

    >>> to_csv(["lat", "lon"], [[0.1, 2], [1e-20, 1 / 3]]).decode().splitlines()
    ['lat,lon', '0.1,2', '1e-20,0.3333333333']
    """
    values = np.asarray(values, dtype=np.float64)
    if values.ndim != 2 or values.shape[1] != len(columns):
        raise ValueError(f"values must have shape (N, {len(columns)}), not {values.shape}")
    out, head = io.BytesIO(), ",".join(name_cell(name, ",") for name in columns)
    np.savetxt(out, values, fmt="%.10g", delimiter=",", header=head, comments="", encoding="utf-8")
    return out.getvalue()


def free_names(wanted: Iterable[str], taken: Sequence[str]) -> list[str]:
    """Return names with a number where they are taken."""
    found, used = list[str](), {name.casefold() for name in taken}
    for name in wanted:
        free = chain([name], (f"{name}_{i}" for i in count(2)))
        found.append(next(text for text in free if text.casefold() not in used))
        used.add(found[-1].casefold())
    return found


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


@dataclass(frozen=True, eq=False)
class BinaryTable:
    """The columns of an `.npy` or Parquet file: a `Source`.

    - `columns`: The cells (N,) of each column.
    - `is_array`: Whether it is an array without names, whose angles are radians.
    """

    path: Path
    names: tuple[str, ...]
    is_named: bool
    columns: Sequence[NDArray[Any]]

    @property
    def is_array(self) -> bool:
        """Whether it is an array without names."""
        return not self.is_named

    @property
    def where(self) -> str:
        """What messages begin with."""
        return f"{self.path}: "

    def place(self, row: int) -> str:
        """Return which row it is, from 1."""
        return f"row {row + 1}"

    def is_numeric(self, column: int) -> bool:
        """Return whether a column is of numbers."""
        if isinstance(self.columns, ParquetColumns):
            return self.columns.is_numeric(column)
        return self.columns[column].dtype.kind in "fiu"

    def numbers(self, column: int) -> Array:
        """Return a column (N,), NaN where values are missing; refuse what holds no numbers."""
        cells = self.columns[column]
        if cells.dtype.kind in "fiu":
            with np.errstate(over="ignore"):
                return cells.astype(np.float64)
        if cells.dtype.kind == "O":
            try:
                return as_numbers(cells, f"{self.path}: column {self.names[column]!r}")
            except OrbiflowError as error:
                raise TableError(
                    literal(str(error)) + "; correct it, or choose another with {columns}"
                ) from error
        raise TableError(
            literal(
                f"{self.path}: column {self.names[column]!r} holds {cells.dtype}, not numbers; "
            )
            + "choose another with {columns}"
        )

    def cells(self, column: int) -> NDArray[Any]:
        """Return the cells (N,) of a column."""
        return self.columns[column]


def _check_size(path: Path, rows: int, columns: int) -> None:
    for number, most, what in ((rows, MAX_ROWS, "rows"), (columns, MAX_COLUMNS, "columns")):
        if number > most:
            raise InputFileError(
                f"{path}: more than {most} {what}, the most that is read; save a part of the table"
            )


def _read_npy(path: Path) -> BinaryTable:
    """Return the table in an `.npy` file, whose header is checked before anything is read."""
    shape, dtype = _npy_header(path)
    fields = dtype.names
    width = shape[1] if fields is None else len(fields)
    _check_size(path, shape[0], width)
    names = fields or tuple(f"column{i}" for i in range(1, width + 1))
    try:
        data = np.load(path, mmap_mode="r", allow_pickle=False, max_header_size=MAX_NPY_HEADER)
        parts = [np.array(data[name] if fields else data[:, i]) for i, name in enumerate(names)]
    except (OSError, ValueError, TypeError, IndexError, OverflowError) as exc:
        raise _damaged(path, exc) from exc
    if not len(parts) or not len(parts[0]):
        raise InputFileError(f"{path}: holds no rows of numbers; export it again")
    return BinaryTable(path, names, fields is not None, tuple(parts))


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
            f"{path}: an array of shape {short(str(shape))} and type {short(str(dtype))}; save "
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


class ParquetColumns(Sequence[NDArray[Any]]):
    """The columns of a Parquet file, each read when it is asked for."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.kinds = importlib.import_module("pyarrow").types
        with _parquet(path) as file:
            _check_size(path, file.metadata.num_rows, len(file.schema_arrow.names))
            self.schema: Any = file.schema_arrow
            # Parquet has categories of words alone, pandas notes others
            noted: Any = self.schema.pandas_metadata or {"columns": []}
        self.words = {
            own["field_name"] for own in noted["columns"] if own["pandas_type"] == "categorical"
        }
        self._read: dict[int, NDArray[Any]] = {}

    def __len__(self) -> int:
        return len(self.schema.names)

    def is_numeric(self, column: int) -> bool:
        """Return whether a column is of numbers by its type."""
        kind = self.schema.types[column]
        tests = self.kinds.is_integer, self.kinds.is_floating, self.kinds.is_decimal
        return self.schema.names[column] not in self.words and any(test(kind) for test in tests)

    def __getitem__(self, column: Any) -> Any:
        if column not in self._read:
            self._read[column] = self._column(column)
        return self._read[column]

    def _column(self, column: int) -> NDArray[Any]:
        name, kind = self.schema.names[column], self.schema.types[column]
        if self.kinds.is_temporal(kind):
            raise InputFileError(
                f"{self.path}: column {short(name)!r} holds times ({kind}); save numbers, such as "
                "hours since a first moment"
            )
        if self.schema.names.count(name) > 1:  # which Parquet cannot tell apart
            raise InputFileError(f"{self.path}: two columns are called {short(name)!r}; rename one")
        with _parquet(self.path) as file:
            chunk = file.read(columns=[name]).column(0)
            if self.is_numeric(column):
                return chunk.cast("float64", safe=False).to_numpy()
            return np.array([*(None if c is None else str(c) for c in chunk.to_pylist()), None])[
                :-1
            ]


def _read_parquet(path: Path) -> BinaryTable:
    """Return the table in a Parquet file."""
    with naming_extras(f"{path}: reading Parquet"):
        columns = ParquetColumns(path)
    return BinaryTable(path, tuple(columns.schema.names), True, columns)


def _damaged(path: Path, exc: Exception) -> InputFileError:
    return InputFileError(f"{path}: damaged or of an unknown kind ({short(str(exc))}); save again")
