"""`orbiflow density`: a fit, scores, samples and pictures by the public command, and mistakes."""

import functools
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from orbiflow.cli.app import run
from refusals import names

FIT = ["--max-frequency", 1, "--segments", 1]
ANGLES = ["--columns", "lat=angle:degrees,lon=angle:degrees"]


def table(folder: Path, rows: int = 100, name: str = "data.csv") -> Path:
    rng = np.random.default_rng(0)
    values = rng.normal([20.0, 60.0], 25.0, (rows, 2)).clip(-89, 89)
    path = folder / name
    path.write_text("lat,lon\n" + "\n".join(f"{a:.4f},{b:.4f}" for a, b in values) + "\n")
    return path


@pytest.fixture(name="fitted", scope="module")
def fitted_fixture(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """A model of the table on a torus or sphere, by the public command; not to be written into."""

    @functools.cache
    def fitted(space: str) -> Path:
        folder = tmp_path_factory.mktemp(space)
        units = ANGLES if space == "torus" else []
        fit = ["density", "fit", table(folder), "--space", space, *units, *FIT]
        assert run(list(map(str, [*fit, "--out", folder / "model"]))) == 0
        return folder / "model"

    return fitted


def test_fit_score_sample(tmp_path: Path, orbiflow) -> None:
    data, model = table(tmp_path), tmp_path / "model"
    how = ("--space", "projective-plane", "--columns", "lat,lon", "--out", model)
    fitted = orbiflow.done("density", "fit", data, *how, *FIT)
    names(fitted.out, "lat,lon")
    report = json.loads((model / "report.json").read_text())
    assert report["columns"] == ["lat", "lon"]
    assert report["report"]["mass"] == pytest.approx(1.0, abs=2e-3)
    gain = report["log_likelihood"]["natural"] - report["log_likelihood"]["uniform"]
    assert gain > 0.5

    scores = tmp_path / "scores.csv"
    orbiflow.done("density", "score", data, "--model", model, "--out", scores)
    header, *rows = scores.read_text().splitlines()
    assert header == "lat,lon,log_prob"
    values = np.array([row.split(",") for row in rows], dtype=float)
    assert values[:, 2].mean() == pytest.approx(report["log_likelihood"]["natural"], abs=1e-6)

    drawn = tmp_path / "drawn.csv"
    arguments = ("density", "sample", "--model", model, "-n", 50, "--out", drawn)
    orbiflow.done(*arguments)
    first = drawn.read_text()
    assert first.startswith("lat,lon\n")
    assert len(first.splitlines()) == 51
    orbiflow(*arguments)
    assert drawn.read_text() == first


def test_plots_for_papers(tmp_path: Path, orbiflow, fitted) -> None:
    data, model, folder = table(tmp_path), fitted("sphere"), tmp_path / "figures"
    plot = ("density", "plot", "--model", model, "--data", data)
    drawn = orbiflow.done(*plot, "--format", "svg", "--width", "9cm", "--out", folder)
    names(drawn.out, folder)
    figures = {"density.svg", "latlon.svg", "square.svg", "samples.svg", "surface.html"}
    assert {path.name for path in folder.iterdir()} - {"flow.svg"} == figures
    assert (folder / "surface.html").read_text().lstrip().lower().startswith("<!doctype html>")
    assert 'width="255.1' in (folder / "latlon.svg").read_text()
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    for options, about in (
        (("--out", tmp_path / "plots.pdf", "--format", "png"), "--out .pdf --format png"),
        (("--out", tmp_path / "plot.png"), "plot.png .pdf"),
        (("--out", tmp_path / "none" / "plots.pdf"), "none"),
    ):
        refused = orbiflow.refused(*plot, *options)
        names(refused.err, *about.split())
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_plot_of_angles_has_their_names_and_options(tmp_path: Path, orbiflow, fitted) -> None:
    data, model = table(tmp_path), fitted("torus")
    plot = ("density", "plot", "--model", model, "--data", data, "--out")
    pictures = []
    for name, *options in (
        ("plain", "--scale", "linear"),
        ("other", "--scale", "log", "--center", "180,180", "--dots"),
    ):
        orbiflow.done(*plot, tmp_path / name, *options)
        pictures.append({path.name: path.read_bytes() for path in (tmp_path / name).iterdir()})
    plain, other = pictures
    for name in ("density.png", "samples.png"):
        assert plain[name] != other[name]
    page = plain["surface.html"].decode()
    names(page, "lat (degrees)", "lon (degrees)", '"dots": false')
    names(other["surface.html"].decode(), '"dots": true')


def test_nothing_of_an_earlier_model_stays(tmp_path: Path, orbiflow) -> None:
    data, model = table(tmp_path), tmp_path / "model"
    fit = ("density", "fit", data, "--space", "torus", *ANGLES, "--out", model)
    fit = (*fit, "--components", "mixture")
    plot = ("density", "plot", "--model", model, "--out", model)
    orbiflow.done(*fit)
    orbiflow.done(*plot, "--data", data)
    names = {"density.png", "samples.png", "surface.html", "density.safetensors", "report.json"}
    assert {path.name for path in model.iterdir()} - {"flow.png"} == names
    # without data there is no picture of samples beside them
    orbiflow.done(*plot)
    assert not (model / "samples.png").exists()
    assert (model / "density.safetensors").exists()
    orbiflow.done(*fit)
    assert {path.name for path in model.iterdir()} == {"density.safetensors", "report.json"}


def test_a_fit_does_not_touch_what_it_did_not_write(tmp_path: Path, orbiflow) -> None:
    data, model = table(tmp_path), tmp_path / "model"
    model.mkdir()
    (model / "density.png").write_text("mine")
    refused = orbiflow.refused(
        "density", "fit", data, "--space", "torus", *ANGLES, *FIT, "--out", model
    )
    names(refused.err, "density.png")
    assert (model / "density.png").read_text() == "mine"
