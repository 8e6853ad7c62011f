"""`region`, `score --region`, `plot --regions`: how many samples tell a mass, and what is refused."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from orbiflow.density import DensityEstimator, DensityLevels, density_to_bytes, read_density
from refusals import names


@pytest.fixture(name="folder", scope="module")
def folder_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a model and its data."""
    folder = tmp_path_factory.mktemp("masses")
    angles = np.random.default_rng(0).vonmises([0.0, 1.0], 4.0, (60, 2))
    np.savetxt(folder / "data.csv", angles, delimiter=",", header="phi,psi", comments="")
    fitted = DensityEstimator("torus", components="mixture").fit(angles)
    (folder / "density.safetensors").write_bytes(
        density_to_bytes(fitted.density_, columns=["phi", "psi"])
    )
    return folder


def test_a_mass_gets_the_samples_that_it_needs(folder: Path, orbiflow) -> None:
    region = ("density", "region", "-m", folder, "--budget", 5000, "--out", folder / "r.json")
    for mass, options, count in (
        ("0.5,0.9", (), 20_000),
        ("0.5,0.9995", (), 200_000),
        ("0.5,0.9995", ("--samples", 20_000), 20_000),
    ):
        orbiflow.done(*region, "--mass", mass, *options)
        assert json.loads((folder / "r.json").read_text())["samples"] == count


def test_rows_far_out_are_told_apart_by_more_samples(folder: Path, orbiflow) -> None:
    out = folder / "s.csv"
    score = ("density", "score", folder / "data.csv", "-m", folder, "--region", "--out", out)
    done = orbiflow(*score)
    names(done.out, 20000, "0.0035", "0.0005", "0.9995")
    done = orbiflow.done(*score, "--samples", 200_000)
    names(done.out, 200000, "0.0011", "5e-05", "0.99995")
    density, _ = read_density(folder / "density.safetensors")
    with out.open() as file:
        rows = list(csv.DictReader(file))
    expected = DensityLevels(density, samples=200_000).hdr(
        np.loadtxt(folder / "data.csv", delimiter=",", skiprows=1)
    )
    assert [float(row["hdr"]) for row in rows] == pytest.approx(expected.tolist(), abs=1e-9)


def test_lines_far_out(folder: Path, orbiflow) -> None:
    plot = ("density", "plot", "-m", folder, "--out", folder / "plots", "--format", "svg")
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
def test_mistakes(words: str, about: str, folder: Path, orbiflow) -> None:
    command, *options = (str(folder / word) if ".csv" in word else word for word in words.split())
    before = sorted(folder.iterdir())
    out = {"region": "x.json", "score": "x.csv", "plot": "x"}[command]
    done = orbiflow.refused("density", command, *options, "-m", folder, "--out", folder / out)
    names(done.err, *about.split())
    assert sorted(folder.iterdir()) == before
