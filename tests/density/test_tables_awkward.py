"""Tables as people have them: decimal commas, no header, missing values, row numbers."""

from pathlib import Path

import numpy as np
import pytest

from orbiflow.density import read_table
from orbiflow.density.data import is_identifier
from orbiflow.density.tables import append_columns
from orbiflow.errors import InputFileError
from refusals import refused
from table_files import write


@pytest.mark.parametrize(
    ("content", "delimiter"),
    [
        ("lat;lon\n1,5;2\n-3,25;4,0\n", ";"),
        ("lat\tlon\n1,5\t2\n-3,25\t4,0\n", "\t"),
        ("lat lon\n1,5 2\n-3,25 4,0\n", " "),
        ('lat,lon\n"1,5",2\n"-3,25","4,0"\n', ","),
    ],
)
def test_decimal_commas(content: str, delimiter: str, tmp_path: Path) -> None:
    path = write(tmp_path, content)
    table = read_table(path, columns=None, width=2)
    assert table.values.tolist() == [[1.5, 2.0], [-3.25, 4.0]]
    assert (table.delimiter, table.decimal) == (delimiter, ",")
    assert "read decimal commas" in table.notes
    scored = write(tmp_path, append_columns(table, path, {"p": [0.5, 7.0]}), "b.csv")
    again = read_table(scored, columns=None, width=3)
    assert again.values.tolist() == [[1.5, 2.0, 0.5], [-3.25, 4.0, 7.0]]


def test_commas_beside_points_are_refused_by_name(tmp_path: Path) -> None:
    path = write(tmp_path, "lat;lon\n1.5;2\n3.5;4\n1,5;2\n")
    with refused("4", "lat", "1,5", kind=InputFileError):
        read_table(path, columns=None, width=2)


def test_without_a_header(tmp_path: Path) -> None:
    path = write(tmp_path, "Paris,48.9,2.4\nRome,41.9,12.5\n")
    with refused("specify", "header", kind=InputFileError):
        read_table(path, columns=None, width=2)
    table = read_table(path, columns=None, width=2, has_header=False)
    assert table.values.tolist() == [[48.9, 2.4], [41.9, 12.5]]
    assert table.columns == ("column2", "column3")
    numbers = write(tmp_path, "2019,2020\n1,2\n")
    assert len(read_table(numbers, columns=None, width=2).values) == 2
    assert len(read_table(numbers, columns=None, width=2, has_header=True).values) == 1


@pytest.mark.parametrize("gap", ["", "NA", "nan", " null "])
def test_rows_with_missing_values(gap: str, tmp_path: Path) -> None:
    path = write(tmp_path, f"lat,lon,note\n1,2,\n{gap},4,a\n5,6,b\n7,{gap},\n")
    with refused("3", "lat", "drop_missing", kind=InputFileError):
        read_table(path, columns=["lat", "lon"], width=None)
    table = read_table(path, columns=["lat", "lon"], width=None, drop_missing=True)
    assert table.values.tolist() == [[1, 2], [5, 6]]
    assert table.lines.tolist() == [2, 4]
    assert "left out 2 rows with missing values, the first in line 3" in table.notes
    scored = append_columns(table, path, {"p": [0.5, 0.25]}).decode().splitlines()
    assert scored == ["lat,lon,note,p", "1,2,,0.5", f"{gap},4,a,", "5,6,b,0.25", f"7,{gap},,"]


def test_missing_values_of_arrays(tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    np.save(path, np.array([[1.0, 2.0], [np.nan, 3.0]]))
    with refused("drop_missing", kind=InputFileError):
        read_table(path, columns=None, width=2)
    table = read_table(path, columns=None, width=2, drop_missing=True)
    assert table.values.tolist() == [[1, 2]]
    np.save(path, np.full((3, 2), np.nan))
    with refused("columns", "column1", "column2", kind=InputFileError):
        read_table(path, columns=None, width=2, drop_missing=True)


@pytest.mark.parametrize(
    ("name", "values", "found"),
    [
        ("anything", [7, 8, 9, 10], True),
        ("site_id", [70, 12, 9, 10], True),
        ("ID", [70, 12, 9, 10], True),
        ("id", [70, 12, 9, 9], False),
        ("id", [0.5, 1.5, 2.5, 3.5], False),
        ("phi", [70, 12, 9, 10], False),
    ],
)
def test_identifiers(name: str, values: list[float], found: bool) -> None:
    assert is_identifier(name, np.array(values, dtype=float)) is found


def test_a_header_with_spaces_between_spaces_is_named(tmp_path: Path) -> None:
    path = write(tmp_path, "site name lat lon\nx 1 2\ny 3 4\n")
    with refused("space", "counts", kind=InputFileError):
        read_table(path, columns=None, width=2)
