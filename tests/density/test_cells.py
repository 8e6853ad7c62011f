"""Cells with units, compass words and times of day, and headers in comments."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orbiflow.density import TableError, read_table
from orbiflow.density.tables import append_columns
from orbiflow.errors import InputFileError
from refusals import refused
from table_files import write

UNITS = {
    "phi,psi\n70.3 deg,1\n-12.5 deg,2\n": ("degrees", [70.3, -12.5]),
    "phi,psi\n70.3°,1\n-12.5 °,2\n": ("degrees", [70.3, -12.5]),
    "phi,psi\n70.3º,1\n-12.5˚,2\n": ("degrees", [70.3, -12.5]),
    "phi,psi\n70.3 degrees,1\n,2\n-12.5 Degrees,3\n": ("degrees", [70.3, np.nan, -12.5]),
    "phi;psi\n70,3 deg;1\n-12,5deg.;2\n": ("degrees", [70.3, -12.5]),
    "phi;psi\n\u22121,2 rad;1\n1,5e-1 rad;2\n": ("radians", [-1.2, 0.15]),
    "phi,psi\n0.25 turns,1\n1 turn,2\n": ("turns", [0.25, 1]),
    '"70.3 deg","1"\n"12.5 deg","2"\n': ("degrees", [70.3, 12.5]),
    "phi,psi\n70.3,1\n12.5,2\n": (None, [70.3, 12.5]),
    "phi,psi deg\n1e3,1\n12.5,2\n": (None, [1000, 12.5]),
}


@pytest.mark.parametrize("content", UNITS)
def test_units_in_cells_are_read(content: str, tmp_path: Path) -> None:
    unit, values = UNITS[content]
    table = read_table(write(tmp_path, content), columns=None, width=2, keep_missing=True)
    assert table.unit == unit
    np.testing.assert_array_equal(table.values[:, 0], values)
    assert table.without(0).unit is None
    notes = " ".join(table.notes)
    assert (f"read {unit}, as the cells say: {table.columns[0]}" in notes) == (unit is not None)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("phi\n70 deg\n1.2 rad\n", "3 phi 1.2 rad"),
        ("phi\n70 deg\n1.2\n", "3 phi 1.2"),
        ("phi\n1.2\n70°\n", "2 phi 1.2"),
        ("phi\n1.2 km\n2 km\n", "every line"),
        ("phi\n" + "70 deg\n" * 200 + "2 rad\n", "202 phi 2 rad"),
        ("phi\n" + "70\n" * 200 + "2 rad\n", "202 phi 2 rad"),
    ],
)  # fmt: skip
def test_mixed_units_are_refused(content: str, words: str, tmp_path: Path) -> None:
    with refused(*words.split(), kind=InputFileError):
        read_table(write(tmp_path, content), columns=None, width=1)


def test_a_column_of_units_is_a_column(tmp_path: Path) -> None:
    path = write(tmp_path, "phi,unit\n-1.390,deg\n2.500,deg\n")
    assert read_table(path, columns=None, width=1).values.tolist() == [[-1.39], [2.5]]


def test_columns_in_different_units_are_refused(tmp_path: Path) -> None:
    table = read_table(write(tmp_path, "a,b\n70 deg,1 rad\n"), columns=None, width=2)
    with refused("different", "degrees", kind=TableError):
        _ = table.unit


def test_compass_words_are_bearings(tmp_path: Path) -> None:
    path = write(tmp_path, "station,wdir,speed\na,N,1\nb,nne,2\nc,South-West,3\nd,,4\ne,WNW,5\n")
    table = read_table(path, columns=None, width=None, keep_missing=True)
    assert table.columns == ("wdir", "speed")
    np.testing.assert_array_equal(table.values[:, 0], [0, 22.5, 225, np.nan, 292.5])
    assert table.unit == "degrees"
    assert (
        "read compass words as degrees, north 0 and clockwise, as the cells say: wdir"
        in table.notes
    )
    alone = read_table(write(tmp_path, "NE\nSW\nE\n"), columns=None, width=None)
    assert alone.values.tolist() == [[45], [225], [90]]


@pytest.mark.parametrize(
    "content", ["phi,side\n1,N\n2,S\n", "phi,quarter\n1,NE\n2,SW\n", "phi,side\n1,E\n2,W\n"]
)
def test_labels_are_no_compass_words(content: str, tmp_path: Path) -> None:
    table = read_table(write(tmp_path, content), columns=None, width=None)
    assert table.columns == ("phi",)
    assert table.unit is None


@pytest.mark.parametrize(
    "times",
    ["05:12\n17:03\n", "05:12:33\n17:03:01.5\n", "5:12 am\n\n7:03 PM\n", "-5h12m33s\n7h3m\n"],
)
def test_times_of_day_are_refused_by_cause(times: str, tmp_path: Path) -> None:
    for content in (times, "time\n" + times):
        with refused("convert", "15", kind=TableError):
            read_table(write(tmp_path, content), columns=None, width=None)
    row = "t,phi\n" + "".join(f"{time},1.5\n" for time in times.split("\n") if time)
    assert read_table(write(tmp_path, row), columns=None, width=None).columns == ("phi",)


HEADED = {
    "# lon lat\n1 2\n3 4\n": ("lon", "lat"),
    "#phi psi\n1 2\n3 4\n": ("phi", "psi"),
    "# made by me, today\n# phi,psi\n# deg,deg\n1,2\n3,4\n": ("phi", "psi"),
    "# lon lat\n1,2\n3,4\n": ("lon", "lat"),
    "# lon, lat\n1 2\n3 4\n": ("lon", "lat"),
    "## a,b\n1,2\n3,4\n": ("a", "b"),
    "# Columns: lon lat\n1 2\n3 4\n": ("lon", "lat"),
    "# time series\n1 2\n3 4\n": None,
    "# time phi\n1 2\n3 4\n": ("time", "phi"),
    "# by hand\n1,2\n3,4\n": None,
    "# angles of all residues\n1 2\n3 4\n": None,
    "# 5 6\n1 2\n3 4\n": None,
    "1 2\n# lon lat\n3 4\n": None,
    "sep=,\n1,2\n3,4\n": None,
}


@pytest.mark.parametrize("content", HEADED)
def test_comments_that_name_the_columns_are_headers(content: str, tmp_path: Path) -> None:
    path, names = write(tmp_path, content), HEADED[content]
    table = read_table(path, columns=None, width=2)
    assert table.values.tolist() == [[1, 2], [3, 4]]
    assert table.header == names
    assert any("comment line" in note and "header" in note for note in table.notes) == bool(names)
    again = write(tmp_path, append_columns(table, path, {"p": [0.5, 0.25]}), "b.csv")
    scored = read_table(again, columns=None, width=3)
    assert scored.values.tolist() == [[1, 2, 0.5], [3, 4, 0.25]]
    assert scored.header == (names and (*names, "p"))


def test_a_comment_is_no_header_beside_one_or_if_there_is_none(tmp_path: Path) -> None:
    path = write(tmp_path, "# c d\na b\n1 2\n")
    assert read_table(path, columns=None, width=2).header == ("a", "b")
    path = write(tmp_path, "# c d\n1 2\n")
    assert read_table(path, columns=None, width=2, has_header=False).header is None


def test_what_savetxt_writes_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    np.savetxt(path, [[1.5, 2.5]], header="made today\nlat lon", delimiter="\t")
    table = read_table(path, columns=["lon", "lat"], width=2)
    assert table.values.tolist() == [[2.5, 1.5]]
