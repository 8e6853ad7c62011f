"""Mistakes as users make them: each is said by the option's name, none ends in a traceback."""

from pathlib import Path

import numpy as np
import pytest

from orbiflow.density import DensityEstimator, density_to_bytes
from refusals import names


@pytest.fixture(name="folder", scope="module")
def folder_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with tables, most of them wrong, and models of two and of three angles."""
    folder = tmp_path_factory.mktemp("mistakes")
    rng = np.random.default_rng(0)
    angles = rng.vonmises([0.0, 1.0, 2.0], 4.0, (40, 3))
    table(folder / "two.csv", "phi,psi", angles[:, :2])
    table(folder / "other.csv", "phi,psi", angles[::-1, :2] + 0.01)
    table(folder / "places.csv", "lat,lon", np.degrees(angles[:, :2]).clip(-80, 80))
    table(folder / "beyond.csv", "lat,lon", np.full((30, 2), 95.0))
    table(folder / "weights.csv", "phi,psi,w", np.column_stack([angles[:, :2], -np.eye(1, 40)[0]]))
    gaps = angles[:, :2].copy()
    gaps[7, 1] = np.nan
    table(folder / "gaps.csv", "phi,psi", gaps)
    table(folder / "nothing.csv", "phi,psi", np.full((12, 2), np.nan))
    for dim in (2, 3):
        fitted = DensityEstimator("torus", components="mixture").fit(angles[:, :dim])
        model = folder / f"model{dim}"
        model.mkdir()
        (model / "density.safetensors").write_bytes(
            density_to_bytes(fitted.density_, columns=["phi", "psi", "chi"][:dim])
        )
    return folder


def table(path: Path, header: str, values: np.ndarray) -> None:
    np.savetxt(path, values, delimiter=",", header=header, comments="")


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
def test_mistakes(words: str, about: str, folder: Path, orbiflow) -> None:
    command, *options = (
        str(folder / word) if (folder / word).exists() else word for word in words.split()
    )
    before = sorted(folder.rglob("*"))
    out = () if command == "compare-data" else ("--out", folder / "out")
    done = orbiflow.refused("density", command, *options, *out)
    names(done.err, *about.split())
    assert sorted(folder.rglob("*")) == before


def test_rows_that_lack_a_value_can_be_left_out_of_pictures(folder, tmp_path, orbiflow) -> None:
    plot = ("density", "plot", "-m", folder / "model2", "--out", tmp_path / "plots", "--data")
    done = orbiflow.done(*plot, folder / "gaps.csv", "--drop-missing")
    names(done.out, 1, 9)
    bare = tmp_path / "bare.csv"
    bare.write_text("".join((folder / "two.csv").read_text().splitlines(keepends=True)[1:]))
    orbiflow.done(*plot, bare, "--no-header", "--columns", "1,2")


def test_a_flow_that_was_meant_and_not_tried_is_said(tmp_path, folder: Path, orbiflow) -> None:
    how = ("--space", "torus", "--unit", "radians", "--out", tmp_path / "m")
    fit = ("density", "fit", folder / "two.csv", *how)
    said = "no flow was tried: with fewer than 300 rows, here 40, none gains anything"
    for options, told in (
        (("--components", "kernels,flow"), True),
        (("--max-frequency", 2), True),
        (("--components", "kernels"), False),
        ((), False),
    ):
        done = orbiflow.done(*fit, *options)
        assert (said in done.out) == told, options
