"""Tables in `.npy` and Parquet files, whose sizes are checked before they are decoded.

Nothing is unpickled.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

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
from orbiflow.errors import InputFileError, OrbiflowError

MAX_NPY_HEADER = 10_000
"""Characters of a header, which numpy parses with `ast.literal_eval`."""


def read_npy(path: Path, reading: Reading) -> Table:
    """Read a table from an `.npy` file."""
    shape, dtype = _npy_header(path)
    check_count(path, shape[0], reading.max_rows, "rows")
    fields = dtype.names
    n_columns = len(fields) if fields is not None else shape[1]
    check_count(path, n_columns, MAX_COLUMNS, "columns")
    names = fields or tuple(f"column{i}" for i in range(1, n_columns + 1))
    types = [dtype[name] for name in fields] if fields is not None else [dtype] * n_columns
    numeric = [kind.kind in "fiu" for kind in types]
    picked, notes = choose(path, names, numeric, reading, types)
    try:
        data = np.load(path, mmap_mode="r", allow_pickle=False, max_header_size=MAX_NPY_HEADER)
        with np.errstate(over="ignore"):
            parts = [data[names[i]] if fields is not None else data[:, i] for i in picked]
            values = np.stack([part.astype(np.float64) for part in parts], axis=1)
    except (OSError, ValueError, TypeError, IndexError, OverflowError) as exc:
        raise _damaged(path, exc) from exc
    return finished(path, values, None, tuple(names[i] for i in picked), reading, notes)


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


def npy_names(path: Path) -> tuple[str, ...] | None:
    """Return the names of a structured array's fields, or None for a plain one."""
    return _npy_header(path)[1].names


@contextmanager
def _parquet(path: Path) -> Generator[Any]:
    """Open a Parquet file; whatever goes wrong inside is its damage."""
    try:
        arrow, parquet = map(importlib.import_module, ("pyarrow", "pyarrow.parquet"))
    except ImportError as exc:
        raise OrbiflowError(f"{path}: reading Parquet needs pyarrow: pip install pyarrow") from exc
    try:
        with parquet.ParquetFile(path) as file:
            yield file
    except InputFileError:
        raise
    except (arrow.ArrowException, OSError, ValueError, KeyError, MemoryError) as exc:
        raise _damaged(path, exc) from exc


def parquet_names(path: Path) -> tuple[str, ...]:
    """Return the names of all columns."""
    with _parquet(path) as file:
        return tuple(file.schema_arrow.names)


def parquet_labels(path: Path, column: str) -> list[str]:
    """Return a column's cells as text, "" for empty ones."""
    names = parquet_names(path)
    name = names[find(path, names, column)]
    with _parquet(path) as file:
        batches = file.iter_batches(BLOCK, columns=[name])
        cells = [cell for batch in batches for cell in batch.column(0).to_pylist()]
    return ["" if cell is None else str(cell).strip() for cell in cells]


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
    return finished(path, np.concatenate(blocks), None, names, reading, notes)


def _damaged(path: Path, exc: Exception) -> InputFileError:
    return InputFileError(f"{path}: damaged or of an unknown kind ({quote(str(exc))}); save again")
