"""Networks on periodic features: symmetry, and the bound of a field's Jacobian."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn

from orbiflow.fields import (
    FourierField,
    PeriodicFeatures,
    group_factor,
    jacobian,
    lipschitz_bound,
    steepness,
    symmetrize,
)
from orbiflow.fields.layers import SLOPES
from orbiflow.flows import METHODS, Flow
from orbiflow.symmetry import WALLPAPER_GROUPS, CrystallographicGroup, wallpaper_group
from refusals import refused
from strategies import (
    SMALL_SPACE_GROUPS,
    equivariance_error,
    groups,
    largest,
    neural_field,
    random_field,
    random_tensor,
    seeds,
    space_group,
)

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


NINE = ("p1", "p2", "p3", "p4", "p6", "pg", "pgg")
"""Groups of the nine isohedral classes."""


def factor(field: FourierField) -> float:
    return group_factor(field.group, field.basis)


def steep(field: FourierField) -> float:
    return float(steepness(field.parameters_.detach(), torch.tensor(field.basis.magnitude)))


def steepest(field: FourierField, seed: int, count: int = 100) -> float:
    with torch.no_grad():
        slopes = field.jacobian(random_tensor(seed, count, field.group.dim))
    return float(torch.linalg.matrix_norm(slopes, ord=2).max())


@settings(max_examples=30)
@given(groups, st.integers(1, 3), seeds)
def test_no_sampled_slope_exceeds_the_groups_factor_times_the_steepness(
    group: CrystallographicGroup, max_frequency: int, seed: int
) -> None:
    field = random_field(group, min(max_frequency, 4 - group.dim), seed)
    found = steepest(field, seed) * (1 - 1e-12)
    assert found <= float(field.lipschitz_bound())
    assert found <= factor(field) * steep(field)


@pytest.mark.parametrize("name", WALLPAPER_GROUPS)
def test_the_factor_is_nearly_reached(name: str) -> None:
    field = FourierField(wallpaper_group(name), 3)
    reached = 0.0
    for index in range(field.size):
        with torch.no_grad():
            field.parameters_.zero_()
            field.parameters_[index] = 1.0
        if steep(field) > 0:
            reached = max(reached, steepest(field, index, 2000) / steep(field))
    assert 0.95 * factor(field) <= reached <= factor(field) * (1 + 1e-12)


@pytest.mark.parametrize(
    ("name", "expected"),
    [("p1", 1.0), ("p2", 1.0), ("p3", 0.75**0.5), ("p4", 0.5**0.5), ("p6", 0.75**0.5)],
)
def test_the_factor_of_groups_without_reflections(name: str, expected: float) -> None:
    field = FourierField(wallpaper_group(name), 4)
    assert factor(field) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("name", WALLPAPER_GROUPS)
def test_no_plane_group_exceeds_root_two(name: str) -> None:
    field = FourierField(wallpaper_group(name), 8)
    assert factor(field) <= math.sqrt(2.0)
    if name in NINE:  # the descent's steps need not shrink
        assert 0.4 * factor(field) < METHODS["midpoint"].injective_below


@pytest.mark.parametrize("name", SMALL_SPACE_GROUPS)
def test_the_factor_of_a_space_group_is_at_most_the_root_of_its_orbits(name: str) -> None:
    group = space_group(name, 0)
    field = FourierField(group, 1)
    assert 0.0 < factor(field) <= math.sqrt(group.order) + 1e-12


@given(st.sampled_from(sorted(WALLPAPER_GROUPS)), st.integers(1, 3), seeds)
def test_the_bound_is_near_what_is_reached_in_the_plane(name, max_frequency, seed) -> None:
    field = random_field(wallpaper_group(name), max_frequency, seed)
    assert float(field.lipschitz_bound()) <= 1.35 * steepest(field, seed, 4000)
