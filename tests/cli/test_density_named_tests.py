"""`density test`: tests by name of several tables, or of parts of one."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from refusals import names


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


HOW = ("--space", "torus", "--unit", "degrees")
FEW = ("--permutations", "99")


@pytest.mark.usefixtures("folder")
def test_tables_and_parts_of_one_give_the_same(orbiflow) -> None:
    tables = ("-d", "a.csv", "-d", "b.csv", "-d", "c.csv")
    done = orbiflow.done("density", "test", *tables, *HOW, *FEW, "--out", "t.json")
    found = json.loads(Path("t.json").read_text())
    by_name = {(one["name"], one["column"]): one for one in found["tests"]}
    assert by_name["watson-williams", "phi"]["p"] < 0.001
    assert by_name["watson-williams", "psi"]["p"] > 0.01
    assert ("kuiper", "phi") not in by_name  # it is of two samples
    names(done.out, "watson-williams", "Fisher, 1993")
    orbiflow.done("density", "test", "-d", "all.csv", "--by", "kind", *HOW, *FEW, "--out", "u.json")
    assert json.loads(Path("u.json").read_text())["tests"] == found["tests"]


@pytest.mark.usefixtures("folder")
def test_some_tests_of_two_tables_as_csv(orbiflow) -> None:
    call = ("density", "test", "-d", "a.csv", "-d", "b.csv", *HOW, *FEW)
    orbiflow.done(*call, "--tests", "kuiper,common-median", "--out", "t.csv")
    rows = list(csv.DictReader(Path("t.csv").read_text().splitlines()))
    assert [row["name"] for row in rows] == ["common-median"] * 2 + ["kuiper"] * 2
    assert float(rows[2]["p"]) < 0.05


@pytest.mark.usefixtures("folder")
def test_rows_of_one_group_stay_together(orbiflow) -> None:
    rng, lines = np.random.default_rng(1), ["kind,nest,phi"]
    for nest in range(24):
        # nests differ much, and the kinds of nests do not
        angles = np.degrees(rng.vonmises(rng.vonmises(0, 2), 50, 12)).round(3)
        lines += [f"{'ab'[nest % 2]},n{nest},{angle}" for angle in angles]
    Path("nests.csv").write_text("\n".join(lines))
    for kind in "ab":
        own = [lines[0], *(line for line in lines if line.startswith(kind))]
        Path(f"{kind}.csv").write_text("\n".join(own))
    how = (*HOW, "--permutations", "199", "--columns")
    found = {}
    for name, options in {
        "rows": ("phi", "-d", "nests.csv", "--by", "kind"),
        "groups": ("phi,nest=group", "-d", "nests.csv", "--by", "kind"),
        "files": ("phi,nest=group", "-d", "a.csv", "-d", "b.csv"),
    }.items():
        done = orbiflow.done("density", "test", *how, *options, "--out", f"{name}.json")
        found[name] = json.loads(Path(f"{name}.json").read_text())["tests"]
    assert min(one["p"] for one in found["rows"]) < 0.01
    assert min(one["p"] for one in found["groups"]) > 0.05
    assert all(one["by"] == "permutation" for one in found["groups"])
    assert {one["name"]: one["statistic"] for one in found["groups"]} == pytest.approx(
        {one["name"]: one["statistic"] for one in found["rows"]}
    )
    assert [one["p"] for one in found["files"]] == [one["p"] for one in found["groups"]]
    names(done.out, 24)
    done = orbiflow("density", "test", *how, "phi,nest=group", "-d", "a.csv", "-d", "nests.csv")
    names(done.err, "a and nests")


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("options", "about"),
    [
        (("-d", "a.csv", "-d", "b.csv", *HOW, "--tests", "rao"), "rao"),
        (("-d", "a.csv", "-d", "b.csv", *HOW, "--tests", "bingham"), "bingham torus"),
        (("-d", "a.csv", "-d", "b.csv", *HOW, "--by", "phi"), "--by --data"),
        (("-d", "all.csv", *HOW, "--by", "phi"), "--by 2 50"),
        (("-d", "all.csv", *HOW, "--by", "name"), "name"),
        (("-d", "all.csv", *HOW, "--by", "kind", "--columns", "kind=group"), "1"),
        (("-d", "a.csv", *HOW), "--data"),
    ],
)
def test_mistakes(options: tuple[str, ...], about: str, orbiflow) -> None:
    done = orbiflow.refused("density", "test", *options)
    names(done.err, *about.split())
