"""`orbiflow density summary`: tables, files and mistakes."""

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
        assert image.width == 1600
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


def test_what_little_tells_is_said(tmp_path: Path, orbiflow) -> None:
    for rows, said in ((["10,20", "10,90", "10,5"], "phi"), (["10,20"], "phi")):
        (tmp_path / "few.csv").write_text("\n".join(["phi,psi", *rows]) + "\n")
        out = ("--out", tmp_path / "s.json")
        done = orbiflow.done(
            "density", "summary", tmp_path / "few.csv", "--space", "torus", "--unit", "degrees",
            *out,
        )  # fmt: skip
        assert said in " ".join(done.out.split())
        (first, _) = json.loads((tmp_path / "s.json").read_text())["columns"]
        assert "-" not in str(first["deviation"]).partition("e")[0]
    assert first["half_width"] is None  # of one row nothing is known


@pytest.mark.parametrize(
    ("options", "about"),
    [
        (("--space", "klein-bottle"), "--space"),
        (("--space", "hypersphere"), "hypersphere"),
        (("--space", "sphere", "--picture", "a.png"), "--picture"),
        (("--space", "sphere", "--missing", "marginalise"), "--missing drop"),
        (("--space", "torus", "--out", "a.txt"), "--out .json .csv"),
        (("--space", "torus", "--level", "1"), "--level"),
        (("--space", "torus", "--columns", "phi,none=group"), "none"),
    ],
)
def test_mistakes(options: tuple[str, ...], about: str, angles: Path, orbiflow) -> None:
    columns = () if "--columns" in options else ("--columns", "phi")
    done = orbiflow.refused("density", "summary", angles, *columns, *options)
    names(done.err, *about.split())
