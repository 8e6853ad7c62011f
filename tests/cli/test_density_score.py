"""`orbiflow density score`: gradients beside log densities, tables with their errors, mistakes."""

from pathlib import Path

import numpy as np
import pytest


@pytest.fixture(name="fitted", scope="module")
def fitted_fixture(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Directions, and the folder of a density of them."""
    from orbiflow.density import DensityEstimator, density_to_bytes

    folder = tmp_path_factory.mktemp("score")
    values = np.random.default_rng(0).normal([20.0, 60.0], 25.0, (100, 2)).clip(-89, 89)
    data = folder / "data.csv"
    np.savetxt(data, values, delimiter=",", fmt="%.4f", header="lat,lon", comments="")
    estimator = DensityEstimator("sphere", components="kernels,mixture").fit(values)
    model = folder / "density.safetensors"
    model.write_bytes(density_to_bytes(estimator.density_))
    return data, model


def columns(path: Path) -> tuple[str, np.ndarray]:
    header, *rows = path.read_text().splitlines()
    return header, np.array([row.split(",") for row in rows], dtype=float)


def test_the_gradient_is_that_of_the_scores(fitted, tmp_path: Path, orbiflow) -> None:
    data, model = fitted
    out = tmp_path / "out.csv"
    orbiflow.done("density", "score", data, "--model", model, "--gradient", "--out", out)
    header, found = columns(out)
    assert header == "lat,lon,log_prob,log_prob_by_lat,log_prob_by_lon"
    for axis, step in enumerate(1e-3 * np.eye(2)):
        ends = []
        for sign in (1, -1):
            moved, scored = tmp_path / "moved.csv", tmp_path / "scored.csv"
            np.savetxt(
                moved, found[:, :2] + sign * step, delimiter=",", header="lat,lon", comments=""
            )
            assert (
                orbiflow("density", "score", moved, "--model", model, "--out", scored).status == 0
            )
            ends.append(columns(scored)[1][:, 2])
        np.testing.assert_allclose(
            found[:, 3 + axis], (ends[0] - ends[1]) / 2e-3, rtol=1e-3, atol=1e-4
        )
