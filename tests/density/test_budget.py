"""What a fit may spend: evaluations decide, the clock only ends, and the integral is 1 in any case."""

import math
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.density import FlowDensity, FlowSettings, fit_density, make_space
from orbiflow.density.fitting import Rows
from orbiflow.density.fitting.likelihood import ITERATIONS_PER_SCORE, Budget, Spent, refine
from orbiflow.fields import SplineField
from orbiflow.flows import Flow
from refusals import refused

SMALL: dict[str, Any] = {"max_frequency": 2, "segments": 2, "roughness": (1e-3,)}


class Clock:
    """Stands still for so many looks, then leaps ahead."""

    def __init__(self, looks: float) -> None:
        self.looks, self.asked = looks, 0

    def __call__(self) -> float:
        self.asked += 1
        return 0.0 if self.asked <= self.looks else 1e9


@pytest.fixture(name="striking_after")
def striking_after_fixture(monkeypatch):
    """A clock in place of the real one."""

    def put(looks: float) -> Clock:
        clock = Clock(looks)
        monkeypatch.setattr("orbiflow.density.fitting.likelihood.clock", clock)
        return clock

    return put


def cluster(name: str, count: int = 200) -> torch.Tensor:
    """Chart points about (20, 60) degrees."""
    rng = np.random.default_rng(0)
    unit = {"unit": "degrees"} if name in ("torus", "klein-bottle") else {}
    table = rng.normal([20.0, 60.0], 15.0, (count, 2)).clip(-89, 89)
    return make_space(name, **unit).to_chart(table)


@given(st.integers(0, 20), st.integers(0, 20))
def test_a_budget_counts(limit: int, wanted: int) -> None:
    budget = Budget(evaluations=limit)
    for _ in range(min(limit, wanted)):
        budget.spend()
    assert budget.used == min(limit, wanted)
    assert budget.notes() == []
    if wanted > limit:
        with refused("evaluations", kind=Spent):
            budget.spend()
        assert budget.used == limit
        assert budget.notes() == [f"stopped by the budget of {limit} evaluations"]


def test_without_a_limit_no_clock_is_asked(striking_after) -> None:
    clock = striking_after(math.inf)
    fit_density(make_space("torus"), cluster("torus"), FlowSettings(**SMALL, iterations=3))
    assert clock.asked <= 5  # when budgets begin


@pytest.mark.parametrize(
    ("name", "looks"),
    [("torus", 1), ("torus", 60), ("sphere", 20), ("klein-bottle", 60), ("projective-plane", 20)],
)
def test_the_integral_does_not_depend_on_the_clock(name: str, looks: int, striking_after) -> None:
    clock = striking_after(looks)
    settings = FlowSettings(**SMALL, seconds=1.0)
    density, report = fit_density(make_space(name), cluster(name), settings)
    assert report.mass == pytest.approx(1.0, abs=5e-4)
    assert density.mass(32) == pytest.approx(1.0, abs=1e-3)
    assert report.integration_error < 5e-4
    struck = clock.asked > looks
    assert report.notes == ("stopped by the limit of 1 s: another run may differ",) * struck


def test_the_same_evaluations_give_the_same_density(striking_after) -> None:
    space, points, values = make_space("sphere"), cluster("sphere"), []
    for _ in range(2):
        clock = striking_after(10**6)  # never, however many looks
        settings = FlowSettings(**SMALL, evaluations=12, seconds=1e6)
        density, report = fit_density(space, points, settings)
        assert clock.asked > 10
        assert report.notes == ("stopped by the budget of 12 evaluations",)
        with torch.no_grad():
            values.append(density.log_prob(points))
    assert torch.equal(*values)


def test_the_default_budget_leaves_the_defaults_alone() -> None:
    settings = FlowSettings(max_frequency=1, segments=1)
    _, report = fit_density(make_space("sphere"), cluster("sphere", 60), settings)
    assert len(report.stages) == 3
    assert report.notes == ()


@pytest.mark.parametrize("iterations", [1, 2, 4, 5])
def test_every_last_iterate_is_scored(iterations: int) -> None:
    points = cluster("torus").float()
    space = make_space("torus")
    fields = [SplineField(space.group, 2, smoothness=2.0, dtype=torch.float32)]
    density = FlowDensity(space, Flow(fields, steps=2, warn=False))
    before = fields[0].parameters_.detach().clone()
    done = refine(density, Rows(points), Rows(points), iterations=iterations)
    assert len(done.validation) == 1 + math.ceil(iterations / ITERATIONS_PER_SCORE)
    # train and validation are the same points: every iterate is better than the one before
    assert done.best == len(done.validation) - 1
    assert done.validation[-1] < done.validation[0] - 0.05
    assert not torch.equal(fields[0].parameters_, before)


def test_no_iteration_changes_nothing() -> None:
    space = make_space("torus")
    density = FlowDensity(space, Flow([SplineField(space.group, 2)]))
    rows = Rows(cluster("torus"))
    done = refine(density, rows, rows, iterations=0)
    assert (done.best, len(done.validation)) == (0, 1)
    assert not bool(next(iter(density.flow.parameters())).any())
