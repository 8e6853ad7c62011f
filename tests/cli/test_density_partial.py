"""`density marginal` and `conditional`, weights and missing angles, by the public command."""

import json
from pathlib import Path

import numpy as np
import pytest

from cli.conftest import Run
from density.blends import random_blend
from orbiflow.density import DensityEstimator, density_to_bytes
from orbiflow.runtime import Cancel, Cancelled, Progress, find
from refusals import names

QUICK = ("--components", "mixture", "--unit", "degrees")


def table(path: Path, *, gaps: bool = False) -> Path:
    """Angles phi, psi and chi in degrees, and what each row weighs."""
    rng = np.random.default_rng(0)
    angles = rng.normal([20.0, 60.0, -100.0], 25.0, (60, 3))
    rows = [[f"{v:.3f}" for v in row] + [str(1 + k % 3)] for k, row in enumerate(angles)]
    if gaps:
        rows[3][1] = rows[4][0] = ""
        rows[5][:3] = ["", "NaN", ""]
    path.write_text("phi,psi,chi,count\n" + "".join(",".join(row) + "\n" for row in rows))
    return path


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("model")
    values = np.loadtxt(table(folder / "data.csv"), delimiter=",", skiprows=1)[:, :3]
    fit = DensityEstimator("torus", unit="degrees", components="mixture").fit(values)
    saved = density_to_bytes(fit.density_, columns=["phi", "psi", "chi"])
    (folder / "density.safetensors").write_bytes(saved)
    return folder


def test_marginal_and_conditional(tmp_path: Path, model: Path, orbiflow: Run) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    done = orbiflow.done("density", "marginal", "--model", model, "--columns", "PSI", "--out", one)
    names(done.out, "psi")
    left = {path.name for path in one.iterdir()}
    assert left == {"density.csv", "density.png", "density.safetensors", "report.json"}
    values = np.loadtxt(one / "density.csv", delimiter=",", skiprows=1)
    assert (one / "density.csv").read_text().startswith("psi,density\n")
    assert values[:, 1].sum() * 0.5 == pytest.approx(1, abs=1e-4)  # steps of half a degree

    given = ("density", "conditional", "--model", model, "--at", "chi=-100")
    orbiflow.done(*given, "--out", two)
    values = np.loadtxt(two / "density.csv", delimiter=",", skiprows=1)
    assert values[:, 2].sum() * 9 == pytest.approx(1, abs=1e-3)
    report = json.loads((two / "report.json").read_text())
    assert report["given"] == {"chi": -100.0}
    assert report["columns"] == ["phi", "psi"]
    orbiflow.done(*given, "--columns", "psi", "--out", two)  # over what was there
    drawn = tmp_path / "drawn.csv"
    orbiflow.done("density", "sample", "--model", two, "-n", 5, "--out", drawn)
    assert drawn.read_text().startswith("psi\n")
    orbiflow.done(*("density", "score", drawn, "--model", two, "--out", tmp_path / "scores.csv"))


@pytest.fixture(scope="module")
def blend(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Kernels, chains and a network of four angles."""
    folder = tmp_path_factory.mktemp("blend")
    saved = density_to_bytes(random_blend(2, 4, network=True), columns=["a", "b", "c", "d"])
    (folder / "density.safetensors").write_bytes(saved)
    return folder


def test_samples_of_three_angles(tmp_path: Path, blend: Path, orbiflow: Run) -> None:
    folder, table = tmp_path / "three", tmp_path / "drawn.csv"
    orbiflow.done("density", "conditional", "-m", blend, "--at", "b=100", "--out", folder)
    done = orbiflow.done("density", "sample", "-m", folder, "-n", 400, "--out", table)
    names(done.out, "weighed")
    assert table.read_text().startswith("a,c,d\n")
    drawn = np.loadtxt(table, delimiter=",", skiprows=1)
    assert drawn.shape == (400, 3)
    assert 90 < np.ptp(drawn, axis=0).min() <= 360  # in degrees
    assert not (folder / "density.csv").exists()


def test_accuracy_is_what_was_asked_for(tmp_path: Path, blend: Path, orbiflow: Run) -> None:
    errors: list[float] = []
    for accuracy in (0.2, 1e-6):
        asked = ("--columns", "d", "--accuracy", accuracy, "--out", tmp_path / "out")
        done = orbiflow.done("density", "marginal", "-m", blend, *asked)
        errors.append(json.loads((tmp_path / "out" / "report.json").read_text())["report"]["error"])
        warned = (
            f"WARNING: the density cannot be approximated to within {accuracy:g} nats"
            in done.out + done.err
        )
        assert warned == (errors[-1] > accuracy) == (accuracy == 1e-6)
    assert errors[0] > errors[1]


def test_it_can_be_cancelled_in_the_middle(tmp_path: Path, blend: Path) -> None:
    cancel, told = Cancel(), list[str]()

    def hear(event: object) -> None:
        if isinstance(event, Progress):
            told.append(event.what)
            if "level 2" in event.what:
                cancel.cancel()

    asked = {"model": blend, "columns": ("d",), "accuracy": 1e-6, "out": tmp_path / "out"}
    with pytest.raises(Cancelled):
        find("density marginal").call(asked).run(hear, cancel)
    assert told[-1] == "integrating, level 2"
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "about"),
    [
        ("conditional --at chi", "psi=-45 chi"), ("conditional --at chi=much", "chi much"),
        ("conditional --at omega=3", "omega phi psi chi"),
        ("conditional --at chi=3 --columns chi", "--columns --at"), ("marginal --columns 4", "4"),
        ("marginal --columns phi,1", "phi"),
    ],
)  # fmt: skip
def test_mistakes(words: str, about: str, tmp_path: Path, model: Path, orbiflow: Run) -> None:
    command, *options = words.split()
    done = orbiflow.refused(
        "density", command, "--model", model, *options, "--out", tmp_path / "out"
    )
    names(done.err, *about.split())
    assert not (tmp_path / "out").exists()


def test_weights_and_missing_angles(tmp_path: Path, orbiflow: Run) -> None:
    data, model, out = table(tmp_path / "gaps.csv", gaps=True), tmp_path / "m", tmp_path / "s.csv"
    weight = ("--columns", "count=weight")
    fit = ("density", "fit", data, *QUICK, *weight, "--space", "torus", "--out", model)
    done = orbiflow.done(*fit, "--missing", "marginalise")
    names(done.out, "2 of 59", "1 row")
    assert json.loads((model / "report.json").read_text())["columns"] == ["phi", "psi", "chi"]
    done = orbiflow.done(
        *("density", "score", data, "--model", model, "--out", out),
        *("--missing", "marginalise", *weight),
    )
    names(done.out, "3 of 60")
    header, *rows = out.read_text().splitlines()
    assert header == "phi,psi,chi,count,log_prob_marginal"
    assert rows[5].endswith(",0")
    values = np.array([float(row.split(",")[-1]) for row in rows])
    whole = np.delete(np.arange(60), [3, 4, 5])
    mean = np.average(values[whole], weights=1 + whole % 3)
    names(done.out, f"{mean:.4f}", 57, "weighted")
    refused = orbiflow(*fit)
    names(refused.err, "line 5", "psi", "--drop-missing")
    orbiflow.done(*fit, "--missing", "drop")
