"""What belongs to rows: cells of any library, labels of groups, and which row of a table is which."""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbiflow.errors import OrbiflowError
from orbiflow.settings import described, is_a, is_tensor

CATEGORIES = ("category", "categorical", "enum", "dictionary")
"""What the types of columns of categories begin with in pandas, polars and pyarrow."""


def is_category(kind: object) -> bool:
    """Return whether a type of columns is one of categories, which are words even if they are numbers.

    >>> is_category("dictionary<values=int64, indices=int8>"), is_category(np.dtype(float))
    (True, False)
    """
    return str(kind).lower().startswith(CATEGORIES)


def cells_of(column: Any) -> Any:
    """Return a column of pandas, polars or pyarrow as an array, and anything else as it is.

    It is an array of objects where its kind has a mark for missing values, and of words, or None, where
    it holds categories.

    >>> cells_of([1, 2])
    [1, 2]
    """
    kind = getattr(column, "dtype", getattr(column, "type", None))
    if kind is None or is_tensor(column) or not hasattr(column, "__len__"):
        return column
    if isinstance(kind, np.dtype):
        return column if is_a(column, np.ndarray) else np.asarray(column)
    cells = column.to_pylist() if hasattr(column, "to_pylist") else list(column)
    if is_category(kind):
        cells = [None if is_missing(cell) else word_of(cell) for cell in cells]
    return np.array([*cells, None], dtype=object)[:-1]


def word_of(cell: Any) -> str:
    """Return the word that a cell is; a whole number is the same word whatever its type.

    >>> word_of(2.0), word_of("2.0")
    ('2', '2.0')
    """
    if isinstance(cell, numbers.Real) and not is_a(cell, bool) and float(cell).is_integer():
        return str(int(float(cell)))
    return str(cell)


def is_missing(cell: Any) -> bool:
    """Return whether a cell of a column is a mark for a missing value, of any library.

    >>> is_missing(None), is_missing(float("nan")), is_missing("nan")
    (True, True, False)
    """
    if cell is None or type(cell).__name__ in ("NAType", "NaTType", "MaskedConstant"):
        return True
    return isinstance(cell, numbers.Real) and math.isnan(cell)


def missing_among(cells: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which cells (N,) are marks for missing values, or empty words."""
    if cells.dtype.kind == "O":
        found = [is_missing(cell) or (is_a(cell, str) and not cell.strip()) for cell in cells]
        return np.array(found, dtype=bool)
    if cells.dtype.kind in "US":
        return np.char.strip(cells.astype(str)) == ""
    if cells.dtype.kind in "mM":
        return np.isnat(cells)
    return np.isnan(cells) if cells.dtype.kind == "f" else np.zeros(cells.shape, dtype=bool)


def group_numbers(labels: Any, rows: int, what: str = "groups") -> NDArray[np.int64]:
    """Return the group (N,) of each row as a whole number from 0, from labels of any kind.

    Raises `OrbiflowError` unless each row has a label.

    >>> group_numbers(["a", "b", "a"], 3).tolist()
    [0, 1, 0]
    """
    array = np.asarray(cells_of(labels))
    if array.shape != (rows,):
        raise OrbiflowError(
            f"{what}: expected a label for each of {rows} rows, got {described(labels)}"
        )
    at = np.flatnonzero(missing_among(array))
    if len(at):
        raise OrbiflowError(
            f"{what}: {len(at)} row{'s' * (len(at) > 1)} without a label, the first is row "
            f"{at[0] + 1}; fill them in, or leave such rows out"
        )
    if array.dtype.kind == "O":  # numbers are in their order, whoever holds them
        numeric = all(isinstance(label, numbers.Real) for label in array)
        array = array.astype(np.float64 if numeric else str)
    return np.unique(array, return_inverse=True)[1].reshape(-1).astype(np.int64)


def alongside(**tables: Any) -> list[Any]:
    """Return tables, columns or mappings of columns with their rows in the order of the first.

    Rows of pandas and xarray have labels: where labels are those of the first that has any, in another
    order, rows are put into its order. Arrays and frames without labels go by place.

    Raises `OrbiflowError` where other rows have labels.
    """
    first: tuple[str, Any] | None = None

    def in_order(name: str, table: Any) -> Any:
        nonlocal first
        if is_a(table, Mapping) and not hasattr(table, "dims"):
            return {key: in_order(f"{name} {key!r}", own) for key, own in table.items()}
        if (labels := _labels_of(table)) is None:
            return table
        if first is None:
            first = name, labels
        called, wanted = first
        if labels.equals(wanted):
            return table
        _check_labels(name, labels, called, wanted)
        places = labels.get_indexer(wanted)
        return (
            table.iloc[places]
            if hasattr(table, "iloc")
            else table[dict.fromkeys(table.dims, places)]
        )

    return [in_order(name, table) for name, table in tables.items()]


def _labels_of(table: Any) -> Any:
    """Return the index of the rows of pandas, or of xarray along one dimension; None of others."""
    if hasattr(table, "iloc"):
        return table.index
    dims = list(getattr(table, "dims", ()))
    return getattr(table, "indexes", {}).get(dims[0]) if len(dims) == 1 else None


def _check_labels(name: str, labels: Any, called: str, wanted: Any) -> None:
    """Refuse labels of rows that are not those wanted, each once."""
    cure = "give both the same rows, or arrays without labels, which go by place"
    for own, index in ((called, wanted), (name, labels)):
        if not index.is_unique:
            raise OrbiflowError(
                f"{name} and {called} have different labels of rows (index), and those of {own} "
                f"repeat: {cure}"
            )
    apart = len(labels.symmetric_difference(wanted))
    if apart:
        raise OrbiflowError(
            f"the rows of {name} and {called} have different labels (index), of which {apart} are in "
            f"one of them alone: {cure}"
        )
