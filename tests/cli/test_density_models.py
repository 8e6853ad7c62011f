"""Models that are not there, tables that are not theirs, names of files that lie."""

from pathlib import Path

import numpy as np
import pytest

from orbiflow.density import DensityEstimator, density_to_bytes
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
        write(folder / f"{name}.csv", columns, data)
        fitted = DensityEstimator(space, unit=unit, components="mixture").fit(data)
        (folder / name).mkdir()
        (folder / name / "density.safetensors").write_bytes(
            density_to_bytes(fitted.density_, columns=columns)
        )
    (folder / "empty").mkdir()
    (folder / "damaged").mkdir()
    whole = (folder / "torus" / "density.safetensors").read_bytes()
    (folder / "damaged" / "density.safetensors").write_bytes(whole[:-9])
    write(folder / "one.csv", ["phi"], angles[:, :1])
    return folder


def write(path: Path, columns: list[str], values: np.ndarray) -> None:
    np.savetxt(path, values, delimiter=",", header=",".join(columns), comments="")


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
    monkeypatch.setattr("orbiflow.density.operations.saved.model_at", None)
    monkeypatch.setattr("orbiflow.density.tables.rows.read_rows", None)
    options = {
        "score": (folder / "torus.csv", "-m", folder / "torus"),
        "sample": ("-m", folder / "torus"),
    }[command]
    before = sorted(folder.rglob("*"))
    done = orbiflow.refused("density", command, *options, "--out", folder / out)
    names(done.err, *about.split())
    assert sorted(folder.rglob("*")) == before
