"""Rounded values are no spikes: the fit finds the rounding, undoes it, and says so."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from orbiflow.density import DensityEstimator, make_space
from orbiflow.density.fitting import repeats_of, spread_evenly
from orbiflow.density.fitting.repeats import Repeats
from orbiflow.errors import DataWarning
from refusals import warned

Rows = NDArray[np.float64]


def weather(rng: np.random.Generator, rows: int) -> Rows:
    """Directions of the wind and temperatures (N, 2), the latter as degrees of an angle."""
    west = rng.random(rows) < 0.6
    wind = np.degrees(np.where(west, rng.vonmises(-1.5, 4, rows), rng.vonmises(1, 2, rows)))
    return np.stack([wind % 360, np.where(west, 12, 5) + 8 * rng.normal(size=rows)], axis=1)


def rounded(values: Rows, step: float) -> Rows:
    return np.round(values / step) * step


@pytest.fixture(scope="module", name="plain")
def plain_fixture() -> tuple[Rows, DensityEstimator]:
    """Weather that was not rounded, and its density."""
    rows = weather(np.random.default_rng(0), 400)
    return rows, DensityEstimator("torus", **HOW).fit(rows)


HOW = {"unit": "degrees", "components": ("kernels", "chains"), "seed": 0}


@pytest.mark.parametrize("step", [1.0, 10.0])
def test_rounded_weather_has_no_spikes(plain: tuple[Rows, DensityEstimator], step: float) -> None:
    rows, density = plain
    new = weather(np.random.default_rng(1), 400)
    with warned(f"{step:g}", kind=DataWarning):
        found = DensityEstimator("torus", **HOW).fit(rounded(rows, step))
    # what rounding loses, and not 3 nats of spikes
    assert float((density.score_samples(new) - found.score_samples(new)).mean()) < 0.01 * step
    on, off = found.marginal(1).score_samples([[10.0], [10.0 + step / 2]])
    assert abs(on - off) < 0.1 + 0.02 * step
    given = found.conditional({1: 10.0}).score_samples([[270.0], [270.0 + step / 2]])
    assert abs(float(np.diff(given)[0])) < 0.1 + 0.02 * step


def test_what_is_asked_for_is_done_without_a_warning() -> None:
    rows = rounded(weather(np.random.default_rng(1), 300), 5.0)
    how = {"unit": "degrees", "components": ("kernels",)}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        places = DensityEstimator("torus", repeats="places", **how).fit(rows)
        smooth = DensityEstimator("torus", repeats="rounding", **how).fit(rows)
    assert float(places.score_samples(rows).mean()) > float(smooth.score_samples(rows).mean()) + 2
    assert "new rows are taken to be rounded as well" in places.report_.notes[-1]
    assert "spread evenly over its step" in smooth.report_.notes[-1]


STEPS = {
    "torus": (1.0, 5.0, 10.0, 22.5, 1 / 4), "sphere": (1.0, 5.0, 10.0, 22.5, 1 / 60),
    "klein-bottle": (1.0, 10.0, 22.5), "projective-plane": (1.0, 10.0),
}  # fmt: skip


@pytest.mark.parametrize(("name", "step"), [(n, s) for n, steps in STEPS.items() for s in steps])
def test_steps_are_found(name: str, step: float) -> None:
    space = make_space(name, **({} if name[0] == "s" or "j" in name else {"unit": "degrees"}))
    reach = min(60.0, 60 * step)  # so that many rows repeat
    rows = rounded(np.random.default_rng(2).uniform(-reach, reach, (2000, 2)), step)
    found = repeats_of(space, space.to_chart(rows))
    assert found.is_rounding
    assert found.spread == pytest.approx((step, step))


def test_steps_that_do_not_divide_the_circle() -> None:
    angles = np.random.default_rng(3).vonmises(1.0, 1.0, (3000, 1))
    for turned in (angles, angles % (2 * np.pi)):
        space = make_space("torus", axes=1)
        assert repeats_of(space, space.to_chart(turned.round(1))).spread == pytest.approx((0.1,))
    space = make_space("torus", axes=1, unit="degrees")
    middles = np.floor(np.degrees(angles) / 5) * 5 + 2.5
    assert repeats_of(space, space.to_chart(middles)).spread == pytest.approx((5.0,))


def test_columns_are_rounded_by_themselves() -> None:
    rng = np.random.default_rng(4)
    rows = weather(rng, 3000)
    space = make_space("torus", unit="degrees")
    rows[:, 0] = rounded(rows[:, 0], 10)
    assert repeats_of(space, space.to_chart(rows)).spread == (10.0, 0.0)
    rows[:, 1] = rounded(rows[:, 1], 0.5)
    assert repeats_of(space, space.to_chart(rows)).spread == (10.0, 0.5)


def test_true_repeats_are_left() -> None:
    """Stations, states and rows that stand there twice are no rounding, whatever their digits."""
    rng = np.random.default_rng(5)
    sphere, torus = make_space("sphere"), make_space("torus", unit="degrees")
    stations = np.stack([rng.uniform(30, 60, 40), rng.uniform(0, 40, 40)], axis=1)
    for digits in (0, 2, 8):
        rows = stations.round(digits)[rng.integers(0, 40, 2000)]
        assert not any(repeats_of(sphere, sphere.to_chart(rows)).spread)
    states = np.stack([rng.choice([0.0, 90, 180, 270], 2000), rng.normal(0, 20, 2000)], axis=1)
    assert not any(repeats_of(torus, torus.to_chart(states)).spread)
    twice = np.repeat(rng.normal(0, 20, (500, 2)), 2, axis=0)
    assert not any(repeats_of(torus, torus.to_chart(twice)).spread)
    fit = DensityEstimator("torus", unit="degrees", components=("kernels",)).fit(twice)
    asked = DensityEstimator(
        "torus", unit="degrees", components=("kernels",), repeats="places"
    ).fit(twice)
    assert np.array_equal(fit.score_samples(twice), asked.score_samples(twice))


def test_rounding_that_hardly_shows_is_left() -> None:
    rng = np.random.default_rng(6)
    space = make_space("torus", unit="degrees")
    rows = rng.normal(0, 20, (2000, 2)).round(1)
    found = repeats_of(space, space.to_chart(rows))
    assert 0 < found.rows < 20
    assert found.taken_for("auto") == "places"
    assert not found.warnings("auto")


@pytest.mark.parametrize("name", ["torus", "sphere", "klein-bottle", "projective-plane"])
def test_rows_are_moved_by_half_a_step_at_most(name: str) -> None:
    space = make_space(name)
    data = space.from_chart(space.uniform(200, torch.Generator().manual_seed(0)))
    points = space.to_chart(data)
    found = Repeats(0, 200, None, None, (0.1, 0.1))
    moved = spread_evenly(space, points, found, torch.Generator().manual_seed(1))
    still = spread_evenly(
        space, points, replace(found, spread=(0.0, 0.0)), torch.Generator().manual_seed(1)
    )
    assert float(space.distance(points, still).max()) < 1e-7
    off = (space.features(points)[0] - space.features(moved)).norm(dim=-1).amin(dim=0)
    assert 0 < float(off.max()) <= 0.05 * 2**0.5 * (np.pi / 180 if space.is_round else 1.0) * 1.01


@pytest.mark.parametrize(
    ("parts", "unit", "digits"),
    [
        (16, "degrees", 0), (32, "degrees", 0), (36, "radians", 4), (16, "radians", 2),
        (24, "turns", 3), (2160, "degrees", 4),
    ],
)  # fmt: skip
def test_directions_that_were_rounded_twice(parts: int, unit: str, digits: int) -> None:
    """Points of the compass in whole degrees: 0, 23, 45, 68 and so on."""
    turn = {"degrees": 360.0, "radians": 2 * np.pi, "turns": 1.0}[unit]
    angles = np.random.default_rng(0).vonmises(1.0, 2.0 if parts < 100 else 2000, 1500) % (
        2 * np.pi
    )
    rows = np.round(rounded(angles / (2 * np.pi), 1 / parts) * turn, digits)
    space = make_space("torus", axes=1, unit=unit)
    found = repeats_of(space, space.to_chart(rows[:, None]))
    assert found.is_rounding
    assert found.spread == pytest.approx([turn / parts])
    if (parts, digits) not in [(16, 2), (2160, 4)]:
        return
    estimator = DensityEstimator("torus", unit=unit, components=("kernels",))
    with warned("brings", kind=DataWarning):
        estimator.fit(rows[:, None])
    peak = np.exp(estimator.score_samples(rows[:, None]).max()) * turn
    assert peak < 1.3 * 2 * np.pi * np.exp(2) / 14.32 if parts < 100 else peak < 150


def test_places_that_lie_on_a_coarse_grid_by_chance_are_places() -> None:
    rng = np.random.default_rng(0)
    few = rng.choice(360, 60, replace=False)
    rows = rng.choice(few, 2000).astype(float)
    space = make_space("torus", axes=1, unit="degrees")
    assert not any(repeats_of(space, space.to_chart(rows[:, None])).spread)


def mixed(rng: np.random.Generator, values: Rows, coarse: float, fine: float, share: float) -> Rows:
    """Round a share of rows (N, k) coarsely, the others finely (0: not at all)."""
    chosen = rng.random(len(values)) < share
    rest = rounded(values, fine) if fine else values
    return np.where(chosen[:, None], rounded(values, coarse), rest)


MIXTURES = [(10.0, 0.0, 0.5), (5.0, 0.01, 0.9), (30.0, 1.0, 0.3)]


@pytest.mark.parametrize(
    ("coarse", "fine", "share", "dim"), [*((*own, 1) for own in MIXTURES), (*MIXTURES[0], 2)]
)
def test_some_values_rounded_more_coarsely_have_no_spikes(
    coarse: float, fine: float, share: float, dim: int
) -> None:
    rng = np.random.default_rng(7)
    rows = mixed(rng, np.degrees(rng.vonmises(1.0, 0.5, (2000, dim))), coarse, fine, share)
    space = make_space("torus", axes=dim, unit="degrees")
    found = repeats_of(space, space.to_chart(rows))
    for heap in found.heaps:
        assert heap is not None
        assert heap.step == pytest.approx(coarse)
        assert heap.share == pytest.approx(share, abs=0.08)
    estimator = DensityEstimator("torus", unit="degrees", components=("kernels",))
    with warned(f"{coarse:g}", kind=DataWarning):
        estimator.fit(rows)
    on = estimator.score_samples(np.full((1, dim), 60.0))
    off = estimator.score_samples(np.full((1, dim), 60.0 + coarse / 2))
    assert abs(float(on[0] - off[0])) < 0.2


def test_usual_values_are_no_heaps() -> None:
    """Calm winds, states, crowded hours, stations of mixed precision and narrow peaks."""
    rng = np.random.default_rng(8)
    line = make_space("torus", axes=1, unit="degrees")
    plane, sphere = make_space("torus", unit="degrees"), make_space("sphere")
    calm = np.where(rng.random(2000) < 0.3, 0.0, rng.uniform(0, 360, 2000).round())
    narrow = np.where(rng.random(2000) < 0.3, rng.normal(100, 1, 2000), rng.uniform(0, 360, 2000))
    for column in (calm, narrow.round(), rng.normal(40, 3, 2000).round(1), narrow):
        assert not any(repeats_of(line, line.to_chart(column[:, None])).heaps)
    states = rng.choice([-60.0, 60, 180], (2000, 2))
    states[:1000] = rng.normal(0, 50, (1000, 2)).round(1)
    assert not any(repeats_of(plane, plane.to_chart(states)).heaps)
    stations = np.stack([rng.uniform(30, 60, 400), rng.uniform(0, 40, 400)], axis=1)
    stations = mixed(rng, stations, 1.0, 0.01, 0.5)[rng.integers(0, 400, 4000)]
    assert not any(repeats_of(sphere, sphere.to_chart(stations)).heaps)


@pytest.mark.parametrize(("step", "values"), [(45.0, 7), (45.0, 5), (30.0, 7), (22.5, 6)])
def test_some_points_of_the_compass_are_enough(step: float, values: int) -> None:
    """Of 8 points of the compass some may not occur."""
    rng = np.random.default_rng(0)
    rows = rounded(rng.normal(160, 1.1 * step, 600), step)
    rows = rows[abs(rows - 160) < step * values / 2, None] % 360
    assert len(np.unique(rows)) == values
    torus = make_space("torus", unit="degrees", axes=1)
    found = repeats_of(torus, torus.to_chart(rows))
    assert found.spread == (step,)
    assert found.is_rounding


@pytest.mark.parametrize(
    "states",
    [
        [-60, 60, 180], [-65, 62, 178], [0, 90, 180, 270], [-60, 60, 180, 120, 0, -120],
        [-63, 58, 177, 90, 0], [10, 55, 190, 235, 325], [0, 72, 144, 216, 288],
    ],
)  # fmt: skip
def test_states_are_no_points_of_the_compass(states: list[float]) -> None:
    rows = np.random.default_rng(0).choice(np.array(states, dtype=float), (600, 1))
    torus = make_space("torus", unit="degrees", axes=1)
    assert not repeats_of(torus, torus.to_chart(rows)).can_be_undone
