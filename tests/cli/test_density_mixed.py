"""The commands of densities, of a table whose columns are not angles alone."""

import json
from pathlib import Path

import numpy as np
import pytest

from density.test_mixed import data_of
from refusals import names


def test_the_commands(tmp_path: Path, orbiflow, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    rows = data_of(120)
    text = "phi,length,temperature\n" + "\n".join(",".join(map(str, row)) for row in rows)
    Path("rows.csv").write_text(text)
    declared = "phi=angle:degrees,length=positive,temperature=linear"
    how = ["--space", "torus", "--columns", declared]
    orbiflow.done("density", "fit", "rows.csv", *how, "--components", "kernels", "-o", "fit")
    report = json.loads(Path("fit/report.json").read_text())
    assert report["space"]["name"] == "torus"
    assert report["log_likelihood"]["natural"] > report["log_likelihood"]["uniform"] > -30
    orbiflow.done("density", "score", "rows.csv", "-m", "fit", "-o", "s.csv")
    orbiflow.done("density", "conditional", "-m", "fit", "--at", "length=1.51", "-o", "part")
    table = np.loadtxt("part/density.csv", delimiter=",", skiprows=1)
    assert table[:, 1].min() < 288 < 294 < table[:, 1].max()
    cell = 3.0 * np.diff(np.unique(table[:, 1])[:2])[0]
    assert table[:, 2].sum() * cell == pytest.approx(1, abs=0.03)
    orbiflow.done("density", "plot", "-m", "part", "--data", "rows.csv", "-o", "p")
    assert {path.name for path in Path("p").iterdir()} >= {"density.png"}
    assert not Path("p/surface.html").exists()
    orbiflow.done("density", "region", "-m", "part", "--mass", "0.5", "-o", "r.json")
    (half,) = json.loads(Path("r.json").read_text())["regions"]
    inside = table[:, 2] >= np.exp(half["log_prob"])
    assert table[inside, 2].sum() * cell == pytest.approx(0.5, abs=0.03)
    assert half["size"] == pytest.approx(inside.sum() * cell, rel=0.1)
    assert half["fraction"] is None
    orbiflow.done("density", "score", "rows.csv", "-m", "fit", "--given", "phi", "-o", "g.csv")
    joint, given = (
        np.loadtxt(name, delimiter=",", skiprows=1, usecols=3) for name in ("s.csv", "g.csv")
    )
    orbiflow.done("density", "marginal", "-m", "fit", "--columns", "phi", "-o", "phi")
    orbiflow.done("density", "score", "rows.csv", "-m", "phi", "-o", "p.csv")
    less = np.loadtxt("p.csv", delimiter=",", skiprows=1, usecols=3)
    assert np.allclose(joint - less, given, atol=1e-6)
    for words, about in (
        (
            "torus --unit degrees",
            "--columns phi=angle:degrees,length=positive,temperature=positive",
        ),
        ("torus --columns phi=cycle:0", "--columns phi cycle:0"),
        ("torus --columns phi=positive", "phi line"),
    ):
        done = orbiflow.refused("density", "fit", "rows.csv", "--space", *words.split(), "-o", "no")
        names(done.err, *about.split())


def test_columns_beside_places(tmp_path: Path, orbiflow, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(0)
    day = rng.uniform(0, 365, 150)
    lat = 20 * np.sin(2 * np.pi * day / 365) + 5 * rng.normal(size=150)
    rows = np.column_stack([day, rng.normal(10, 20, 150), lat, 3 + lat / 20 + rng.random(150)])
    np.savetxt("rows.csv", rows, delimiter=",", header="day,lon,lat,depth", comments="")
    how = ["--space", "sphere", "--columns", "lat,lon,day=cycle:365,depth=positive"]
    how += ["--components", "mixture"]
    orbiflow.done("density", "fit", "rows.csv", *how, "-o", "fit")
    report = json.loads(Path("fit/report.json").read_text())
    assert report["columns"] == ["lat", "lon", "day", "depth"]
    assert report["space"]["base"]["name"] == "sphere"
    orbiflow.done("density", "score", "rows.csv", "-m", "fit", "--given", "day", "-o", "g.csv")
    orbiflow.done("density", "conditional", "-m", "fit", "--at", "day=91", "-o", "spring")
    orbiflow.done("density", "marginal", "-m", "spring", "--columns", "lat,lon", "-o", "place")
    assert Path("place/density.png").exists()
    done = orbiflow("density", "marginal", "-m", "fit", "--columns", "lat", "-o", "half")
    assert done.status != 0
    names(done.err, "sphere")
    pictures = ["--data", "rows.csv", "--along", "depth", "--slices", "3,4", "-o", "p"]
    orbiflow.done("density", "plot", "-m", "fit", *pictures)
    assert {path.name for path in Path("p").iterdir()} >= {"series.png", "beside.png"}
    done = orbiflow.refused("density", "plot", "-m", "fit", "--along", "lat", "-o", "q")
    names(done.err, "--along", "day", "depth")
    orbiflow.refused("density", "plot", "-m", "place", "--along", "day", "-o", "q")
    trend = ["--of", "depth", "--along", "day", "-n", 5, "-o", "t.csv"]
    orbiflow.done("density", "trend", "-m", "fit", *trend)
    table = np.loadtxt("t.csv", delimiter=",", skiprows=1)
    assert table[[0, -1], 0].tolist() == [0, 365]
    assert table[1, 1] > table[3, 1] + 0.5
    orbiflow.refused("density", "summary", "rows.csv", *how[:-2], "-o", "s.json")
