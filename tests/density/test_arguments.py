"""Wrong arguments of public functions: our messages, or it simply works."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch

from orbiflow.density import (
    AdaptiveKernels,
    DensityEstimator,
    DensitySettings,
    FlowDensity,
    FlowSettings,
    Mixture,
    Sphere,
    Torus,
    UniformDensity,
    VonMisesChains,
    density_to_bytes,
    fit_density,
    make_space,
    read_density,
)
from orbiflow.density.models import kl_by_quadrature, midpoints
from orbiflow.density.spaces import clear_rotation
from orbiflow.fields import SplineField
from orbiflow.flows import Flow
from refusals import refused

SPACES = ("torus", "sphere", "klein-bottle", "projective-plane")
torus, sphere = Torus(2), Sphere()


def a_density(space: Any = torus, dtype: torch.dtype = torch.float64) -> FlowDensity:
    field = SplineField(space.group, 2, dtype=dtype)
    with torch.no_grad():
        field.parameters_.normal_(std=0.02)
    return FlowDensity(space, Flow([field], steps=2, warn=False))


POINTS = torch.rand(30, 2, dtype=torch.float64)
HALVES = torch.full((4,), 0.25)
QUICK: Any = {"max_frequency": 1, "segments": 1, "iterations": 1}

WRONG: dict[str, tuple[Callable[[], Any], str]] = {
    "a name for a space": (
        lambda: FlowDensity("torus", Flow(lambda x: x)),  # type: ignore[arg-type]
        "torus `make_space`",
    ),
    "no flow": (lambda: FlowDensity(torus, None), "flow Flow"),  # type: ignore[arg-type]
    "no base": (
        lambda: FlowDensity(torus, Flow(lambda x: x), "uniform"),  # type: ignore[arg-type]
        "base Density",
    ),
    "three columns": (lambda: a_density().log_prob(torch.rand(5, 3)), "5 3"),
    "a number": (lambda: a_density().log_prob(torch.tensor(0.5)), ""),
    "text": (lambda: a_density().log_prob("points"), "points"),  # type: ignore[arg-type]
    "complex": (
        lambda: a_density().log_prob(torch.rand(2, 2, dtype=torch.complex64)),
        "points numbers",
    ),
    "nan": (lambda: a_density().log_prob(torch.full((2, 2), torch.nan)), "points finite"),
    "measure": (
        lambda: a_density().log_prob(POINTS, measure=3),  # type: ignore[arg-type]
        "measure",
    ),
    "sample text": (lambda: a_density().sample("five"), "number samples"),
    "sample less": (lambda: a_density().sample(-1), "number samples"),
    "midpoints": (lambda: midpoints(torus, 2.5), "resolution number"),  # type: ignore[arg-type]
    "kl": (lambda: kl_by_quadrature(torch.ones(3), torch.ones(4)), "3 4"),
    "a base's space": (lambda: UniformDensity("sphere"), "space Space"),  # type: ignore[arg-type]
    "kernels": (
        lambda: AdaptiveKernels(torus, "a", torch.ones(1), torch.ones(1)),  # type: ignore[arg-type]
        "centers numbers",
    ),
    "kernels' shapes": (
        lambda: AdaptiveKernels(torus, torch.tensor(1.0), torch.ones(1), torch.ones(1)),
        "fit",
    ),
    "chains": (lambda: VonMisesChains(sphere, HALVES, HALVES, HALVES), "Mises chains"),
    "chains' shapes": (
        lambda: VonMisesChains(torus, [0.0], HALVES, HALVES),  # type: ignore[arg-type]
        "log_weights",
    ),
    "a mixture of nothing": (
        lambda: Mixture([a_density(), None], [0.5, 0.5]),  # type: ignore[list-item]
        "components Density",
    ),
    "fit: a name": (lambda: fit_density("torus", POINTS), "space Space"),  # type: ignore[arg-type]
    "fit: columns": (lambda: fit_density(sphere, torch.rand(30, 3)), "2 30 3"),
    "fit: one row": (lambda: fit_density(sphere, torch.rand(2)), "2"),
    "fit: nan": (lambda: fit_density(sphere, POINTS / 0 * 0), "points finite"),
    "fit: settings": (
        lambda: fit_density(sphere, POINTS, {"max_frequency": 2}),  # type: ignore[arg-type]
        "FlowSettings",
    ),
    "fit: other settings": (
        lambda: fit_density(sphere, POINTS, DensitySettings()),  # type: ignore[arg-type]
        "FlowSettings",
    ),
    "fit: four angles": (lambda: fit_density(Torus(4), torch.rand(30, 4)), "dimensions 3"),
    "max_frequency": (
        lambda: FlowSettings(max_frequency=2.5),  # type: ignore[arg-type]
        "max_frequency 1 64",
    ),
    "frequency text": (
        lambda: FlowSettings(max_frequency="8"),  # type: ignore[arg-type]
        "max_frequency",
    ),
    "seed": (lambda: FlowSettings(seed=None), "seed"),  # type: ignore[arg-type]
    "roughness": (lambda: FlowSettings(roughness=1e-3), "roughness"),  # type: ignore[arg-type]
    "weights": (lambda: FlowSettings(roughness=("a",)), "roughness 1"),  # type: ignore[arg-type]
    "validation": (lambda: FlowSettings(validation="a"), "validation 1"),  # type: ignore[arg-type]
    "dim": (lambda: Torus("2"), "number 1 64"),  # type: ignore[arg-type]
    "unit": (lambda: Torus(2, unit=None), "unit"),  # type: ignore[arg-type]
    "form": (lambda: Sphere(form=["latlon"]), "form latlon"),  # type: ignore[arg-type]
    "rotation": (lambda: Sphere(rotation="none"), "rotation"),
    "clear_rotation": (lambda: clear_rotation(torus, [[0.0, 0.0]]), "RoundSpace"),  # type: ignore[arg-type]
    "make_space": (lambda: make_space(torus), "unknown space"),  # type: ignore[arg-type]
    "from_chart": (lambda: torus.from_chart(torch.rand(3, 3)), "3"),
    "from_chart, round": (lambda: sphere.from_chart(torch.rand(3, 1)), "3 1"),
    "project": (lambda: sphere.project(torch.rand(3, 5)), "3 5"),
    "to bytes": (lambda: density_to_bytes("density"), "density"),  # type: ignore[arg-type]
    "read": (lambda: read_density(3), "file 3"),  # type: ignore[arg-type]
    "estimator": (lambda: DensityEstimator(3).fit(POINTS), "takes 3"),  # type: ignore[arg-type]
    "estimator's data": (lambda: DensityEstimator().fit([1.0]), "shape"),
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


def test_arrays_of_every_kind_are_fitted() -> None:
    for points in (POINTS.numpy(), POINTS.tolist(), POINTS.float()):
        density, _ = fit_density(torus, points, FlowSettings(**QUICK))  # type: ignore[arg-type]
        assert density.sample(3).shape == (3, 2)
    whole = np.random.default_rng(0).integers(-90, 90, (30, 2))
    assert DensityEstimator("sphere", **QUICK).fit(whole).sample(2).shape == (2, 2)


def test_a_number_of_samples_is_a_shape() -> None:
    density = a_density()
    generators = [torch.Generator().manual_seed(0) for _ in range(2)]
    assert torch.equal(
        density.sample(5, generators[0]), density.sample(torch.Size([5]), generators[1])
    )
