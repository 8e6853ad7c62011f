"""What is read of a table: units, identifiers, missing values, rows by value; and `density cv`."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from density.cross_validation.small_tables import table_of
from orbiflow.density import DensityEstimator, read_density
from refusals import names

SMALL = ["--components", "mixture"]


def table(folder: Path, scale: float, *, first: str = "", count: int = 40) -> Path:
    rng = np.random.default_rng(0)
    rows = (scale * rng.normal(0.0, 1.0, (count, 2)).clip(-3, 3)).round(4)
    path = folder / "data.csv"
    header = f"{first}phi angle,psi angle\n"
    lines = [f"{k},{a},{b}" if first else f"{a},{b}" for k, (a, b) in enumerate(rows, 1)]
    path.write_text("\ufeff" + header + "\n".join(lines) + "\n")
    return path


def test_units_are_said_or_asked_for(tmp_path: Path, orbiflow) -> None:
    out = tmp_path / "model"
    fit = ("density", "fit", table(tmp_path, 1.0), "--space", "torus", "--out", out, *SMALL)
    for scale, unit in ((1.0, "radians"), (50.0, "degrees")):
        table(tmp_path, scale)
        asked = orbiflow.refused(*fit)
        words = f"phi angle=angle:{unit},psi angle=angle:{unit}"
        names(asked.err, f"--columns '{words}'")
        said = orbiflow.done(*fit, "--columns", words)
        names(said.out, words)
        orbiflow.done(*fit, "--unit", unit)
    report = json.loads((out / "report.json").read_text())
    assert report["space"]["unit"] == "degrees"
    assert report["columns"] == ["phi angle", "psi angle"]
    assert report["report"]["components"][0]["name"] == "mixture"


def test_columns_that_number_the_rows_are_left_out(tmp_path: Path, orbiflow) -> None:
    data, out = table(tmp_path, 1.0, first="id,"), tmp_path / "model"
    how = ("--space", "torus", "--unit", "radians", "--out", out)
    names(orbiflow.done("density", "fit", data, *how, *SMALL).out, "left out id")
    assert json.loads((out / "report.json").read_text())["columns"] == ["phi angle", "psi angle"]
    scores = tmp_path / "scores.csv"
    orbiflow.done("density", "score", data, "--model", out, "--out", scores)
    assert scores.read_text().startswith("id,phi angle,psi angle,log_prob")


def test_missing_values_and_no_header(tmp_path: Path, orbiflow) -> None:
    data, out = table(tmp_path, 1.0), tmp_path / "model"
    rows = data.read_text(encoding="utf-8-sig").splitlines()[1:]
    data.write_text("\n".join(["x,1.0", *rows, "0.5,"]) + "\n")
    both = "x=angle:radians,1.0=angle:radians"
    fit = ("density", "fit", data, "--space", "torus", "--columns", both, "--out", out, *SMALL)
    assert "--drop-missing" in orbiflow(*fit).err
    fitted = orbiflow.done(*fit, "--drop-missing")
    names(fitted.out, 1)
    scores = tmp_path / "scores.csv"
    score = ("density", "score", data, "--model", out, "--out", scores, "--drop-missing")
    orbiflow.done(*score)
    assert scores.read_text().splitlines()[-1] == "0.5,,"
    data.write_text("\n".join(["a,0.1,0.2", *(f"b,{row}" for row in rows)]) + "\n")
    fit = ("density", "fit", data, "--space", "torus", "--out", out, *SMALL)
    assert "--header" in orbiflow(*fit).err
    names(orbiflow(*fit, "--no-header").err, "--columns 2=angle:radians,3=angle:radians")
    orbiflow.done(*fit, "--no-header", "--unit", "radians")


def test_the_mean_says_of_how_many_rows_it_is(tmp_path, orbiflow, monkeypatch) -> None:
    data, out = table(tmp_path, 1.0, count=60), tmp_path / "model"
    fit = ("density", "fit", data, "--space", "torus", "--unit", "radians", "--out", out, *SMALL)
    values = np.loadtxt(data, delimiter=",", skiprows=1, encoding="utf-8-sig")

    def mean_of(done, rows: str) -> tuple[int, float]:
        assert done.status == 0, done.err
        likelihood = json.loads((out / "report.json").read_text())["log_likelihood"]
        names(done.out, f"{rows} {likelihood['natural']:.4f}")
        return likelihood["natural_rows"], likelihood["natural"]

    count, mean = mean_of(orbiflow(*fit), "these rows")
    fitted = DensityEstimator.fitted(read_density(out / "density.safetensors")[0])
    scores = fitted.score_samples(values)
    assert (count, mean) == (60, pytest.approx(scores.mean()))
    # few of many are drawn by the seed: the same at every run, and not every so many-th
    monkeypatch.setattr("orbiflow.density.operations.fitting.MOST_SCORED", 25)
    count, mean = mean_of(orbiflow(*fit), "25 of them")
    assert (count, mean_of(orbiflow(*fit), "25 of them")) == (25, (25, mean))
    assert mean != pytest.approx(scores.mean(), abs=1e-9)
    assert mean == pytest.approx(scores.mean(), abs=1.0)
    data.write_text(data.read_text() + "0.5,\n")
    monkeypatch.undo()
    count, _ = mean_of(orbiflow(*fit, "--missing", "marginalise"), "60 of them")
    assert count == 60


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
    [("site=north,site=east", 3, 39.0), ("site = east", 1, 90.0), ("phase=1,site=north", 2, 15.0)],
)
def test_rows_are_chosen_by_values(summary, where: str, rows: int, mean: float) -> None:
    done, columns = summary("--columns", "angle", "--where", where)
    assert done.status == 0, done.err
    assert (columns[0]["rows"], columns[0]["mean"]) == (rows, pytest.approx(mean, abs=1))
    names(done.out, f"{rows} of 5")


def test_missing_values_of_rows_that_are_read_are_refused_and_of_others_not(summary) -> None:
    done, _ = summary("--columns", "angle", "--where", "phase=2")
    assert done.status != 0
    names(done.err, "line 4", "'angle'")
    done, columns = summary("--columns", "angle", "--where", "phase=2", "--drop-missing")
    assert columns[0]["rows"] == 1
    # counts are those of the rows that are read: one of the others has none
    done, columns = summary("--columns", "angle,count=count", "--where", "phase=1")
    assert columns[0]["rows"] == 4
    done, columns = summary("--columns", "count=ignore", "--where", "phase=3")
    assert [own["name"] for own in columns] == ["angle"]  # what chooses rows is no data


@pytest.mark.parametrize(
    ("where", "words"),
    [
        ("phase=", "--where phase=1"), ("phase=7", "phase 7 1 2 3 --where"),
        ("colour=red", "colour"), ("site=north,phase=2", "site=north phase=2 --where"),
    ],
)  # fmt: skip
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


HOW = "--space torus --unit radians --components mixture --against uniform --folds 2"
QUICK = HOW.split()


def test_twice(tmp_path: Path, orbiflow: Any) -> None:
    data, out = table_of(tmp_path, 40, protein=[f"p{k // 4}" for k in range(40)]), tmp_path / "out"
    command = ("density", "cv", data, "--out", out, "--columns", "protein=group", *QUICK)
    first = orbiflow.done(*command)
    names(first.out, "folds/mixture-1-01", 40, 10, "mixture", "uniform", out / "cv.csv")
    done = {path: path.stat().st_mtime_ns for path in out.glob("folds/**/*")}
    second = orbiflow.done(*command)
    names(second.out, "mixture", "uniform")
    assert {path: path.stat().st_mtime_ns for path in out.glob("folds/**/*")} == done


@pytest.mark.parametrize(
    ("arguments", "about"),
    [
        (("--columns", "protein=group", "--folds", "11"), "11 10"),
        (("--columns", "chain=group"), "chain phi psi protein"),
        (("--components", "mixture,chains", "--against", "chains+mixture"), "mixture+chains"),
        (("--out", "diary"), "page.txt"),
    ],
)
def test_mistakes(arguments: tuple[str, ...], about: str, tmp_path, orbiflow, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    table_of(tmp_path, 40, protein=[f"p{k // 4}" for k in range(40)])
    (tmp_path / "diary").mkdir()
    (tmp_path / "diary" / "page.txt").touch()
    usual = dict(zip(QUICK[::2], QUICK[1::2], strict=True))
    others = [word for name in usual if name not in arguments for word in (name, usual[name])]
    outcome = orbiflow.refused("density", "cv", "angles.csv", *others, *arguments)
    assert outcome.err.startswith("error: ")
    names(outcome.err, *about.split())
    assert not (tmp_path / "cv").exists()
