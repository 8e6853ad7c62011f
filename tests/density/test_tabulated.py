"""A density's table: near the density, invariant, and honest about its error."""

import pytest
import torch

from density.blends import blended
from orbiflow.density import AdaptiveKernels, FlowDensity, TabulatedDensity, Torus, make_space
from orbiflow.errors import OrbiflowError
from orbiflow.fields import SplineField
from orbiflow.flows import Flow

SPACES = ("torus", "sphere", "klein-bottle", "projective-plane")


def some_density(name: str) -> FlowDensity:
    """A flow of one random field."""
    torch.manual_seed(4)
    space = make_space(name)
    field = SplineField(space.group, 3, smoothness=2.0)
    with torch.no_grad():
        field.parameters_.normal_(std=0.05 if name == "torus" else 0.15)
    return FlowDensity(space, Flow([field], steps=4))


@pytest.mark.parametrize("name", SPACES)
def test_the_table_is_as_near_as_it_says(name: str) -> None:
    density = some_density(name)
    table = TabulatedDensity(density, 128)
    assert table.error < 5e-3
    generator = torch.Generator().manual_seed(9)
    points = density.sample((2000,), generator)
    for measure in ("square", "natural", "uniform"):
        with torch.no_grad():
            off = table.log_prob(points, measure=measure) - density.log_prob(
                points, measure=measure
            )
        assert float(off.square().mean().sqrt()) < 2 * table.error + 1e-9
        assert float(off.abs().max()) < 5 * table.largest + 1e-9


@pytest.mark.parametrize("name", SPACES)
def test_the_table_is_invariant(name: str) -> None:
    table = TabulatedDensity(some_density(name), 64)
    points = torch.rand(200, 2, dtype=torch.float64)
    for element in table.space.group.cosets:
        there = table.log_prob(element(points) + 2, measure="uniform")
        assert torch.allclose(there, table.log_prob(points, measure="uniform"), atol=1e-9)


@pytest.mark.parametrize("name", SPACES)
def test_kernels_narrower_than_a_cell_are_kept_apart(name: str) -> None:
    torch.manual_seed(5)
    plain = some_density(name)
    space = plain.space
    width = 1 if space.is_round else 2
    kappa = 10 ** (1 + 6 * torch.rand(200, 1, dtype=torch.float64)).expand(200, width)
    kernels = AdaptiveKernels(
        space, torch.rand(200, 2, dtype=torch.float64), kappa, torch.full((200,), 1 / 200)
    )
    shares = torch.tensor([0.3, 0.6, 0.1])
    density = blended(space, plain.flow, plain.base, kernels, shares)
    table = TabulatedDensity(density, 128)
    assert table.error < 5e-3
    points = density.sample((1000,), torch.Generator().manual_seed(1))
    off = (table.log_prob(points) - density.log_prob(points)).detach().abs()
    assert float(off.max()) < 5 * table.largest + 1e-9


def test_a_finer_table_is_nearer() -> None:
    density = some_density("torus")
    assert TabulatedDensity(density, 128).error < 0.2 * TabulatedDensity(density, 32).error


def test_bad_requests() -> None:
    with pytest.raises(OrbiflowError, match="from 8 to 4096"):
        TabulatedDensity(some_density("torus"), 4)
    space = Torus(3)
    with pytest.raises(OrbiflowError, match="two dimensions"):
        TabulatedDensity(FlowDensity(space, Flow([SplineField(space.group, 1)])))
