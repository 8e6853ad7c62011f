"""Arrays and data frames of any library as columns of plain cells, and cells as numbers."""

from __future__ import annotations

import importlib
import math
import numbers
from collections.abc import Mapping, Sequence
from datetime import date, time, timedelta
from decimal import Decimal
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.settings import described, is_a, is_tensor

CATEGORIES = ("category", "categorical", "enum", "dictionary")
"""What the types of columns of categories begin with in pandas, polars and pyarrow."""

DRAWS = ("chain", "draw", "sample")
"""Dimensions along which there are rows: ArviZ's own, and the one in which it stacks them."""

RUNS = 10
"""Runs of neighbouring draws in each chain: those of one are held out together."""

LEAST_RUN = 2
"""Draws in a run, without which they are as good as apart."""


class Data(NamedTuple):
    """Numbers, NaN where they are missing, and the names of their columns if they have names."""

    values: Array
    names: tuple[str, ...] | None


def as_data(data: Any, what: str = "data") -> Data:
    """Return data as float64, missing values as NaN, and the names of their columns.

    Args:
        data: An array or nested lists, masked or structured ones too, a tensor, or a data frame: of
            pandas or polars, a table of pyarrow, an xarray.Dataset of columns along one dimension, or
            draws of a sampler: ArviZ's InferenceData, or what xarray holds along chain and draw.
        what: What they are, for messages.

    Raises:
        OrbiflowError: For complex numbers, text, dates, Booleans, ragged lists and other containers,
            and for columns without any value.

    >>> as_data(np.ma.masked_greater([[1.0, 999.0]], 900)).values.tolist()
    [[1.0, nan]]
    """
    columns = columns_of(data, what)
    if columns is None:
        return Data(as_numbers(data, what), None)
    parts = [as_numbers(cells, f"{what}: column {name!r}") for name, cells in columns]
    check_lengths(parts, what)
    values = np.stack(parts, axis=1) if parts else np.empty((0, 0))
    names = tuple(name for name, _ in columns)
    return Data(values, names if all(is_a(name, str) for name in names) else None)


def check_lengths(columns: Sequence[NDArray[Any]], what: str) -> None:
    """Refuse columns that are not of one length (N,)."""
    shapes = {cells.shape for cells in columns}
    if len(shapes) > 1 or any(len(shape) != 1 for shape in shapes):
        raise OrbiflowError(f"{what}: the columns must be of one length, got {sorted(shapes)}")


def columns_of(data: Any, what: str) -> list[tuple[Any, Any]] | None:
    """Return the names and columns of a frame, or None for what is not one."""
    if hasattr(data, "collect_schema") and hasattr(data, "collect"):
        raise OrbiflowError(f"{what}: a lazy frame holds no numbers yet; call its collect() first")
    frame: Any = _posterior_of(data)
    if _has_draws(frame):
        return _columns_of_draws(frame, what)
    if hasattr(frame, "data_vars"):  # xarray
        if len(frame.dims) != 1:
            raise OrbiflowError(
                f"{what}: a Dataset of the dimensions {', '.join(map(str, frame.dims))}; give columns "
                "along one, such as dataset.to_dataframe().reset_index()[['lat', 'lon']]"
            )
        return [(name, frame[name].values) for name in frame.data_vars]
    if hasattr(frame, "column_names"):  # pyarrow
        return [(n, cells_of(frame.column(k))) for k, n in enumerate(frame.column_names)]
    if is_a(frame, np.ndarray) and frame.dtype.names:
        return [(name, frame[name]) for name in frame.dtype.names]
    name: Any = None if is_tensor(frame) else getattr(frame, "name", None)
    if (
        is_a(name, str) and name and len(getattr(frame, "shape", ())) == 1
    ):  # a column of any library
        return [(name, cells_of(frame))]
    names: Any = getattr(frame, "columns", None)
    if names is None or callable(names):
        return None
    table: Any = frame
    if hasattr(table, "iloc"):  # pandas
        return [(n, cells_of(table.iloc[:, k])) for k, n in enumerate(names)]
    parts = table.get_columns() if hasattr(table, "get_columns") else np.asarray(table).T  # polars
    return [(n, cells_of(cells)) for n, cells in zip(names, parts, strict=True)]


def _posterior_of(data: Any) -> Any:
    """Return the posterior sample of ArviZ's InferenceData or xarray's DataTree, others as they are."""
    posterior = getattr(data, "posterior", None)
    return posterior if hasattr(posterior, "data_vars") else data


def _has_draws(data: Any) -> bool:
    """Return whether a Dataset or a DataArray of xarray has draws along a dimension of its own."""
    return hasattr(data, "coords") and not set(DRAWS).isdisjoint(getattr(data, "dims", ()))


def _columns_of_draws(data: Any, what: str) -> list[tuple[str, Any]]:
    """Return the names and columns (N,) of a Dataset or DataArray, chain after chain.

    A variable of more dimensions has a column for each entry, named as ArviZ names it: "torsion[phi]".
    """
    along = [name for name in DRAWS if name in data.dims]
    variables = data.data_vars if hasattr(data, "data_vars") else {data.name or "x": data}
    columns: list[tuple[str, Any]] = []
    for name, variable in variables.items():
        if not set(along) <= set(variable.dims):
            raise OrbiflowError(
                f"{what}: variable {name!r} is not along {' and '.join(along)}; choose those that are, "
                "such as dataset[['phi', 'psi']]"
            )
        others = [dim for dim in variable.dims if dim not in along]
        table = variable.transpose(*along, *others).values
        table = table.reshape(math.prod(table.shape[: len(along)]), -1)
        for k, entry in enumerate(product(*(variable[dim].values for dim in others))):
            labels = f"[{', '.join(map(str, entry))}]" if others else ""
            columns.append((f"{name}{labels}", table[:, k]))
    return columns


def runs_of_draws(data: Any) -> NDArray[np.int64] | None:
    """Return the run (N,) of neighbouring draws in which each row lies, or None for other data.

    Draws of one chain are like the ones before, so that rows held out one by one would be known by
    their neighbours.
    """
    data = _posterior_of(data)
    if not (_has_draws(data) and "draw" in data.dims):
        return None
    draws, chains = int(data.sizes["draw"]), int(data.sizes.get("chain", 1))
    if draws < LEAST_RUN * RUNS:
        return None
    return (np.arange(chains)[:, None] * RUNS + np.arange(draws) * RUNS // draws).ravel()


def has_categories(column: Any) -> bool:
    """Return whether a column of pandas, polars or pyarrow holds categories."""
    kind = getattr(column, "dtype", getattr(column, "type", None))
    return kind is not None and str(kind).lower().startswith(CATEGORIES)


def cells_of(column: Any) -> Any:
    """Return a column of pandas, polars or pyarrow as an array, and anything else as it is.

    It is an array of objects where its kind has a mark for missing values, and of words, or None, where
    it holds categories, which are words even if they are numbers.

    >>> cells_of([1, 2])
    [1, 2]
    """
    kind = getattr(column, "dtype", getattr(column, "type", None))
    if kind is None or is_tensor(column) or not hasattr(column, "__len__"):
        return column
    if isinstance(kind, np.dtype):
        return column if is_a(column, np.ndarray) else np.asarray(column)
    cells = column.to_pylist() if hasattr(column, "to_pylist") else list(column)
    if has_categories(column):
        cells = [None if is_missing(cell) else word_of(cell) for cell in cells]
    return object_array(cells)


def object_array(cells: Sequence[Any]) -> NDArray[Any]:
    """Return an array of objects (N,), whatever they are."""
    return np.array([*cells, None], dtype=object)[:-1]


def word_of(cell: Any) -> str:
    """Return the word that a cell is; a whole number is the same word whatever its type.

    >>> word_of(2.0), word_of("2.0")
    ('2', '2.0')
    """
    if isinstance(cell, numbers.Real) and not is_a(cell, bool) and float(cell).is_integer():
        return str(int(float(cell)))
    return str(cell)


def words_of_cells(cells: NDArray[Any]) -> NDArray[np.str_]:
    """Return cells (N,) as words, empty where they are missing; 2.0 is the word 2."""
    pairs = zip(cells.tolist(), missing_among(cells).tolist(), strict=True)
    return np.array(
        ["" if is_gone else word_of(cell).strip() for cell, is_gone in pairs], dtype=str
    )


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
    if cells.dtype.kind in "OUS":
        lacking = [
            is_missing(c) or (is_a(c, str | bytes) and not c.strip()) for c in cells.tolist()
        ]
        return np.array(lacking, dtype=bool)
    if cells.dtype.kind in "mM":
        return np.isnat(cells)
    return np.isnan(cells) if cells.dtype.kind == "f" else np.zeros(cells.shape, dtype=bool)


DATES_CURE = "; give numbers, such as hours since a first moment, or hours of the day"
TEXT_CURE = "; convert the column to numbers (pandas.to_numeric)"
ANGLES_CURE = "; numpy.angle gives the angles of complex numbers"
KINDS = {
    "b": "Booleans", "U": "text", "S": "text", "M": "dates", "m": "durations", "c": "complex numbers",
}  # fmt: skip


def as_numbers(data: Any, what: str) -> Array:
    """Return an array of any shape as float64, missing values as NaN.

    >>> as_numbers([[1, None]], "angles").tolist()
    [[1.0, nan]]
    """
    data = cells_of(data)
    if is_tensor(data):
        data = data.detach().cpu()
        data = (data.double() if data.is_floating_point() else data).numpy()
    is_container = is_a(data, Sequence | numbers.Number) or hasattr(data, "__array__")
    if is_a(data, Mapping | str | bytes) or not is_container:
        raise OrbiflowError(
            f"{what}: expected an array or a data frame of numbers, got {described(data)}"
        )
    mask = np.ma.getmaskarray(data) if is_a(data, np.ma.MaskedArray) else None
    try:
        array: NDArray[Any] = np.asarray(data)
    except (TypeError, ValueError) as error:  # ragged
        raise OrbiflowError(f"{what}: expected numbers in rows of one length: {error}") from error
    kind = array.dtype.kind
    if kind == "O":
        array = _of_objects(array, what)
    elif kind not in "fiu":
        sample = f", such as {array.flat[0].item()!r:.40}" if array.size else ""
        cure = DATES_CURE if kind in "mM" else ANGLES_CURE if kind == "c" else ""
        words = KINDS.get(kind, str(array.dtype))
        raise OrbiflowError(f"{what}: expected numbers, got {words}{sample}{cure}")
    with np.errstate(over="ignore"):
        values = array.astype(np.float64)
    if mask is not None:
        values[mask] = np.nan
    return values


def _of_objects(array: NDArray[Any], what: str) -> Array:
    values = np.empty(array.shape)
    flat = values.reshape(-1)
    for k, item in enumerate(array.reshape(-1)):
        if isinstance(item, Decimal | numbers.Real) and not is_a(item, bool):
            flat[k] = float(item)
        elif is_missing(item):
            flat[k] = math.nan
        else:
            row = np.unravel_index(k, array.shape)[0] + 1 if array.ndim else 1
            cure = ANGLES_CURE * is_a(item, complex)
            cure += DATES_CURE * is_a(item, date | time | timedelta)
            cure += TEXT_CURE * is_a(item, str)
            raise OrbiflowError(
                f"{what}: expected numbers, got {described(item)} in row {row}{cure}"
            )
    return values


OUTPUTS = ("default", "pandas", "polars")
"""What rows can be returned as."""


def frame_of(rows: Array, names: Sequence[str], output: str) -> Any:
    """Return rows (N, k) as they are, or as a frame of pandas or polars with these names."""
    if output == "default":
        return rows
    try:
        library = importlib.import_module(output)
    except ImportError as error:
        raise OrbiflowError(f"{output} is not installed: install it, or ask for arrays") from error
    return library.DataFrame({name: rows[:, k] for k, name in enumerate(names)})
