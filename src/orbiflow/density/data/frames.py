"""Arrays and data frames of any library as plain numbers, with NaN for whatever is missing."""

from __future__ import annotations

import importlib
import math
import numbers
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date, time, timedelta
from decimal import Decimal
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.density.data.draws import columns_of_draws, has_draws, posterior_of
from orbiflow.density.data.row_labels import cells_of, is_missing
from orbiflow.errors import OrbiflowError
from orbiflow.settings import described, is_a, is_tensor


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
    parts = [as_numbers(part, f"{what}: column {name!r}") for name, part in columns]
    sizes = {part.shape for part in parts}
    if len(sizes) > 1 or any(len(size) != 1 for size in sizes):
        raise OrbiflowError(f"{what}: the columns must be of one length, got {sorted(sizes)}")
    values = np.stack(parts, axis=1) if parts else np.empty((0, 0))
    names = [name for name, _ in columns]
    named = all(is_a(name, str) for name in names)
    return Data(values, tuple(cast("list[str]", names)) if named else None)


@dataclass(frozen=True, eq=False)
class Frame:
    """The columns of a data frame or of an array: a `Source`.

    - `parts`: The columns' cells, each (N,).
    - `is_array`: Whether it is an array, whose angles are radians unless declared.
    """

    names: tuple[str, ...]
    is_named: bool
    parts: tuple[Any, ...]
    what: str = "data"
    is_array: bool = False

    @classmethod
    def of(cls, data: Any, what: str = "data", names: Sequence[str] | None = None) -> Frame:
        """Return the columns of an array (N, k), which may get names, or of a data frame.

        Raises `OrbiflowError` for data that are neither.
        """
        columns = columns_of(data, what)
        if columns is None:
            values = as_numbers(data, what)
            require_table(values)
            called = tuple(f"column{k}" for k in range(1, values.shape[1] + 1))
            parts = tuple(values.T)
            return cls(tuple(names or called), names is not None, parts, what, is_array=True)
        own = tuple(str(name) for name, _ in columns)
        named = all(is_a(name, str) for name, _ in columns)
        if not named:
            own = tuple(f"column{k}" for k in range(1, len(columns) + 1))
        parts = tuple(np.asarray(cells_of(part)) for _, part in columns)
        sizes = {part.shape for part in parts}
        if len(sizes) > 1 or any(len(size) != 1 for size in sizes):
            raise OrbiflowError(f"{what}: the columns must be of one length, got {sorted(sizes)}")
        return cls(own, named, parts, what)

    @property
    def where(self) -> str:
        """What messages begin with."""
        return "" if self.what == "data" else f"{self.what}: "

    def is_numeric(self, column: int) -> bool:
        """Return whether a column is of numbers, by its type or by all of its cells."""
        part = self.parts[column]
        if part.dtype.kind != "O":
            return part.dtype.kind in "fiu"
        known = [cell for cell in part if not is_missing(cell)]
        return bool(known) and all(is_a(c, numbers.Real) and not is_a(c, bool) for c in known)

    def numbers(self, column: int) -> Array:
        """Return a column (N,) as float64, missing values as NaN; refuse what holds no numbers."""
        return as_numbers(self.parts[column], f"{self.what}: column {self.names[column]!r}")

    def cells(self, column: int) -> NDArray[Any]:
        """Return the cells (N,) of a column as they are."""
        return self.parts[column]

    def place(self, row: int) -> str:
        """Return which row it is, from 1."""
        return f"row {row + 1}"


def columns_of(data: Any, what: str) -> list[tuple[Any, Any]] | None:
    """Return the names and columns of a frame, or None for what is not one."""
    if hasattr(data, "collect_schema") and hasattr(data, "collect"):
        raise OrbiflowError(f"{what}: a lazy frame holds no numbers yet; call its collect() first")
    data = posterior_of(data)
    if has_draws(data):
        return columns_of_draws(data, what)
    if hasattr(data, "data_vars"):  # xarray
        if len(data.dims) != 1:
            raise OrbiflowError(
                f"{what}: a Dataset of the dimensions {', '.join(map(str, data.dims))}; give columns "
                "along one, such as dataset.to_dataframe().reset_index()[['lat', 'lon']]"
            )
        return [(name, data[name].values) for name in data.data_vars]
    if hasattr(data, "column_names"):  # pyarrow
        return [(n, cells_of(data.column(k))) for k, n in enumerate(data.column_names)]
    if is_a(data, np.ndarray) and data.dtype.names:
        return [(name, data[name]) for name in data.dtype.names]
    frame: Any = data
    if hasattr(data, "dtype") and not is_tensor(data) and is_a(name := _name_of(data), str):
        return [(name, cells_of(data))]
    names = getattr(frame, "columns", None)
    if names is None or callable(names):
        return None
    if hasattr(frame, "iloc"):  # pandas
        return [(n, cells_of(frame.iloc[:, k])) for k, n in enumerate(names)]
    if hasattr(frame, "get_columns"):  # polars
        return [(n, cells_of(c)) for n, c in zip(names, frame.get_columns(), strict=True)]
    return list(zip(names, np.asarray(frame).T, strict=True))


def _name_of(column: Any) -> str | None:
    """Return the name of a column (N,) of pandas, polars or xarray, None if it has none."""
    return (getattr(column, "name", None) or None) if len(column.shape) == 1 else None


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
    if array.dtype.kind == "c":
        raise OrbiflowError(
            f"{what}: expected real numbers, got complex ones; numpy.angle gives their angles"
        )
    if array.dtype.kind == "O":
        array = _of_objects(array, what)
    elif array.dtype.kind not in "fiu":
        cure = DATES_CURE * (array.dtype.kind in "mM")
        raise OrbiflowError(f"{what}: expected numbers, got {_kind(array)}{cure}")
    values = array.astype(np.float64)
    if mask is not None:
        values[mask] = np.nan
    return values


DATES_CURE = "; give numbers, such as hours since a first moment, or hours of the day"


def _kind(array: NDArray[Any]) -> str:
    words = {"b": "Booleans", "U": "text", "S": "text", "M": "dates", "m": "durations"}
    sample = f", such as {array.flat[0].item()!r:.40}" if array.size else ""
    return words.get(array.dtype.kind, str(array.dtype)) + sample


def _of_objects(array: NDArray[Any], what: str) -> Array:
    values = np.empty(array.shape)
    flat = values.reshape(-1)
    for k, item in enumerate(array.reshape(-1)):
        if isinstance(item, float | int | Decimal | numbers.Real) and not is_a(item, bool):
            flat[k] = float(item)
        elif is_missing(item):
            flat[k] = math.nan
        else:
            row = np.unravel_index(k, array.shape)[0] + 1 if array.ndim else 1
            cure = "; numpy.angle gives the angles of complex numbers" * is_a(item, complex)
            cure += DATES_CURE * is_a(item, date | time | timedelta)
            raise OrbiflowError(
                f"{what}: expected numbers, got {described(item)} in row {row}{cure}"
            )
    return values


def require_table(data: Array) -> None:
    """Refuse data that are no rows and columns."""
    if data.ndim != 2:
        cure = ""
        if data.ndim == 1:
            cure = "; of one row write [[...]], of one column data.reshape(-1, 1) (NumPy)"
        raise OrbiflowError(f"expected data of shape (N, k), got {data.shape}{cure}")


def require_values(values: Array, names: Sequence[str] | None) -> None:
    """Refuse columns (N, k) of which no row has a value, and values that are infinite."""
    rows = np.flatnonzero(np.isinf(values).any(axis=1))
    if len(rows):
        raise OrbiflowError(
            f"row {rows[0] + 1} has an infinite value ({len(rows)} such rows): correct or remove it"
        )
    empty = np.flatnonzero(np.isnan(values).all(axis=0)).tolist() if len(values) else []
    if empty:
        own = [repr(names[k]) if names else str(k + 1) for k in empty]
        several = len(own) > 1
        have, them = ("have", "them") if several else ("has", "it")
        raise OrbiflowError(
            f"column{'s' * several} {', '.join(own)} {have} no value in any row; leave {them} out"
        )


OUTPUTS = ("default", "pandas", "polars")
"""What rows can be returned as."""


def frame_of(rows: Array, names: Sequence[str], output: str) -> Any:
    """Return rows (N, k) as they are, or as a frame of pandas or polars with these names."""
    if output == "default":
        return rows
    try:
        made = importlib.import_module(output)
    except ImportError as error:
        raise OrbiflowError(f"{output} is not installed: install it, or ask for arrays") from error
    columns = {name: rows[:, k] for k, name in enumerate(names)}
    return made.DataFrame(columns)
