"""Rows of a table are chosen by the values of other columns."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from refusals import names

TABLE = """site,angle,phase,count
north,10,1,2
north,20,1.0,2
south,,2,3
south,200,2,
east,90,3,1
"""


@pytest.fixture(name="summary")
def summary_fixture(tmp_path: Path, orbiflow: Any):
    (tmp_path / "a.csv").write_text(TABLE)

    def run(*options: str) -> tuple[Any, list[dict[str, Any]]]:
        out = tmp_path / "out.json"
        out.unlink(missing_ok=True)
        how = ("--space", "torus", "--unit", "degrees", *options, "--out", out)
        done = orbiflow("density", "summary", tmp_path / "a.csv", *how)
        return done, json.loads(out.read_text())["columns"] if out.exists() else []

    return run


@pytest.mark.parametrize(
    ("where", "rows", "mean"),
    [
        ("phase=1", 2, 15.0),
        ("site=north", 2, 15.0),
        ("site=north,site=east", 3, 39.0),
        ("site = east", 1, 90.0),
        ("phase=1,site=north", 2, 15.0),
    ],
)
def test_rows_are_chosen_by_values(summary, where: str, rows: int, mean: float) -> None:
    done, columns = summary("--columns", "angle", "--where", where)
    assert done.status == 0, done.err
    assert (columns[0]["rows"], columns[0]["mean"]) == (rows, pytest.approx(mean, abs=1))
    names(done.out, f"{rows} of 5")


def test_a_column_that_chooses_rows_is_no_data(summary) -> None:
    done, columns = summary("--columns", "count=ignore", "--where", "phase=3")
    assert done.status == 0, done.err
    assert [own["name"] for own in columns] == ["angle"]


def test_missing_values_of_rows_that_are_read_are_refused_and_of_others_not(summary) -> None:
    done, _ = summary("--columns", "angle", "--where", "phase=2")
    assert done.status != 0
    names(done.err, "line 4", "'angle'")
    done, columns = summary("--columns", "angle", "--where", "phase=2", "--drop-missing")
    assert columns[0]["rows"] == 1
    # counts are those of the rows that are read: one of the others has none
    done, columns = summary("--columns", "angle,count=count", "--where", "phase=1")
    assert columns[0]["rows"] == 4


@pytest.mark.parametrize(
    ("where", "words"),
    [
        ("phase", "--where must hold columns with values, such as phase=1, got 'phase'"),
        ("phase=", "such as phase=1"),
        ("phase=7", "no row has phase 7; there are 1, 2, 3: change --where"),
        ("colour=red", "colour"),
        ("site=north,phase=2", "no row has all of site=north, phase=2: change --where"),
    ],
)
def test_what_chooses_no_row_is_refused(summary, where: str, words: str) -> None:
    done, _ = summary("--columns", "angle", "--where", where)
    assert done.status != 0
    names(done.err, *words.split())


def test_rows_that_are_not_read_have_no_score(tmp_path: Path, orbiflow: Any) -> None:
    angles = np.random.default_rng(0).vonmises(0, 3, 60)
    rows = "".join(f"{angle:.6f},{'ab'[k % 2]}\n" for k, angle in enumerate(angles))
    (tmp_path / "a.csv").write_text("angle,kind\n" + rows)
    how = ("--space", "torus", "--columns", "angle=angle:radians", "--components", "mixture")
    done = orbiflow.done(
        "density", "fit", tmp_path / "a.csv", *how, "--where", "kind=a", "-o", tmp_path / "m"
    )
    names(done.out, "30 of 60")
    out = tmp_path / "scores.csv"
    orbiflow.done(
        *("density", "score", tmp_path / "a.csv", "--model", tmp_path / "m", "--where", "kind=b"),
        *("--out", out),
    )
    cells = [line.split(",") for line in out.read_text().splitlines()[1:]]
    assert all((kind == "b") == bool(score) for _, kind, score, *_ in cells)
