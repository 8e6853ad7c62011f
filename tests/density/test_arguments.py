"""Wrong arguments of public functions: our messages, or it simply works."""

from collections.abc import Callable
from typing import Any

import pytest
import torch

from orbiflow import density
from orbiflow.density import FlowDensity, Sphere, Torus, make_space
from orbiflow.density.models import kl_by_quadrature, midpoints
from orbiflow.density.spaces import clear_rotation
from orbiflow.fields import SplineField
from orbiflow.flows import Flow
from refusals import refused

SPACES = ("torus", "sphere", "klein-bottle", "projective-plane")
torus: Any = Torus(2)
sphere: Any = Sphere()


def a_density(space: Any = torus, dtype: torch.dtype = torch.float64) -> Any:
    field = SplineField(space.group, 2, dtype=dtype)
    with torch.no_grad():
        field.parameters_.normal_(std=0.02)
    return FlowDensity(space, Flow([field], steps=2, warn=False))


POINTS = torch.rand(30, 2, dtype=torch.float64)
HALVES = torch.full((4,), 0.25)
FLOW = Flow(lambda x: x)
od: Any = density  # its arguments are wrong on purpose
WRONG: dict[str, tuple[Callable[[], Any], str]] = {
    "a name for a space": (lambda: od.FlowDensity("torus", FLOW), "torus `make_space`"),
    "no flow": (lambda: od.FlowDensity(torus, None), "flow Flow"),
    "no base": (lambda: od.FlowDensity(torus, FLOW, "uniform"), "base Density"),
    "a number": (lambda: a_density().log_prob(torch.tensor(0.5)), ""),
    "text": (lambda: a_density().log_prob("points"), "points"),
    "complex": (lambda: a_density().log_prob(POINTS * 1j), "points numbers"),
    "nan": (lambda: a_density().log_prob(POINTS * torch.nan), "points finite"),
    "measure": (lambda: a_density().log_prob(POINTS, measure=3), "measure"),
    "sample text": (lambda: a_density().sample("five"), "number samples"),
    "midpoints": (lambda: midpoints(torus, 2.5), "resolution number"),  # type: ignore[arg-type]
    "kl": (lambda: kl_by_quadrature(torch.ones(3), torch.ones(4)), "3 4"),
    "a base's space": (lambda: od.UniformDensity("sphere"), "space Space"),
    "kernels": (lambda: od.AdaptiveKernels(torus, "a", HALVES, HALVES), "centers numbers"),
    "chains": (lambda: od.VonMisesChains(sphere, HALVES, HALVES, HALVES), "Mises chains"),
    "chains' shapes": (lambda: od.VonMisesChains(torus, [0.0], HALVES, HALVES), "log_weights"),
    "a mixture of nothing": (lambda: od.Mixture([None], [1.0]), "components Density"),
    "fit: a name": (lambda: od.fit_density("torus", POINTS), "space Space"),
    "fit: columns": (lambda: od.fit_density(sphere, torch.rand(30, 3)), "2 30 3"),
    "fit: settings": (lambda: od.fit_density(sphere, POINTS, od.DensitySettings()), "FlowSettings"),
    "fit: four angles": (lambda: od.fit_density(od.Torus(4), torch.rand(30, 4)), "dimensions 3"),
    "dim": (lambda: od.Torus("2"), "number 1 64"),
    "clear_rotation": (lambda: clear_rotation(torus, [[0.0, 0.0]]), "RoundSpace"),
    "from_chart": (lambda: torus.from_chart(torch.rand(3, 3)), "3"),
    "project": (lambda: sphere.project(torch.rand(3, 5)), "3 5"),
    "to bytes": (lambda: od.density_to_bytes("density"), "density"),
    "read": (lambda: od.read_density(3), "file 3"),
    "estimator": (lambda: od.DensityEstimator(3).fit(POINTS), "takes 3"),
}


@pytest.mark.parametrize("case", WRONG)
def test_our_messages(case: str) -> None:
    call, message = WRONG[case]
    with refused(*message.split()):
        call()


@pytest.mark.parametrize("name", SPACES)
@pytest.mark.parametrize("flow_dtype", [torch.float32, torch.float64])
def test_dtypes_mix(name: str, flow_dtype: torch.dtype) -> None:
    space = make_space(name)
    density = a_density(space, flow_dtype)
    exact = density.log_prob(POINTS).detach()
    assert exact.dtype == torch.float64
    single = density.log_prob(POINTS.float()).detach()
    assert single.dtype == torch.float32
    assert torch.allclose(single.double(), exact, atol=2e-3)
    listed = density.log_prob(POINTS.tolist())  # type: ignore[arg-type]
    assert torch.equal(listed.detach(), exact)
    assert torch.equal(density.log_prob(POINTS.numpy()).detach(), exact)  # type: ignore[arg-type]
    whole = torch.tensor([[1, 2], [3, 4]])
    if not space.is_round:  # whole numbers are cone points there
        assert torch.equal(density.log_prob(whole), density.log_prob(whole.double()))
