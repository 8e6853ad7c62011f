"""Models and tables that are not there or not theirs, mistakes in options, masses and their samples."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from orbiflow.density import DensityEstimator, DensityLevels, density_to_bytes, read_density
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
    ("model", "about"),
    [
        ("nowhere", "nowhere"),
        ("empty", "empty density.safetensors"),
        ("damaged", "damaged"),
        ("torus.csv", "torus.csv"),
    ],
)
@pytest.mark.parametrize("command", ["score", "sample", "plot", "region", "marginal", "compare"])
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


@pytest.mark.parametrize("command", ["score", "plot", "compare"])
def test_another_number_of_columns(command: str, folder: Path, tmp_path: Path, orbiflow) -> None:
    models = [word for name in ("torus", "degrees") for word in ("-m", folder / name)]
    options = {
        "score": (*models[:2], "--out", tmp_path / "x.csv", folder / "torus.csv"),
        "plot": (*models[:2], "--out", tmp_path / "x", "--data", folder / "torus.csv"),
        "compare": ("-m", folder / "torus", "-m", folder / "torus2", "-d", folder / "torus.csv"),
    }[command]
    other = folder / "torus2"
    other.mkdir(exist_ok=True)
    model = folder / "torus" / "density.safetensors"
    (other / model.name).write_bytes(model.read_bytes())
    done = orbiflow.refused("density", command, *options, "--columns", "phi")
    names(done.err, "1", "phi", "phi, psi")


def test_angles_that_seem_to_be_in_another_unit(folder: Path, tmp_path: Path, orbiflow) -> None:
    out = tmp_path / "x.csv"

    def said(data: str, model: str, *options: str) -> str:
        given = ("-m", folder / model, "--out", out, *options)
        done = orbiflow.done("density", "score", folder / data, *given)
        return done.out

    assert "WARNING" not in said("torus.csv", "torus")
    assert "WARNING" not in said("degrees.csv", "degrees")
    assert "WARNING" not in said("sphere.csv", "sphere")
    refused = orbiflow.refused(
        "density", "score", folder / "degrees.csv", "-m", folder / "torus", "-o", out
    )
    names(refused.err, "degrees.csv", "turn", "line")
    names(said("torus.csv", "degrees"), "WARNING", "radians", "phi", "psi")
    names(said("torus.csv", "sphere", "--columns", "1,2"), "WARNING", "radians")
    one = ("density", "conditional", "-m", folder / "torus", "--out", tmp_path / "m", "--at")
    names(orbiflow(*one, "psi=45").err, "psi", 45, "turn")
    assert "WARNING" not in orbiflow(*one, "psi=4.5").out


@pytest.mark.parametrize(("out", "about"), [("empty", "empty"), ("none/x.csv", "none")])
@pytest.mark.parametrize("command", ["score", "sample"])
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
    write(folder / "places.csv", "lat,lon", np.degrees(angles[:, :2]).clip(-80, 80))
    write(folder / "beyond.csv", "lat,lon", np.full((30, 2), 95.0))
    write(folder / "weights.csv", "phi,psi,w", np.column_stack([angles[:, :2], -np.eye(1, 40)[0]]))
    gaps = angles[:, :2].copy()
    gaps[7, 1] = np.nan
    write(folder / "gaps.csv", "phi,psi", gaps)
    write(folder / "nothing.csv", "phi,psi", np.full((12, 2), np.nan))
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
        ("fit places.csv --space sphere --unit radians", "--unit radians"),
        ("fit places.csv --space sphere --components chains", "Sphere 2 chains"),
        ("fit gaps.csv --space klein-bottle --missing marginalise", "--missing marginalise"),
        ("fit gaps.csv --space torus --missing marginalise --components flow", "--components"),
        ("fit gaps.csv --space torus --unit radians", "--drop-missing 9 psi"),
        ("fit nothing.csv --space torus --unit radians", "nothing.csv phi"),
        ("fit weights.csv --space torus --unit radians --columns w=weight", "'w' weight -1:"),
        (
            "cv gaps.csv --space torus --missing marginalise --components flow",
            "--missing marginalise",
        ),
        ("plot -m model3 --regions 0.5", "--regions 3"),
        ("plot -m model2 --data gaps.csv", "--drop-missing"),
        ("compare-data -d places.csv -d beyond.csv --space sphere", "beyond 95 90 lat 30"),
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
    for options, told in (
        (("--components", "kernels,flow"), True),
        (("--max-frequency", 2), True),
        (("--components", "kernels"), False),
        ((), False),
    ):
        done = orbiflow.done(*fit, *options)
        assert (said in done.out) == told, options


def test_a_mass_gets_the_samples_that_it_needs(folder: Path, tmp_path: Path, orbiflow) -> None:
    out = tmp_path / "r.json"
    region = ("density", "region", "-m", folder / "torus", "--budget", 5000, "--out", out)
    for mass, options, count in (
        ("0.5,0.9", (), 20_000),
        ("0.5,0.9995", (), 200_000),
        ("0.5,0.9995", ("--samples", 20_000), 20_000),
    ):
        orbiflow.done(*region, "--mass", mass, *options)
        assert json.loads(out.read_text())["samples"] == count


def test_rows_far_out_are_told_apart_by_more_samples(folder: Path, tmp_path, orbiflow) -> None:
    out, data, model = tmp_path / "s.csv", folder / "torus.csv", folder / "torus"
    score = ("density", "score", data, "-m", model, "--region", "--out", out)
    done = orbiflow(*score)
    names(done.out, 20000, "0.0035", "0.0005", "0.9995")
    done = orbiflow.done(*score, "--samples", 200_000)
    names(done.out, 200000, "0.0011", "5e-05", "0.99995")
    density, _ = read_density(model / "density.safetensors")
    with out.open() as file:
        rows = list(csv.DictReader(file))
    angles = np.loadtxt(data, delimiter=",", skiprows=1)
    expected = DensityLevels(density, samples=200_000).hdr(angles)
    assert [float(row["hdr"]) for row in rows] == pytest.approx(expected.tolist(), abs=1e-9)


def test_lines_far_out(folder: Path, tmp_path: Path, orbiflow) -> None:
    plot = ("density", "plot", "-m", folder / "torus", "--out", tmp_path, "--format", "svg")
    done = orbiflow.done(*plot, "--regions", "0.5,0.9995", "--region-samples", 20_000)
    names(done.out, "50 %", "99.95 %")


@pytest.mark.parametrize(
    ("words", "about"),
    [
        ("region --mass 0.000001 --samples 20000", "0 20000"),
        ("region --mass 0.99999999", "1 1e-06 0.999999"),
        ("region --smooth 0.00001", "--smooth"),
        ("score data.csv --samples 20000", "--samples --region"),
        ("score data.csv --region --samples 20", "--samples 1000 10000000"),
        ("plot --regions abc", "--regions 1 0 abc"),
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


def columns(path: Path) -> tuple[str, np.ndarray]:
    header, *rows = path.read_text().splitlines()
    return header, np.array([row.split(",") for row in rows], dtype=float)


def test_the_gradient_is_that_of_the_scores(folder: Path, tmp_path: Path, orbiflow) -> None:
    out, moved, scored = (tmp_path / f"{name}.csv" for name in ("out", "moved", "scored"))
    model = ("--model", folder / "sphere", "--out")
    orbiflow.done("density", "score", folder / "sphere.csv", "--gradient", *model, out)
    header, found = columns(out)
    assert header == "lat,lon,log_prob,log_prob_by_lat,log_prob_by_lon"
    for axis, step in enumerate(1e-3 * np.eye(2)):
        ends = []
        for sign in (1, -1):
            write(moved, "lat,lon", found[:, :2] + sign * step)
            orbiflow.done("density", "score", moved, *model, scored)
            ends.append(columns(scored)[1][:, 2])
        slope = (ends[0] - ends[1]) / 2e-3
        np.testing.assert_allclose(found[:, 3 + axis], slope, rtol=1e-3, atol=1e-4)
