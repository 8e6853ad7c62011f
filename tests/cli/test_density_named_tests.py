"""`density compare --tests` and `--by`: tests by name of several tables, or of parts of one."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest


@pytest.fixture(name="folder")
def folder_fixture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Three tables of angles, and one of all, in the folder of work."""
    monkeypatch.chdir(tmp_path)
    rng, lines = np.random.default_rng(0), ["kind,phi,psi"]
    for name, mean in (("a", 0.0), ("b", 0.8), ("c", 0.0)):
        rows = np.degrees(rng.vonmises([mean, 1], [3, 5], (40, 2))).round(3).tolist()
        own = [",".join(map(str, row)) for row in rows]
        Path(f"{name}.csv").write_text("\n".join(["phi,psi", *own]))
        lines += [f"{name},{line}" for line in own]
    Path("all.csv").write_text("\n".join(lines))
    return tmp_path


HOW = ("--space", "torus", "--unit", "degrees", "--permutations", "99")


@pytest.mark.usefixtures("folder")
def test_tables_and_parts_of_one_give_the_same(orbiflow) -> None:
    tables = ("-d", "a.csv", "-d", "b.csv", "-d", "c.csv")
    done = orbiflow("density", "compare", *tables, *HOW, "--out", "t.json")
    assert done.status == 0, done.err
    found = json.loads(Path("t.json").read_text())
    by_name = {(one["name"], one["column"]): one for one in found["tests"]}
    assert by_name["watson-williams", "phi"]["p"] < 0.001
    assert by_name["watson-williams", "psi"]["p"] > 0.01
    assert ("kuiper", "phi") not in by_name  # it is of two samples
    assert "watson-williams" in done.out
    assert "Fisher, 1993" in done.out
    done = orbiflow("density", "compare", "-d", "all.csv", "--by", "kind", *HOW, "--out", "u.json")
    assert done.status == 0, done.err
    assert json.loads(Path("u.json").read_text())["tests"] == found["tests"]


@pytest.mark.usefixtures("folder")
def test_some_tests_of_two_tables_as_csv(orbiflow) -> None:
    call = ("density", "compare", "-d", "a.csv", "-d", "b.csv", *HOW)
    done = orbiflow(*call, "--tests", "kuiper,common-median", "--out", "t.csv")
    assert done.status == 0, done.err
    rows = list(csv.DictReader(Path("t.csv").read_text().splitlines()))
    assert [row["name"] for row in rows] == ["common-median"] * 2 + ["kuiper"] * 2
    assert float(rows[2]["p"]) < 0.05


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("-d", "a.csv", "-d", "b.csv", *HOW, "--tests", "rao"), "rao"),
        (("-d", "a.csv", "-d", "b.csv", *HOW, "--tests", "bingham"), "no bingham on the torus"),
        (
            ("-d", "a.csv", "-d", "b.csv", *HOW, "--by", "phi"),
            "--by divides the rows of one --data",
        ),
        (("-d", "all.csv", *HOW, "--by", "phi"), "--by must have 2 to 50 values"),
        (("-d", "all.csv", *HOW, "--by", "name"), "name"),
        (("-d", "all.csv", *HOW, "--by", "kind", "--group", "kind"), "independent rows"),
        (("-d", "all.csv", "--by", "kind"), "need their --space"),
        (("-d", "a.csv", *HOW), "two --data"),
    ],
)
def test_mistakes(options: tuple[str, ...], message: str, orbiflow) -> None:
    done = orbiflow("density", "compare", *options)
    assert done.status == 2
    assert message in done.err
