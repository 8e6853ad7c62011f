"""`orbiflow density fit`: units said or refused, identifiers left out, missing values, no header."""

import json
from pathlib import Path

import numpy as np
import pytest

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


@pytest.mark.parametrize("space", ["torus", "klein-bottle"])
def test_columns_that_number_the_rows_are_left_out(space: str, tmp_path: Path, orbiflow) -> None:
    data, out = table(tmp_path, 1.0, first="id,"), tmp_path / "model"
    how = ("--space", space, "--unit", "radians", "--out", out)
    columns = ("--columns", "phi angle,psi angle") if space == "klein-bottle" else ()
    fitted = orbiflow.done("density", "fit", data, *how, *columns, *SMALL)
    assert bool(columns) or "left out id" in fitted.out
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
    mean_of(orbiflow(*fit, "--missing", "marginalise"), "25 of them")
    monkeypatch.undo()
    count, _ = mean_of(orbiflow(*fit, "--missing", "marginalise"), "60 of them")
    assert count == 60
