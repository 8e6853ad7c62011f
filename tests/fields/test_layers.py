"""Networks on periodic features: symmetry, bounds by their layers, and bijective flows."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn

from orbiflow.fields import PeriodicFeatures, jacobian, lipschitz_bound, symmetrize
from orbiflow.fields.layers import SLOPES
from orbiflow.flows import Flow
from orbiflow.symmetry import CrystallographicGroup, wallpaper_group
from refusals import refused
from strategies import equivariance_error, groups, largest, neural_field, random_tensor

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


def disturbed(field, seed):
    """The field with random weights everywhere, the last layer included."""
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in field.parameters():
            noise = torch.randn(parameter.shape, generator=generator, dtype=parameter.dtype)
            parameter.add_(0.3 * noise)
    return field


@settings(max_examples=10)
@given(groups, st.integers(0, 1000))
def test_equivariance_holds_to_rounding(group, seed):
    field = disturbed(neural_field(group, hidden=(8,), seed=seed), seed)
    assert equivariance_error(field, group, random_tensor(seed, 8, group.dim)) < 1e-11


def test_a_new_field_is_zero():
    field = neural_field(wallpaper_group("p4"))
    assert largest(field(random_tensor(0, 10, 2))) == 0.0


@pytest.mark.parametrize(
    ("dim", "max_frequency", "size"), [(1, 3, 6), (2, 1, 8), (2, 2, 24), (3, 1, 26), (4, 2, 16)]
)
def test_features_are_cosines_and_sines_of_half_the_box(dim, max_frequency, size):
    group = CrystallographicGroup.generate(torch.eye(dim).numpy())
    features = PeriodicFeatures(group, max_frequency)
    values = features(random_tensor(0, 50, dim))
    assert features.size == values.shape[-1] == size
    half = size // 2
    torch.testing.assert_close(
        values[:, :half].square() + values[:, half:].square(),
        torch.ones(50, half, dtype=torch.float64),
    )


def test_features_without_a_frequency_are_refused():
    with refused("max_frequency", 0):
        PeriodicFeatures(wallpaper_group("p1"), 0)
