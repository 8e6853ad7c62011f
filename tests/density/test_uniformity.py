"""Rao's spacing test has its own distribution."""

import numpy as np
import pytest
from scipy.stats import kstest

from orbiflow.density import summarize_angles, uniformity
from orbiflow.density.uniformity import rao_p


def with_excess(degrees: float, count: int) -> np.ndarray:
    """Angles in turns of which gaps exceed 360 / n by so much in all, one gap alone."""
    gaps = np.full(count, (1 - 1 / count - degrees / 360) / (count - 1))
    gaps[0] = 1 / count + degrees / 360
    return np.cumsum(gaps)


@pytest.mark.parametrize(
    ("count", "degrees", "p"),
    [  # Batschelet, Circular Statistics in Biology (1981), table L
        (4, 221.14, 0.01), (4, 186.45, 0.05), (5, 211.93, 0.01), (5, 183.44, 0.05), (5, 168.66, 0.1),
    ],
)  # fmt: skip
def test_critical_values_are_those_of_tables(count: int, degrees: float, p: float) -> None:
    assert rao_p(with_excess(degrees, count)) == pytest.approx(p, abs=2e-4)


@pytest.mark.parametrize("count", [4, 11, 60])
def test_p_of_even_angles_is_even(count: int) -> None:
    rng = np.random.default_rng(count)
    found = [rao_p(rng.uniform(-3, 3, count)) for _ in range(400)]
    assert kstest(np.array(found, dtype=float), "uniform").pvalue > 1e-3


@pytest.mark.parametrize("score", [-2.0, 0.0, 1.0, 2.3, 3.5])
def test_both_forms_agree(score: float, monkeypatch: pytest.MonkeyPatch) -> None:
    mean = (1 - 1 / 200) ** 200
    turns = with_excess(360 * (mean + score * 0.0173), 200)
    exact = rao_p(turns)
    monkeypatch.setattr(uniformity, "MOST_EXACT", 10)
    assert rao_p(turns) == pytest.approx(exact, abs=2e-4, rel=0.06)


def test_gaps_of_even_and_of_rounded_angles() -> None:
    assert rao_p(np.arange(12) / 12 + 0.01) == pytest.approx(1)
    rng = np.random.default_rng(0)
    assert rao_p(rng.integers(0, 72, 60) / 72) is None
    assert rao_p(np.array([0.1, 0.2, 0.3])) is None
    # four modes a quarter apart: the mean is nowhere, and the gaps are uneven
    angles = (np.degrees(rng.vonmises(0, 200, 48)) + 90 * np.arange(48)) % 360
    (found,), _ = summarize_angles(angles, unit="degrees")
    assert found.rao_p is not None
    assert found.rao_p < 1e-6
    assert (found.rayleigh_p or 0) > 0.5
    (weighed,), _ = summarize_angles(angles, unit="degrees", weights=1 + np.arange(48))
    assert weighed.rao_p is None
