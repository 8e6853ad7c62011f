"""The spline through a Fourier field: symmetric, smooth, with exact derivatives."""

from functools import partial

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.fields import FourierField, SplineField, jacobian
from orbiflow.fields.spline_field import padded, spline_sum
from orbiflow.symmetry import CrystallographicGroup, identification_group, wallpaper_group
from refusals import refused

SPACES = ("torus", "sphere", "klein-bottle", "projective-plane")
names = st.sampled_from(SPACES)
seeds = st.integers(0, 2**31)


def pair(
    name: str, seed: int, frequency: int = 5
) -> tuple[SplineField, FourierField, torch.Tensor]:
    """The two fields with the same parameters, and points around."""
    torch.manual_seed(seed)
    group = identification_group(name)
    spline = SplineField(group, frequency, smoothness=1.0)
    fourier = FourierField(group, frequency, smoothness=1.0)
    with torch.no_grad():
        spline.parameters_.normal_()
        fourier.parameters_.copy_(spline.parameters_)
    return spline, fourier, 6 * torch.rand(20, 2, dtype=torch.float64) - 3


@given(names, seeds)
@settings(max_examples=15, deadline=None)
def test_it_commutes_with_the_group(name: str, seed: int) -> None:
    spline, _, points = pair(name, seed)
    with torch.no_grad():
        for element in spline.group.cosets:
            turned = spline(points) @ torch.tensor(element.linear).mT
            assert torch.allclose(spline(element(points)), turned, atol=1e-10)


@given(names, seeds)
@settings(max_examples=10, deadline=None)
def test_it_meets_the_fourier_field_at_the_grid(name: str, seed: int) -> None:
    spline, fourier, _ = pair(name, seed)
    sides = torch.tensor(spline.sides, dtype=torch.float64)
    lengths = torch.tensor(spline.group.lattice.diagonal().copy())
    points = torch.floor(torch.rand(30, 2, dtype=torch.float64) * sides) / sides * lengths
    with torch.no_grad():
        assert torch.allclose(spline(points), fourier(points), atol=1e-10)


@given(names, seeds)
@settings(max_examples=5, deadline=None)
def test_its_divergence_is_the_trace_of_its_jacobian(name: str, seed: int) -> None:
    spline, _, points = pair(name, seed)
    trace = jacobian(spline, points).diagonal(dim1=-2, dim2=-1).sum(dim=-1)
    assert torch.allclose(spline.divergence(points), trace, atol=1e-9)


@given(names, seeds)
@settings(max_examples=5, deadline=None)
def test_the_adjoint_is_the_transpose(name: str, seed: int) -> None:
    spline, _, points = pair(name, seed)
    forces = torch.randn_like(points)
    work = float((spline(points) * forces).sum().detach())
    assert float(spline.adjoint(points, forces) @ spline.parameters_.detach()) == pytest.approx(
        work
    )


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_derivatives_of_the_sum_against_numerical_ones(dim: int) -> None:
    torch.manual_seed(dim)
    table = torch.randn(dim, *(6, 8, 5)[:dim], dtype=torch.float64, requires_grad=True)
    u = (20 * torch.rand(dim, 4, dtype=torch.float64) - 5).requires_grad_()
    rates = (1.5, 0.7, 2.0)[:dim]
    way = {"fast_mode": dim == 3}
    assert torch.autograd.gradcheck(lambda t, x: spline_sum(padded(t), x)[0], (table, u), **way)
    assert torch.autograd.gradcheck(lambda t, x: spline_sum(padded(t), x, rates), (table, u), **way)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_second_derivatives_of_the_sum_against_numerical_ones(dim: int) -> None:
    torch.manual_seed(dim)
    table = torch.randn(dim, *(4, 5, 4)[:dim], dtype=torch.float64, requires_grad=True)
    u = (20 * torch.rand(dim, 3, dtype=torch.float64) - 5).requires_grad_()
    rates = (1.5, 0.7, 2.0)[:dim]
    # along random directions instead of every entry's
    check = partial(torch.autograd.gradgradcheck, inputs=(table, u), fast_mode=dim == 3)
    assert check(lambda t, x: spline_sum(padded(t), x)[0])
    assert check(lambda t, x: spline_sum(padded(t), x, rates))


def test_a_field_made_double_is_as_symmetric_as_one_born_so() -> None:
    group = identification_group("sphere")
    field = SplineField(group, 4, smoothness=1.0, dtype=torch.float32).double()
    assert field.values.dtype == torch.float64
    assert torch.equal(field.scale, SplineField(group, 4, smoothness=1.0).scale)


@pytest.mark.parametrize(
    "group",
    [
        wallpaper_group("p6"),
        CrystallographicGroup.generate([[1.0, 0.3], [0.0, 1.0]], []),
        CrystallographicGroup.generate(torch.eye(4).numpy(), []),
    ],
)
def test_other_groups_are_refused(group: CrystallographicGroup) -> None:
    with refused("FourierField"):
        SplineField(group, 2)


@given(names, seeds)
@settings(max_examples=10, deadline=None)
def test_no_sampled_slope_exceeds_its_lipschitz_bound(name: str, seed: int) -> None:
    spline, _, _ = pair(name, seed)
    with torch.no_grad():
        slopes = jacobian(spline, 6 * torch.rand(500, 2, dtype=torch.float64) - 3)
    steepest = float(torch.linalg.matrix_norm(slopes, ord=2).max())
    bound = float(spline.lipschitz_bound())
    assert 0.3 * bound < steepest <= bound
