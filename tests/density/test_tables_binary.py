"""Tables in NPY and Parquet files: what is read, what is refused."""

import io
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.density import read_table
from orbiflow.density.tables import append_columns, text
from orbiflow.errors import InputFileError
from refusals import refused
from table_files import PROPERTY, refuse, rows_of_file, write

# npy


def npy(array: np.ndarray, **options: bool) -> bytes:
    file = io.BytesIO()
    np.save(file, array, **options)  # pyright: ignore[reportArgumentType]
    return file.getvalue()


@pytest.mark.parametrize(
    "array",
    [
        np.array([[1, 2], [3, 4]]),
        np.array([[1, 2], [3, 4]], dtype=">f4"),
        np.asfortranarray(np.array([[1, 2], [3, 4]], dtype=np.uint8)),
        np.array([[1, 2], [3, 4]], dtype=np.longdouble),
        np.array([(1, b"a", 2), (3, b"b", 4)], dtype=[("lat", "f4"), ("s", "S3"), ("lon", "i2")]),
    ],
)
def test_npy(tmp_path: Path, array: np.ndarray) -> None:
    path = write(tmp_path, npy(array), "a" if array.dtype == np.uint8 else "a.npy")
    table = read_table(path)
    fields = array.dtype.names
    assert (table.is_named, table.is_array) == (fields is not None, fields is None)
    assert table.place(1) == "row 2"
    rows = rows_of_file(path, columns=("1=linear", "lon=linear" if fields else "2=linear"))
    assert rows.values.tolist() == [[1, 2], [3, 4]]
    assert rows.values.dtype == np.float64
    assert rows.columns == (("lat", "lon") if fields else ("column1", "column2"))
    out = append_columns(rows, {"LAT": [5, 6]}).decode().splitlines()
    assert out[0] == ("lat,lon,LAT_2" if fields else "column1,column2,LAT")
    assert out[1:] == ["1,2,5", "3,4,6"]


def claim(shape: str, descr: str = "'<f8'") -> bytes:
    """An npy file whose header promises `shape` and that holds 16 bytes."""
    header = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}}}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + bytes(16)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (npy(np.array([[{}, 1]], dtype=object), allow_pickle=True), "Python"),
        (claim("(1,)", "[('a', '|O')]"), "Python"), (npy(np.array([1.0, 2])), "(2,)"),
        (npy(np.zeros((2, 2, 2))), "shape"),
        (npy(np.zeros((0, 2))), "rows"), (npy(np.zeros((2, 0))), "rows"),
        (npy(np.array([["a", "b"]])), "column1 text"),
        (npy(np.array([[1j, 2]])), "column1 complex"), (npy(np.zeros((9, 2)))[:-1], "damaged"),
        (claim("(10000000, 9000)"), "damaged"),
        (claim("(4611686018427387904, 4)"), "damaged"),
        (claim("(1, 4611686018427387904)"), "damaged"),
        (claim("(20000001, 1)", "'|V0'"), "20000000"),
        (claim("(0, 4611686018427387904)"), "10000"), (claim("(-1, 2)"), "damaged"),
        (claim("(" * 900), "damaged"), (claim("(1, 2)" + " " * 20_000), "damaged"),
        (claim("(1, 2)", "'<q9'"), "damaged"), (b"\x93NUMPY\x09\x00" + bytes(99), "damaged"),
        (b"\x93NUM", "begin file"), (b"1,2\n", "begin file"),
    ],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:invalid escape")
def test_bad_npy(tmp_path: Path, content: bytes, message: str) -> None:
    refuse(write(tmp_path, content, "a.npy"), message)


def test_npy_columns_of_no_numbers(tmp_path: Path) -> None:
    array = np.array([(1, b"a", np.nan)], dtype=[("lat", "f4"), ("s", "S3"), ("x", "f8")])
    path = write(tmp_path, npy(array), "a.npy")
    for columns, about in (("lat=linear,s=linear", "column s"), ("lat=linear,x=linear", "x value")):
        with refused(path, *about.split(), kind=InputFileError):
            rows_of_file(path, columns=tuple(columns.split(",")))


# Parquet


def test_parquet_without_pyarrow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with refused("orbiflow[parquet]"):
        read_table(write(tmp_path, "PAR1", "a.parquet"))
    refuse(write(tmp_path, "1,2", "a.parquet"), "begin parquet")


def parquet(tmp_path: Path, columns: dict[str, Any], names: list[str] | None = None) -> Path:
    table = pyarrow.table(columns)
    path = tmp_path / "a.parquet"
    pyarrow.parquet.write_table(table.rename_columns(names) if names else table, path)
    return path


def test_parquet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = parquet(tmp_path, {"lat": [1.0, 3], "city": ["a", "b"], "lon.x": [2**60 + 1, 4]})
    table = read_table(path)
    assert [table.is_numeric(k) for k in range(3)] == [True, False, True]
    assert table.cells(1).tolist() == ["a", "b"]
    rows = rows_of_file(path, columns=("lat=linear", "lon.x=linear"))
    assert rows.values.tolist() == [[1, 2**60], [3, 4]]
    assert append_columns(rows, {"p": [5, 6]}).startswith(b"lat,lon.x,p\n1,1.152921505e+18,5\n")
    for columns, about in (("lat=linear,CITY=linear", "city a"), ("x=linear", "column x")):
        with refused(path, *about.split(), kind=InputFileError):
            rows_of_file(path, columns=tuple(columns.split(",")))
    monkeypatch.setattr(text, "MAX_ROWS", 1)
    refuse(path, "rows 1")


def test_times_are_no_numbers(tmp_path: Path) -> None:
    path = parquet(tmp_path, {"when": np.arange("2026-01-01", "2026-01-09", dtype="M8[D]")})
    with refused(path, "'when'", "times", kind=InputFileError):
        rows_of_file(path, columns=("when=linear",))


def test_parquet_nulls_and_repeated_names(tmp_path: Path) -> None:
    path = parquet(tmp_path, {"a": [1, None, 2], "b": [1.0, None, float("nan")]})
    with refused(path, 3, "row 2", kind=InputFileError):
        rows_of_file(path, columns=("a=linear", "b=linear"))
    path = parquet(tmp_path, {"a": np.zeros(0), "b": np.zeros(0)})
    with refused(path, "rows", kind=InputFileError):
        rows_of_file(path, columns=("a=linear", "b=linear"))
    path = parquet(tmp_path, {"a": [1], "b": [2], "c": [3]}, ["a", "a", "c"])
    refuse(path, "columns a")


@PROPERTY
@given(data=st.data())
def test_damaged_parquet(tmp_path: Path, data: st.DataObject) -> None:
    path = parquet(tmp_path, {"a": list(range(50)), "b": [0.5] * 50})
    content = bytearray(path.read_bytes())
    for i in data.draw(st.lists(st.integers(4, len(content) - 1), min_size=1, max_size=4)):
        content[i] ^= data.draw(st.integers(1, 255))
    path.write_bytes(content[: data.draw(st.integers(4, len(content)))])
    try:
        table = read_table(path)
        lengths = {len(table.cells(k)) for k in range(len(table.names))}
    except InputFileError:
        return
    assert len(lengths) == 1
