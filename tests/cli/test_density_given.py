"""The commands of densities where covariates are known: fit, score, sample, conditional and trend."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from orbiflow.runtime import Note, find
from refusals import names

MEANS = {"GLY": 0.0, "PRO": 90.0}


def rows_of(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text().splitlines()))


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a table, and the fit of its angles to all other columns."""
    folder = tmp_path_factory.mktemp("given")
    rng = np.random.default_rng(0)
    words, warm = rng.choice(list(MEANS), 240), rng.normal(20, 5, 240)
    hours = rng.uniform(0, 24, 240)
    mean = np.radians([MEANS[word] for word in words]) + (warm - 20) / 10
    angles = np.degrees(rng.vonmises(mean, 20.0))
    rows = zip(angles, warm, hours, words, strict=True)
    text = "phi,warm,hour,residue\n" + "\n".join(",".join(map(str, row)) for row in rows)
    (folder / "rows.csv").write_text(text)
    how = {"space": "torus", "unit": "degrees", "components": ["mixture"], "columns": ["phi"]}
    how["effort"] = "fast"
    given = {
        "data": folder / "rows.csv",
        "given": ["residue", "warm=linear", "hour"],
        "out": folder / "fit",
    }
    told: list[object] = []
    find("density fit").call({**how, **given}).run(told.append)
    notes = [one.text for one in told if isinstance(one, Note)]
    assert "given: residue=word,warm=linear,hour=cycle:24" in notes
    return folder


def test_the_report_says_what_is_gained(model: Path) -> None:
    said = json.loads((model / "fit" / "report.json").read_text())["report"]["given"]
    assert said["gain"] > 4 * said["error"]
    assert said["declaration"] == "residue=word,warm=linear,hour=cycle:24"


def test_rows_are_scored_where_all_is_known(model: Path, orbiflow, tmp_path: Path) -> None:
    ask = ("density", "score", model / "rows.csv", "-m", model / "fit", "-o", tmp_path / "s.csv")
    orbiflow.done(*ask, "--given", "warm,hour,residue")
    known = rows_of(tmp_path / "s.csv")
    orbiflow.done(*ask)
    gains = [
        float(row["log_prob_given"]) - float(other["log_prob"])
        for row, other in zip(known, rows_of(tmp_path / "s.csv"), strict=True)
    ]
    assert np.mean(gains) > 0.7
    done = orbiflow.refused(*ask, "--given", "warm")
    names(done.err, "--given", "residue", "warm", "hour")
    done = orbiflow(*ask, "--given", "warm=linear,hour=cycle:12,residue=word")
    names(done.err, "--given", "hour", "cycle:12", "cycle:24")
    other = tmp_path / "other.csv"
    other.write_text("phi,warm,hour,residue\n1,20,3,TRP\n2,,4,GLY\n")
    ask = ("density", "score", other, "-m", model / "fit", "-o", tmp_path / "t.csv")
    ask = (*ask, "--given", "warm,hour,residue")
    names(orbiflow(*ask).err, "warm", "line 3", "--drop-missing")
    names(orbiflow(*ask, "--drop-missing").err, "residue", "TRP", "GLY, PRO")


def test_samples_and_models_are_where_covariates_are(model: Path, orbiflow, tmp_path: Path) -> None:
    at = ("--at", "warm=25,hour=6,residue=PRO")
    orbiflow.done("density", "sample", "-m", model / "fit", *at, "-o", tmp_path / "s.csv")
    drawn = np.radians(np.loadtxt(tmp_path / "s.csv", skiprows=1))
    truth = 90 + np.degrees(0.5)
    assert np.degrees(np.angle(np.exp(1j * drawn).mean())) == pytest.approx(truth, abs=10)
    orbiflow.done("density", "conditional", "-m", model / "fit", *at, "-o", tmp_path / "part")
    table = np.loadtxt(tmp_path / "part" / "density.csv", delimiter=",", skiprows=1)
    assert table[table[:, 1].argmax(), 0] == pytest.approx(truth, abs=12)
    given = json.loads((tmp_path / "part" / "report.json").read_text())["given"]
    assert given == {"residue": "PRO", "warm": 25.0, "hour": 6.0}
    ask = ("density", "sample", "-m", model / "fit", "-o", tmp_path / "no.csv", "--at")
    names(orbiflow.refused(*ask, "warm=hot,hour=6,residue=PRO").err, "warm", "hot")
    far = orbiflow(
        *("density", "sample", "-m", model / "fit", "-o", tmp_path / "far.csv"),
        *("--at", "warm=900,hour=6,residue=PRO"),
    )
    names(far.out, "'warm'", 900)


def test_trends_are_along_covariates(model: Path, orbiflow, tmp_path: Path) -> None:
    ask = ("density", "trend", "-m", model / "fit", "--of", "phi", "--at", "hour=6")
    orbiflow.done(*ask, "--along", "warm", "-n", 5, "-o", tmp_path / "t.csv")
    rows = rows_of(tmp_path / "t.csv")
    assert [row["residue"] for row in rows] == ["GLY"] * 5 + ["PRO"] * 5
    assert float(rows[7]["phi_low_50"]) < float(rows[7]["phi"]) < float(rows[7]["phi_high_50"])
    done = orbiflow(*ask, "--along", "residue", "-o", tmp_path / "w.csv")
    names(done.out, "warm")
    rows = rows_of(tmp_path / "w.csv")
    assert [float(row["phi"]) for row in rows] == pytest.approx([0, 90], abs=12)
    for name in "tw":
        assert (tmp_path / f"{name}.png").read_bytes()[:4] == b"\x89PNG"


def test_a_slip_is_refused_and_a_number_asked_for(orbiflow, tmp_path: Path) -> None:
    (tmp_path / "rows.csv").write_text("phi,warm\n" + "1,2\n" * 20 + "2,3O\n")
    how = ["--space", "torus", "--unit", "degrees", "--columns", "phi", "--given", "warm=linear"]
    done = orbiflow.refused("density", "fit", tmp_path / "rows.csv", *how, "-o", tmp_path / "fit")
    names(done.err, "warm", "3O", 22)
    (tmp_path / "rows.csv").write_text("phi,warm\n" + "1,2\n2,3\n" * 20 + "2,-9999\n")
    ask = ("density", "fit", tmp_path / "rows.csv", *how, "-o", tmp_path / "fit")
    names(orbiflow.refused(*ask).err, "warm", "--missing-codes")
    (tmp_path / "rows.csv").write_text("phi,warm\n" + "1,2\n" * 20 + "2,3\n")
    how[-1] = "warm"
    done = orbiflow("density", "fit", tmp_path / "rows.csv", *how, "-o", tmp_path / "fit")
    names(done.err, "--given warm=positive")
