"""Fitting: coupling, the closed-form start, likelihood, the estimator, storage."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

import orbiflow.density as od
from density.blends import two_clusters
from orbiflow.density.fitting import Rows
from orbiflow.density.fitting.flow import conjugate_gradients, coupled, match_flow
from orbiflow.density.fitting.likelihood import MAX_HALVINGS, Objective, merged
from orbiflow.density.fitting.report import sides
from orbiflow.fields import FourierField
from orbiflow.flows import Flow
from refusals import refused

SPACES = (od.Torus(2), od.Sphere(), od.KleinBottle(), od.ProjectivePlane())
every = pytest.mark.parametrize("space", SPACES, ids=lambda s: s.name)
seeds = st.integers(0, 2**31 - 1)
QUICK = od.FlowSettings(max_frequency=3, segments=2, iterations=8, roughness=(1e-3,))


@every
@settings(max_examples=5)
@given(seed=seeds)
def test_coupling_is_a_pairing_with_short_geodesics(space, seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, end = (torch.tensor(rng.random((60, 2))) for _ in range(2))
    paired, move = coupled(space, start, end, group=25)
    assert torch.equal(*(torch.sort(p.flatten()).values for p in (paired, start)))
    assert float(space.distance(space.project(paired + move), end).max()) < 1e-9
    assert float((move**2).sum()) <= float((space.displacement(start, end) ** 2).sum()) + 1e-9


@given(st.integers(1, 12), seeds)
def test_conjugate_gradients_solve(size: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = torch.tensor(rng.normal(size=(size, size)))
    matrix = root @ root.mT + torch.eye(size)
    right = torch.tensor(rng.normal(size=size))
    found = conjugate_gradients(lambda x: matrix @ x, right, matrix.diagonal(), 200, 1e-10)
    assert torch.allclose(matrix @ found, right, atol=1e-6)


@every
def test_matching_recovers_a_field(space) -> None:
    truth, generator = FourierField(space.group, 4), torch.Generator().manual_seed(0)
    truth.parameters_.data.copy_(0.02 * torch.randn(truth.size, generator=generator).double())
    points = torch.rand(3000, 2, dtype=torch.float64, generator=generator)
    found = FourierField(space.group, 4, smoothness=2.0)
    with torch.no_grad():  # a single segment with tiny moves regresses the field itself
        move = 1e-6 * truth(points)
    match_flow([found], space, points, move, ridge=0.0, iterations=200)
    error = 1e6 * found.parameters_.detach() * found.scale - truth.parameters_.detach()
    assert float(error.abs().max()) < 1e-4


@settings(max_examples=5, deadline=None)
@given(seeds)
def test_the_gradient_of_the_objective(seed: int) -> None:
    space = od.Sphere()
    fields = [FourierField(space.group, 3, smoothness=1.0) for _ in range(2)]
    density = od.FlowDensity(space, Flow(fields, steps=2, warn=False), od.UniformDensity(space))
    objective = Objective(density, Rows(two_clusters(space, 30)), roughness=1e-3)
    rng = np.random.default_rng(seed)
    at, along = 0.05 * rng.normal(size=(2, len(objective.get())))
    loss, gradient = objective(at)
    ahead, behind = (objective(at + s * 1e-4 * along)[0] for s in (1, -1))
    assert (ahead - behind) / 2e-4 == pytest.approx(gradient @ along, rel=1e-4, abs=1e-7)
    assert math.isfinite(loss)


@every
def test_a_fit_is_no_worse_than_its_start_and_normalised(space) -> None:
    density, report = od.fit_density(space, two_clusters(space, 600), QUICK)
    assert report.validation_nll < report.start_nll + 0.01
    assert report.validation_nll < -0.5  # 0 is the even density of the square
    assert report.mass == pytest.approx(1.0, abs=1e-3)
    assert report.integration_error < 1e-3
    assert report.notes == ()
    assert (report.train, report.validation, report.duplicates) == (540, 60, 0)
    held_out = two_clusters(space, 2000, seed=1)
    with torch.no_grad():
        nll = -float(density.log_prob(held_out).mean())
    assert nll == pytest.approx(report.validation_nll, abs=0.3)


def test_what_only_the_integrators_error_gained_is_undone() -> None:
    rng = np.random.default_rng(0)
    space = od.make_space("klein-bottle", unit="degrees")
    points = space.to_chart(rng.normal([20.0, 60.0], 15.0, (200, 2)).clip(-89, 89))
    settings = od.FlowSettings(max_frequency=2, segments=2, roughness=(1e-4,))
    _, report = od.fit_density(space, points, settings)
    # with one step a segment, refinement tore the flow: 3.7 nats worse than its start
    assert report.validation_nll < report.start_nll + 0.01
    assert report.train_nll < -2.5
    assert report.mass == pytest.approx(1.0, abs=5e-4)
    assert report.steps <= 16


def test_equal_points_stay_on_one_side_and_are_said() -> None:
    points = two_clusters(od.Torus(2), 300)[
        torch.randint(0, 60, (300,), generator=torch.manual_seed(0))
    ]
    order, out, repeats = sides(points, 0.2, torch.Generator().manual_seed(0))
    train, held = points[order][~out], points[order][out]
    assert len(train) + len(held) == 300
    assert repeats == 300 - len(torch.unique(points, dim=0))
    both = torch.cat([torch.unique(train, dim=0), torch.unique(held, dim=0)])
    assert len(torch.unique(both, dim=0)) == len(both)
    _, report = od.fit_density(od.Torus(2), points, QUICK)
    assert f"{repeats} of 300 points repeat another" in report.notes[0]


def test_few_or_equal_points_are_refused() -> None:
    for points in (torch.rand(9, 2), torch.full((500, 2), 0.3)):
        with refused("10", "points"):
            od.fit_density(od.Torus(2), points, QUICK)


@given(seeds, st.integers(1, 20), st.integers(1, 8), st.integers(1, 3))
def test_merging_keeps_mean_and_mass(seed: int, cells: int, crowd: int, dim: int) -> None:
    rng = np.random.default_rng(seed)
    points = torch.tensor(rng.random((200, dim)) ** 4)  # crowded at 0
    found = merged(Rows(points), cells, crowd)
    few, weights = found.points, found.weights
    assert weights is not None
    assert float(weights.sum()) == pytest.approx(1)
    assert torch.allclose(weights @ few, points.mean(dim=0))
    finest = (points * (cells << MAX_HALVINGS)).floor()
    fullest = int(finest.unique(dim=0, return_counts=True)[1].max())
    assert float(weights.max()) <= max(crowd, fullest) / 200 + 1e-9
    # every point is as near to its cell's mean as cells are wide
    assert float(torch.cdist(points, few).amin(dim=1).max()) <= math.sqrt(dim) / cells


def test_held_out_scores_are_of_the_points_themselves() -> None:
    rng = np.random.default_rng(3)
    sharp = np.where(rng.random((700, 1)) < 0.5, 0.3, 0.7) + 0.01 * rng.normal(size=(700, 2))
    settings = od.FlowSettings(max_frequency=3, segments=2, iterations=8, roughness=(1e-3, 1e-4))
    _, report = od.fit_density(od.Torus(2), torch.tensor(sharp), settings)
    stage = report.stages[-1]
    assert stage.validation[stage.best] == pytest.approx(report.validation_nll, abs=0.01)


@pytest.mark.parametrize(
    "changes",
    [
        {"max_frequency": 0}, {"max_frequency": 65}, {"segments": 0}, {"iterations": -1},
        {"validation": 0.0}, {"validation": 1.0}, {"roughness": ()}, {"roughness": (-1.0,)},
    ],
)  # fmt: skip
def test_settings_out_of_range(changes) -> None:
    with refused(*changes):
        od.FlowSettings(**changes)
