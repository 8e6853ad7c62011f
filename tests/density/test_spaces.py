"""The four spaces: units, measures, distances, conformal bijections, and what they refuse."""

import math

import mpmath
import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

import orbiflow.density as od
from orbiflow.density.spaces import clear_rotation
from orbiflow.density.spaces.round import NULL3, K, log_area, thetas, to_sphere
from refusals import refused

TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
SPACES = (
    od.Torus(2), od.Torus(2, unit="degrees"), od.KleinBottle(), od.KleinBottle(unit="turns"),
    od.Sphere(), od.Sphere(form="vector", rotation=TURN), od.ProjectivePlane(rotation=TURN),
    od.ProjectivePlane(form="vector"),
)  # fmt: skip
seeds = st.integers(0, 2**32 - 1)
every = pytest.mark.parametrize("space", SPACES, ids=repr)


def square(seed: int, count: int = 50, dim: int = 2) -> torch.Tensor:
    return torch.tensor(np.random.default_rng(seed).random((count, dim)))


@every
@given(seed=seeds)
def test_data_and_chart_there_and_back(space, seed: int) -> None:
    points = square(seed)
    again = space.to_chart(space.from_chart(points))
    error = space.distance(points, again)
    # at a cone point of the sphere the chart is as ill-conditioned as a fourth root
    scale = (space.log_area(points) / 2).exp()
    assert float((error * scale).max()) < 1e-12
    assert float(error[scale > 1e-3].max()) < 1e-9
    assert bool(((again > -1e-9) & (again < 1 + 1e-9)).all())


@every
def test_densities_of_the_uniform_distribution(space) -> None:
    points = square(0)
    natural = space.log_area(points) - math.log(space.volume)  # of the square, uniform in nature
    factor = {m: space.log_density_factor(points, m) for m in od.MEASURES}
    assert torch.allclose(
        natural + factor["natural"], torch.tensor(-math.log(space.volume)).double()
    )
    assert torch.allclose(natural + factor["uniform"], torch.zeros(50).double(), atol=1e-12)
    assert torch.equal(factor["square"], torch.zeros(50).double())
    with refused("measure", "natural"):
        space.log_density_factor(points, "round")


@every
def test_uniform_points_are_even(space) -> None:
    points = space.uniform(20_000, torch.Generator().manual_seed(0))
    counts = torch.histogramdd(points, [5, 5], range=[0.0, 1.0, 0.0, 1.0]).hist
    t = (torch.arange(200, dtype=torch.float64) + 0.5) / 200
    grid = torch.stack(torch.meshgrid(t, t, indexing="ij"), dim=-1)
    area = space.log_area(grid).exp().reshape(5, 40, 5, 40).mean(dim=(1, 3))
    expected = 20_000 * area / area.sum()
    assert float(((counts - expected) ** 2 / expected).sum()) < 60  # chi-square, 24 degrees


@given(st.floats(-400, 400), st.floats(-400, 400))
def test_the_klein_identification(theta: float, phi: float) -> None:
    space = od.KleinBottle(unit="degrees")
    images = [[theta, phi], [theta + 180, 180 - phi], [theta + 360, phi], [theta, phi - 360]]
    points = space.to_chart(images)
    assert float(space.distance(points[:1].expand(4, -1), points).max()) < 1e-9


@given(st.floats(-90, 90), st.floats(-180, 179.99))
def test_latitude_and_longitude(lat: float, lon: float) -> None:
    again = od.to_latlon(od.to_vectors([[lat, lon]]))
    assert np.allclose(od.to_vectors(again), od.to_vectors([[lat, lon]]), atol=1e-12)
    assert again[0, 0] == pytest.approx(lat, abs=1e-9)
    assert -180 <= again[0, 1] < 180


def test_a_torus_of_any_dimension() -> None:
    space = od.Torus(7, unit="degrees")
    data = np.random.default_rng(0).uniform(-180, 180, (20, 7))
    assert np.allclose(space.from_chart(space.to_chart(data)), data)
    assert space.volume == 360.0**7
    a, b = square(1, 20, 7), square(2, 20, 7)
    assert float(space.distance(a, b).max()) <= math.sqrt(7) / 2


@pytest.mark.parametrize("kind", [od.Sphere, od.ProjectivePlane])
def test_clear_rotation_moves_the_cone_points_away(kind) -> None:
    rng = np.random.default_rng(0)
    vectors = rng.normal(size=(500, 3)) * 0.2 + kind().cone_vectors()[0]
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    turned = kind(rotation=clear_rotation(kind(), vectors))
    cosines = vectors @ turned.cone_vectors().T
    assert (abs(cosines) if turned.power == 2 else cosines).max() < 0.95
    assert np.allclose(clear_rotation(kind(), vectors), turned.rotation)


BAD = {
    "latitude": (od.Sphere(), [[10, 0], [95, 0], [-91, 3]], "latitude 2 95"),
    "longitude": (od.Sphere(), [[0, 1000.0]], "1 1000 360"),
    "length": (od.ProjectivePlane(), [[1, 0, 0], [1, 1, 0]], "2 1.414"),
    "columns": (od.Torus(3), [[1.0, 2.0]], "angles 3 1 2"),
    "one row, flat": (od.Sphere(), [1.0, 2.0], "shape 2"),
    "nan": (od.KleinBottle(), [[0, 0], [0, math.nan]], "infinite 2"),
    "inf": (od.Torus(1), [[math.inf]], "infinite 1"),
    "text": (od.Torus(2), [["a", "b"]], "numbers"),
    "ragged": (od.Torus(2), [[1, 2], [3]], "numbers"),
}


@pytest.mark.parametrize("case", BAD)
def test_data_that_are_not_of_the_space(case: str) -> None:
    space, data, message = BAD[case]
    with refused(*message.split()):
        space.to_chart(data)


def test_options_that_are_none() -> None:
    for make, message in (
        (lambda: od.Torus(0), "1 64"),
        (lambda: od.Torus(2, unit="grad"), "unit"),
        (lambda: od.Sphere(form="utm"), "form"),
        (lambda: od.Sphere(rotation=2 * np.eye(3)), "orthogonal"),
        (lambda: od.make_space("moebius"), "moebius"),
        (lambda: od.make_space("sphere", unit="degrees"), "sphere unit"),
    ):
        with refused(*message.split()):
            make()


ROUND_SPACES = (od.Sphere(), od.ProjectivePlane())


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
    for space, w in zip(ROUND_SPACES, (u**2, u), strict=True):
        height = (abs(w) ** 2 - 1) / (abs(w) ** 2 + 1)
        plane = 2 * w / (abs(w) ** 2 + 1)
        expected = torch.tensor([[plane.real, plane.imag, height]], dtype=torch.float64)
        found = to_sphere(torch.tensor([[x, y]], dtype=torch.float64), space.power)
        assert gap(found, expected, 4) < 1e-11


@pytest.mark.parametrize("space", ROUND_SPACES, ids=lambda s: s.name)
@given(seed=seeds)
def test_every_vector_has_a_place(space, seed: int) -> None:
    vectors = torch.randn(200, 3, generator=torch.Generator().manual_seed(seed)).double()
    vectors = vectors / vectors.norm(dim=1, keepdim=True)
    again = torch.tensor(space.vectors(space.vectors_to_chart(vectors.numpy())))
    assert gap(again, vectors, space.power) < 1e-10


@pytest.mark.parametrize("space", ROUND_SPACES, ids=lambda s: s.name)
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


@pytest.mark.parametrize(
    ("space", "area"), [(ROUND_SPACES[0], 4 * math.pi), (ROUND_SPACES[1], 2 * math.pi)]
)
def test_the_area_is_that_of_the_space(space, area: float) -> None:
    t = (torch.arange(200, dtype=torch.float64) + 0.5) / 200
    grid = torch.stack(torch.meshgrid(t, t, indexing="ij"), dim=-1)
    assert float(log_area(grid, space.power).exp().mean()) == pytest.approx(area, abs=1e-10)
    assert space.volume == area


@pytest.mark.parametrize("space", ROUND_SPACES, ids=lambda s: s.name)
def test_poles_cone_points_and_the_cut_are_finite(space) -> None:
    t = np.linspace(0, 2 * np.pi, 65)
    circles = [np.roll(np.stack([np.cos(t), np.sin(t), 0 * t], 1), k, axis=1) for k in range(3)]
    special = np.concatenate([np.eye(3), -np.eye(3), space.cone_vectors(), *circles])
    points = space.vectors_to_chart(special)
    assert bool(torch.isfinite(points).all())
    assert gap(torch.tensor(space.vectors(points)), torch.tensor(special), space.power) < 1e-7
    assert bool(torch.isfinite(space.log_area(torch.tensor([[0.0, 0.0], [1.0, 1.0]]))).all())
