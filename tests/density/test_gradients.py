"""Log densities are differentiable in the points and in the data's own coordinates."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from density.blends import blended, bump, flow_of
from orbiflow.density import (
    MEASURES,
    AdaptiveKernels,
    Density,
    DensityEstimator,
    FlowDensity,
    KleinBottle,
    ProjectivePlane,
    Space,
    Sphere,
    Torus,
    UniformDensity,
    log_density_gradient,
    make_space,
)
from orbiflow.fields import FourierField
from orbiflow.flows import Flow
from refusals import refused
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


TURN = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
SPACES_BY_UNIT: dict[str, Space] = {
    "one angle": Torus(1), "degrees": Torus(2, unit="degrees"),
    "three turns": Torus(3, unit="turns"), "bottle": KleinBottle(),
    "bottle in degrees": KleinBottle(unit="degrees"), "lat, lon": Sphere(rotation=TURN),
    "vectors": Sphere(form="vector", rotation=TURN), "axes": ProjectivePlane(rotation=TURN),
    "axes as vectors": ProjectivePlane(form="vector", rotation=TURN),
}  # fmt: skip


def density_on(space: Space, seed: int, share: float) -> Density:
    """A flow of one field, kernels and a floor."""
    torch.manual_seed(seed)
    # of waves: a spline's divergence has kinks, where numerical derivatives are off
    flow = Flow(random_field(space.group, 2, seed % 2**31, rms=0.05), steps=4, warn=False)
    width = 1 if space.is_round else space.dim
    kernels = AdaptiveKernels(
        space,
        torch.rand(6, space.dim, dtype=torch.float64),
        0.5 + 20 * torch.rand(6, width, dtype=torch.float64),
        torch.softmax(torch.randn(6, dtype=torch.float64), dim=0),
    )
    shares = torch.tensor([share, 0.7 - share, 0.3])
    return blended(space, flow, UniformDensity(space), kernels, shares)


def data_on(space: Space, seed: int) -> np.ndarray:
    """Points anywhere, not only canonical ones."""
    rng = np.random.default_rng(seed)
    if not space.is_round:
        return (
            rng.uniform(-1.5, 1.5, (20, space.dim))
            * {"radians": 6, "degrees": 360, "turns": 1}[str(space.unit)]
        )
    vectors = rng.normal(size=(20, 3))
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    if space.settings()["form"] == "vector":
        return vectors
    return np.stack(
        [
            np.degrees(np.arcsin(vectors[:, 2])),
            np.degrees(np.arctan2(vectors[:, 1], vectors[:, 0])),
        ],
        axis=1,
    )


def log_density(density: Density, data: np.ndarray) -> np.ndarray:
    """In natural measure."""
    if density.space.is_round and data.shape[1] == 3:
        data = data / np.linalg.norm(data, axis=1, keepdims=True)
    with torch.no_grad():
        return density.log_prob(density.space.to_chart(data), measure="natural").numpy()


@given(st.sampled_from(sorted(SPACES_BY_UNIT)), st.integers(0, 2**31), st.sampled_from([0.0, 0.4]))
@settings(max_examples=7, deadline=None)
def test_the_gradient_is_the_numerical_one(name: str, seed: int, share: float) -> None:
    space = SPACES_BY_UNIT[name]
    density, data = density_on(space, seed, share), data_on(space, seed)
    values, found = log_density_gradient(density, data)
    np.testing.assert_allclose(values, log_density(density, data), rtol=1e-9, atol=1e-9)
    unit = 1.0 if data.shape[1] == 3 and space.is_round else None
    turn = {"radians": 2 * np.pi, "degrees": 360.0, "turns": 1.0}
    scale = (unit or turn.get(str(space.unit), 360.0)) / 6
    for axis in range(data.shape[1]):
        step = np.zeros(data.shape[1])
        step[axis] = 1e-6 * scale
        # vectors are divided by their length, so that the difference is along the sphere
        ahead, behind = (log_density(density, data + s * step) for s in (1, -1))
        expected = (ahead - behind) / (2e-6 * scale)
        if space.is_round:  # next to a cone point the chart's own digits are few
            cones = density.space.cone_vectors()  # type: ignore[attr-defined]
            own = space.vectors(space.to_chart(data))  # type: ignore[attr-defined]
            clear = abs(own @ cones.T).max(axis=1) < 0.999
        else:
            clear = np.ones(len(data), dtype=bool)
        off = abs(found[:, axis] - expected)[clear]
        assert off.max(initial=0.0) * scale < 2e-5


def test_of_vectors_it_is_tangent_and_the_same_in_both_forms() -> None:
    space = SPACES_BY_UNIT["vectors"]
    density, vectors = density_on(space, 3, 0.3), data_on(space, 4)
    _, found = log_density_gradient(density, vectors)
    assert abs((found * vectors).sum(axis=1)).max() < 1e-10
    latlon = np.degrees(
        np.stack([np.arcsin(vectors[:, 2]), np.arctan2(vectors[:, 1], vectors[:, 0])], axis=1)
    )
    _, other = log_density_gradient(density, latlon)
    across = np.cos(np.radians(latlon[:, 0]))
    length = np.degrees(np.hypot(other[:, 0], other[:, 1] / across))
    np.testing.assert_allclose(length, np.linalg.norm(found, axis=1), rtol=1e-9)


def test_both_ends_of_an_axis_point_uphill_alike() -> None:
    space = SPACES_BY_UNIT["axes as vectors"]
    density, vectors = density_on(space, 3, 0.3), data_on(space, 4)
    found = [log_density_gradient(density, end)[1] for end in (vectors, -vectors)]
    np.testing.assert_allclose(found[0], -found[1], atol=1e-9)


def test_the_estimator_has_it() -> None:
    angles = np.random.default_rng(0).vonmises(1.0, 4.0, (80, 1))
    estimator = DensityEstimator("torus", components="mixture").fit(angles)
    slope = estimator.score_gradient([[0.5], [1.5]])
    assert slope[0, 0] > 0 > slope[1, 0]
    assert estimator.score_gradient(np.zeros((0, 1))).shape == (0, 1)
    with refused("fitted"):
        DensityEstimator().score_gradient([[0.0]])
