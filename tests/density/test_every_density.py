"""What holds of every density on every space: invariant, normalised, sampled, differentiable, saved."""

import json
import math
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

import orbiflow.density as od
from density.blends import (
    bump,
    flow_of,
    numbers,
    random_chains,
    random_kernels,
    random_network,
    random_product_chains,
    stored,
)
from orbiflow.density.models import flow_obstacle
from orbiflow.density.spaces import RoundSpace, UnitVectorSpace
from orbiflow.errors import OrbiflowError
from orbiflow.flows import Flow
from orbiflow.symmetry import rotation_matrix, wallpaper_group
from strategies import central_difference, random_field, seeds

TURN = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
BESIDE = [(3.0, 2.0), 24.0]
SPACES: dict[str, od.Space] = {
    "angle": od.Torus(1),
    "angles in degrees": od.Torus(2, unit="degrees"),
    "angles in turns": od.Torus(3, unit="turns"),
    "an angle, a length, hours": od.Torus([None, *BESIDE], unit="degrees"),
    "latitude and longitude": od.make_space("sphere", rotation=TURN),
    "directions": od.make_space("sphere", form="vector", rotation=TURN),
    "bottle": od.make_space("klein-bottle", unit="turns"),
    "axes": od.make_space("projective-plane", rotation=TURN),
    "axes as vectors": od.make_space("projective-plane", form="vector"),
    "circle": od.make_space("hypersphere", dim=1),
    "hypersphere": od.make_space("hypersphere", dim=9),
    "lines": od.make_space("projective-space", dim=4),
    "rotations": od.make_space("rotation-space"),
    "orientations": od.make_space("rotation-space", symmetry="O", specimen="222"),
    "turned pattern": od.make_space(
        "quotient", group=wallpaper_group("cm").conjugate(2.5 * rotation_matrix(0.4), [0.3, 0.7])
    ),
    **{name: od.make_space(name) for name in ("p3", "p4g", "tricosm", "second-amphicosm")},
    "directions and times": od.ProductSpace(od.make_space("sphere", form="vector"), BESIDE),
    "bottle and times": od.ProductSpace(od.make_space("klein-bottle", unit="degrees"), BESIDE),
    "orientations and times": od.ProductSpace(
        od.make_space("rotation-space", symmetry="222"), BESIDE
    ),
    "pattern and times": od.ProductSpace(od.make_space("p4"), BESIDE),
}


def density_on(space: od.Space, seed: int) -> od.Density:
    """Kernels, a uniform part and, where there may be one, a flow of waves."""
    kernels = random_kernels(np.random.default_rng(seed), space, 5, 1.0, 9.0)
    parts: list[od.Density] = [kernels, od.UniformDensity(space)]
    if not flow_obstacle(space) and space.dim < 4:
        # a spline's divergence has kinks, where numerical derivatives are off
        field = random_field(space.group, 2, seed % 2**31, rms=0.05)
        parts.append(od.FlowDensity(space, Flow(field, steps=4, warn=False), bump(space)))
    return od.Mixture(parts, [0.6, 0.2, 0.2] if len(parts) == 3 else [0.8, 0.2])


def parametric(kind: type[od.AngularCentralGaussian | od.FisherBingham], name: str) -> od.Density:
    """A density of a family whose axes are not those of the space."""
    turn = torch.tensor(TURN)
    if kind is od.AngularCentralGaussian:
        return od.AngularCentralGaussian(
            od.make_space(name), turn.mT @ turn.new_tensor([3, 1, 0.4]).diag() @ turn
        )
    oval = turn.mT @ turn.new_tensor([1.5, -1, 0]).diag() @ turn
    return od.FisherBingham(od.make_space(name), 2 * turn[0] * (name == "sphere"), oval)


DENSITIES: dict[str, Callable[[int], od.Density]] = {
    **{name: partial(density_on, space) for name, space in SPACES.items()},
    **{
        f"chains of {dim}": lambda seed, dim=dim: random_chains(
            np.random.default_rng(seed), od.Torus(dim, unit="degrees")
        )
        for dim in (1, 2, 4)
    },
    "chains of an angle, a length, hours": lambda seed: random_chains(
        np.random.default_rng(seed), od.Torus([None, *BESIDE])
    ),
    "network": lambda seed: random_network(np.random.default_rng(seed), od.Torus(4)),
    "sine": lambda _: od.VonMisesSine(od.make_space("torus"), numbers(0.2, 0.9), numbers(2, 3, 3)),
    "Fisher-Bingham": lambda _: parametric(od.FisherBingham, "sphere"),
    "Bingham": lambda _: parametric(od.FisherBingham, "projective-plane"),
    "angular central Gaussian": lambda _: parametric(od.AngularCentralGaussian, "projective-plane"),
    **{
        f"chains on {name}": partial(random_product_chains, space)
        for name, space in SPACES.items()
        if isinstance(space, od.ProductSpace)
    },
}
names = st.sampled_from(sorted(DENSITIES))


def images_of(space: od.Space, points: Tensor, rng: np.random.Generator) -> Tensor:
    """Points (E, N, d) that are the same as these (N, d), by each element of the group."""
    if isinstance(space, od.ProductSpace):
        base, rest = space.split(points)
        images = images_of(space.base, base, rng)
        steps = torch.tensor(rng.integers(-3, 4, (len(images), 1, rest.shape[-1])))
        return torch.cat([images, rest + steps], dim=-1)
    if isinstance(space, UnitVectorSpace):
        return points @ space.elements.mT
    steps = rng.integers(-3, 4, (space.group.order, 1, space.dim)) @ space.group.lattice.T
    return space.group.images(points) + torch.tensor(steps)


@given(name=names, seed=seeds)
@settings(max_examples=20)
def test_images_are_one_point(name: str, seed: int) -> None:
    density = DENSITIES[name](seed)
    space = density.space
    points = space.uniform(20, torch.Generator().manual_seed(seed))
    images = images_of(space, points, np.random.default_rng(seed))
    projected = space.project(images)
    assert torch.allclose(space.project(projected), projected, atol=1e-9)
    with torch.no_grad():
        found = density.log_prob(torch.cat([images, projected]))
    torch.testing.assert_close(found, found[:1].expand_as(found), rtol=0, atol=1e-8)
    data = space.from_chart(points)
    again = space.features(space.to_chart(data)), space.features(points)[:1]
    assert float((again[0] - again[1]).abs().amax(dim=-1).amin(dim=0).max()) < 1e-7
    found = space.from_features(space.features(points)[0])
    torch.testing.assert_close(found, space.project(points), rtol=0, atol=1e-7)


@given(name=st.sampled_from(sorted(name for name in SPACES if SPACES[name].has_chart)), seed=seeds)
@settings(max_examples=12)
def test_distance_is_a_metric_and_the_least_over_many_images(name: str, seed: int) -> None:
    space, source = SPACES[name], torch.Generator().manual_seed(seed)
    a, b, c = (space.uniform(20, source) for _ in range(3))
    ab = space.distance(a, b)
    assert torch.allclose(ab, space.distance(b, a), atol=1e-9)
    assert bool((space.distance(a, c) <= ab + space.distance(b, c) + 1e-9).all())
    near = space.group.elements_near(space.domain.site, 3.5)
    brute = torch.stack([(g(b) - a).norm(dim=-1) for g in near]).amin(dim=0)
    assert torch.allclose(ab, brute, atol=1e-9)
    table = space.squared_distances(a, b)
    assert torch.allclose(table.diagonal(), ab**2, atol=1e-9)


@pytest.mark.parametrize("name", DENSITIES)
@torch.no_grad()
def test_samples_follow_a_density_that_integrates_to_one(name: str) -> None:
    density, source, count = DENSITIES[name](7), torch.Generator().manual_seed(0), 6_000
    space = density.space
    other = random_kernels(np.random.default_rng(1), space, 3)
    even, drawn = space.uniform(count, source), density.sample((count,), source)
    assert torch.allclose(space.project(drawn), drawn, atol=1e-9)

    def mean(values: Tensor) -> tuple[float, float]:
        return float(values.mean()), 5 * float(values.std()) / count**0.5

    value, wave = (
        lambda at, own=own: own.log_prob(at, measure="uniform").exp() for own in (density, other)
    )
    for values in (value(even), wave(even)):
        found, error = mean(values)
        assert found == pytest.approx(1, abs=error)
    (found, error), (expected, more) = mean(wave(drawn)), mean(wave(even) * value(even))
    assert found == pytest.approx(expected, abs=error + more)


@given(name=names, seed=seeds)
@settings(max_examples=20)
def test_gradients_are_slopes_in_the_data(name: str, seed: int) -> None:
    density, rng = DENSITIES[name](seed), np.random.default_rng(seed)
    space = density.space
    data = space.from_chart(space.uniform(9, torch.Generator().manual_seed(seed)))
    base = space.base if isinstance(space, od.ProductSpace) else space
    own = slice(data.shape[1] - space.dim + base.dim)
    if isinstance(base, RoundSpace):  # next to a cone point the chart's own digits are few
        vectors = base.vectors(base.to_chart(data[:, own]))
        data = data[abs(vectors @ base.cone_vectors().T).max(axis=1) < 0.999]
    values, slopes = od.log_density_gradient(density, data)
    step = 1e-6 * np.ptp(data, axis=0) * rng.normal(size=data.shape)
    if isinstance(base, UnitVectorSpace) or base.settings().get("form") == "vector":
        along = (step[:, own] * data[:, own]).sum(axis=1, keepdims=True)
        step[:, own] -= along * data[:, own]
        assert (slopes[:, own] * data[:, own]).sum(axis=1) == pytest.approx(0, abs=1e-9)
    ahead, behind = (od.log_density_gradient(density, data + s)[0] for s in (step, -step))
    np.testing.assert_allclose((slopes * step).sum(axis=1), (ahead - behind) / 2, atol=1e-9)
    at = space.to_chart(data)
    logs = density.log_prob(at, measure="natural").detach().numpy()
    np.testing.assert_allclose(values, logs, atol=1e-8)


@pytest.mark.parametrize("name", ["angles in degrees", "directions", "bottle", "axes"])
@settings(max_examples=3)
@given(seed=seeds, measure=st.sampled_from(od.MEASURES))
def test_gradients_in_points_and_parameters(name: str, seed: int, measure: str) -> None:
    density = density_on(SPACES[name], seed)
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


@pytest.mark.parametrize("name", DENSITIES)
def test_a_file_gives_the_same_density_back(name: str, tmp_path: Path) -> None:
    density = DENSITIES[name](3)
    again, space = stored(density, tmp_path), density.space
    points = space.uniform(20, torch.Generator().manual_seed(0))
    assert again.space == space
    assert sum(again.space == other for other in SPACES.values()) <= 1
    assert (type(again), again.kind) == (type(density), density.kind)
    with torch.no_grad():
        assert torch.equal(again.log_prob(points), density.log_prob(points))


def first_part(name: str, seed: int) -> od.Density:
    """What a density is made of, the first of them."""
    return next(iter(DENSITIES[name](seed).parts()))[1]


ONE_OF_EACH = (
    "angle", "chains of 4", "network", "sine", "Bingham", "angular central Gaussian",
    "chains on bottle and times",
)  # fmt: skip


@pytest.mark.parametrize("name", ONE_OF_EACH)
def test_damaged_tensors_are_refused(name: str) -> None:
    part = first_part(name, 3)
    header, tensors = json.loads(json.dumps(part.header())), part.tensors()
    for key, tensor in tensors.items():
        others = {k: v for k, v in tensors.items() if k != key}
        wrong = [{}, *({key: t} for t in (tensor + math.nan, tensor[..., :0], tensor.long()))]
        for damage in wrong:
            with pytest.raises(OrbiflowError):
                type(part).from_header(part.space, header, {**others, **damage})


@pytest.mark.parametrize(
    "name", ["angle", "rotations", "chains of 2", "chains on bottle and times"]
)
def test_several_of_a_kind_are_one(name: str) -> None:
    parts = [first_part(name, seed) for seed in (1, 2)]
    both = type(parts[0]).joined(parts, torch.tensor([1.0, 3.0]))
    assert both is not None
    at = both.space.uniform(50, torch.Generator().manual_seed(0))
    expected = od.Mixture(parts, [0.25, 0.75]).log_prob(at)
    torch.testing.assert_close(both.log_prob(at), expected, rtol=0, atol=1e-9)
