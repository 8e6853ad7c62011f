"""Rows that lack angles: they count by what they have, and are scored by it."""

import itertools

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from density.blends import random_kernels
from orbiflow.arrays import Array
from orbiflow.density import (
    DensityEstimator,
    DensitySettings,
    Torus,
    density_to_bytes,
    fit_automatic,
)
from orbiflow.density.fitting import Rows
from orbiflow.density.fitting.kernels import fit_mixture
from orbiflow.density.fitting.rows import with_incomplete
from orbiflow.density.inference import at_observed, log_prob_observed
from refusals import refused

seeds = st.integers(0, 2**31)
BOTH = DensitySettings(components=("kernels", "mixture"))


def two_clusters(seed: int, count: int, share: float = 0.5) -> Array:
    """Angles about (0, 1) and (2, -1), the latter of a share."""
    rng = np.random.default_rng(seed)
    at = np.array([[0.0, 1.0], [2.0, -1.0]])[(rng.uniform(size=count) < share).astype(int)]
    return rng.vonmises(at, 30.0)


@given(seeds)
@settings(deadline=None, max_examples=5)
def test_em_climbs_on_the_likelihood_of_what_is_there(seed: int) -> None:
    rng = np.random.default_rng(seed)
    space = Torus(3)
    points = torch.tensor(rng.uniform(size=(80, 3)) * 0.5)
    points[torch.tensor(rng.uniform(size=(80, 3)) < 0.3)] = torch.nan
    points = points[~points.isnan().all(dim=1)]
    scores = []
    for iterations in (1, 2, 4, 8, 16):
        part = fit_mixture(
            space,
            Rows(points),
            2,
            iterations=iterations,
            generator=torch.Generator().manual_seed(seed),
        )
        scores.append(float(at_observed(part, points).mean()))
    # but for the imaginary points that hold concentrations finite
    assert all(b > a - 5e-3 for a, b in itertools.pairwise(scores))


@given(seeds)
@settings(deadline=None, max_examples=5)
def test_kernels_take_over_what_incomplete_rows_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    kernels = random_kernels(rng, Torus(2))
    points = torch.tensor(rng.uniform(size=(50, 2)))
    points[:, 1] = torch.nan
    before = at_observed(kernels, points)
    after = at_observed(with_incomplete(kernels, Rows(points), 1.0), points)
    # a step of EM raises the likelihood of the rows that it is of
    assert float(after.mean()) >= float(before.mean()) - 0.05


def test_rows_that_lack_angles_tell_how_common_places_are() -> None:
    """Whole rows have one cluster too rarely; rows that know the first angle alone make up for it."""
    whole, rest = two_clusters(0, 200, 0.1), two_clusters(1, 600, 0.6)
    rest[:, 1] = np.nan
    density = DensityEstimator("torus", missing="marginalise", components="kernels,mixture").fit(
        np.concatenate([whole, rest])
    )
    drawn = density.sample(4000, random_state=0)
    share = (np.cos(drawn[:, 0] - 2) > np.cos(drawn[:, 0])).mean()
    assert share == pytest.approx((0.1 * 200 + 0.6 * 600) / 800, abs=0.05)
    # and the second angle still goes with the first
    assert np.cos(drawn[np.cos(drawn[:, 0] - 2) > 0.9][:, 1] + 1).mean() > 0.8
    assert any("600 of 800 rows lack some angles" in note for note in density.report_.notes)


def test_whole_rows_are_fitted_as_ever() -> None:
    angles = two_clusters(2, 120)
    one, other = (
        DensityEstimator("torus", components="kernels,mixture", missing=missing).fit(angles)
        for missing in ("refuse", "marginalise")
    )
    assert density_to_bytes(one.density_) == density_to_bytes(other.density_)


def test_weights_and_rows_without_any_angle() -> None:
    angles = two_clusters(3, 90)
    angles[:30, 1] = np.nan
    angles[5] = np.nan
    weights = np.linspace(1, 2, 90)
    space = Torus(2)
    points = torch.tensor(angles / (2 * np.pi))
    found, report = fit_automatic(space, points, BOTH, missing="marginalise", weights=weights)
    again, _ = fit_automatic(
        space,
        points[np.arange(90) != 5],
        BOTH,
        missing="marginalise",
        weights=weights[np.arange(90) != 5],
    )
    assert density_to_bytes(found) == density_to_bytes(again)
    assert report.points == 89
    assert any("1 row lacks all angles" in note for note in report.notes)


def test_scores_are_of_the_angles_that_are_there() -> None:
    fit = DensityEstimator("torus", components="kernels", missing="marginalise").fit(
        two_clusters(4, 60)
    )
    rows = np.array([[0.1, np.nan], [np.nan, 1.1], [0.1, 1.1], [np.nan, np.nan]])
    found = fit.score_samples(rows)
    first, second = fit.marginal("angle1"), fit.marginal(1)
    assert found[0] == pytest.approx(first.score_samples([[0.1]])[0])
    assert found[1] == pytest.approx(second.score_samples([[1.1]])[0])
    assert found[2] == pytest.approx(fit.score_samples(rows[2:3])[0])
    assert found[3] == 0
    chart = torch.tensor(rows / (2 * np.pi))
    assert found == pytest.approx(log_prob_observed(fit.density_, chart, measure="natural").numpy())


def test_mistakes_are_named() -> None:
    angles = two_clusters(5, 60)
    angles[0, 1] = np.nan
    for options, message in (
        ({}, "missing"),
        ({"missing": "marginalise", "components": "chains"}, "chains"),
        ({"missing": "marginalise", "components": "flow"}, "missing marginalise"),
        ({"missing": "guess"}, "missing"),
        ({"missing": "marginalise", "space": "klein-bottle"}, "missing"),
    ):
        with refused(*message.split()):
            DensityEstimator(**{"space": "torus", **options}).fit(angles)  # type: ignore[arg-type]
    angles[5:, 1] = np.nan
    with refused("different", "10", "4"):
        DensityEstimator("torus", missing="marginalise").fit(angles)
    angles[7, 0] = np.inf
    with refused("infinite"):
        DensityEstimator("torus", missing="marginalise").fit(angles)
