"""Data in any container: frames of all libraries, masked arrays, what is no number."""

from decimal import Decimal
from typing import Any

import numpy as np
import pytest
import torch

from orbiflow.density.data import as_data
from refusals import refused

NAN = float("nan")


def same(found: Any, values: list[list[float]], names: tuple[str, ...] | None) -> None:
    assert found.names == names
    assert found.values.dtype == np.float64
    assert np.array_equal(found.values, values, equal_nan=True)


ARRAYS = {
    "list": [[1, 2], [3, NAN]],
    "none": [[1, 2], [3, None]],
    "object": np.array([[1, 2], [Decimal(3), None]], dtype=object),
    "masked": np.ma.masked_greater([[1, 2], [3, 999]], 900),
    "masked integers": np.ma.masked_equal(np.array([[1, 2], [3, -99]]), -99),
    "tensor": torch.tensor([[1, 2], [3, NAN]], requires_grad=True),
    "float32": np.array([[1, 2], [3, NAN]], dtype=np.float32),
}


@pytest.mark.parametrize("kind", ARRAYS)
def test_arrays(kind: str) -> None:
    same(as_data(ARRAYS[kind]), [[1, 2], [3, NAN]], None)


def test_structured_arrays_have_names() -> None:
    rows = np.array([(1, 2.0), (3, NAN)], dtype=[("phi", "i4"), ("psi", "f8")])
    same(as_data(rows), [[1, 2], [3, NAN]], ("phi", "psi"))


def test_pandas() -> None:
    pandas = pytest.importorskip("pandas")
    for psi in (
        [2.0, None],
        [2, pandas.NA],
        pandas.array([2, None], dtype="Int64"),
        pandas.array([2, None], dtype="Float64"),
        np.array([2, None], dtype=object),
    ):
        frame = pandas.DataFrame({"phi": [1, 3], "psi": psi}, index=[7, 5])
        same(as_data(frame), [[1, 2], [3, NAN]], ("phi", "psi"))
    assert as_data(pandas.DataFrame([[1, 2]])).names is None
    for wrong, words in (
        (["x", "1.5"], "phi x 1"),
        ([True, False], "numbers Booleans"),
        (pandas.to_datetime(["2020-01-01", "2020-01-02"]), "numbers dates"),
        ([1.0, 2 + 1j], "phi"),
    ):
        with refused(*words.split()):
            as_data(pandas.DataFrame({"phi": wrong}))


def test_polars() -> None:
    polars = pytest.importorskip("polars")
    for psi in ([2.0, None], [2, None], [2.0, NAN]):
        same(
            as_data(polars.DataFrame({"phi": [1, 3], "psi": psi})),
            [[1, 2], [3, NAN]],
            ("phi", "psi"),
        )
    with refused("phi", "x"):
        as_data(polars.DataFrame({"phi": ["x"]}))
    with refused("call", "collect"):
        as_data(polars.DataFrame({"phi": [1]}).lazy())


def test_pyarrow() -> None:
    arrow = pytest.importorskip("pyarrow")
    same(
        as_data(arrow.table({"phi": [1, 3], "psi": [2, None]})), [[1, 2], [3, NAN]], ("phi", "psi")
    )


def test_xarray() -> None:
    xarray = pytest.importorskip("xarray")
    data = xarray.Dataset({"phi": ("n", [1, 3]), "psi": ("n", [2.0, NAN])})
    same(as_data(data), [[1, 2], [3, NAN]], ("phi", "psi"))
    same(as_data(xarray.DataArray([[1, 2], [3, NAN]])), [[1, 2], [3, NAN]], None)
    with refused("Dataset", "n", "m"):
        as_data(xarray.Dataset({"phi": (("n", "m"), [[1, 3]])}))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (np.array([[1j, 2]]), "numpy.angle"),
        (np.array([[1, 2 + 1j]], dtype=object), "1 numpy.angle"),
        (np.array([["1", "2"]]), "numbers 1"), (np.array([[True, False]]), "numbers Booleans"),
        (np.array([["2020-01-01"]], dtype="M8[D]"), "numbers dates"),
        ([[1, 2], [3]], "rows length"), ({"phi": [1, 2]}, "numbers 1"), ("phi", "phi"),
        (None, "array numbers"), (object(), "object"), ([[1, [2]]], "numbers"),
    ],
)  # fmt: skip
def test_what_is_no_number_is_refused(wrong: Any, words: str) -> None:
    with refused(*words.split()):
        as_data(wrong)
