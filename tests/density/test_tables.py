"""Tables of text: what is read, what is refused, what is written."""

import csv
import io
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.density import read_table
from orbiflow.density.data import TableRows
from orbiflow.density.tables import append_columns, files, text, to_csv
from orbiflow.errors import InputFileError, OrbiflowError
from refusals import refused
from table_files import PROPERTY, refuse, rows_of_file, values_of, write


@pytest.mark.parametrize(
    ("content", "delimiter", "columns"),
    [
        ("lat,lon\r1,2\r3,4\r", ",", ("lat", "lon")),
        ("\ufeff1,2\n3,4\n", ",", ("column1", "column2")),
        ("# by hand\n\n lat , lon\n1, 2\n  # more\n3, 4\n\n", ",", ("lat", "lon")),
        ('"lat","lon"\n"1",2\n3,"4"\n', ",", ("lat", "lon")),
        ("lat lon\n 1   2\n3\t4  \n", " ", ("lat", "lon")),
        ('"lat" "lon"\n1 2\n3 4\n', " ", ("lat", "lon")),
        ("1\xa02\n3 4", " ", ("column1", "column2")),
        ('"row names" lat\n"1" 2\n3 "4"\n', " ", ("row names", "lat")),
        (",lon\n1,2\n3,4\n", ",", ("column1", "lon")),
        ("PAR1,b\n1,2\n3,4\n", ",", ("PAR1", "b")),
        ("1e0,+2.\n.3e1,4\n", ",", ("column1", "column2")),
        ("# made by me\n# lat, lon\n1 2\n3 4\n", " ", ("lat", "lon")),
        ("sep=;\nlat;lon\n1;2\n3;4\n", ";", ("lat", "lon")),
        ('"a;b";"c,d"\n1;2\n3;4\n', ";", ("a;b", "c,d")),
    ],
)
@pytest.mark.parametrize("name", ["a.csv", "a.TSV"])
def test_text(tmp_path, content: str, delimiter: str, columns: tuple[str, ...], name: str) -> None:
    table = read_table(write(tmp_path, content, name))
    assert table.text is not None
    assert values_of(table).tolist() == [[1, 2], [3, 4]]
    assert (table.names, table.text.delimiter) == (columns, delimiter)
    assert table.is_named == (columns != ("column1", "column2"))


def test_lines_and_words(tmp_path: Path) -> None:
    path = write(
        tmp_path, "# c\ncity,lat,code\n\nParis,\u221248.9,01\n# d\nRome,NA,1.0\nBonn,50,x\n"
    )
    table = read_table(path)
    assert [table.place(row) for row in range(3)] == ["line 4", "line 6", "line 7"]
    assert [table.is_numeric(k) for k in range(3)] == [False, True, True]
    np.testing.assert_array_equal(table.numbers(1), [-48.9, np.nan, 50])
    assert table.cells(2).tolist() == ["01", "1.0", "x"]  # as they are written
    with refused("line 7", "code", "x", kind=InputFileError):
        table.numbers(2)


finite = st.floats(-1e300, 1e300)
MISSING_CELLS = ["", "NA", "n/a", "NaN", "null", "-", "?", "#N/A", "VRB", "-999.25"]


@st.composite
def written_tables(draw: st.DrawFn) -> tuple[bytes, np.ndarray, list[str], list[int], str]:
    """A file, what it holds, its names, the lines of its rows, and the mark before decimals."""
    width = draw(st.integers(2, 4))
    mark = draw(st.sampled_from(",;\t| "))
    decimal = draw(st.sampled_from(".," if mark != "," else "."))
    cells = finite | st.sampled_from(MISSING_CELLS[mark == " " :])  # spaces have no empty cells
    rows = draw(st.lists(st.lists(cells, min_size=width, max_size=width), min_size=2, max_size=8))
    for row in rows:  # no row of missing cells alone, which may be blank
        row[0] = draw(finite)
    names = [f"x{k}, a" if k == 1 else f"x{k}" for k in range(width)]
    has_header = draw(st.booleans())
    out, lines = io.StringIO(), []
    end = draw(st.sampled_from(["\n", "\r\n", "\r"]))
    quoting: Any = draw(st.sampled_from([csv.QUOTE_MINIMAL, csv.QUOTE_ALL]))
    writer = csv.writer(out, delimiter=mark, lineterminator="\n", quoting=quoting)
    for k, row in enumerate([names, *rows] if has_header else rows):
        out.write("".join(draw(st.lists(st.sampled_from(["# 1, 2; 3\n", "\n"]), max_size=2))))
        lines += [out.getvalue().count("\n") + 1] * (k >= has_header)
        said = [repr(c).replace(".", decimal) if isinstance(c, float) else c for c in row]
        if not (has_header and k == 0):
            said = [f"-999{decimal}25" if c == "-999.25" else c for c in said]
        writer.writerow(said)
    encoding = draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]))
    values = np.array([[c if isinstance(c, float) else np.nan for c in row] for row in rows])
    content = out.getvalue().replace("\n", end).encode(encoding)
    return content, values, names if has_header else [], lines, decimal


@PROPERTY
@given(written=written_tables())
def test_any_table_that_is_written_is_read_back(tmp_path: Path, written) -> None:
    content, values, names, lines, decimal = written
    path = write(tmp_path, content)
    codes = ("VRB", f"-999{decimal}25")
    table = read_table(path, decimal=decimal, codes=codes)
    assert table.text is not None
    np.testing.assert_array_equal(values_of(table), values)
    assert table.text.lines.tolist() == lines
    assert list(table.names if table.is_named else []) == names
    # and what is written of it again, in its own lines with a column more
    roles = (None,) * len(table.names)
    rows = TableRows(table, np.arange(len(values)), values, table.names, roles)
    scored = append_columns(rows, {"p": values[:, 0]}).decode()
    again = read_table(write(tmp_path, scored, "b.csv"), decimal=decimal, codes=codes)
    np.testing.assert_array_equal(values_of(again)[:, :-1], values)
    np.testing.assert_allclose(again.numbers(len(values[0])), values[:, 0], rtol=1e-9)


def test_choice(tmp_path: Path) -> None:
    path = write(tmp_path, "lat,lon,depth,Depth,1e\n1,2,3,4,5\n")
    for wanted, values, names in (
        ("lon,lat", [2, 1], ("lon", "lat")),
        (" LON ,1", [2, 1], ("lon", "lat")),
        ("Depth=linear,depth=linear", [4, 3], ("Depth", "depth")),
        ("2,5", [2, 5], ("lon", "1e")),
    ):
        roles = tuple(w if "=" in w else f"{w}=angle" for w in wanted.split(","))
        rows = rows_of_file(path, columns=roles)
        assert (rows.values.tolist(), rows.columns) == ([values], names)
    named = write(tmp_path, "a,1\n5,6\n", "b.csv")
    assert rows_of_file(named, columns=("1=angle",)).values.tolist() == [[6]]  # before a number
    twice = write(tmp_path, "x,x,y\n1,2,3\n", "c.csv")
    assert rows_of_file(twice, columns=("2=angle", "y=angle")).values.tolist() == [[2, 3]]
    for file, columns, about in (
        (twice, "x=angle,y=angle", "columns 1 2 x"),
        (path, "lat=angle,alt=angle", "alt lat 1 5"),
        (path, "lat=angle,0=angle", "0"),
        (path, f"lat=angle,{'9' * 5000}=angle", "999"),
        (path, "lat=angle,=angle", "column"),
        (path, "lat=angle,1=angle", "twice"),
    ):
        with refused(*about.split()):
            rows_of_file(file, columns=tuple(columns.split(",")))


def test_first_line_of_words_and_numbers(tmp_path: Path) -> None:
    path = write(tmp_path, "city,2019,2020\nParis,1,2\nRome,3,4\n")
    refuse(path, "header 1")
    assert len(read_table(path, has_header=True).cells(0)) == 2
    assert read_table(path, has_header=False).cells(0).tolist() == ["city", "Paris", "Rome"]
    below = write(tmp_path, "id,2019\n1,2\n3,4\n", "b.csv")
    assert values_of(read_table(below)).tolist() == [[1, 2], [3, 4]]
    # decimal commas without a header are a row, whichever mark was meant
    commas = write(tmp_path, "1,5;2\n3;4\n", "c.csv")
    refuse(commas, "line 1 1,5 column1")
    assert values_of(read_table(commas, decimal=",")).tolist() == [[1.5, 2], [3, 4]]
    # R leaves out the name of the rows' names
    r = read_table(write(tmp_path, '"x" "y"\n"1" 5 6\n"2" 7 8\n', "d.txt"))
    assert (r.names, r.numbers(1).tolist()) == (("column1", "x", "y"), [5, 7])
    assert values_of(read_table(write(tmp_path, "x\n1\n2\n"))).tolist() == [[1], [2]]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "file empty"),
        ("\n \n", "comments blank"),
        ("# a\nlat,lon\n", "follows 2"),
        ("lat,lon\n1,2\n3,x4\n", "3 lon x4"),
        ("1,2\n3,4\n\n5,1_000\n", "4 column2 1_000"),
        ("a,b\n" + "1,2\n" * 200 + "1," + "z" * 99, "202 b zzz"),
        ("a;b\n0.5;2\n1,5;2\n", "line 3 a 1,5"),
        ("a,b\n1,2\n3\n", "line 3 1 2"),
        ("a,b\n" + "1,2\n" * 200 + "1,2,3\n", "202 3 1 2"),
        ("a,b\n" + "1,2\n" * 200 + "1\n1,2\n" + "7\n" * 9, "202 1 204 3"),
        ("a b\n1 2\n3 4 5\n", "line 3 3 2"),
        ('a,b\n1,"2\n', "quotation 2"),
        ('a b\n"1 2\n3" 4\n', "quotation 2"),
        ('a,b\n1,"2"\n3,\t"4,5"\n', "line 3 3 2"),
        (b"a,b\n" + b"1,2\n" * 9000 + b"\xe9,4\n", "9002 UTF-8"),
        (b"a,b\n" + b"1,2\n" * 9000 + b"1,2\x003\n", "9002 null"),
        ("a,b\n1,2\n".encode("utf-16")[:-1], "UTF-16"),
        (bytes(range(256)) * 9, "binary data"),
        (b"\x1f\x8b\x08\xff", "1 UTF-8"),
        ("sep=\u00a6\n1\u00a62\n", "line 1"),
        ("1" * 2**21, "longer 1"),
        ("," * 10_001, "10000"),
    ],
)
def test_bad_text(tmp_path: Path, content: str | bytes, message: str) -> None:
    refuse(write(tmp_path, content), message)


def test_decimal_commas_are_said_and_points_are_none_then(tmp_path: Path) -> None:
    path = write(tmp_path, "a;b\n1,5;2\n1.500;3\n2,5;4\n")
    refuse(path, "line 3 a 1.500", decimal=",")
    refuse(path, "line 2 a 1,5", decimal=".")
    refuse(write(tmp_path, "sep=,\na,b\n1,2\n"), "line 1", decimal=",")


def test_missing_and_infinite_values(tmp_path: Path) -> None:
    for content, about in (
        ("a,b\n1,2\n,2\nNA,nan\n4,5\n", "3 NaN a"),
        ("a,b\n1,2\n3,-1e999\n", "line 3 b infinite"),
        ("a,b\n1,\n3,\n", "b no value"),
    ):
        path = write(tmp_path, content)
        with refused(path, *about.split()):
            rows_of_file(path, columns=("a=angle", "b=angle"), drop_missing="no value" in about)


def test_no_file_or_one_that_is_too_large(tmp_path: Path) -> None:
    refuse(tmp_path / "a.csv", "file")
    refuse(tmp_path, "folder")
    refuse(tmp_path / "a\0.csv", "read")
    path = write(tmp_path, "1,2")
    refuse(path / "b.csv", "read")
    with path.open("r+b") as file:
        file.truncate(2**31 + 1)  # sparse
    refuse(path, "2.0 GiB 2")


def test_limits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path, "a,b\n1,2\n3,4\n5,6\n")
    monkeypatch.setattr(text, "MAX_ROWS", 3)
    assert len(read_table(path).cells(0)) == 3
    monkeypatch.setattr(text, "MAX_ROWS", 2)
    refuse(path, "rows 2")
    monkeypatch.setattr(files, "MAX_BYTES", 5)
    refuse(path, "read")


def test_memory_is_bounded(tmp_path: Path) -> None:
    path = write(tmp_path, "lat,lon\n" + "12.3456,65.4321\n" * 30_000)
    size = path.stat().st_size
    assert len(read_table(write(tmp_path, "a\n1\n", "b.csv")).names) == 1  # pandas is imported
    tracemalloc.start()
    table = read_table(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert values_of(table).shape == (30_000, 2)
    assert peak < 5 * size + 2**20


PIECES = [
    *'1,;\t "#\n\rx-e_é\0', "2.5", "NA", "sep=", "\x0b", "\xa0", "\u2212", "\ufeff", "\x1c",
    "1,2\n", "1 2\n", '"1";', "\\",
]  # fmt: skip
texts = st.lists(st.sampled_from(PIECES), max_size=40).map("".join)


@PROPERTY
@given(content=st.binary(max_size=60) | texts | texts.map(lambda own: own.encode("utf-16")))
@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("name", ["a.csv", "a.npy", "a"])
def test_any_bytes_are_read_or_refused(
    tmp_path: Path, content: bytes | str, name: str, decimal: str
) -> None:
    path = write(tmp_path, content, name)
    try:
        table = read_table(path, decimal=decimal)
    except OrbiflowError:
        return
    assert table.text is not None
    for column in range(len(table.names)):
        cells = table.cells(column)
        assert len(cells) == len(table.text.lines) > 0
        if table.is_numeric(column):
            try:
                assert len(table.numbers(column)) == len(cells)
            except InputFileError:
                continue
            rows = rows_of_file_or_none(path, column, decimal)
            assert rows is None or append_columns(rows, {"p": np.zeros(len(rows.values))})


def rows_of_file_or_none(path: Path, column: int, decimal: str):
    try:
        return rows_of_file(path, columns=(f"{column + 1}=linear",), decimal=decimal)
    except OrbiflowError:
        return None


def rows_of_two(path: Path):
    return rows_of_file(path, columns=("1=linear", "2=linear"))


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("# c\n\nx,y\n1,2\n# d\n3,4\n", "# c\nx,y,p\n1,2,0.3333333333\n# d\n3,4,-inf\n"),
        ("\ufeffx;y\r\n1;2\r\n3;4", "x;y;p\n1;2;0.3333333333\n3;4;-inf\n"),
        ("1 2\n3  4\n", "1 2 0.3333333333\n3  4 -inf\n"),
        ("x,P\n1,2\n3,4\n", "x,P,p_2\n1,2,0.3333333333\n3,4,-inf\n"),
        ('x,y,"é, t"\n1,2,"a,b"\n3,4,c\n', 'x,y,"é, t",p\n1,2,"a,b",0.3333333333\n3,4,c,-inf\n'),
        ("# x, y\n1 2\n3 4\n", "# x, y p\n1 2 0.3333333333\n3 4 -inf\n"),
    ],
)
def test_append_column(tmp_path: Path, content: str, expected: str) -> None:
    rows = rows_of_two(write(tmp_path, content))
    assert append_columns(rows, {"p": [1 / 3, -np.inf]}).decode() == expected


def test_rows_that_are_left_out_get_no_value(tmp_path: Path) -> None:
    for content, expected in (
        ("x,y\n1,2\n,4\n5,6\n", "x,y,p\n1,2,7\n,4,\n5,6,8\n"),
        ("x y\n1 2\nNA 4\n5 6\n", "x y p\n1 2 7\nNA 4 nan\n5 6 8\n"),
    ):
        path = write(tmp_path, content)
        rows = rows_of_file(path, columns=("x=linear", "y=linear"), drop_missing=True)
        assert append_columns(rows, {"p": [7, 8]}).decode() == expected


@pytest.mark.parametrize("changed", ["x,y\n1,2\n", "x,y\n1,2\n3,4\n5,6\n", "\nx,y\n1,2\n3,4\n"])
def test_append_column_to_a_changed_file(tmp_path: Path, changed: str) -> None:
    path = write(tmp_path, "x,y\n1,2\n3,4\n")
    rows = rows_of_two(path)
    write(tmp_path, changed)
    with refused("changed", "after", kind=InputFileError):
        append_columns(rows, {"p": [1, 2]})


def test_to_csv_quotes_names() -> None:
    names = ["a,b", 'c"d', "#e", "f\n g", "é"]
    header = to_csv(names, np.zeros((0, 5))).decode()
    assert header == '"a,b","c""d","#e",f g,é\n'
    with refused("shape", kind=ValueError):
        to_csv(["a"], [[1, 2]])
