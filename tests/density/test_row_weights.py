"""Rows that count more than others, and rows that belong together."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

import orbiflow.density as od
from density.blends import flow_of
from orbiflow.density import weighed
from orbiflow.density.fitting import (
    Rows,
    gain_of,
    mean_of,
    sparse_weights,
    stacked,
    stacking_weights,
)
from orbiflow.density.fitting.chains import fit_chain_mixture, spread_chains
from orbiflow.density.fitting.kernels import fit_mixture, kernel_estimates
from orbiflow.density.fitting.likelihood import Objective, merged
from orbiflow.density.fitting.rows import effective_rows
from refusals import refused

seeds = st.integers(0, 2**31)
PLACES = [[0.3, 0.3], [0.7, 0.7]]
few = settings(deadline=None, max_examples=7)


def repeated(seed: int, count: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Points on the torus, integer weights, and each point as often as its weight says."""
    rng = np.random.default_rng(seed)
    points = od.make_space("torus").project(torch.tensor(0.5 + 0.15 * rng.normal(size=(count, 2))))
    weights = torch.tensor(rng.integers(1, 5, count))
    return points, weights.double(), points.repeat_interleave(weights, dim=0)


@given(seeds)
@few
def test_kernels_of_weighted_rows_are_those_of_repeated_ones(seed: int) -> None:
    points, weights, rows = repeated(seed, 40)
    space = od.make_space("torus")
    found = kernel_estimates(space, Rows(points, weights), repeats=False)
    expected = kernel_estimates(space, Rows(rows), repeats=False)
    at = space.uniform(30, torch.Generator().manual_seed(seed))
    assert found.keys() == expected.keys()
    for name, part in found.items():
        assert torch.allclose(part.log_prob(at), expected[name].log_prob(at), atol=1e-9)


@given(seeds)
@few
def test_stacking_of_weighted_rows_is_that_of_repeated_ones(seed: int) -> None:
    rng = np.random.default_rng(seed)
    counts = torch.tensor(rng.integers(1, 6, 60))
    table = torch.tensor(2 * rng.normal(size=(5, 60)))
    whole = table.repeat_interleave(counts, dim=1)
    own = counts.double()
    assert torch.allclose(stacking_weights(table, own), stacking_weights(whole), atol=1e-9)
    always = torch.arange(5) == 4
    found = sparse_weights(table, always, own)
    # what is always there has half a row of 60 at least, or half of those that are repeated
    assert mean_of(stacked(table, found), own) == pytest.approx(
        float(stacked(whole, sparse_weights(whole, always)).mean()), abs=0.5 / 61
    )
    assert gain_of(table[0], table[1], own).nats == pytest.approx(
        gain_of(whole[0], whole[1]).nats, abs=1e-9
    )
    gain = gain_of(torch.tensor([1.0, 2.0, 3.0, 4.0]), torch.zeros(4))
    assert (gain.nats, gain.error) == (2.5, pytest.approx(np.std([1, 2, 3, 4], ddof=1) / 2))


@given(seeds)
@few
def test_mixtures_of_one_component_are_those_of_repeated_rows(seed: int) -> None:
    points, weights, rows = repeated(seed, 60)
    space = od.make_space("torus")
    at = space.uniform(30, torch.Generator().manual_seed(seed))

    def generator() -> torch.Generator:
        return torch.Generator().manual_seed(0)

    one = fit_mixture(space, Rows(points, weights), 1, generator=generator())
    other = fit_mixture(space, Rows(rows), 1, generator=generator())
    assert torch.allclose(one.log_prob(at), other.log_prob(at), atol=1e-6)


@given(seeds, st.integers(1, 3))
@few
def test_chains_from_one_start_are_those_of_repeated_rows(seed: int, count: int) -> None:
    points, weights, repeats = repeated(seed, 60)
    space = od.make_space("torus")
    generator = torch.Generator().manual_seed(seed)
    order = torch.randperm(2, generator=generator)
    start = spread_chains(space, Rows(points, weights), count, order, generator)
    weighted, plain = (
        fit_chain_mixture(start, rows, rows, 15) for rows in (Rows(points, weights), Rows(repeats))
    )
    at = space.uniform(30, generator)
    assert torch.allclose(weighted.log_prob(at), plain.log_prob(at), atol=1e-6)
    assert float(plain.log_prob(repeats).mean()) > float(start.log_prob(repeats).mean())


@given(seeds, st.integers(1, 6))
@few
def test_chains_start_at_rows_that_weigh_something(seed: int, count: int) -> None:
    points = repeated(seed, 20)[0]
    weights = (torch.arange(20) % 3 == 0).double()
    generator = torch.Generator().manual_seed(seed)
    start = spread_chains(
        od.make_space("torus"), Rows(points, weights), count, torch.arange(2), generator
    )
    means = start.means[1:, :, 0] / (2 * math.pi)
    away = (means[:, None] - points[weights > 0]).abs().amax(dim=2).amin(dim=1)
    assert float(away.max()) < 1e-12


@given(seeds, st.integers(2, 9))
@few
def test_merged_points_carry_their_weights(seed: int, cells: int) -> None:
    points, weights, rows = repeated(seed, 80)
    found = merged(Rows(points, weights), cells, 10**6)
    expected = merged(Rows(rows), cells, 10**6)
    assert found.weights is not None
    assert expected.weights is not None
    assert torch.allclose(found.points, expected.points)
    assert torch.allclose(found.weights, expected.weights)


def test_a_flow_descends_on_the_weighted_likelihood() -> None:
    points, weights, rows = repeated(0, 90)
    estimator = od.DensityEstimator(
        "torus", components="flow", max_frequency=2, segments=1, iterations=2
    )
    density = estimator.fit(points.numpy() * 2 * math.pi, sample_weight=weights.numpy()).density_
    assert type(density) is od.FlowDensity  # with nothing beside it
    both = [
        Objective(flow_of(density), own, roughness=1e-3)
        for own in (Rows(points, weights / weights.sum()), Rows(rows))
    ]
    (loss, slope), (expected, also) = (one(one.get()) for one in both)
    assert loss == pytest.approx(expected, abs=1e-9)
    assert slope == pytest.approx(also, abs=1e-9)


@pytest.mark.parametrize(
    "options",
    [
        {"components": "kernels"},
        {"components": "flow", "max_frequency": 1, "segments": 1, "iterations": 2},
    ],
)
def test_equal_weights_are_none(options: dict[str, object]) -> None:
    angles = np.random.default_rng(0).vonmises([0.0, 1.0], 4.0, (90, 2))
    first, second = (
        od.DensityEstimator("torus", **options).fit(angles, sample_weight=weight)  # type: ignore[arg-type]
        for weight in (None, np.full(90, 0.3))
    )
    assert od.density_to_bytes(first.density_) == od.density_to_bytes(second.density_)
    assert first.report_.effective is second.report_.effective is None


@pytest.mark.parametrize("space", ["torus", "projective-plane"])
def test_a_fit_follows_its_weights(space: str) -> None:
    """Of two clusters, one weighs nine times the other; and rows of weight 0 are not there."""
    rng = np.random.default_rng(1)
    chart = np.repeat(PLACES, 50, axis=0) + 0.02 * rng.normal(size=(100, 2))
    made = od.make_space(space)
    data = made.from_chart(torch.tensor(chart))
    weights = np.repeat([0.9, 0.1], 50)
    some = od.DensityEstimator(made, components="kernels").fit(data, sample_weight=weights)
    drawn = some.density_.sample((3000,), torch.Generator().manual_seed(0))
    near, far = (made.distance(torch.tensor(at).expand(3000, 2), drawn) for at in PLACES)
    assert float((near < far).double().mean()) == pytest.approx(0.9, abs=0.05)
    assert some.report_.effective == pytest.approx(effective_rows(torch.tensor(weights)))
    assert any("100 rows say as much as" in note for note in some.report_.notes)
    ghosts = np.concatenate([data, data[::-1]]), np.concatenate([weights, np.zeros(100)])
    again = od.DensityEstimator(made, components="kernels").fit(ghosts[0], sample_weight=ghosts[1])
    assert od.density_to_bytes(again.density_) == od.density_to_bytes(some.density_)


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        (np.ones(7), "weight 60"), (np.ones((60, 1)), "weight 60"), (-np.eye(60)[3], "4 -1"),
        (np.where(np.arange(60) == 5, np.nan, 1.0), "6 nan"), (np.full(60, np.inf), "1 inf"),
        (np.zeros(60), "weights 0"), (["much"] * 60, "weights"),
    ],
)  # fmt: skip
def test_weights_that_are_none_are_refused(weights: object, message: str) -> None:
    points = np.random.default_rng(0).uniform(size=(60, 2))
    with refused(*message.split()):
        od.DensityEstimator("torus").fit(points, sample_weight=weights)  # type: ignore[arg-type]


@given(st.lists(st.floats(1e-3, 1e3), min_size=2, max_size=30), st.floats(1e-100, 1e100))
def test_only_ratios_count(values: list[float], factor: float) -> None:
    points = torch.zeros(len(values), 1)
    one, other = (weighed(points, [v * f for v in values]) for f in (1.0, factor))
    if one.weights is None or other.weights is None:
        assert max(values) <= min(values) * (1 + 1e-12)
        return
    assert torch.allclose(one.weights, other.weights)
    assert float(one.weights.mean()) == pytest.approx(1)
    assert 1 <= effective_rows(one.weights) <= len(values) * (1 + 1e-12)


pandas = pytest.importorskip("pandas")
RNG = np.random.default_rng(0)
ROWS = 60
NAMES = [f"r{k}" for k in range(ROWS)]
SHUFFLED = RNG.permutation(ROWS)
ANGLES = pandas.DataFrame(np.degrees(RNG.vonmises(0, 2, (ROWS, 2))), NAMES, ["phi", "psi"])
LABELS_PLACES = pandas.DataFrame(
    np.stack([RNG.normal(48, 9, ROWS), RNG.normal(9, 9, ROWS)], 1), NAMES, ["lat", "lon"]
)
TURNS = pandas.DataFrame(RNG.normal(0, 0.5, (ROWS, 3)), NAMES, ["rx", "ry", "rz"])
WEIGHTS = pandas.Series(RNG.uniform(0, 3, ROWS), NAMES)
GROUPS = pandas.Series(RNG.integers(0, 12, ROWS), NAMES)
KIND: Any = {"unit": "degrees", "components": "mixture", "effort": "fast"}
TORUS = od.make_space("torus", axes=2, unit="degrees")
POINTS = pandas.DataFrame(TORUS.to_chart(ANGLES).numpy(), NAMES)


def summarized(weights: Any, groups: Any) -> Any:
    both = {"weights": weights, "groups": groups}
    space = od.RotationSpace(form="vector")
    return [
        od.summarize_angles(ANGLES, unit="degrees", **both),
        od.summarize_directions(LABELS_PLACES, **both),
        od.summarize_axes(LABELS_PLACES, **both),
        od.summarize_orientations(space, TURNS, **both),
    ]


def fitted(weights: Any, groups: Any) -> Any:
    model = od.DensityEstimator(**KIND).fit(ANGLES, sample_weight=weights, groups=groups)
    return model.score(ANGLES, sample_weight=weights)


def fitted_in_the_chart(weights: Any, groups: Any) -> Any:
    found, _ = od.fit_automatic(TORUS, POINTS, weights=weights, groups=groups)
    return found.log_prob(TORUS.to_chart(ANGLES)).sum().item()


@cache
def models() -> dict[str, od.DensityEstimator]:
    return {name: od.DensityEstimator(**KIND).fit(ANGLES + k) for name, k in (("a", 0), ("b", 30))}


def compared(weights: Any, groups: Any) -> Any:
    scores = {k: pandas.Series(m.score_samples(ANGLES), NAMES) for k, m in models().items()}
    scores["b"] = scores["b"][weights.index]
    found = od.compare_scores(scores, weights=weights + 0.1, groups=groups)
    return found, od.compare_models(models(), ANGLES, groups=groups)


def sampled(weights: Any, groups: Any) -> Any:
    del weights
    other = pandas.Series([f"o{k}" for k in groups], groups.index)
    samples, labels = {"a": ANGLES[["phi"]], "b": ANGLES[["psi"]]}, {"a": groups, "b": other}
    samples["b"] = samples["b"].set_axis(["phi"], axis=1)
    how: Any = {"unit": "degrees", "groups": labels}
    return (
        od.compare_samples(samples, settings=od.DataComparisonSettings(permutations=99), **how),
        od.named_tests(samples, settings=od.NamedTestSettings(permutations=99), **how),
    )


CALLS = [summarized, fitted, fitted_in_the_chart, compared, sampled]


@pytest.mark.parametrize("call", CALLS)
def test_labels_are_aligned_or_refused(call: Any) -> None:
    right = call(WEIGHTS, GROUPS)
    assert call(WEIGHTS.iloc[SHUFFLED], GROUPS.iloc[SHUFFLED]) == right
    others = GROUPS.set_axis([*NAMES[3:], "x", "y", "z"])
    with refused("groups", "6"):
        call(WEIGHTS, others)
    twice = GROUPS.set_axis([*NAMES[1:], "r1"])
    with refused("groups", "repeat"):
        call(WEIGHTS, twice)


@pytest.mark.parametrize(
    ("call", "gap"),
    [*((call, None) for call in CALLS), *((fitted, g) for g in (np.nan, pandas.NA, ""))],
)
def test_rows_without_a_group_are_refused(call: Any, gap: Any) -> None:
    groups = GROUPS.astype(object)
    groups.iloc[[4, 9]] = gap
    with refused("groups", "2", "5"):
        call(WEIGHTS, groups)


def test_what_has_no_labels_goes_by_place() -> None:
    right = fitted(WEIGHTS, GROUPS)
    assert fitted(WEIGHTS.to_numpy(), GROUPS.tolist()) == right
    bare = od.DensityEstimator(**KIND).fit(ANGLES.to_numpy(), sample_weight=WEIGHTS, groups=GROUPS)
    assert bare.score(ANGLES.to_numpy(), sample_weight=WEIGHTS) == right
    polars = pytest.importorskip("polars")
    by_place = polars.Series(WEIGHTS.to_numpy()), polars.Series(GROUPS.to_numpy())
    assert fitted(*by_place) == right


def test_labels_of_xarray() -> None:
    xarray = pytest.importorskip("xarray")
    right = fitted(WEIGHTS, GROUPS)
    weights = xarray.DataArray(WEIGHTS.to_numpy(), {"row": NAMES}, "row")
    assert fitted(weights[SHUFFLED], GROUPS) == right
    rows = ANGLES.rename_axis("row").to_xarray()
    model = od.DensityEstimator(**KIND).fit(
        rows, sample_weight=weights[SHUFFLED], groups=GROUPS.iloc[SHUFFLED]
    )
    assert model.score(rows, sample_weight=weights[SHUFFLED]) == right


def test_covariates_have_labels() -> None:
    x = pandas.DataFrame({"warm": RNG.uniform(0, 90, ROWS), "side": [*"ab"] * 30}, NAMES)
    y = pandas.DataFrame({"phi": np.degrees(RNG.vonmises(np.radians(x["warm"]), 9))}, NAMES)
    mixed = x.iloc[SHUFFLED]
    real: Any = {**KIND, "columns": {"warm": "linear"}}
    model = od.DensityEstimator(**real).fit(y, given=x)
    right = model.score_samples(y, given=x)
    columns = {"warm": mixed["warm"], "side": x["side"]}
    for covariates in (mixed, columns):
        assert np.array_equal(model.score_samples(y, given=covariates), right)
        assert model.score(y, given=covariates) == pytest.approx(right.mean())
    assert np.array_equal(
        od.DensityEstimator(**real).fit(y, given=columns).score_samples(y, given=x), right
    )
    weighed = model.score(y, None, WEIGHTS.iloc[SHUFFLED], given=mixed)
    assert weighed == pytest.approx(np.average(right, weights=WEIGHTS))
    for call in (model.fit, model.score, model.score_samples):
        with refused("given", "2"):
            call(y, given=x.set_axis([*NAMES[1:], "new"]))


def test_a_time_that_is_none_is_no_group() -> None:
    days = pandas.Series(pandas.date_range("2020-01-01", periods=ROWS))
    days[3] = pandas.NaT
    with refused("groups", "row 4"):
        od.DensityEstimator(**KIND).fit(RNG.uniform(0, 90, (ROWS, 1)), groups=days)
