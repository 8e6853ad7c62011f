"""Figures of tables: `density summary`, tests by name and parametric families."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from refusals import names


@pytest.fixture(name="angles")
def angles_fixture(tmp_path: Path) -> Path:
    rng = np.random.default_rng(0)
    rows = np.column_stack([rng.vonmises(1, 2, (60, 2)), rng.uniform(1, 2, 60), np.arange(60) // 2])
    rows[0, 1] = np.nan
    path = tmp_path / "angles.csv"
    np.savetxt(path, rows, delimiter=",", header="phi,wind direction,w,chain", comments="")
    return path


def test_angles(angles: Path, tmp_path: Path, orbiflow) -> None:
    out, picture = tmp_path / "s.json", tmp_path / "roses.png"
    command = ("density", "summary", angles, "--space", "torus", "--unit", "radians")
    command = (*command, "--missing", "marginalise", "--columns")
    done = orbiflow.done(*command, "phi,wind direction", "--out", out, "--picture", picture)
    for text in ("Tests of uniformity", "Fisher-Lee", "± (95 %)", f"written to {out}"):
        assert text in " ".join(done.out.split())
    document = json.loads(out.read_text())
    assert [column["rows"] for column in document["columns"]] == [60, 59]
    assert abs(document["columns"][0]["mean"] - 1) < document["columns"][0]["half_width"]
    with Image.open(picture) as image:
        assert image.width == 400  # a fourth of what users get
    columns = "phi,wind direction,w=weight,chain=group"
    done = orbiflow(*command, columns, "--level", "0.9", "--out", tmp_path / "s.csv")
    names(done.out, 30)
    rows = list(csv.DictReader((tmp_path / "s.csv").read_text().splitlines()))
    assert [row["name"] for row in rows] == ["phi", "wind direction"]
    assert [row["kuiper_p"] for row in rows] == ["", ""]
    assert float(rows[0]["rayleigh_p"]) < 1e-3


@pytest.mark.parametrize("space", ["sphere", "projective-plane"])
def test_directions_and_axes(space: str, tmp_path: Path, orbiflow) -> None:
    places = np.random.default_rng(0).normal([30, 140], 8, (20, 2))
    np.savetxt(tmp_path / "p.csv", places, delimiter=",", header="lat,lon", comments="")
    command = ("density", "summary", tmp_path / "p.csv", "--space", space)
    done = orbiflow.done(*command, "--out", tmp_path / "s.csv")
    names(done.out, 25, 20)
    (row,) = csv.DictReader((tmp_path / "s.csv").read_text().splitlines())
    name = "mean" if space == "sphere" else "principal"
    assert float(row[f"{name}_1"]) == pytest.approx(30, abs=6)
    assert float(row[f"{name}_2"]) == pytest.approx(140, abs=6)


@pytest.mark.parametrize(
    ("options", "about"),
    [
        (("--space", "hypersphere"), "hypersphere"),
        (("--space", "sphere", "--picture", "a.png"), "--picture"),
        (("--space", "sphere", "--missing", "marginalise"), "--missing drop"),
        (("--space", "torus", "--out", "a.txt"), "--out .json .csv"),
    ],
)
def test_mistakes(options: tuple[str, ...], about: str, angles: Path, orbiflow) -> None:
    columns = () if "--columns" in options else ("--columns", "phi")
    done = orbiflow.refused("density", "summary", angles, *columns, *options)
    names(done.err, *about.split())


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
    how = (*HOW, "--permutations", "119", "--columns")
    found = {}
    for name, options in {
        "rows": ("phi", "-d", "nests.csv", "--by", "kind"),
        "groups": ("phi,nest=group", "-d", "a.csv", "-d", "b.csv"),
    }.items():
        done = orbiflow.done("density", "test", *how, *options, "--out", f"{name}.json")
        found[name] = json.loads(Path(f"{name}.json").read_text())["tests"]
    assert min(one["p"] for one in found["rows"]) < 0.01
    assert min(one["p"] for one in found["groups"]) > 0.05
    assert all(one["by"] == "permutation" for one in found["groups"])
    names(done.out, 24)
    done = orbiflow("density", "test", *how, "phi,nest=group", "-d", "a.csv", "-d", "nests.csv")
    names(done.err, "a and nests")


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("options", "about"),
    [
        (("-d", "a.csv", "-d", "b.csv", *HOW, "--tests", "rao"), "rao"),
        (("-d", "a.csv", "-d", "b.csv", *HOW, "--by", "phi"), "--by --data"),
        (("-d", "all.csv", *HOW, "--by", "phi"), "--by 2 50"),
        (("-d", "all.csv", *HOW, "--by", "kind", "--columns", "kind=group"), "1"),
        (("-d", "a.csv", *HOW), "--data"),
    ],
)
def test_mistakes_of_tests(options: tuple[str, ...], about: str, orbiflow) -> None:
    done = orbiflow.refused("density", "test", *options)
    names(done.err, *about.split())


def test_parameters_are_shown_and_written(tmp_path: Path, orbiflow) -> None:
    table = np.degrees(np.random.default_rng(0).vonmises([0.2, -1.0], 3.0, (80, 2)))
    data, out = tmp_path / "t.csv", tmp_path / "fit"
    np.savetxt(data, table, delimiter=",", header="phi,psi", comments="")
    call = ("density", "fit", data, "--space", "torus", "--unit", "degrees", "--out", out)
    result = orbiflow.done(*call, "--components", "von-mises")
    names(result.out, "concentration_psi", "degrees")
    found = json.loads((out / "report.json").read_text())["report"]["parametric"]
    assert found["family"] == "von-mises"
    assert [one["name"] for one in found["parameters"]][:2] == ["mean_phi", "concentration_phi"]
    assert f"{found['parameters'][1]['value']:.5g}" in result.out
    orbiflow.done("density", "score", data, "--model", out, "--out", tmp_path / "s.csv")
    refused = orbiflow(*call, "--components", "kent")
    assert refused.status != 0
    names(refused.err, "von-mises")
