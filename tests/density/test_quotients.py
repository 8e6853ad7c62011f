"""R^d modulo any crystallographic group: plane orbifolds, flat manifolds, crystals."""

import itertools
import math
from pathlib import Path
from typing import Any, Self

import numpy as np
import pytest
import shapely
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike
from torch import Tensor

import orbiflow.density as od
from density.blends import random_kernels, stored
from orbiflow.density.models import midpoints
from orbiflow.density.pictures import density_thumbnail
from orbiflow.density.pictures.square import Cell
from orbiflow.errors import GroupError, OrbiflowError
from orbiflow.fields import FourierField, SplineField, has_even_grid
from orbiflow.flows import Flow
from orbiflow.symmetry import (
    FLAT_MANIFOLDS,
    WALLPAPER_GROUPS,
    CrystallographicGroup,
    Isometry,
    flat_manifold,
    group_by_name,
    rotation_matrix,
    wallpaper_group,
)
from refusals import refused

NAMES = (*WALLPAPER_GROUPS, *FLAT_MANIFOLDS)
names = st.sampled_from(NAMES)
seeds = st.integers(0, 2**32 - 1)


def some_kernels(space: od.Space, seed: int = 0, count: int = 5) -> od.AdaptiveKernels:
    return random_kernels(np.random.default_rng(seed), space, count, 0.5, 4.5)


def some_flow(space: od.Space, seed: int = 0) -> Flow:
    torch.manual_seed(seed)
    field = (SplineField if has_even_grid(space.group) else FourierField)(space.group, 1)
    torch.nn.init.normal_(field.parameters_, std=0.15 / field.size**0.5)
    return Flow(field, steps=4, warn=False)


def points_of(space: od.Space, seed: int, count: int = 20) -> Tensor:
    return space.uniform(count, torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("name", NAMES)
def test_densities_integrate_to_one(name: str) -> None:
    space = od.QuotientSpace(name)
    assert space.group.cell_volume == pytest.approx(space.group.order)
    grid = midpoints(space, 64 if space.dim == 2 else 16)
    for density in (some_kernels(space), od.UniformDensity(space)):
        assert float(density.log_prob(grid).exp().mean()) == pytest.approx(1, abs=1e-6)


@given(name=names, seed=seeds)
@settings(max_examples=4)
def test_the_domain_holds_the_nearest_of_each_orbit(name: str, seed: int) -> None:
    space = od.QuotientSpace(name)
    rng = np.random.default_rng(seed)
    points = space.domain.project(rng.uniform(-5, 5, (40, space.dim)))
    own = np.linalg.norm(points - space.domain.site, axis=1)
    for g in space.group.elements_near(space.domain.site, 4.0):
        assert (np.linalg.norm(points - g(space.domain.site), axis=1) >= own - 1e-9).all()


@pytest.mark.parametrize("name", ["p6m", "p2", "3-torus", "second-amphidicosm"])
def test_the_mass_of_a_flow_in_any_dimension(name: str) -> None:
    space = od.QuotientSpace(name)
    density = od.FlowDensity(space, some_flow(space), some_kernels(space))
    assert density.mass(24 if space.dim == 2 else 8) == pytest.approx(1, abs=1e-3)
    larger = od.FlowDensity(space, Flow(lambda x: 0.1 * x, steps=4), od.UniformDensity(space))
    assert larger.mass(3) == pytest.approx(1, abs=1e-3)  # a dilation: the Jacobian is counted


HOMOLOGY = {
    "3-torus": (0, 0, 0), "dicosm": (0, 2, 2), "tricosm": (0, 3), "tetracosm": (0, 2),
    "hexacosm": (0,), "didicosm": (4, 4), "first-amphicosm": (0, 0, 2), "second-amphicosm": (0, 0),
    "first-amphidicosm": (0, 2, 2), "second-amphidicosm": (0, 4),
}  # fmt: skip
"""First homology: the orders of cyclic factors, 0 for Z (Wolf, Spaces of constant curvature, 1967)."""


@pytest.mark.parametrize("name", FLAT_MANIFOLDS)
def test_the_manifolds_are_what_they_are_called(name: str) -> None:
    group = flat_manifold(name)
    for g in group.cosets[
        1:
    ]:  # without fixed points: the shift along its axis is no lattice vector
        turned = np.eye(3) - g.linear
        for step in itertools.product((-1, 0, 1), repeat=3):
            shift = g.translation + group.lattice @ step
            place = np.linalg.lstsq(turned, shift, rcond=None)[0]
            assert np.linalg.norm(turned @ place - shift) > 1e-3
    orientable = all(g.determinant > 0 for g in group.cosets)
    assert orientable == (name in list(FLAT_MANIFOLDS)[:6])
    assert homology(group) == HOMOLOGY[name]


def homology(group: CrystallographicGroup) -> tuple[int, ...]:
    """The group made abelian: generators are the lattice's and the cosets, relations their products."""
    from sympy import ZZ, Matrix
    from sympy.matrices.normalforms import smith_normal_form

    size = group.order

    def row(isometry: Isometry) -> Any:
        """An element as a lattice vector and a coset."""
        for k, coset in enumerate(group.cosets):
            if np.allclose(coset.linear, isometry.linear):
                vector = np.round(
                    group.inverse_lattice @ (isometry.translation - coset.translation)
                )
                return np.concatenate([vector, np.eye(size)[k]])
        raise AssertionError

    lattice = [Isometry(np.eye(3), vector) for vector in group.lattice.T]
    relations = [row(group.cosets[0])]
    for g, h in itertools.product([*lattice, *group.cosets], repeat=2):
        relations.append(row(g @ h) - row(g) - row(h) + row(group.cosets[0]))
    table = Matrix(np.unique(np.array(relations).astype(int), axis=0).tolist())
    factors = [abs(int(x)) for x in smith_normal_form(table, domain=ZZ).diagonal()]
    factors += [0] * (3 + size - len(factors))
    return tuple(sorted(factor for factor in factors if factor != 1))


def test_a_density_is_saved_by_its_group_alone(tmp_path: Path) -> None:
    turn = rotation_matrix(0.4) * 2.5  # neither the axes nor the unit are the chart's
    for group in (wallpaper_group("cm").conjugate(turn, [0.3, 0.7]), group_by_name("hexacosm")):
        space = od.QuotientSpace(group)
        both = [some_kernels(space), od.FlowDensity(space, some_flow(space))]
        density = od.Mixture(both, [0.6, 0.4])
        again = stored(density, tmp_path)
        assert again.space == space
        assert again.space.settings()["group"]["name"] == group.name
        at = points_of(space, 1)
        assert torch.equal(again.log_prob(at), density.log_prob(at))
        data = space.from_chart(at)
        images = np.concatenate([g(data) for g in group.cosets])
        logs = density.log_prob(space.to_chart(images), measure="natural").reshape(group.order, -1)
        torch.testing.assert_close(logs, logs[:1].expand_as(logs), rtol=0, atol=1e-9)
        values, slopes = od.log_density_gradient(density, data)
        step = np.random.default_rng(0).normal(size=data.shape) * 1e-5
        ahead, behind = (od.log_density_gradient(density, data + s)[0] for s in (step, -step))
        np.testing.assert_allclose((ahead - behind) / 2, (slopes * step).sum(axis=1), atol=1e-9)
        torch.testing.assert_close(torch.tensor(values), logs[0].detach(), rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["p31m", "hantzsche-wendt"])
def test_a_fit_finds_a_known_density(name: str) -> None:
    space = od.QuotientSpace(name)
    generator = torch.Generator().manual_seed(0)
    truth = od.Mixture([some_kernels(space, 3), od.UniformDensity(space)], [0.8, 0.2])
    data = space.from_chart(truth.sample(150, generator))
    fresh = space.from_chart(truth.sample(2000, generator))
    estimator = od.DensityEstimator(name, components="mixture").fit(data)
    logs = truth.log_prob(space.to_chart(fresh), measure="natural").numpy()
    assert -0.02 < float((logs - estimator.score_samples(fresh)).mean()) < 0.15
    assert estimator.sample(5, random_state=1).shape == (5, space.dim)


@pytest.mark.parametrize("name", ["pgg", "p3"])
def test_a_flow_is_fitted_where_the_domain_is_no_cube(name: str) -> None:
    space = od.QuotientSpace(name)
    generator = torch.Generator().manual_seed(0)
    data = space.from_chart(some_kernels(space, 3).sample(400, generator))
    options: dict[str, Any] = {"components": "flow", "segments": 1, "iterations": 4}
    estimator = od.DensityEstimator(space, max_frequency=2, **options).fit(data)
    assert estimator.report_.mass == pytest.approx(1, abs=1e-3)
    uniform = -math.log(space.volume)
    assert estimator.score(data) > uniform + 0.02


class Moebius(od.Space):
    """A user's own space: a strip between mirrors whose ends are joined with a half turn."""

    name = "test-moebius"
    columns = ("along", "across")

    def __init__(self, length: float = 3.0) -> None:
        self.length = length
        flip = np.diag([1.0, -1.0])
        glide = Isometry(flip, np.array([length, 0.0]) / length**0.5)
        mirror = Isometry(flip, np.array([0.0, 1.0]) / length**0.5)
        lattice = np.diag([2 * length, 2.0]) / length**0.5
        self.group = CrystallographicGroup.generate(lattice, [glide, mirror])

    @classmethod
    def for_data(cls, data: Any, *, unit: str = "radians", seed: int = 0) -> Self:
        del data, unit, seed
        return cls()

    @property
    def volume(self) -> float:
        return self.length / 2

    def to_chart(self, data: ArrayLike) -> Tensor:
        return self.project(torch.tensor(np.asarray(data) / self.length**0.5))

    def from_chart(self, points: Tensor) -> Any:
        return self.project(points).numpy() * self.length**0.5

    def data_gradient(self, data: ArrayLike, points: Tensor, gradient: Tensor) -> Any:
        del data, points
        return gradient.numpy() / self.length**0.5

    def settings(self) -> dict[str, Any]:
        return {"length": self.length}


def test_a_space_of_your_own_is_fitted_and_saved(tmp_path: Path) -> None:
    space = Moebius(2.0)
    data = np.random.default_rng(0).normal([0.5, 0.2], 0.2, (24, 2))
    estimator = od.DensityEstimator(space, components="mixture").fit(data)
    grid = midpoints(space, 64)
    assert float(estimator.density_.log_prob(grid).exp().mean()) == pytest.approx(1, abs=1e-6)
    again = stored(estimator.density_, tmp_path)
    assert again.space == space
    assert od.make_space("test-moebius", length=2.0) == space
    with refused("name"):
        type("Other", (Moebius,), {"name": "torus"})


def test_what_is_refused() -> None:
    for make, message in (
        (lambda: od.QuotientSpace("p5"), "unknown p5"),
        (lambda: od.QuotientSpace("p4", cell=(1.0, 2.0)), "lattice p4"),
        (lambda: od.QuotientSpace("tricosm", cell=(1, 1, 1)), "nearest fits"),
        (lambda: od.QuotientSpace("p4", cell=(1, 2, 3, 4)), "cell"),
        (lambda: od.QuotientSpace(wallpaper_group("p4"), cell=(1, 1)), "cell"),
        (lambda: od.QuotientSpace({"lattice": [[1.0]]}), "numbers missing"),
        (lambda: od.QuotientSpace("p4").to_chart([[1.0, 2.0, 3.0]]), "coordinates 2"),
        (lambda: od.make_space("quotient"), "group"),
        (lambda: od.DensityEstimator("quotient").fit(np.zeros((20, 2))), "group"),
        (lambda: od.QuotientSpace("p4", cell=(1e-60, 1e-60)), "1e-60"),
    ):
        with pytest.raises((OrbiflowError, TypeError)) as caught:
            make()
        assert all(word in str(caught.value) for word in message.split()), caught.value
    with pytest.raises(GroupError):
        flat_manifold("bottle")


def test_a_plane_orbifold_is_drawn_in_the_units_of_its_data(tmp_path: Path) -> None:
    space = od.QuotientSpace("p31m", cell=(20.0, 20.0))
    density = od.Mixture([some_kernels(space), od.UniformDensity(space)], [0.7, 0.3])
    cell = Cell(space, od.PlotSettings(names=("phi", "psi")))
    assert cell.view.names == ("φ", "ψ")
    ring = cell.domain.corners()
    x, y = ring.T
    area = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    assert area == pytest.approx(space.volume)
    dots = cell.places(points_of(space, 0, 50))
    assert shapely.Polygon(ring).buffer(1e-9).contains(shapely.MultiPoint(dots))
    colouring = cell.colouring(density, od.PlotSettings())
    assert colouring.extent == pytest.approx((cell.low[0], cell.high[0], cell.low[1], cell.high[1]))
    drawn = od.plot_density(density, tmp_path / "p31m", od.PlotSettings(width=85.0))
    assert [path.name for path in drawn.files] == ["density.pdf"]
    assert density_thumbnail(density, np.zeros((0, 2))).startswith(b"\x89PNG")
    levels = od.DensityLevels(density, samples=1000)
    assert 0.4 < levels.highest(0.5).held < 0.6
    solid = od.UniformDensity(od.QuotientSpace("hantzsche-wendt"))
    assert density_thumbnail(solid, np.zeros((0, 3))).startswith(b"\x89PNG")
    with refused("smooth"):
        od.DensityLevels(density, samples=1000, smooth=1.0)
    with refused("coordinate", "meaning"):
        od.marginal(density, [0])
    with refused("pictures", "dimensions"):
        od.plot_density(solid, tmp_path / "solid")
    with refused("drawn", "dimensions"):
        od.outlines(levels, [levels.highest(0.5)])
