"""The commands of densities, of a table whose columns are not angles alone."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from density.test_mixed import data_of


def test_the_commands(tmp_path: Path, orbiflow, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    rows = data_of(200)
    text = "phi,length,temperature\n" + "\n".join(",".join(map(str, row)) for row in rows)
    Path("rows.csv").write_text(text)
    how = ["--space", "torus", "--unit", "degrees", "--linear", "length,temperature"]
    done = orbiflow("density", "fit", "rows.csv", *how, "--components", "kernels", "-o", "fit")
    assert done.status == 0, done.err
    report = json.loads(Path("fit/report.json").read_text())
    assert report["space"]["name"] == "mixed"
    assert report["log_likelihood"]["natural"] > report["log_likelihood"]["uniform"] > -30
    assert orbiflow("density", "score", "rows.csv", "-m", "fit", "-o", "s.csv").status == 0
    done = orbiflow("density", "conditional", "-m", "fit", "--given", "length=1.51", "-o", "part")
    assert done.status == 0, done.err
    assert "per unit of each column" in done.out
    table = np.loadtxt("part/density.csv", delimiter=",", skiprows=1)
    assert table[:, 1].min() < 288 < 294 < table[:, 1].max()
    cell = 3.0 * np.diff(np.unique(table[:, 1])[:2])[0]
    assert table[:, 2].sum() * cell == pytest.approx(1, abs=0.03)
    assert orbiflow("density", "plot", "-m", "part", "--data", "rows.csv", "-o", "p").status == 0
    assert {path.name for path in Path("p").iterdir()} >= {"density.png"}
    assert not Path("p/surface.html").exists()
    done = orbiflow("density", "region", "-m", "part", "--mass", "0.5", "-o", "r.json")
    assert done.status == 2
    assert "of angles alone, not of real columns" in done.err
    done = orbiflow("density", "score", "rows.csv", "-m", "fit", "--given", "phi", "-o", "g.csv")
    assert done.status == 0, done.err
    joint, given = (
        np.loadtxt(name, delimiter=",", skiprows=1, usecols=3) for name in ("s.csv", "g.csv")
    )
    alone = orbiflow("density", "marginal", "-m", "fit", "--columns", "phi", "-o", "phi")
    assert alone.status == 0
    done = orbiflow("density", "score", "rows.csv", "-m", "phi", "-o", "p.csv")
    assert done.status == 0, done.err
    less = np.loadtxt("p.csv", delimiter=",", skiprows=1, usecols=3)
    assert np.allclose(joint - less, given, atol=1e-6)
    done = orbiflow(
        "density", "trend", "-m", "fit", "--of", "length", "--along", "phi", "-n", 9, "-o", "t.csv"
    )
    assert done.status == 0, done.err
    table = np.loadtxt("t.csv", delimiter=",", skiprows=1)
    assert table.shape == (9, 7)
    assert (table[:, 2] < table[:, 1]).all()
    assert Path("t.png").read_bytes()[:4] == b"\x89PNG"
    cv = ["--components", "kernels", "--folds", 3, "-o", "cv"]
    done = orbiflow("density", "cv", "rows.csv", *how, *cv)
    assert done.status == 0, done.err
    found = json.loads(Path("cv/report.json").read_text())
    assert found["uniform"] < 0
    for words, message in (
        (["--space", "sphere", "--linear", "length"], "beside angles on a torus"),
        (["--space", "torus", "--unit", "degrees", "--linear", "speed"], "--linear names speed"),
    ):
        done = orbiflow("density", "fit", "rows.csv", *words, "-o", "no")
        assert done.status == 2
        assert message in done.err
