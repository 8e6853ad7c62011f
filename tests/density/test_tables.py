"""Tables of numbers: what is read from each kind of file, what is refused, what is written."""

import io
import sys
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from orbiflow.density.tables import append_column, files, read_table, text, to_csv
from orbiflow.errors import InputFileError, OrbiflowError

PROPERTY = settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def write(tmp_path: Path, content: str | bytes, name: str = "a.csv") -> Path:
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def refuse(path: Path, match: str, columns: list[str] | None = None, width: int | None = 2) -> None:
    with pytest.raises(InputFileError, match=match) as caught:
        read_table(path, columns=columns, width=width)
    assert str(caught.value).startswith(f"{path}: ")
    assert len(str(caught.value)) < 2 * len(str(path)) + 400


@pytest.mark.parametrize(
    ("content", "delimiter", "columns"),
    [
        ("lat,lon\n1,2\n3,4\n", ",", ("lat", "lon")),
        ("lat,lon\r\n1,2\r\n3,4", ",", ("lat", "lon")),
        ("lat,lon\r1,2\r3,4\r", ",", ("lat", "lon")),
        ("\ufefflat,lon\n1,2\n3,4\n", ",", ("lat", "lon")),
        ("\ufeff1,2\n3,4\n", ",", ("column1", "column2")),
        ("# by hand\n\n lat , lon\n1, 2\n  # more\n3, 4\n\n", ",", ("lat", "lon")),
        ('"lat","lon"\n"1",2\n3,"4"\n', ",", ("lat", "lon")),
        ("lat\tlon\n1\t2\n3\t4\n", "\t", ("lat", "lon")),
        ("lat;lon\n1;2\n3;4\n", ";", ("lat", "lon")),
        ("lat lon\n 1   2\n3\t4  \n", " ", ("lat", "lon")),
        ('"lat" "lon"\n1 2\n3 4\n', " ", ("lat", "lon")),
        ("1 2\n3 4", " ", ("column1", "column2")),
        (",lon\n1,2\n3,4\n", ",", ("column1", "lon")),
        ("PAR1,b\n1,2\n3,4\n", ",", ("PAR1", "b")),
        ("1e0,+2.\n.3e1,4\n", ",", ("column1", "column2")),
    ],
)
@pytest.mark.parametrize("name", ["a.csv", "a.txt", "a.TSV"])
def test_text(
    tmp_path: Path, content: str, delimiter: str, columns: tuple[str, ...], name: str
) -> None:
    table = read_table(write(tmp_path, content, name), columns=None, width=2)
    assert table.values.tolist() == [[1, 2], [3, 4]]
    assert table.values.dtype == np.float64
    assert (table.columns, table.delimiter) == (columns, delimiter)
    assert (table.header is None) == (columns == ("column1", "column2"))


def test_lines_and_notes(tmp_path: Path) -> None:
    path = write(tmp_path, "# c\ncity,lat,lon\n\nParis,48.9,2.4\n# d\nRome,41.9,12.5\n")
    table = read_table(path, columns=None, width=2)
    assert table.lines.tolist() == [4, 6]
    assert table.header == ("city", "lat", "lon")
    assert table.notes == (
        "took the columns of numbers: lat, lon",
        "took line 2 as the header: city, lat, lon",
        "passed over 2 comment lines",
    )


@pytest.mark.parametrize(
    ("wanted", "values", "names"),
    [
        (["lon", "lat"], [2, 1], ("lon", "lat")),
        ([" LON ", "1"], [2, 1], ("lon", "lat")),
        (["Depth", "depth"], [4, 3], ("Depth", "depth")),
        (["2", "5"], [2, 5], ("lon", "1e")),
    ],
)
def test_choice(tmp_path: Path, wanted: list[str], values: list, names: tuple[str, ...]) -> None:
    path = write(tmp_path, "lat,lon,depth,Depth,1e\n1,2,3,4,5\n")
    table = read_table(path, columns=wanted, width=2)
    assert table.values.tolist() == [values]
    assert table.columns == names


def test_repeated_names_can_be_told_apart_by_number(tmp_path: Path) -> None:
    path = write(tmp_path, "x,x,y\n1,2,3\n")
    assert read_table(path, columns=["2", "y"], width=2).values.tolist() == [[2, 3]]
    refuse(path, "columns 1 and 2 are all called 'x'", ["x", "y"])
    refuse(path, "columns 1 and 2 are all called 'x'", width=3)


def test_a_name_wins_over_a_number(tmp_path: Path) -> None:
    path = write(tmp_path, "a,1\n5,6\n")
    assert read_table(path, columns=["1"], width=1).values.tolist() == [[6]]


def test_first_line_of_words_and_numbers(tmp_path: Path) -> None:
    path = write(tmp_path, "city,2019,2020\nParis,1,2\nRome,3,4\n")
    assert len(read_table(path, columns=["2019", "2020"], width=2).values) == 2
    refuse(path, "line 1 may be a header or a row")
    refuse(path, "line 1 may be a header or a row", ["2", "3"])
    below = write(tmp_path, "id,2019\n1,2\n3,4\n", "b.csv")
    assert read_table(below, columns=None, width=2).values.tolist() == [[1, 2], [3, 4]]


def test_single_column(tmp_path: Path) -> None:
    table = read_table(write(tmp_path, "x\n1\n2\n"), columns=None, width=1)
    assert table.values.tolist() == [[1], [2]]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "the file is empty"),
        ("\n \n", "only comments and blank lines"),
        ("# a\n# b\n", "only comments and blank lines"),
        ("\ufeff", "only comments and blank lines"),
        ("# a\nlat,lon\n", "line 2 is a header and no row follows"),
        ("lat,lon\n1,2\n3,x4\n", "line 3: column 'lon': 'x4' is not a number"),
        ("1,2\n3,4\n\n5,1_000\n", "line 4: column 'column2': '1_000' is not"),
        ("a,b\n" + "1,2\n" * 200 + "1," + "z" * 99, "line 202: column 'b': 'z{37}...'"),
        ("a;b\n1,5;2\n", "column 'a': '1,5' is not a number; write decimal points, not commas"),
        ("a,b,c\n1,2,x\n1,2,3\n1,y,x", "line 4: column 'b': 'y' is not"),
        ("a,b\n1,2\n,2\nNA,nan\n4,inf\n", "4 cells empty, NaN or infinite, .* line 3, column 'a'"),
        ("1,2\n3,-1e999\n", "1 cell empty, NaN or infinite, .* line 2, column 'column2'"),
        ("1,\n3,4\n", "1 cell empty, NaN or infinite, .* line 1,"),
        ("a,b\n1,2\n3\n", "line 3 has 1 cell and line 1 has 2"),
        ("a,b\n" + "1,2\n" * 200 + "1,2,3\n", "line 202 has 3 cells and line 1 has 2"),
        ('a,b\n1,"2\n', "line 2: .* quotation mark"),
        ('a,b\n"1"x,2\n', "line 2: .* quotation mark"),
        ("a,b,c\n1,2,3\n", r"2 columns .* it has 3 \(its columns: a, b, c\).* --columns"),
        ("a,b\nx,y\n", "line 2: column 'a': 'x' is not"),
        ("a,b,c\nx,y,z\n", "it has 0"),
        (b"a,b\n1,2\n\xe9,4\n", "line 3: not UTF-8"),
        (b"a,b\n" + b"1,2\n" * 9000 + b"\xe9,4\n", "line 9002: not UTF-8"),
        ("a,b\n1,2\n".encode("utf-16"), "binary data"),
        (bytes(range(256)) * 9, "binary data"),
        (b"\x1f\x8b\x08\xff", "line 1: not UTF-8"),
        ("1" * 2**21, "line 1 is longer than"),
        ("," * 10_001, "more than 10000 columns"),
    ],
)
def test_bad_text(tmp_path: Path, content: str | bytes, message: str) -> None:
    refuse(write(tmp_path, content), message)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (["lat", "alt"], r"no column 'alt'; it has lat, lon, city: .* from 1 to 3"),
        (["lat", "4"], "no column '4'"),
        (["lat", "0"], "no column '0'"),
        (["lat", "9" * 5000], "no column '9{37}...'"),
        (["lat", "²"], "no column"),
        (["lat", ""], "no column ''"),
        (["lat", "1"], "names a column twice"),
        (["lat"], "2 columns of numbers must be taken and --columns names 1"),
        ([], "--columns names 0"),
        (["lat", "city"], "line 2: column 'city': 'Paris' is not"),
    ],
)
def test_bad_choice(tmp_path: Path, columns: list[str], message: str) -> None:
    refuse(write(tmp_path, "lat,lon,city\n48.9,2.4,Paris\n"), message, columns)


def test_no_file(tmp_path: Path) -> None:
    refuse(tmp_path / "a.csv", "no such file")
    refuse(tmp_path, "is a folder")
    refuse(tmp_path / "a\0.csv", "cannot be read")
    refuse(write(tmp_path, "1,2") / "b.csv", "cannot be read")


def test_limits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path, "1,2\n3,4\n5,6\n")
    with pytest.raises(InputFileError, match="more than 2 rows"):
        read_table(path, columns=None, width=2, max_rows=2)
    assert len(read_table(path, columns=None, width=2, max_rows=3).values) == 3
    monkeypatch.setattr(files, "MAX_BYTES", 5)
    refuse(path, "at most .* are read")


def test_size_is_checked_before_reading(tmp_path: Path) -> None:
    path = write(tmp_path, "1,2\n")
    with path.open("r+b") as file:
        file.truncate(2**31 + 1)  # sparse
    refuse(path, "2.0 GiB, at most 2")


def test_blocks_give_what_one_pass_gives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    values = np.random.default_rng(0).normal(size=(1000, 3))
    path = write(tmp_path, to_csv("abc", values))
    whole = read_table(path, columns=None, width=3)
    np.testing.assert_allclose(whole.values, values, rtol=1e-9)
    monkeypatch.setattr(text, "BLOCK", 7)
    in_blocks = read_table(path, columns=None, width=3)
    np.testing.assert_array_equal(in_blocks.values, whole.values)
    np.testing.assert_array_equal(in_blocks.lines, np.arange(2, 1002))
    path.write_bytes(path.read_bytes() + b"1,2,x\n")
    refuse(path, "line 1002: column 'c': 'x'", width=3)


def test_memory_is_bounded(tmp_path: Path) -> None:
    path = write(tmp_path, "lat,lon,note\n" + "12.3456,65.4321,a long text\n" * 100_000)
    tracemalloc.start()
    table = read_table(path, columns=["lat", "lon"], width=2)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert table.values.shape == (100_000, 2)
    assert peak < table.values.nbytes + table.lines.nbytes + 24 * 2**20


@PROPERTY
@given(content=st.binary(max_size=60) | st.text('1.e+-,;\t "#\nxnaé_', max_size=60))
@pytest.mark.parametrize("name", ["a.csv", "a.npy", "a"])
def test_any_bytes_are_read_or_refused(tmp_path: Path, content: bytes | str, name: str) -> None:
    path = write(tmp_path, content, name)
    try:
        table = read_table(path, columns=None, width=None)
    except OrbiflowError:  # "PAR1" without pyarrow is no InputFileError
        return
    assert np.isfinite(table.values).all()
    assert table.values.shape == (len(table.lines), len(table.columns))
    assert append_column(table, path, "p", np.zeros(len(table.lines)))


finite = st.floats(-1e300, 1e300)


@PROPERTY
@given(rows=st.lists(st.tuples(finite, finite), min_size=1), mark=st.sampled_from(",;\t "))
def test_no_row_is_lost_without_a_header(
    tmp_path: Path, rows: list[tuple[float, float]], mark: str
) -> None:
    path = write(tmp_path, "".join(f"{x!r}{mark}{y!r}\n" for x, y in rows))
    table = read_table(path, columns=None, width=2)
    assert table.values.tolist() == [list(row) for row in rows]
    scored = write(tmp_path, append_column(table, path, "p", table.values[:, 0]), "b.csv")
    again = read_table(scored, columns=["1", "2", "3"], width=3)
    np.testing.assert_array_equal(again.values[:, :2], table.values)
    np.testing.assert_allclose(again.values[:, 2], table.values[:, 0], rtol=1e-9)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("# c\n\nx,y\n1,2\n# d\n3,4\n", "# c\nx,y,p\n1,2,0.3333333333\n# d\n3,4,-inf\n"),
        ("\ufeffx;y\r\n1;2\r\n3;4", "x;y;p\n1;2;0.3333333333\n3;4;-inf\n"),
        ("1 2\n3  4\n", "1 2 0.3333333333\n3  4 -inf\n"),
        ("x,P\n1,2\n3,4\n", "x,P,p_2\n1,2,0.3333333333\n3,4,-inf\n"),
        ('x,y,"é, t"\n1,2,"a,b"\n3,4,c\n', 'x,y,"é, t",p\n1,2,"a,b",0.3333333333\n3,4,c,-inf\n'),
    ],
)
def test_append_column(tmp_path: Path, content: str, expected: str) -> None:
    path = write(tmp_path, content)
    table = read_table(path, columns=["1", "2"], width=2)
    assert append_column(table, path, "p", [1 / 3, -np.inf]).decode() == expected


@pytest.mark.parametrize("changed", ["x,y\n1,2\n", "x,y\n1,2\n3,4\n5,6\n", "\nx,y\n1,2\n3,4\n"])
def test_append_column_to_a_changed_file(tmp_path: Path, changed: str) -> None:
    path = write(tmp_path, "x,y\n1,2\n3,4\n")
    table = read_table(path, columns=None, width=2)
    with pytest.raises(ValueError, match=r"shape \(2,\)"):
        append_column(table, path, "p", [1, 2, 3])
    write(tmp_path, changed)
    with pytest.raises(InputFileError, match="changed after it was read"):
        append_column(table, path, "p", [1, 2])


def test_to_csv_quotes_names() -> None:
    names = ["a,b", 'c"d', "#e", "f\n g", "é"]
    header = to_csv(names, np.zeros((0, 5))).decode()
    assert header == '"a,b","c""d","#e",f g,é\n'
    with pytest.raises(ValueError, match="shape"):
        to_csv(["a"], [[1, 2]])


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
@pytest.mark.parametrize("name", ["a.npy", "a"])
def test_npy(tmp_path: Path, array: np.ndarray, name: str) -> None:
    path = write(tmp_path, npy(array), name)
    table = read_table(path, columns=None, width=2)
    assert table.values.tolist() == [[1, 2], [3, 4]]
    assert table.values.dtype == np.float64
    assert table.columns == (("lat", "lon") if array.dtype.names else ("column1", "column2"))
    assert table.lines.tolist() == [1, 2]
    assert (table.header, table.delimiter) == (None, None)
    out = append_column(table, path, "LAT", [5, 6]).decode().splitlines()
    assert out[0] == ("lat,lon,LAT_2" if array.dtype.names else "column1,column2,LAT")
    assert out[1:] == ["1,2,5", "3,4,6"]


def test_npy_choice(tmp_path: Path) -> None:
    path = write(tmp_path, npy(np.array([[1, 2, 3]])), "a.npy")
    assert read_table(path, columns=["3", "column1"], width=2).values.tolist() == [[3, 1]]
    refuse(path, "2 columns of numbers must be taken and it has 3")


def claim(shape: str, descr: str = "'<f8'") -> bytes:
    """An npy file whose header promises `shape` and that holds 16 bytes."""
    header = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}}}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + bytes(16)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (npy(np.array([[{}, 1]], dtype=object), allow_pickle=True), "Python objects"),
        (claim("(1,)", "[('a', '|O')]"), "Python objects"),
        (npy(np.array([1.0, 2])), r"shape '\(2,\)'"),
        (npy(np.zeros((2, 2, 2))), "shape"),
        (npy(np.array(1.0)), "shape"),
        (npy(np.zeros((0, 2))), "no rows"),
        (npy(np.zeros((2, 0))), "it has 0"),
        (npy(np.array([["a", "b"]])), "column 'column1' holds '<U1', not numbers"),
        (npy(np.array([[1j, 2]])), "column 'column1' holds 'complex128'"),
        (npy(np.array([[1j, 2, 3]])), "it has 0"),
        (npy(np.array([[1, 2], [np.nan, np.inf]])), "2 cells empty, .* row 2, column 'column1'"),
        (npy(np.zeros((9, 2)))[:-1], "promises 144 bytes of numbers and 143 follow"),
        (claim("(10000000, 9000)"), "promises 720000000000 bytes"),
        (claim("(4611686018427387904, 4)"), "promises 147573952589676412928 bytes"),
        (claim("(1, 4611686018427387904)"), "promises"),
        (claim("(20000001, 1)", "'|V0'"), "more than 20000000 rows"),
        (claim("(0, 4611686018427387904)"), "more than 10000 columns"),
        (claim("(-1, 2)"), "shape"),
        (claim("(" * 900), "damaged"),
        (claim("(1, 2)" + " " * 20_000), "damaged"),
        (claim("(1, 2)", "'<q9'"), "damaged"),
        (b"\x93NUMPY\x09\x00" + bytes(99), "damaged"),
        (b"\x93NUM", "does not begin as a .npy file"),
        (b"1,2\n", "does not begin as a .npy file"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid escape")
def test_bad_npy(tmp_path: Path, content: bytes, message: str) -> None:
    refuse(write(tmp_path, content, "a.npy"), message)


def test_npy_column_that_is_text(tmp_path: Path) -> None:
    array = np.array([(1, b"a")], dtype=[("lat", "f4"), ("s", "S3")])
    refuse(write(tmp_path, npy(array), "a.npy"), "column 's' holds", ["lat", "s"])


# Parquet


def test_parquet_without_pyarrow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(OrbiflowError, match=r"pip install 'orbiflow\[parquet\]'"):
        read_table(write(tmp_path, "PAR1", "a.parquet"), columns=None, width=2)
    refuse(write(tmp_path, "1,2", "a.parquet"), "does not begin as a .parquet file")


def parquet(tmp_path: Path, columns: dict[str, Any], names: list[str] | None = None) -> Path:
    arrow = pytest.importorskip("pyarrow")
    table = arrow.table(columns)
    path = tmp_path / "a.parquet"
    pytest.importorskip("pyarrow.parquet").write_table(
        table.rename_columns(names) if names else table, path
    )
    return path


def test_parquet(tmp_path: Path) -> None:
    path = parquet(tmp_path, {"lat": [1.0, 3], "city": ["a", "b"], "lon.x": [2**60 + 1, 4]})
    table = read_table(path, columns=None, width=2)
    assert table.values.tolist() == [[1, 2**60], [3, 4]]
    assert table.columns == ("lat", "lon.x")
    assert table.lines.tolist() == [1, 2]
    assert append_column(table, path, "p", [5, 6]).startswith(b"lat,lon.x,p\n1,1.152921505e+18,5\n")
    refuse(path, "column 'city' holds 'string', not numbers", ["lat", "CITY"])
    refuse(path, "no column 'x'", ["x"])
    with pytest.raises(InputFileError, match="more than 1 rows"):
        read_table(path, columns=None, width=2, max_rows=1)


def test_parquet_nulls_and_repeated_names(tmp_path: Path) -> None:
    refuse(
        parquet(tmp_path, {"a": [1, None, 2], "b": [1.0, None, float("nan")]}), "3 cells .* row 2"
    )
    refuse(parquet(tmp_path, {"a": np.zeros(0), "b": np.zeros(0)}), "no rows")
    path = parquet(tmp_path, {"a": [1], "b": [2], "c": [3]}, ["a", "a", "c"])
    refuse(path, "columns 1 and 2 are all called 'a'", ["1", "c"])


@PROPERTY
@given(data=st.data())
def test_damaged_parquet(tmp_path: Path, data: st.DataObject) -> None:
    path = parquet(tmp_path, {"a": list(range(50)), "b": [0.5] * 50})
    content = bytearray(path.read_bytes())
    for i in data.draw(st.lists(st.integers(4, len(content) - 1), min_size=1, max_size=4)):
        content[i] ^= data.draw(st.integers(1, 255))
    path.write_bytes(content[: data.draw(st.integers(4, len(content)))])
    try:
        table = read_table(path, columns=None, width=2, max_rows=1000)
    except InputFileError:
        return
    assert len(table.values) == len(table.lines)
