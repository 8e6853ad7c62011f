"""Log densities are differentiable in the points, and the derivatives are right."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from density.blends import blended, bump, flow_of
from orbiflow.density import (
    MEASURES,
    AdaptiveKernels,
    Density,
    FlowDensity,
    Space,
    UniformDensity,
    make_space,
)
from orbiflow.fields import FourierField
from orbiflow.flows import Flow
from strategies import central_difference, random_field, seeds

SPACES = ("torus", "sphere", "klein-bottle", "projective-plane")
KINDS = ("uniform", "von-mises", "blended")


def density_of(kind: str, space: Space, seed: int) -> Density:
    torch.manual_seed(seed % 2**31)
    flow = Flow(random_field(space.group, 2, seed, rms=0.05), steps=4, warn=False)
    base = bump(space) if kind == "von-mises" else UniformDensity(space)
    if kind != "blended":
        return FlowDensity(space, flow, base)
    width = 1 if space.is_round else 2
    kernels = AdaptiveKernels(
        space,
        torch.rand(5, 2, dtype=torch.float64),
        2 + 20 * torch.rand(5, width, dtype=torch.float64),
        torch.full((5,), 0.2),
    )
    return blended(space, flow, base, kernels, torch.tensor([0.2, 0.7, 0.1]))


@pytest.mark.parametrize("name", SPACES)
@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=2)
@given(seed=seeds, measure=st.sampled_from(MEASURES))
def test_gradients_in_the_points(kind: str, name: str, seed: int, measure: str) -> None:
    space = make_space(name)
    density = density_of(kind, space, seed)
    # off edges and cone points, where the projection has its seams
    points = 0.1 + 0.8 * torch.rand(20, 2, dtype=torch.float64)
    points.requires_grad_()
    found = torch.autograd.grad(density.log_prob(points, measure=measure).sum(), points)[0]
    with torch.no_grad():
        expected = central_difference(
            lambda p: density.log_prob(p, measure=measure)[..., None], points.detach()
        )[..., 0, :]
    assert torch.allclose(found, expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("name", SPACES)
def test_unit_vectors_are_those_of_the_data(name: str) -> None:
    space = make_space(name)
    points = torch.rand(10, 2, dtype=torch.float64)
    images = space.features(points)
    assert images.shape[1] == 10
    if space.is_round:
        assert torch.allclose(images.norm(dim=-1), torch.ones(len(images), 10).double())


def test_parameters_have_gradients_beside_those_of_the_points() -> None:
    space = make_space("sphere")
    density = density_of("blended", space, 0)
    points = torch.rand(5, 2, dtype=torch.float64, requires_grad=True)
    field = next(iter(flow_of(density).flow.segments))  # type: ignore[arg-type]
    assert isinstance(field, FourierField)
    wanted = (points, field.parameters_)
    grads = torch.autograd.grad(density.log_prob(points).sum(), wanted)
    assert all(bool(g.abs().max() > 0) for g in grads)
