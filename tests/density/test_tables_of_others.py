"""Tables as other programs write them: names with spaces, words for gaps, R's row names, UTF-16."""

from pathlib import Path

import numpy as np
import pytest

from orbiflow.density import read_table
from orbiflow.density.tables import append_columns, with_minus
from orbiflow.errors import InputFileError
from refusals import refused
from table_files import write


@pytest.mark.parametrize(
    "name", ["Direction (deg)", "wind direction", "azimuth [grad]", "mean angle of all"]
)
@pytest.mark.parametrize("suffix", ["csv", "txt"])
def test_one_column_under_a_name_with_spaces(name: str, suffix: str, tmp_path: Path) -> None:
    path = write(tmp_path, f"{name}\n10\n20.5\nNA\n350\n", f"a.{suffix}")
    table = read_table(path, columns=None, width=None, drop_missing=True)
    assert table.columns == (name,)
    assert table.values.tolist() == [[10], [20.5], [350]]
    scored = write(tmp_path, append_columns(table, path, {"p": [1, 2, 3]}), "b.csv")
    assert read_table(scored, columns=None, width=2, drop_missing=True).columns == (name, "p")


@pytest.mark.parametrize("content", ["phi psi\n1\n2\n", "lat lon\n1\n2\n"])
def test_two_names_above_one_column_are_refused(content: str, tmp_path: Path) -> None:
    with refused("cell", "1", "2", kind=InputFileError):
        read_table(write(tmp_path, content), columns=None, width=None)


@pytest.mark.parametrize("content", ["wind dir\n1 2\n3 4\n", "1 2\n3 4\n"])
def test_columns_between_spaces_are_several(content: str, tmp_path: Path) -> None:
    assert read_table(write(tmp_path, content), columns=None, width=None).values.tolist()[-1] == [
        3,
        4,
    ]


GAPS = ["VRB", "MM", "M", "?", ".", "*", "\\N", "nil", "missing", "-1.#IND", "1.#QNAN", "#VALUE!"]


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("content", ["dir,b\n10,1\n{},2\n20,3\n", "dir;b\n1,5;1\n{};2\n2,5;3\n"])
def test_words_for_missing_values(gap: str, content: str, tmp_path: Path) -> None:
    path = write(tmp_path, content.format(gap))
    table = read_table(path, columns=None, width=2, drop_missing=True)
    assert table.values[:, 1].tolist() == [1, 3]
    with refused("1", "3", "dir", kind=InputFileError):
        read_table(path, columns=None, width=2)


@pytest.mark.parametrize(
    ("content", "names", "values"),
    [
        ("m,mm\n1,2\n3,4\n", ("m", "mm"), [[1, 2], [3, 4]]),
        ("M\n1\n2\n", ("M",), [[1], [2]]),
        ("VRB,5\n1,2\n", ("column1", "column2"), [[np.nan, 5], [1, 2]]),
        ("sex,a\nM,1\nF,2\n", ("a",), [[1], [2]]),
        ("# m, mm\n1, 2\n3, 4\n", ("m", "mm"), [[1, 2], [3, 4]]),
    ],
)
def test_words_for_missing_values_may_be_names(
    content: str, names: tuple[str, ...], values: list[list[float]], tmp_path: Path
) -> None:
    table = read_table(write(tmp_path, content), columns=None, width=None, keep_missing=True)
    assert table.columns == names
    np.testing.assert_array_equal(table.values, values)


R_TABLES = [
    '"phi" "psi"\n"1" -60.5 -45\n"2" -61 -44\n',
    '"phi" "psi"\n"Mazda RX4" -60.5 -45\n"Fiat" -61 -44\n',
    "phi psi\na -60.5 -45\nb -61 -44\n",
    '"phi","psi"\n"1",-60.5,-45\n"2",-61,-44\n',
    "phi\tpsi\n7\t-60.5\t-45\n3\t-61\t-44\n",
    "phi|psi\n-60.5|-45\n-61|-44\n",
    "phi|psi\n-60,5|-45,0\n-61,0|-44,0\n",
]


@pytest.mark.parametrize("content", R_TABLES)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_tables_of_r_and_databases(content: str, encoding: str, tmp_path: Path) -> None:
    path = write(tmp_path, content.encode(encoding))
    table = read_table(path, columns=["phi", "psi"], width=2)
    assert table.values.tolist() == [[-60.5, -45], [-61, -44]]
    scored = write(tmp_path, append_columns(table, path, {"p": [0.5, 7.0]}), "b.csv")
    again = read_table(scored, columns=["psi", "p"], width=2)
    assert again.values.tolist() == [[-45, 0.5], [-44, 7]]


@pytest.mark.parametrize(
    "content",
    [
        "phi,psi\n-60.5,-45,1\n-61,-44,2\n",
        "a\n10 gon\n20 gon\n",
        "phi,psi\n1,-45,1\n1,-44,2\n",
        "1,2\n3,4,5\n",
    ],
)
def test_headers_that_lack_another_name_are_refused(content: str, tmp_path: Path) -> None:
    with refused("every", "line", kind=InputFileError):
        read_table(write(tmp_path, content), columns=None, width=None)


def test_typographic_minus() -> None:
    assert float(with_minus("−45")) == -45
