"""Tori of four and more angles through the estimator, and back from a file."""

from pathlib import Path

import numpy as np
import pytest
import torch

from orbiflow.density import DensityEstimator, Mixture, Torus, density_to_bytes, read_density
from orbiflow.errors import InputFileError
from refusals import refused


def data(count: int = 400) -> np.ndarray:
    """Five angles in degrees, the fourth and fifth tied to the first."""
    rng = np.random.default_rng(0)
    x = rng.vonmises([0.0, 1.0, -2.0, 0.0, 0.0], [2.0, 4.0, 8.0, 20.0, 20.0], (count, 5))
    x[:, 3:] += 0.7 * np.sin(x[:, :1])
    return np.degrees(x)


def test_five_angles(tmp_path: Path) -> None:
    points = data()
    estimator = DensityEstimator("torus", unit="degrees").fit(points[:200])
    assert isinstance(estimator.density_, Mixture)
    assert "chains" in estimator.density_.weight_of_kind
    assert estimator.score(points[200:]) > -5 * np.log(360) + 3
    assert estimator.sample(7, random_state=1).shape == (7, 5)
    path = tmp_path / "density.safetensors"
    path.write_bytes(density_to_bytes(estimator.density_, columns=list("abcde")))
    back, extra = read_density(path)
    assert extra == {"columns": list("abcde")}
    chart = estimator.space_.to_chart(points)
    with torch.no_grad():
        assert torch.equal(back.log_prob(chart), estimator.density_.log_prob(chart))
    broken = bytearray(path.read_bytes())
    broken[-100:] = b"\xff" * 100
    path.write_bytes(bytes(broken))
    with refused("damaged", kind=InputFileError):
        read_density(path)


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"segments": 2, "max_frequency": 16}, "max_frequency segments"),
        ({"iterations": 3}, "iterations"),
    ],
)
def test_settings_without_a_meaning_are_refused(settings: dict, named: str) -> None:
    with refused(*named.split(), "torus", 5):
        DensityEstimator("torus", unit="degrees", **settings).fit(data(20))
    with refused(*named.split()):
        DensityEstimator(Torus(5, unit="degrees"), **settings).fit(data(20))
