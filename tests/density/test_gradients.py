"""Log densities are differentiable in the points and in the data's own coordinates."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from density.blends import blended, bump, flow_of, random_kernels
from orbiflow.density import (
    MEASURES,
    Density,
    DensityEstimator,
    KleinBottle,
    ProjectivePlane,
    Space,
    Sphere,
    Torus,
    log_density_gradient,
    make_space,
)
from orbiflow.flows import Flow
from refusals import refused
from strategies import central_difference, random_field, seeds

SPACES = ("torus", "sphere", "klein-bottle", "projective-plane")


@pytest.mark.parametrize("name", SPACES)
@settings(max_examples=3)
@given(seed=seeds, measure=st.sampled_from(MEASURES))
def test_gradients_in_the_points(name: str, seed: int, measure: str) -> None:
    density = density_on(make_space(name), seed, 0.3)
    # off edges and cone points, where the projection has its seams
    points = 0.1 + 0.8 * torch.rand(20, 2, dtype=torch.float64)
    points.requires_grad_()
    found, *slopes = torch.autograd.grad(
        density.log_prob(points, measure=measure).sum(),
        [points, *flow_of(density).flow.parameters()],
    )
    with torch.no_grad():
        expected = central_difference(
            lambda p: density.log_prob(p, measure=measure)[..., None], points.detach()
        )[..., 0, :]
    assert torch.allclose(found, expected, rtol=1e-5, atol=1e-5)
    assert all(bool(slope.abs().max() > 0) for slope in slopes)


def test_none_before_a_fit() -> None:
    with refused("fitted"):
        DensityEstimator().score_gradient([[0.0]])


TURN = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
SPACES_BY_UNIT: dict[str, Space] = {
    "one angle": Torus(1), "degrees": Torus(2, unit="degrees"),
    "three turns": Torus(3, unit="turns"), "bottle": KleinBottle(),
    "bottle in degrees": KleinBottle(unit="degrees"), "lat, lon": Sphere(rotation=TURN),
    "vectors": Sphere(form="vector", rotation=TURN), "axes": ProjectivePlane(rotation=TURN),
    "axes as vectors": ProjectivePlane(form="vector", rotation=TURN),
}  # fmt: skip


def density_on(space: Space, seed: int, share: float) -> Density:
    """A flow of one field on a bump, kernels and a floor."""
    torch.manual_seed(seed % 2**31)
    # of waves: a spline's divergence has kinks, where numerical derivatives are off
    flow = Flow(random_field(space.group, 2, seed % 2**31, rms=0.05), steps=4, warn=False)
    kernels = random_kernels(np.random.default_rng(seed), space, 6, 0.5, 20.0)
    shares = torch.tensor([share, 0.7 - share, 0.3])
    return blended(space, flow, bump(space), kernels, shares)


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
