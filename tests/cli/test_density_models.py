"""Models and tables that are not there or not theirs, mistakes in options, masses and their samples."""

import json
from pathlib import Path

import numpy as np
import pytest

from cli.conftest import Outcome
from orbiflow.density import DensityEstimator, density_to_bytes, log_density_gradient, read_density
from refusals import names


@pytest.fixture(name="folder", scope="module")
def folder_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with models of two angles and of directions, and their data."""
    folder = tmp_path_factory.mktemp("models")
    angles = np.random.default_rng(0).vonmises([0.0, 1.0], 4.0, (60, 2))
    for name, space, unit, data, columns in (
        ("torus", "torus", "radians", angles, ["phi", "psi"]),
        ("degrees", "torus", "degrees", np.degrees(angles), ["phi", "psi"]),
        ("sphere", "sphere", None, np.degrees(angles).clip(-80, 80), ["lat", "lon"]),
    ):
        write(folder / f"{name}.csv", ",".join(columns), data)
        fitted = DensityEstimator(space, unit=unit, components="mixture").fit(data)
        (folder / name).mkdir()
        (folder / name / "density.safetensors").write_bytes(
            density_to_bytes(fitted.density_, columns=columns)
        )
    (folder / "empty").mkdir()
    (folder / "damaged").mkdir()
    whole = (folder / "torus" / "density.safetensors").read_bytes()
    (folder / "damaged" / "density.safetensors").write_bytes(whole[:-9])
    write(folder / "one.csv", "phi", angles[:, :1])
    return folder


def write(path: Path, header: str, values: np.ndarray) -> None:
    np.savetxt(path, values, delimiter=",", header=header, comments="")


@pytest.mark.parametrize(
    ("command", "model", "about"),
    [
        ("score", "nowhere", "nowhere"), ("sample", "empty", "empty density.safetensors"),
        ("plot", "damaged", "damaged"), ("region", "torus.csv", "torus.csv"),
        ("marginal", "nowhere", "nowhere"), ("compare", "nowhere", "nowhere"),
    ],
)  # fmt: skip
def test_models_that_are_none(
    command: str, model: str, about: str, folder: Path, tmp_path: Path, orbiflow
) -> None:
    options = {
        "score": (folder / "torus.csv", "--out", tmp_path / "x.csv"),
        "sample": ("--out", tmp_path / "x.csv"),
        "plot": ("--out", tmp_path / "x"),
        "region": ("--out", tmp_path / "x.json"),
        "marginal": ("--columns", "phi", "--out", tmp_path / "x"),
        "compare": ("-m", folder / "torus", "-d", folder / "torus.csv"),
    }[command]
    done = orbiflow.refused("density", command, "-m", folder / model, *options)
    names(done.err, *about.split())
    assert not list(tmp_path.iterdir())


def test_another_number_of_columns(folder: Path, tmp_path: Path, orbiflow) -> None:
    score = ("density", "score", folder / "torus.csv", "-m", folder / "torus")
    done = orbiflow.refused(*score, "--out", tmp_path / "x.csv", "--columns", "phi")
    names(done.err, "1", "phi", "phi, psi")


def test_angles_that_seem_to_be_in_another_unit(folder: Path, tmp_path: Path, orbiflow) -> None:
    out = tmp_path / "x.csv"

    def scored(data: str, model: str) -> Outcome:
        return orbiflow("density", "score", folder / data, "-m", folder / model, "--out", out)

    assert "WARNING" not in scored("degrees.csv", "degrees").out
    names(scored("degrees.csv", "torus").err, "degrees.csv", "turn", "line")
    names(scored("torus.csv", "degrees").out, "WARNING", "radians", "phi", "psi")


@pytest.mark.parametrize(
    ("command", "out", "about"), [("score", "empty", "empty"), ("sample", "none/x.csv", "none")]
)
def test_where_a_table_goes_is_looked_at_first(
    command: str, out: str, about: str, folder: Path, orbiflow, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("orbiflow.density.operations.saved.SavedDensity", None)
    monkeypatch.setattr("orbiflow.density.tables.rows.read_rows", None)
    options = {
        "score": (folder / "torus.csv", "-m", folder / "torus"),
        "sample": ("-m", folder / "torus"),
    }[command]
    before = sorted(folder.rglob("*"))
    done = orbiflow.refused("density", command, *options, "--out", folder / out)
    names(done.err, *about.split())
    assert sorted(folder.rglob("*")) == before


@pytest.fixture(name="folder_of_options", scope="module")
def folder_fixture_of_options(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with tables, most of them wrong, and models of two and of three angles."""
    folder = tmp_path_factory.mktemp("mistakes")
    rng = np.random.default_rng(0)
    angles = rng.vonmises([0.0, 1.0, 2.0], 4.0, (40, 3))
    write(folder / "two.csv", "phi,psi", angles[:, :2])
    write(folder / "other.csv", "phi,psi", angles[::-1, :2] + 0.01)
    write(folder / "weights.csv", "phi,psi,w", np.column_stack([angles[:, :2], -np.eye(1, 40)[0]]))
    gaps = angles[:, :2].copy()
    gaps[7, 1] = np.nan
    write(folder / "gaps.csv", "phi,psi", gaps)
    for dim in (2, 3):
        fitted = DensityEstimator("torus", components="mixture").fit(angles[:, :dim])
        model = folder / f"model{dim}"
        model.mkdir()
        (model / "density.safetensors").write_bytes(
            density_to_bytes(fitted.density_, columns=["phi", "psi", "chi"][:dim])
        )
    return folder


@pytest.mark.parametrize(
    ("words", "about"),
    [
        (
            "fit two.csv --space torus --components kernels --max-frequency 5",
            "--max-frequency --components",
        ),
        ("fit gaps.csv --space torus --missing marginalise --components flow", "--components"),
        ("fit gaps.csv --space torus --unit radians", "--drop-missing 9 psi"),
        ("fit weights.csv --space torus --unit radians --columns w=weight", "'w' weight -1:"),
        ("plot -m model3 --regions 0.5", "--regions 3"),
        ("plot -m model2 --data gaps.csv", "--drop-missing"),
        ("compare-data -d two.csv -d gaps.csv --space torus --unit radians", "--drop-missing"),
    ],
)
def test_mistakes(words: str, about: str, folder_of_options: Path, orbiflow) -> None:
    command, *options = (
        str(folder_of_options / word) if (folder_of_options / word).exists() else word
        for word in words.split()
    )
    before = sorted(folder_of_options.rglob("*"))
    out = () if command == "compare-data" else ("--out", folder_of_options / "out")
    done = orbiflow.refused("density", command, *options, *out)
    names(done.err, *about.split())
    assert sorted(folder_of_options.rglob("*")) == before


def test_rows_that_lack_a_value_can_be_left_out_of_pictures(
    folder_of_options, tmp_path, orbiflow
) -> None:
    model, out = folder_of_options / "model2", tmp_path / "plots"
    plot = ("density", "plot", "-m", model, "--out", out, "--data")
    done = orbiflow.done(*plot, folder_of_options / "gaps.csv", "--drop-missing")
    names(done.out, 1, 9)
    bare = tmp_path / "bare.csv"
    bare.write_text((folder_of_options / "two.csv").read_text().partition("\n")[2])
    orbiflow.done(*plot, bare, "--no-header", "--columns", "1,2")


def test_a_flow_that_was_meant_and_not_tried_is_said(
    tmp_path, folder_of_options: Path, orbiflow
) -> None:
    how = ("--space", "torus", "--unit", "radians", "--out", tmp_path / "m")
    fit = ("density", "fit", folder_of_options / "two.csv", *how)
    said = "no flow was tried: with fewer than 300 rows, here 40, none gains anything"
    for options, told in ((("--components", "kernels,flow"), True), ((), False)):
        done = orbiflow.done(*fit, *options)
        assert (said in done.out) == told, options


def test_a_mass_gets_the_samples_that_it_needs(folder: Path, tmp_path: Path, orbiflow) -> None:
    out = tmp_path / "r.json"
    region = ("density", "region", "-m", folder / "torus", "--budget", 5000, "--out", out)
    for options, count in (((), 200_000), (("--samples", 20_000), 20_000)):
        orbiflow.done(*region, "--mass", "0.5,0.9995", *options)
        assert json.loads(out.read_text())["samples"] == count


def test_geojson_of_directions(folder: Path, tmp_path: Path, orbiflow) -> None:
    out = tmp_path / "r.geojson"
    orbiflow.done("density", "region", "-m", folder / "sphere", "--mass", "0.8", "--out", out)
    (feature,) = json.loads(out.read_text())["features"]
    assert feature["geometry"]["type"] == "MultiPolygon"
    assert feature["properties"]["held"] == 0.8


@pytest.mark.parametrize(
    ("words", "about"),
    [
        ("region --mass 0.000001 --samples 20000", "0 20000"),
        ("region --smooth 0.00001", "--smooth"),
        ("score data.csv --samples 20000", "--samples --region"),
    ],
)
def test_mistakes_of_masses(words: str, about: str, folder: Path, tmp_path, orbiflow) -> None:
    command, *options = (
        str(folder / "torus.csv") if word == "data.csv" else word for word in words.split()
    )
    out = tmp_path / {"region": "x.json", "score": "x.csv", "plot": "x"}[command]
    done = orbiflow.refused("density", command, *options, "-m", folder / "torus", "--out", out)
    names(done.err, *about.split())
    assert not list(tmp_path.iterdir())


def test_the_gradient_is_that_of_the_scores(folder: Path, tmp_path: Path, orbiflow) -> None:
    model, out = folder / "sphere", tmp_path / "out.csv"
    table = folder / "sphere.csv"
    orbiflow.done("density", "score", table, "--gradient", "--model", model, "--out", out)
    assert out.read_text().startswith("lat,lon,log_prob,log_prob_by_lat,log_prob_by_lon\n")
    found = np.loadtxt(out, delimiter=",", skiprows=1)
    density, _ = read_density(model / "density.safetensors")
    values, slopes = log_density_gradient(density, found[:, :2])
    np.testing.assert_allclose(found[:, 2], values, rtol=1e-6)
    np.testing.assert_allclose(found[:, 3:], slopes, rtol=1e-6)
