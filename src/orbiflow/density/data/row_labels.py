"""What rows belong to, and which row of one table is which of another."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbiflow.density.data.frames import cells_of, missing_among
from orbiflow.errors import OrbiflowError
from orbiflow.settings import described, is_a


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
        numeric = all(isinstance(label, Real) for label in array)
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
            return {key: in_order(f"{name} {key!r}", column) for key, column in table.items()}
        if (labels := _labels_of(table)) is None:
            return table
        called, wanted = first = first or (name, labels)
        if labels.equals(wanted):
            return table
        _check_labels(name, labels, called, wanted)
        places = labels.get_indexer(wanted)
        is_pandas = hasattr(table, "iloc")
        return table.iloc[places] if is_pandas else table[dict.fromkeys(table.dims, places)]

    return [in_order(name, table) for name, table in tables.items()]


def _labels_of(table: Any) -> Any:
    """Return the index of the rows of pandas, or of xarray along one dimension; None of others."""
    if hasattr(table, "iloc"):
        return table.index
    dims = list(getattr(table, "dims", ()))
    return getattr(table, "indexes", {}).get(dims[0]) if len(dims) == 1 else None


def _check_labels(name: str, labels: Any, called: str, wanted: Any) -> None:
    """Refuse labels of rows that are not those wanted, each once."""
    what = ""
    for what_table, index in ((called, wanted), (name, labels)):
        if not index.is_unique:
            what = f", and those of {what_table} repeat"
    if not what and (apart := len(labels.symmetric_difference(wanted))):
        what = f", of which {apart} are in one of them alone"
    if what:
        raise OrbiflowError(
            f"the rows of {name} and {called} have different labels (index){what}: give both the same "
            "rows, or arrays without labels, which go by place"
        )
