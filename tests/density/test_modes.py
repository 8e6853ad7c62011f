"""Whatever torch's settings are: one thread inside, the caller's afterwards, and usable results."""

from typing import Any

import numpy as np
import pytest
import torch

import orbiflow.density as od
from density.blends import flow_of, stored
from orbiflow.fields import SplineField
from orbiflow.flows import Flow

DATA = np.random.default_rng(0).normal([20.0, 40.0], 10.0, (60, 2))
QUICK: dict[str, Any] = {
    "unit": "degrees", "max_frequency": 1, "segments": 1, "iterations": 2, "roughness": (1e-3,)
}  # fmt: skip


@pytest.fixture(name="three_threads")
def three_threads_fixture():
    before = torch.get_num_threads()
    torch.set_num_threads(3)
    yield
    torch.set_num_threads(before)


class Watched(od.UniformDensity):
    """Notes how many threads it is evaluated on."""

    def __init__(self, space) -> None:
        super().__init__(space)
        self.seen: set[int] = set()

    def log_chart(self, points):
        self.seen.add(torch.get_num_threads())
        return super().log_chart(points)

    def draw(self, count, generator):
        self.seen.add(torch.get_num_threads())
        return super().draw(count, generator)


@pytest.mark.usefixtures("three_threads")
def test_fits_and_densities_work_on_one_thread_and_give_the_others_back() -> None:
    seen: set[int] = set()
    estimator = od.DensityEstimator("sphere", components="flow,mixture", **QUICK)
    estimator.fit(DATA, progress=lambda *_: seen.add(torch.get_num_threads()))
    assert seen == {1}
    estimator.score(DATA)
    estimator.sample(3)
    assert torch.get_num_threads() == 3
    space = od.make_space("torus")
    base = Watched(space)
    density = od.FlowDensity(space, Flow([SplineField(space.group, 1)]), base)
    points = torch.rand(5, 2, dtype=torch.float64)
    density.log_prob(points)
    density.sample((3,))
    density.mass(8)
    density.entropy(10)
    assert base.seen == {1}
    assert torch.get_num_threads() == 3


@pytest.mark.parametrize(
    ("name", "mode"), [("torus", torch.inference_mode), ("sphere", torch.no_grad)]
)
def test_fits_do_not_depend_on_the_callers_mode(name: str, mode: Any) -> None:
    estimator = od.DensityEstimator(name, components=("flow",), **QUICK)
    plain = od.DensityEstimator(name, components=("flow",), **QUICK).fit(DATA)
    with mode():
        estimator.fit(DATA)
    assert estimator.score(DATA) == plain.score(DATA)
    points = torch.rand(4, 2, dtype=torch.float64, requires_grad=True)
    value = estimator.density_.log_prob(points).sum()
    wanted = (points, *flow_of(estimator.density_).flow.parameters())
    assert all(bool(g.isfinite().all()) for g in torch.autograd.grad(value, wanted))


@pytest.mark.parametrize("name", ["torus", "projective-plane"])
def test_no_cache_is_poisoned_when_it_is_first_filled_under_inference(name: str, tmp_path) -> None:
    fit = od.DensityEstimator(name, components="flow,mixture", **QUICK).fit(DATA)
    with torch.inference_mode():  # everything is made and evaluated here first
        density = stored(fit.density_, tmp_path)
        space = od.make_space(name)
        own = od.FlowDensity(space, Flow([SplineField(space.group, 3, smoothness=0.7)]))
        at = torch.rand(3, 2, dtype=torch.float64)
        for each in (density, own):
            each.log_prob(at, measure="natural")
            each.sample((2,))
            space.displacement(at, at.flip(0))
    fresh = od.make_space(name)
    points = fresh.uniform(60, torch.Generator().manual_seed(0))
    found, _ = od.fit_density(
        fresh, points, od.FlowSettings(max_frequency=1, segments=1, iterations=1)
    )
    found.log_prob(points.requires_grad_()).sum().backward()
    assert points.grad is not None
    points.grad = None
    # a model that was read under inference is like any other
    density.log_prob(points).sum().backward()
    assert points.grad is not None
    assert bool(points.grad.isfinite().all())
