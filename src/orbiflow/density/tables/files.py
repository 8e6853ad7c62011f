"""Tables of any kind of file, and writing them."""

from __future__ import annotations

import importlib
import io
from collections.abc import Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbiflow.density.data import DataTable, TableRows, numbered, object_array, short
from orbiflow.density.tables.text import append_to_text, check_size, is_utf16, name_cell, read_text
from orbiflow.errors import InputFileError
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
) -> DataTable:
    """Return the columns of a text, `.npy` or Parquet file; the options are those of `read_text`.

    `.npy` files hold a 2-dimensional array of numbers or a 1-dimensional structured one.

    Raises `InputFileError` for a file that cannot be read.
    """
    path = Path(path)
    kind = kind_of_file(path)
    if kind == "text":
        return read_text(path, has_header=has_header, decimal=decimal, codes=codes)
    return _read_npy(path, codes) if kind == "npy" else _read_parquet(path, codes)


def append_columns(rows: TableRows, columns: Mapping[str, ArrayLike]) -> bytes:
    """Return the file of rows with more columns (N,), as text.

    A text file is kept as it is, see `append_to_text`; from others the columns of the rows are written,
    as CSV. A name that is taken gets a number: "density_2".
    """
    values = [np.asarray(column, dtype=np.float64) for column in columns.values()]
    names = free_names(columns, _names_of(rows))
    if rows.source.text is not None:
        return append_to_text(rows.source, dict(zip(names, values, strict=True)), rows.numbers)
    return to_csv((*rows.columns, *names), np.column_stack([rows.values, *values]))


def renamed_columns(rows: TableRows, names: Iterable[str]) -> dict[str, str]:
    """Return what `append_columns` calls columns whose names the file has already."""
    wanted = list(names)
    pairs = zip(wanted, free_names(wanted, _names_of(rows)), strict=True)
    return {name: free for name, free in pairs if name != free}


def _names_of(rows: TableRows) -> tuple[str, ...]:
    """Return the names of the columns that are written beside new ones."""
    table = rows.source
    return rows.columns if table.text is None else table.names if table.is_named else ()


def free_names(wanted: Iterable[str], taken: Sequence[str]) -> list[str]:
    """Return names with a number where they are taken."""
    names, used = list[str](), {name.casefold() for name in taken}
    for name in wanted:
        free = chain([name], (f"{name}_{i}" for i in count(2)))
        names.append(next(text for text in free if text.casefold() not in used))
        used.add(names[-1].casefold())
    return names


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


def kind_of_file(path: Path) -> str:
    """Return "text", "npy" or "parquet", by the first bytes, which must agree with the extension."""
    try:
        size, is_file = path.stat().st_size, path.is_file()
        with path.open("rb") if is_file else io.BytesIO() as file:
            head = file.read(4096)
    except (OSError, ValueError) as exc:  # ValueError: a null byte in the name
        raise InputFileError(f"{path}: cannot be read ({exc}); check the path") from exc
    if not is_file or size > MAX_BYTES or not head:
        what = f"{size / 2**30:.1f} GiB, at most {MAX_BYTES / 2**30:g} are read; split the file"
        what = what if head else "the file is empty; export or download it again"
        raise InputFileError(
            f"{path}: {what if is_file else 'is a folder or a device; give a file'}"
        )
    for kind, magic in _MAGIC.items():
        if head.startswith(magic) and path.suffix.lower() not in _TEXT:
            return kind
        if path.suffix.lower() == f".{kind}":
            raise InputFileError(f"{path}: does not begin as a .{kind} file does; save it again")
    if b"\0" in head and not is_utf16(head):
        raise InputFileError(f"{path}: binary data, not a table; save it as CSV in UTF-8")
    return "text"


def _read_npy(path: Path, codes: Sequence[str]) -> DataTable:
    """Return the table in an `.npy` file, of which no more is read than there is."""
    try:
        with np.errstate(over="ignore"):  # of shapes that no file has
            data = np.load(path, mmap_mode="r", allow_pickle=False, max_header_size=MAX_NPY_HEADER)
    except Exception as exc:  # numpy's parser of headers raises many types
        raise _damaged(path, exc) from exc
    fields = data.dtype.names
    if data.ndim != (2 if fields is None else 1):
        raise InputFileError(
            f"{path}: an array of shape {short(str(data.shape))} and type {short(str(data.dtype))}; "
            "save one of shape (N, k), or (N,) with named fields"
        )
    names = fields or tuple(numbered(data.shape[1]))
    check_size(path, len(data), len(names))
    if not data.size:
        raise InputFileError(f"{path}: holds no rows of numbers; export it again")
    parts = [np.array(data[name] if fields else data[:, i]) for i, name in enumerate(names)]
    return DataTable(
        names, fields is not None, parts, f"{path}: ", path, fields is None, codes=tuple(codes)
    )


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
        self.path, self._cells = path, dict[int, NDArray[Any]]()
        with _parquet(path) as file:
            check_size(path, file.metadata.num_rows, len(file.schema_arrow.names))
            self.schema: Any = file.schema_arrow
        kinds = importlib.import_module("pyarrow").types
        # Parquet has categories of words alone, pandas notes others
        noted: Any = self.schema.pandas_metadata or {"columns": ()}
        words = {
            note["field_name"] for note in noted["columns"] if note["pandas_type"] == "categorical"
        }
        tests = kinds.is_integer, kinds.is_floating, kinds.is_decimal
        pairs = enumerate(zip(self.schema.names, self.schema.types, strict=True))
        self.numeric = frozenset(
            k
            for k, (name, kind) in pairs
            if name not in words and any(is_so(kind) for is_so in tests)
        )

    def __len__(self) -> int:
        return len(self.schema.names)

    def __getitem__(self, column: Any) -> Any:
        if column not in self._cells:
            self._cells[column] = self._read(column)
        return self._cells[column]

    def _read(self, column: int) -> NDArray[Any]:
        name, kind = self.schema.names[column], self.schema.types[column]
        if importlib.import_module("pyarrow").types.is_temporal(kind):
            raise InputFileError(
                f"{self.path}: column {short(name)!r} holds times ({kind}); save numbers, such as "
                "hours since a first moment"
            )
        if self.schema.names.count(name) > 1:  # which Parquet cannot tell apart
            raise InputFileError(f"{self.path}: two columns are called {short(name)!r}; rename one")
        with _parquet(self.path) as file:
            chunk = file.read(columns=[name]).column(0)
            if column in self.numeric:
                return chunk.cast("float64", safe=False).to_numpy()
            return object_array([None if cell is None else str(cell) for cell in chunk.to_pylist()])


def _read_parquet(path: Path, codes: Sequence[str]) -> DataTable:
    """Return the table in a Parquet file."""
    columns = ParquetColumns(path)
    names, numeric = tuple(columns.schema.names), columns.numeric
    return DataTable(names, True, columns, f"{path}: ", path, False, numeric, tuple(codes))


def _damaged(path: Path, exc: Exception) -> InputFileError:
    return InputFileError(f"{path}: damaged or of an unknown kind ({short(str(exc))}); save again")
