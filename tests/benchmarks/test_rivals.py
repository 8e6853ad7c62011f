"""Rivals' densities are put into the unit of ours, and integrate to one there."""

import importlib
import math
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.stats
from scipy.spatial.transform import Rotation

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
MODULES = ("rivals", "density_known", "density_data", "common")


@pytest.fixture(autouse=True)
def _modules(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    yield
    for name in MODULES:
        sys.modules.pop(name, None)


def uniform_rows(space: str, count: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    if space == "torus":
        return rng.uniform(-10, 10, (count, 3))
    if space == "rotation-space":
        return Rotation.random(count, rng=rng).as_quat()
    lat = np.degrees(np.arcsin(rng.uniform(-1, 1, count)))
    return np.stack([lat, rng.uniform(-180, 540, count)], axis=1)


@pytest.mark.parametrize(
    ("space", "volume"),
    [("torus", (2 * math.pi) ** 3), ("sphere", 4 * math.pi), ("rotation-space", 1.0)],
)
def test_what_is_even_is_even_in_the_box(space: str, volume: float) -> None:
    rivals = importlib.import_module("rivals")
    box = rivals.box_of(space, 3)
    rows = box.lay(uniform_rows(space, 4000))
    assert rows.shape == (4000, box.dim)
    assert (abs(rows) <= math.pi + 1e-12).all()
    even = (rows + math.pi) / (2 * math.pi)
    for axis in range(box.dim):
        if space != "torus":
            assert scipy.stats.kstest(even[:, axis], "uniform").pvalue > 1e-3
    # the even density of the box is the even density of the space
    assert box.shift - box.dim * math.log(2 * math.pi) == pytest.approx(-math.log(volume))


def test_the_true_density_of_mixtures_of_rotations_has_the_mean_one() -> None:
    rows, _, log_density, *_ = importlib.import_module("density_known").turned(16, 2000)
    other = Rotation.random(50_000, rng=np.random.default_rng(1)).as_quat()
    ratio = np.exp(log_density(other))
    assert ratio.mean() == pytest.approx(1, abs=5 * ratio.std() / len(ratio) ** 0.5)
    assert log_density(rows) == pytest.approx(log_density(-rows))
    # by Jensen's inequality, and by three nats
    assert log_density(rows).mean() > 3


@pytest.mark.parametrize("space", ["torus", "sphere", "rotation-space"])
def test_kernels_of_scikit_learn_integrate_to_one(space: str) -> None:
    rivals = importlib.import_module("rivals")
    rng = np.random.default_rng(2)
    if space == "torus":
        angle = rng.normal(0, 0.6, (60, 2))
        line = (np.arange(200) + 0.5) / 200 * 2 * math.pi
        grid = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
        rows, points = (
            np.stack([np.cos(own), np.sin(own)], axis=2).reshape(len(own), 4)
            for own in (angle, grid)
        )
        volume = (2 * math.pi) ** 2
    else:
        # many even points of a sphere, with an error of one over the root of their number
        width = 3 if space == "sphere" else 4
        rows, points = (rng.normal(size=(count, width)) for count in (60, 40_000))
        rows[:, 0] = 2 * abs(rows[:, 0])
        rows, points = (own / np.linalg.norm(own, axis=1, keepdims=True) for own in (rows, points))
        volume = 4 * math.pi if space == "sphere" else 1.0
    log, _ = rivals.scikit_learn(rows[:40], rows[40:], signed=space != "rotation-space")
    density = np.exp(log(points)) * volume
    error = 0 if space == "torus" else density.std() / len(density) ** 0.5
    assert density.mean() == pytest.approx(1, abs=5 * error + 2e-3)
