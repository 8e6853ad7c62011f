"""`orbiflow density compare` and `region`, `score --region`, columns by their names, and mistakes."""

import csv
import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from cli.conftest import call_main
from refusals import names

QUICK = ("--components", "mixture")


def write(path: Path, header: str, rows: np.ndarray, labels: list[str] | None = None) -> Path:
    lines = [",".join(f"{v:.5f}" for v in row) for row in rows]
    if labels is not None:
        lines = [f"{label},{line}" for label, line in zip(labels, lines, strict=True)]
    path.write_text("\n".join([header, *lines]) + "\n")
    return path


def table_of(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text().splitlines()))


def angles(seed: int, rows: int = 120, kappa: float = 6.0) -> np.ndarray:
    return np.degrees(np.random.default_rng(seed).vonmises([0.5, -1.0], kappa, (rows, 2)))


@pytest.fixture(name="made", scope="module")
def made_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two models of phi, psi, one good and one that has the columns the other way round."""
    made = tmp_path_factory.mktemp("made")
    write(made / "good.csv", "phi,psi", angles(0))
    write(made / "poor.csv", "psi,phi", angles(1, kappa=0.5)[:, ::-1])
    write(made / "held.csv", "name,psi,phi", angles(2)[:, ::-1], [f"p{k % 30}" for k in range(120)])
    for name in ("good", "poor"):
        fit = ("density", "fit", made / f"{name}.csv", "--space", "torus", "--unit", "degrees")
        assert call_main(lambda: ("", ""), *fit, *QUICK, "--out", made / name).status == 0
    return made


@pytest.fixture(name="folder")
def folder_fixture(made: Path, tmp_path: Path) -> Path:
    """A copy of `made` to work in."""
    return shutil.copytree(made, tmp_path, dirs_exist_ok=True)


def test_models_are_compared_by_the_names_of_their_columns(folder: Path, orbiflow: Any) -> None:
    models = ("-m", folder / "poor", "-m", folder / "good")
    out = folder / "c.json"
    done = orbiflow.done("density", "compare", *models, "--data", folder / "held.csv", "--out", out)
    names(done.out, "good", "poor")
    assert "WARNING" not in done.out
    found = json.loads(out.read_text())
    assert found["kind"] == "models"
    assert found["best"] == "good"
    assert found["groups"] is None
    good = next(s for s in found["scores"] if s["name"] == "good")
    # phi and psi by name: as if the file had them in the order of the fit
    plain = write(folder / "plain.csv", "phi,psi", angles(2))
    orbiflow.done("density", "score", plain, "--model", folder / "good", "--out", folder / "s.csv")
    rows = table_of(folder / "s.csv")
    assert np.mean([float(row["log_prob"]) for row in rows]) == pytest.approx(
        good["mean"], abs=1e-6
    )
    grouped = orbiflow.done(
        "density", "compare", *models, "--data", folder / "held.csv", "--columns",
        "name=group", "--out", folder / "c.csv",
    )  # fmt: skip
    names(grouped.out, 30)
    data = write(folder / "w.csv", "phi,psi,w", np.column_stack([angles(2), np.arange(1, 121)]))
    orbiflow.done(
        "density", "compare", *models, "--data", data, "--columns", "w=weight", "--out", out
    )
    scores = [float(row["log_prob"]) for row in rows]
    good = next(s for s in json.loads(out.read_text())["scores"] if s["name"] == "good")
    assert good["mean"] == pytest.approx(np.average(scores, weights=range(1, 121)), abs=1e-6)
    (row,) = table_of(folder / "c.csv")
    assert (row["first"], row["better"]) == ("good", "good")


def test_rows_that_a_model_was_fitted_to_are_known(folder: Path, orbiflow: Any) -> None:
    models = ("-m", folder / "good", "-m", folder / "poor")
    done = orbiflow.done("density", "compare", *models, "--data", folder / "good.csv")
    names(done.out, "WARNING: good", 120)
    mixed = write(folder / "mixed.csv", "phi,psi", np.concatenate([angles(0)[:20], angles(3)]))
    done = orbiflow("density", "compare", *models, "--data", mixed)
    names(done.out, 20, 140, "good")


def test_data_sets_are_compared(folder: Path, orbiflow: Any) -> None:
    flipped = write(folder / "b.csv", "psi,phi", angles(5, rows=60)[:, ::-1])
    compare = ("density", "compare-data", "--space", "torus", "--unit", "degrees")
    compare = (*compare, "--permutations", 99, "-d", folder / "good.csv", "-d")
    orbiflow.done(*compare, flipped)
    out = folder / "d.csv"
    how = ("--divergence", "--bootstrap", 200, "--out", out)
    done = orbiflow(*compare, folder / "poor.csv", *how)
    names(done.out, "good", "poor")
    rows = {row["figure"]: row for row in table_of(out)}
    assert float(rows["p"]["value"]) == pytest.approx(0.01)
    assert float(rows["accuracy"]["low"]) > 0.5


def test_regions(folder: Path, orbiflow: Any) -> None:
    out = folder / "r.json"
    orbiflow.done("density", "region", "-m", folder / "good", "--mass", "0.5, 0.9", "--out", out)
    found = json.loads(out.read_text())
    assert found["size_unit"] == "degrees^2"
    assert [r["mass"] for r in found["regions"]] == [0.5, 0.9]
    for region in found["regions"]:
        shape = shapely.MultiPolygon([(rings[0], rings[1:]) for rings in region["polygons"]])
        assert shape.is_valid
        assert shape.area == pytest.approx(region["polygons_size"])
        assert region["polygons_mass"] == pytest.approx(region["mass"], abs=0.02)
    table = folder / "r.csv"
    orbiflow.done("density", "region", "-m", folder / "good", "--level", "-9", "--out", table)
    header, first, *_ = table.read_text().splitlines()
    assert header == "region,mass,log_prob,polygon,ring,angle1,angle2"
    assert first.startswith("1,,-9,1,0,")
    refused = orbiflow.refused(
        "density", "region", "-m", folder / "good", "--out", folder / "r.geojson"
    )
    names(refused.err, "torus")
    scored = folder / "s.csv"
    orbiflow.done(
        "density", "score", folder / "held.csv", "-m", folder / "good", "--region", "--out", scored
    )
    rows = table_of(scored)
    assert list(rows[0]) == ["name", "psi", "phi", "log_prob", "hdr"]
    level = found["regions"][1]["log_prob"]
    for row in rows:
        inside = float(row["log_prob"]) >= level
        assert inside == (float(row["hdr"]) < 0.9)


def test_masses_have_errors_that_are_not_zero(folder: Path, orbiflow: Any) -> None:
    def said(*options: object) -> str:
        out = folder / "said.json"
        done = orbiflow.done("density", "region", "-m", folder / "good", "--out", out, *options)
        (line,) = [line for line in done.out.splitlines() if line.startswith("  mass ")]
        assert not re.search(r"± 0\.0*( |:|$)", line)
        return line

    names(said("--mass", 0.5), "0.5000 ± 0.0035")
    # no sample is inside: one more might have been
    names(said("--level", "1000"), "0.000000 ± 0.0000")


def test_score_refuses_other_columns(folder: Path, orbiflow: Any) -> None:
    other = write(folder / "other.csv", "chi1,chi2", angles(4))
    score = ("density", "score", other, "--model", folder / "good", "--out", folder / "s.csv")
    refused = orbiflow.refused(*score)
    names(refused.err, "phi, psi", "chi1, chi2", "--columns")
    assert not (folder / "s.csv").exists()
    orbiflow.done(*score, "--columns", "chi1,chi2")
    half = write(folder / "half.csv", "phi,chi2", angles(4))
    assert "no psi among phi, chi2" in orbiflow("density", "score", half, "-m", folder / "good").err
    bare = folder / "bare.csv"
    bare.write_text("\n".join(f"{a},{b}" for a, b in angles(4)) + "\n")
    done = orbiflow.done("density", "score", bare, "-m", folder / "good", "--out", folder / "b.csv")
    names(done.out, "phi, psi")


PAIR = ("compare", "-m", "good", "-m", "poor", "-d", "held.csv")

MISTAKES: dict[str, tuple[tuple[object, ...], str]] = {
    "no group": ((*PAIR, "--columns", "who=group"), "who"),
    "weight": (
        (*("compare-data", "-d", "good.csv", "-d", "odd.csv", "--space", "torus"), "--columns",
         "phi=angle:degrees,2=weight"),
        "--columns weight",
    ),
    "no file": ((*PAIR[:-1], "none.csv"), "none"),
    "other columns": (
        ("compare-data", "-d", "good.csv", "-d", "odd.csv", "--space", "torus", "--unit", "degrees"),
        "good phi, psi odd phi, chi --columns",
    ),
    "no unit": (
        ("compare-data", "-d", "good.csv", "-d", "poor.csv", "--space", "torus"),
        "phi=angle:degrees,psi=angle:degrees",
    ),
}  # fmt: skip


def test_mistakes(folder: Path, orbiflow: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    write(folder / "odd.csv", "phi,chi", angles(4))
    for arguments, about in MISTAKES.values():
        done = orbiflow.refused("density", *arguments)
        names(done.err, *about.split())


def test_two_data_sets_on_a_quotient(tmp_path: Path, orbiflow: Any) -> None:
    places = np.random.default_rng(0).uniform(0, 10, (80, 2))
    one = write(tmp_path / "one.csv", "x,y", places[:40])
    other = write(tmp_path / "other.csv", "x,y", places[40:])
    command = ("density", "compare-data", "-d", one, "-d", other, "--permutations", 19, "--space")
    done = orbiflow.done(*command, "4*2", "--cell", "10,10")
    assert "no cell was given" not in done.out
    fit = ("density", "fit", one, *QUICK, "--space", "p4gm", "--out", tmp_path / "m")
    fitted = orbiflow.done(*fit, "--cell", "10,10")
    assert "-0.0000" not in fitted.out + done.out
    report = json.loads((tmp_path / "m" / "report.json").read_text())
    assert report["log_likelihood"]["uniform"] == pytest.approx(-np.log(12.5))
    assert "no cell was given: its lengths are taken to be about 1" in orbiflow(*fit).out
    for given, about in (
        (("p4g", "--cell", "10,10", "--unit", "degrees"), "--unit"),
        (("torus", "--cell", "10,10"), "--cell torus"),
        (("p5",), "--space"),
    ):
        refused = orbiflow.refused(*command, *given)
        names(refused.err, *about.split())
    refused = orbiflow.refused("density", "plot", "-m", tmp_path / "m", "--measure", "square")
    names(refused.err, "--measure square", "torus", "sphere")
