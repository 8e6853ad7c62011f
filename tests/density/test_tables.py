"""Tables of numbers: what is read from each kind of file, what is refused, what is written."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.density import read_table
from orbiflow.density.tables import append_columns, files, text, to_csv
from orbiflow.errors import InputFileError, OrbiflowError
from refusals import refused
from table_files import PROPERTY, refuse, write


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
        "skipped 2 comment lines",
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
    refuse(path, "columns 1 2 x", ["x", "y"])
    refuse(path, "columns 1 2 x", width=3)


def test_a_name_wins_over_a_number(tmp_path: Path) -> None:
    path = write(tmp_path, "a,1\n5,6\n")
    assert read_table(path, columns=["1"], width=1).values.tolist() == [[6]]


def test_first_line_of_words_and_numbers(tmp_path: Path) -> None:
    path = write(tmp_path, "city,2019,2020\nParis,1,2\nRome,3,4\n")
    assert len(read_table(path, columns=["2019", "2020"], width=2).values) == 2
    refuse(path, "header 1")
    refuse(path, "header 1", ["2", "3"])
    below = write(tmp_path, "id,2019\n1,2\n3,4\n", "b.csv")
    assert read_table(below, columns=None, width=2).values.tolist() == [[1, 2], [3, 4]]


def test_single_column(tmp_path: Path) -> None:
    table = read_table(write(tmp_path, "x\n1\n2\n"), columns=None, width=1)
    assert table.values.tolist() == [[1], [2]]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "file empty"),
        ("\n \n", "comments blank"),
        ("# a\n# b\n", "comments blank"),
        ("\ufeff", "comments blank"),
        ("# a\nlat,lon\n", "follows 2"),
        ("lat,lon\n1,2\n3,x4\n", "3 lon x4"),
        ("1,2\n3,4\n\n5,1_000\n", "4 column2 1_000"),
        ("a,b\n" + "1,2\n" * 200 + "1," + "z" * 99, "202 b zzz"),
        ("a;b\n0.5;2\n1,5;2\n", "1,5"),
        ("a,b,c\n1,2,x\n1,2,3\n1,y,x", "column 4 b y"),
        ("a,b\n1,2\n,2\nNA,nan\n4,inf\n", "4 NaN 3"),
        ("1,2\n3,-1e999\n", "1 NaN 2 column2"),
        ("1,\n3,4\n", "1 NaN"),
        ("a,b\n1,2\n3\n", "line 3 1 2"),
        ("a,b\n" + "1,2\n" * 200 + "1,2,3\n", "202 3 1 2"),
        ("a,b\n1,x\ny,2\n3,4\n", "column 2 b x"),
        ("a,b\n1\n2\n" + "3,4\n" * 9, "line 2 1 3"),
        ("a,b\n" + "1,2\n" * 200 + "1\n1,2\n" + "7\n" * 9, "202 1 204 3"),
        ('a,b\n1,"2\n', "quotation 2"),
        ('a,b\n"1"x,2\n', "quotation 2"),
        ("a,b,c\n1,2,3\n", "columns 2 3 b"),
        ("a,b\nx,y\n", "column 2 x"),
        ("a,b,c\nx,y,z\n", "0"),
        (b"a,b\n1,2\n\xe9,4\n", "3 UTF-8"),
        (b"a,b\n" + b"1,2\n" * 9000 + b"\xe9,4\n", "9002 UTF-8"),
        ("a,b\n1,2\n".encode("utf-16-le"), "binary data"),
        ("a,b\n1,2\n".encode("utf-16")[:-1], "UTF-16"),
        (bytes(range(256)) * 9, "binary data"),
        (b"\x1f\x8b\x08\xff", "1 UTF-8"),
        ("1" * 2**21, "longer 1"),
        ("," * 10_001, "10000"),
    ],
)
def test_bad_text(tmp_path: Path, content: str | bytes, message: str) -> None:
    refuse(write(tmp_path, content), message)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (["lat", "alt"], "alt lat 1 3"),
        (["lat", "4"], "column 4"),
        (["lat", "0"], "column 0"),
        (["lat", "9" * 5000], "999"),
        (["lat", "²"], "column"),
        (["lat", ""], "column"),
        (["lat", "1"], "names column"),
        (["lat"], "columns 2 1"),
        ([], "columns 0"),
        (["lat", "city"], "2 city Paris"),
    ],
)
def test_bad_choice(tmp_path: Path, columns: list[str], message: str) -> None:
    refuse(write(tmp_path, "lat,lon,city\n48.9,2.4,Paris\n"), message, columns)


def test_no_file(tmp_path: Path) -> None:
    refuse(tmp_path / "a.csv", "file")
    refuse(tmp_path, "folder")
    refuse(tmp_path / "a\0.csv", "read")
    refuse(write(tmp_path, "1,2") / "b.csv", "read")


def test_limits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path, "1,2\n3,4\n5,6\n")
    with refused("rows", "2", kind=InputFileError):
        read_table(path, columns=None, width=2, max_rows=2)
    assert len(read_table(path, columns=None, width=2, max_rows=3).values) == 3
    monkeypatch.setattr(files, "MAX_BYTES", 5)
    refuse(path, "read")


def test_size_is_checked_before_reading(tmp_path: Path) -> None:
    path = write(tmp_path, "1,2\n")
    with path.open("r+b") as file:
        file.truncate(2**31 + 1)  # sparse
    refuse(path, "2.0 GiB 2")


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
    refuse(path, "1002 c x", width=3)


def test_memory_is_bounded(tmp_path: Path) -> None:
    path = write(tmp_path, "lat,lon,note\n" + "12.3456,65.4321,a long text\n" * 40_000)
    tracemalloc.start()
    table = read_table(path, columns=["lat", "lon"], width=2)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert table.values.shape == (40_000, 2)
    assert peak < table.values.nbytes + table.lines.nbytes + 8 * 2**20


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
    assert append_columns(table, path, {"p": np.zeros(len(table.lines))})


finite = st.floats(-1e300, 1e300)


@PROPERTY
@given(rows=st.lists(st.tuples(finite, finite), min_size=1), mark=st.sampled_from(",;\t "))
def test_no_row_is_lost_without_a_header(
    tmp_path: Path, rows: list[tuple[float, float]], mark: str
) -> None:
    path = write(tmp_path, "".join(f"{x!r}{mark}{y!r}\n" for x, y in rows))
    table = read_table(path, columns=None, width=2)
    assert table.values.tolist() == [list(row) for row in rows]
    scored = write(tmp_path, append_columns(table, path, {"p": table.values[:, 0]}), "b.csv")
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
    assert append_columns(table, path, {"p": [1 / 3, -np.inf]}).decode() == expected


@pytest.mark.parametrize("changed", ["x,y\n1,2\n", "x,y\n1,2\n3,4\n5,6\n", "\nx,y\n1,2\n3,4\n"])
def test_append_column_to_a_changed_file(tmp_path: Path, changed: str) -> None:
    path = write(tmp_path, "x,y\n1,2\n3,4\n")
    table = read_table(path, columns=None, width=2)
    with refused("shape", "2", kind=ValueError):
        append_columns(table, path, {"p": [1, 2, 3]})
    write(tmp_path, changed)
    with refused("changed", "after", kind=InputFileError):
        append_columns(table, path, {"p": [1, 2]})


def test_to_csv_quotes_names() -> None:
    names = ["a,b", 'c"d', "#e", "f\n g", "é"]
    header = to_csv(names, np.zeros((0, 5))).decode()
    assert header == '"a,b","c""d","#e",f g,é\n'
    with refused("shape", kind=ValueError):
        to_csv(["a"], [[1, 2]])
