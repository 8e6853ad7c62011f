"""The conformal bijections of the square with the sphere and with the projective plane."""

import math

import mpmath
import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.density import ProjectivePlane, Sphere
from orbiflow.density.spaces.round import NULL3, K, from_sphere, log_area, thetas, to_sphere

SPACES = (Sphere(), ProjectivePlane())
seeds = st.integers(0, 2**32 - 1)


def square(seed: int, count: int = 200) -> torch.Tensor:
    return torch.tensor(np.random.default_rng(seed).random((count, 2)))


def gap(one: torch.Tensor, other: torch.Tensor, power: int) -> float:
    """Largest distance of unit vectors, or of axes."""
    distance = (one - other).norm(dim=-1)
    if power == 2:
        distance = torch.minimum(distance, (one + other).norm(dim=-1))
    return float(distance.max())


def test_constants() -> None:
    with mpmath.workdps(30):
        assert float(mpmath.ellipk(mpmath.mpf(1) / 2)) == K
        assert float(mpmath.jtheta(3, 0, mpmath.exp(-mpmath.pi))) == NULL3


@given(st.floats(-1, 1), st.floats(-1, 1))
def test_thetas_are_those_of_mpmath(x: float, y: float) -> None:
    found = thetas(torch.tensor([complex(x, y)], dtype=torch.complex128))
    for n, value in enumerate(found, start=1):
        exact = complex(mpmath.jtheta(n, mpmath.pi * mpmath.mpc(x, y) / 2, mpmath.exp(-mpmath.pi)))
        assert abs(complex(value[0]) - exact) < 1e-13 * max(1.0, abs(exact))


@given(st.floats(0.01, 0.99), st.floats(0.01, 0.99))
def test_it_is_the_elliptic_function_of_the_design(x: float, y: float) -> None:
    z = mpmath.mpc(x, y)
    cn2 = mpmath.ellipfun("cn", mpmath.mpf(K) * z, m=mpmath.mpf(1) / 2) ** 2
    u = complex((1 + cn2) / (1 - cn2))
    for space, w in zip(SPACES, (u**2, u), strict=True):
        height = (abs(w) ** 2 - 1) / (abs(w) ** 2 + 1)
        plane = 2 * w / (abs(w) ** 2 + 1)
        expected = torch.tensor([[plane.real, plane.imag, height]], dtype=torch.float64)
        found = to_sphere(torch.tensor([[x, y]], dtype=torch.float64), space.power)
        assert gap(found, expected, 4) < 1e-11


@pytest.mark.parametrize("space", SPACES, ids=lambda s: s.name)
@given(seed=seeds)
def test_there_and_back(space, seed: int) -> None:
    points = square(seed)
    back = space.project(torch.tensor(from_sphere(space.vectors(points), space.power)))
    assert float((back - points).abs().max()) < 1e-10
    vectors = torch.randn(200, 3, generator=torch.Generator().manual_seed(seed)).double()
    vectors = vectors / vectors.norm(dim=1, keepdim=True)
    again = torch.tensor(space.vectors(space.vectors_to_chart(vectors.numpy())))
    assert gap(again, vectors, space.power) < 1e-10


@pytest.mark.parametrize("space", SPACES, ids=lambda s: s.name)
@given(seed=seeds)
def test_the_area_factor_is_the_jacobian(space, seed: int) -> None:
    points = square(seed, 20).requires_grad_()
    vectors = to_sphere(points, space.power)
    rows = [
        torch.autograd.grad(vectors[:, i].sum(), points, retain_graph=True)[0] for i in range(3)
    ]
    jacobian = torch.stack(rows, dim=1)
    area = torch.linalg.cross(jacobian[:, :, 0], jacobian[:, :, 1]).norm(dim=-1)
    assert torch.allclose(area, log_area(points.detach(), space.power).exp(), rtol=1e-10)
    # conformal: the two derivatives are orthogonal and equally long
    metric = jacobian.mT @ jacobian
    assert torch.allclose(metric, area[:, None, None] * torch.eye(2).double(), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("space", "area"), [(SPACES[0], 4 * math.pi), (SPACES[1], 2 * math.pi)])
def test_the_area_is_that_of_the_space(space, area: float) -> None:
    t = (torch.arange(200, dtype=torch.float64) + 0.5) / 200
    grid = torch.stack(torch.meshgrid(t, t, indexing="ij"), dim=-1)
    assert float(log_area(grid, space.power).exp().mean()) == pytest.approx(area, abs=1e-10)
    assert space.volume == area


@pytest.mark.parametrize("space", SPACES, ids=lambda s: s.name)
@given(seed=seeds)
def test_both_are_invariant_under_the_group(space, seed: int) -> None:
    points = square(seed, 50)
    rng = np.random.default_rng(seed)
    images = space.group.images(points) + torch.tensor(2.0 * rng.integers(-3, 4, (4, 1, 2)))
    spread = space.log_area(images) - space.log_area(points)
    assert float(spread.abs().max()) < 1e-9
    for image in space.project(images):
        assert (
            gap(to_sphere(image, space.power), to_sphere(points, space.power), space.power) < 1e-10
        )


@pytest.mark.parametrize("space", SPACES, ids=lambda s: s.name)
def test_poles_cone_points_and_the_cut_are_finite(space) -> None:
    t = np.linspace(0, 2 * np.pi, 65)
    circles = [np.roll(np.stack([np.cos(t), np.sin(t), 0 * t], 1), k, axis=1) for k in range(3)]
    special = np.concatenate([np.eye(3), -np.eye(3), space.cone_vectors(), *circles])
    points = space.vectors_to_chart(special)
    assert bool(torch.isfinite(points).all())
    assert gap(torch.tensor(space.vectors(points)), torch.tensor(special), space.power) < 1e-7
    assert bool(torch.isfinite(space.log_area(torch.tensor([[0.0, 0.0], [1.0, 1.0]]))).all())
