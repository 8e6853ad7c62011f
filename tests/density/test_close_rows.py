"""Rows that are close together are told apart, down to some metres on the earth and less."""

import math

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

import orbiflow.density as od
from orbiflow.density.fitting.kernels import NARROWEST, narrowest_for
from orbiflow.density.models import MAX_CONCENTRATION
from orbiflow.density.models.sums import near_log_sum
from orbiflow.errors import DataWarning
from refusals import warned

EARTH = 6_371_000.0
"""Radius in metres."""

MIDDLE = (48.2, 16.37)
Rows = NDArray[np.float64]


def town(rng: np.random.Generator, rows: int, apart: float, wide: float) -> tuple[Rows, Rows]:
    """Places (N, 2) in degrees in two clusters some metres apart, and their true log densities."""
    east = wide * rng.normal(size=rows) + np.where(rng.random(rows) < 0.5, -apart, apart) / 2
    north = wide * rng.normal(size=rows)
    found = np.stack([north, east / math.cos(math.radians(MIDDLE[0]))], axis=1)
    fits = [-((east - sign * apart / 2) ** 2 + north**2) / (2 * wide**2) for sign in (-1, 1)]
    true = np.logaddexp(*fits) - math.log(4 * math.pi * (wide / EARTH) ** 2)
    return MIDDLE + np.degrees(found / EARTH), true


@pytest.mark.parametrize(("apart", "wide"), [(640, 100), (6, 1)])
def test_a_town_is_as_sharp_as_its_rows(apart: float, wide: float) -> None:
    rng = np.random.default_rng(1)
    rows, _ = town(rng, 300, apart, wide)
    fit = od.DensityEstimator("sphere", components=("kernels",)).fit(rows)
    new, true = town(rng, 500, apart, wide)
    assert float((true - fit.score_samples(new)).mean()) < 0.15
    cluster = np.degrees(apart / 2 / EARTH) / math.cos(math.radians(MIDDLE[0]))
    on, between = fit.score_samples([[MIDDLE[0], MIDDLE[1] + cluster], list(MIDDLE)])
    assert on > between + 2
    drawn = fit.sample(300, random_state=0)
    off = np.radians(drawn - MIDDLE) * EARTH
    off[:, 1] = abs(off[:, 1] * math.cos(math.radians(MIDDLE[0]))) - apart / 2
    assert (np.linalg.norm(off, axis=1) < 4 * wide).mean() > 0.97
    region = od.highest_density_region(fit, 0.5)
    assert region.contains(new).mean() == pytest.approx(0.5, abs=0.08)


@pytest.mark.parametrize(("apart", "wide"), [(60, 8)])
def test_regions_of_a_town_are_outlined(apart: float, wide: float) -> None:
    rows, _ = town(np.random.default_rng(8), 300, apart, wide)
    fit = od.DensityEstimator("sphere", components=("kernels",)).fit(rows)
    levels = od.DensityLevels(fit, samples=8000)
    (outline,) = od.outlines(levels, [levels.highest(0.6)])
    assert outline.polygons_mass == pytest.approx(0.6, abs=0.03)
    assert outline.polygons_size == pytest.approx(outline.size, rel=0.1)
    assert not outline.notes
    west, south, east, north = np.radians(outline.shape.bounds) * EARTH
    assert (north - south) < 6 * wide
    assert (east - west) * math.cos(math.radians(MIDDLE[0])) < apart + 6 * wide


@pytest.mark.parametrize("wide", [1e-4, 1e-6])
def test_close_angles_lose_nothing(wide: float) -> None:
    rng = np.random.default_rng(2)
    rows = np.array([1.0, -2.0]) + wide * rng.normal(size=(300, 2))
    fit = od.DensityEstimator("torus", components=("kernels",)).fit(rows)
    noise = rng.normal(size=(1000, 2))
    true = -(noise**2).sum(axis=1) / 2 - math.log(2 * math.pi * wide**2)
    assert float((true - fit.score_samples([1.0, -2.0] + wide * noise)).mean()) < 0.2
    alone = fit.marginal(0).score_samples(1.0 + wide * noise[:, :1])
    assert float((-(noise[:, 0] ** 2) / 2 - alone).mean()) < math.log(wide * 2.5066) + 0.2
    given = fit.conditional({1: -2.0}).score_samples(1.0 + wide * noise[:, :1])
    assert float(given.mean()) == pytest.approx(float(alone.mean()), abs=0.3)


@pytest.mark.parametrize(
    ("name", "kappa"),
    [("torus", MAX_CONCENTRATION), ("sphere", 1e12), ("klein-bottle", 1e9), ("hypersphere", 1e12)],
)
def test_sharp_kernels_are_exact(name: str, kappa: float) -> None:
    """Sums by tiles are those term by term; samples are as far from the centres as they should be."""
    space = od.make_space(name, **({"dim": 3} if name == "hypersphere" else {}))
    centers = space.uniform(40, torch.Generator().manual_seed(0))
    like = torch.ones(40, 1 if space.is_round else space.dim, dtype=torch.float64)
    wide = torch.where(torch.arange(40)[:, None] % 4 == 0, 30.0, kappa)
    kernels = od.AdaptiveKernels(space, centers, like * wide, like[:, 0] / 40)
    points = torch.cat([kernels.sample((1500,), torch.Generator().manual_seed(1)), centers])
    features = space.features(points)[0].mT.contiguous()
    plain = kernels._terms.plain_log_sum(features)
    assert (near_log_sum(kernels._terms, features) - plain).abs().max() < 1e-6
    slope = torch.autograd.functional.jacobian(
        lambda x: near_log_sum(kernels._terms, x).sum(), features
    )
    expected = torch.autograd.functional.jacobian(
        lambda x: kernels._terms.plain_log_sum(x).sum(), features
    )
    assert (slope - expected).abs().max() < 1e-6 * expected.abs().max()
    sharp = od.AdaptiveKernels(space, centers, kappa * like, like[:, 0] / 40)
    drawn = space.features(sharp.sample((2000,), torch.Generator().manual_seed(2)))
    away = (drawn[:, :, None] - space.features(centers)[0]).square().sum(dim=-1)
    nearest = away.amin(dim=(0, 2))
    assert float(nearest.mean()) * kappa == pytest.approx(space.dim, rel=0.1)


def test_equal_rows_are_those_that_are_equal() -> None:
    rng = np.random.default_rng(3)
    for wide in (1e-7, 1e-8, 1e-9):
        rows = np.unique((-1.3 + wide * rng.normal(size=(300, 1))).round(12), axis=0)
        assert len(od.places(od.make_space("torus", axes=1).to_chart(rows))[0]) == len(rows)
    sphere = od.make_space("sphere")
    pairs = np.array([[10.0, 20.0], [10.0, 380.0 - 360], [10.0, -340.0], [10.0, 20.0000001]])
    assert len(od.places(sphere.to_chart(pairs))[0]) == 2


def test_summaries_of_close_rows() -> None:
    rng = np.random.default_rng(4)
    angles = -1.3 + 1e-7 * rng.normal(size=2000)
    (found,), _ = od.summarize_angles(angles)
    assert found.concentration == pytest.approx(1e14, rel=0.1)
    assert found.deviation == pytest.approx(1e-7, rel=0.05)
    (equal,), _ = od.summarize_angles(np.full(20, -1.3))
    assert equal.concentration is None
    places_, _ = town(rng, 2000, 0.0, 100.0)
    town_ = od.summarize_directions(places_)
    assert town_.concentration == pytest.approx((EARTH / 100) ** 2, rel=0.1)
    assert town_.k == pytest.approx((EARTH / 100) ** 2, rel=0.1)
    assert town_.fisher_cone == pytest.approx(town_.cone, rel=0.1)


def test_gradients_of_close_rows() -> None:
    rows, _ = town(np.random.default_rng(5), 200, 0.0, 10.0)
    fit = od.DensityEstimator("sphere", components=("kernels",)).fit(rows)
    at, step = np.array([[*MIDDLE]]) + np.degrees(8 / EARTH), np.degrees(0.01 / EARTH)
    _, slope = od.log_density_gradient(fit.density_, at)
    moved = [fit.score_samples(at + sign * np.array([[step, 0.0]])) for sign in (-1, 1)]
    assert slope[0, 0] == pytest.approx(float(moved[1][0] - moved[0][0]) / (2 * step), rel=1e-3)


def test_ordinary_rows_ask_for_no_more() -> None:
    rng = np.random.default_rng(6)
    for dim, rows in ((1, 20_000), (2, 5_000)):
        space = od.make_space("torus", axes=dim)
        points = space.to_chart(rng.vonmises(0.0, 5.0, (rows, dim)))
        assert narrowest_for(space, points) == (NARROWEST, False)
    space = od.make_space("torus")
    same = space.to_chart(rng.vonmises(0.0, 5.0, (5, 2))[rng.integers(0, 5, 300)])
    assert narrowest_for(space, same) == (NARROWEST, False)


@pytest.mark.usefixtures("whole_fits")
def test_the_limit_is_said() -> None:
    rng = np.random.default_rng(7)
    rows = 1.0 + 1e-11 * rng.normal(size=(60, 1))
    with warned("1e-08", kind=DataWarning):
        fit = od.DensityEstimator("torus", components=("kernels",)).fit(rows)
    assert any("cannot tell them apart" in note for note in fit.report_.notes)
