"""Numbers in text: thousands, decimal commas, typographic minus signs, Excel's first line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.density import TableError, read_table
from orbiflow.density.tables import append_columns
from orbiflow.density.tables.cells import Mark
from orbiflow.errors import InputFileError
from refusals import refused
from table_files import PROPERTY, write

RIGHT = {
    # one column of decimal commas, with and without thousands
    "winkel\n1.025,2\n998,7\n1.149,0\n": [1025.2, 998.7, 1149],
    "winkel\n25,2\n-98,7\n149,0\n": [25.2, -98.7, 149],
    "winkel\n1025,2\n98,75\n": [1025.2, 98.75],
    # thousands by the evidence of other cells
    'run,h\na,"1,025.5"\nb,"1,100"\nc,998\n': [1025.5, 1100, 998],
    'run,h\na,"1,025"\nb,"1,100"\nc,998\n': [1025, 1100, 998],
    'run,h\na,"1,234,567"\nb,"1,100"\n': [1234567, 1100],
    "run;h\na;1.025,5\nb;1.100\n": [1025.5, 1100],
    "run;h\na;1.234.567\nb;48,5\n": [1234567, 48.5],
    "run\th\na\t1.025\nb\t48,5\n": [1025, 48.5],
    "run;h\na;1 025,5\nb;48,5\n": [1025.5, 48.5],
    "run;h\na;1\u00a0025,5\nb;48,5\n": [1025.5, 48.5],
    "run;h\na;1\u202f025\nb;48\n": [1025, 48],
    "run,h\na,1'025.5\nb,48\n": [1025.5, 48],
    "25,05\n98,75\n": [25.05, 98.75],  # without a header
    "1,0\n2,10\n30,0\n": [0, 10, 0],
    # as before: a point alone is before decimals, a comma between semicolons as well
    "run,h\na,1.025\nb,2.100\n": [1.025, 2.1],
    "run,h\na,1.025\nb,7\nc,2.100\n": [1.025, 7, 2.1],
    "run,h\na,1.025\nb,12\nc,2.125\n": [1.025, 12, 2.125],
    "run;h\na;48,004\nb;48,896\n": [48.004, 48.896],
    "run;h\na;0,123\nb;48,896\n": [0.123, 48.896],
    'run,h\na,"1,5"\nb,"1,025"\n': [1.5, 1.025],
    # minus signs and degrees
    "run;h\na;\u221232,7\nb;\u22124,5\n": [-32.7, -4.5],
    "run,h\na,\u221232.7\nb,\u2013.5\n": [-32.7, -0.5],
    "run h\n1 \u221232,7\n2 \uff0d4,5\n": [-32.7, -4.5],
    "run,h\na,48.2°\nb,-10.5°\n": [48.2, -10.5],
    # Excel's first line
    "sep=;\nrun;h\na;48,004\nb;9,147\n": [48.004, 9.147],
    "\ufeffsep=;\r\nrun;h\r\na;48,004\r\nb;9,147\r\n": [48.004, 9.147],
    'SEP=|\nrun|h\na|48.004\nb|9.147\n': [48.004, 9.147],
    "sep=,\nrun,h\na,48.004\nb,9.147\n": [48.004, 9.147],
    "sep=\t\nrun\th\na\t48.004\nb\t9\n": [48.004, 9],
}  # fmt: skip


@pytest.mark.parametrize("content", RIGHT)
def test_numbers_are_read_as_they_are_written(content: str, tmp_path: Path) -> None:
    path = write(tmp_path, content)
    table = read_table(path, columns=None, width=None)
    assert table.values[:, -1].tolist() == RIGHT[content]
    scored = write(tmp_path, append_columns(table, path, {"p": [0.5] * len(table.lines)}), "b.csv")
    again = read_table(scored, columns=None, width=None, decimal=table.decimal)  # type: ignore[arg-type]
    assert again.values[:, -2:].tolist() == [[value, 0.5] for value in RIGHT[content]]


DOUBTFUL = {
    "h\n1,025\n1,140\n": (1025, 1.025),
    "h\n1.025\n998\n1.140\n": (1025, 1.025),
    "run;h\na;1.025\nb;998\nc;1.140\n": (1025, 1.025),
    'run,h\na,"1,025"\nb,"1,100"\n': (1025, 1.025),
    "run\th\na\t1,025\nb\t2,500\n": (1025, 1.025),
    'run,h\na,"12,345"\nb,"-1,100"\n': (12345, 12.345),
}


@pytest.mark.parametrize("content", DOUBTFUL)
def test_what_may_be_thousands_or_decimals_is_asked(content: str, tmp_path: Path) -> None:
    path = write(tmp_path, content)
    with refused("specify", "h", kind=TableError):
        read_table(path, columns=["h"], width=None)
    whole, fraction = DOUBTFUL[content]
    marks: tuple[Mark, Mark] = (".", ",")
    found = [
        read_table(path, columns=["h"], width=None, decimal=mark).values[0, 0] for mark in marks
    ]
    assert sorted(found) == [fraction, whole]


def test_only_columns_that_are_read_must_be_clear(tmp_path: Path) -> None:
    path = write(tmp_path, 'fare,h\n"1,025",3\n"1,100",4\n')
    assert read_table(path, columns=["h"], width=None).values.tolist() == [[3], [4]]


@pytest.mark.parametrize(
    "content",
    ["run;h\na;1.5\nb;1,5\n", 'run,h\na,"1,5"\nb,2.5\n', "run;h\na;1.5\nb;1,025,000\nc;1,5\n"],
)
def test_both_marks_before_decimals_are_refused(content: str, tmp_path: Path) -> None:
    with refused("1,5", "write", kind=InputFileError):
        read_table(write(tmp_path, content), columns=["h"], width=None)


def test_a_mark_that_is_first_seen_late_is_refused_with_its_cure(tmp_path: Path) -> None:
    rows = "".join(f"{k},{k}\n" for k in range(200))
    path = write(tmp_path, f'run,h\n{rows}9,"1,5"\n')
    with refused("202", "h", "1,5", kind=TableError):
        read_table(path, columns=["h"], width=None)
    assert read_table(path, columns=["h"], width=None, decimal=",").values[-1, 0] == 1.5


@PROPERTY
@given(
    st.lists(st.decimals(-9999, 9999, places=2), min_size=4, max_size=30),
    st.sampled_from([(",", ".", "\u2212"), (",", "", "-"), (".", ",", "-"), (".", "'", "\u2212")]),
)
def test_any_two_decimals_come_back(tmp_path: Path, numbers: list, marks: tuple) -> None:
    decimal, parting, minus = marks
    texts = [f"{number:,}".replace(",", "_").replace(".", decimal) for number in numbers]
    texts = [text.replace("_", parting).replace("-", minus) for text in texts]
    path = write(tmp_path, "a;b\n" + "".join(f"x;{text}\n" for text in texts))
    found = read_table(path, columns=["b"], width=None).values[:, 0]
    assert np.array_equal(found, [float(number) for number in numbers])


def test_codes_for_missing_values_are_missing(tmp_path: Path) -> None:
    path = write(tmp_path, "a,b\n1,999\n-99,3\n4,5\n")
    how: dict[str, Any] = {"columns": ["a", "b"], "width": None, "missing_codes": (999, -99)}
    with refused("cells", "2", kind=InputFileError):
        read_table(path, **how)
    table = read_table(path, **how, drop_missing=True)
    assert table.values.tolist() == [[4, 5]]
    assert table.lines.tolist() == [4]
    kept = read_table(path, **how, keep_missing=True).values
    assert np.isnan(kept).tolist() == [[False, True], [True, False], [False, False]]


def test_a_column_without_a_value_is_named(tmp_path: Path) -> None:
    path = write(tmp_path, "phi,chi,psi\n1,NULL,3\n4,NULL,6\n")
    assert read_table(path, columns=None, width=None).columns == ("phi", "psi")
    ways: list[dict[str, Any]] = [{}, {"drop_missing": True}, {"keep_missing": True}]
    for how in ways:
        with refused("chi", kind=InputFileError):
            read_table(path, columns=["phi", "chi"], width=None, **how)
    array = tmp_path / "a.npy"
    np.save(array, np.array([[1.0, np.nan], [2.0, np.nan]]))
    table = read_table(array, columns=None, width=None)
    assert table.columns == ("column1",)
    assert "left out the column: column2 has no value in any row" in table.notes


@pytest.mark.parametrize("error", ["#N/A", "#DIV/0!", "#VALUE!", "#ref!"])
def test_a_spreadsheets_error_begins_no_comment(error: str, tmp_path: Path) -> None:
    path = write(tmp_path, f"a,b\n1,2\n{error},3\n4,5\n")
    with refused("line", "3", kind=InputFileError):
        read_table(path, columns=["a", "b"], width=None)


def test_decimal_commas_that_begin_late(tmp_path: Path) -> None:
    rows = [f"{k};1" for k in range(100, 250)] + ["353,621;1", "128,250;1"]
    path = write(tmp_path, "\n".join(["angle;n", *rows]) + "\n")
    with refused("353,621", "353621", "353.621", kind=TableError):
        read_table(path, columns=["angle"], width=None)
    found = read_table(path, columns=["angle"], width=None, decimal=",").values
    assert found[-2:, 0].tolist() == [353.621, 128.25]
