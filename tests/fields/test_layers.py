"""Bounds of networks by their layers, and bijective flows along symmetrized ones."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn

from orbiflow.fields import PeriodicFeatures, jacobian, lipschitz_bound, symmetrize
from orbiflow.fields.layers import SLOPES
from orbiflow.flows import Flow
from orbiflow.symmetry import wallpaper_group
from refusals import refused

SQUARE = wallpaper_group("p4")
ACTIVATIONS = [kind for kind in SLOPES if kind is not nn.Linear]


def network(activation: nn.Module, seed: int, scale: float = 1.0) -> nn.Sequential:
    """A periodic network of two layers from points of the plane to vectors."""
    torch.manual_seed(seed)
    features = PeriodicFeatures(SQUARE, 1)
    made = nn.Sequential(features, nn.Linear(features.size, 8), activation, nn.Linear(8, 2))
    with torch.no_grad():
        for own in made.parameters():
            own.mul_(scale)
    return made.double()


@pytest.mark.parametrize(
    "layer",
    [*(kind() for kind in ACTIVATIONS), nn.LeakyReLU(-3.0), nn.ELU(2.5), nn.GELU("tanh")],
    ids=str,
)
def test_no_activation_is_steeper_than_is_said(layer: nn.Module) -> None:
    at = torch.linspace(-8, 8, 200_001, dtype=torch.float64, requires_grad=True)
    slope = torch.autograd.grad(layer(at).sum(), at)[0].abs().max()
    bound = lipschitz_bound(layer)
    assert bound is not None
    assert float(slope) <= bound <= 1.001 * max(float(slope), 0.999)


@settings(max_examples=20, deadline=None)
@given(st.sampled_from(ACTIVATIONS), st.integers(0, 1000), st.floats(0.1, 4))
def test_no_sampled_slope_exceeds_the_bound(kind: type[nn.Module], seed: int, scale: float) -> None:
    field = symmetrize(network(kind(), seed, scale), SQUARE, periodic=True)
    points = torch.rand(200, 2, dtype=torch.float64)
    steepest = torch.linalg.matrix_norm(jacobian(field, points), ord=2).max()
    bound = lipschitz_bound(field)
    assert bound is not None
    assert float(steepest.detach()) <= bound * (1 + 1e-12)


def test_the_bound_of_features_is_attained() -> None:
    features = PeriodicFeatures(SQUARE, 2)
    points = torch.rand(5, 2, dtype=torch.float64)
    slopes = torch.func.vmap(torch.func.jacrev(features))(points)
    norms = torch.linalg.matrix_norm(slopes, ord=2)
    assert torch.allclose(norms, features.lipschitz_bound().expand(5), rtol=1e-12)


def test_a_bijective_flow_along_a_symmetrized_network_has_the_determinants_of_its_map() -> None:
    fields = [symmetrize(network(nn.Tanh(), seed, 1.5), SQUARE, periodic=True) for seed in (0, 1)]
    flow = Flow(fields, steps=1, method="midpoint", bijective=True)
    assert flow.steps > 1
    points = torch.rand(6, 2, dtype=torch.float64)
    _, logs = flow.forward_and_log_det(points)
    slopes = torch.stack([torch.autograd.functional.jacobian(flow.forward, one) for one in points])
    assert torch.allclose(torch.linalg.slogdet(slopes)[1], logs, atol=1e-9)
    rotation = SQUARE.cosets[1]
    assert torch.allclose(flow.forward(rotation(points)), rotation(flow.forward(points)))


def test_what_has_no_bound_is_refused() -> None:
    class Twice(nn.Linear):
        def forward(self, input: torch.Tensor) -> torch.Tensor:
            return 2 * super().forward(input)

    known = network(nn.Tanh(), 0)
    blended = symmetrize(known, SQUARE)  # over neighbouring cells: values are part of its slope
    own = nn.Sequential(PeriodicFeatures(SQUARE, 1), Twice(8, 2)).double()
    for field in (blended, symmetrize(own, SQUARE, periodic=True)):
        assert lipschitz_bound(field) is None
        with refused("bijective"):
            Flow(field, bijective=True)
