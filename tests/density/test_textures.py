"""Pole densities, texture index and volume fractions against quadrature and draws."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.spatial.transform import Rotation
from torch import Tensor

from orbiflow.density import (
    AdaptiveKernels,
    Density,
    Mixture,
    RotationSpace,
    Sphere,
    UniformDensity,
)
from orbiflow.density.inference import fractions_near, misorientations, pole_density, texture_index
from refusals import refused
from strategies import seeds

GROUPS = st.sampled_from(["C1", "C2y", "D2", "D3", "D3y", "C4", "D6", "T", "O"])


def texture(crystal: str, specimen: str, seed: int, high: float = 30.0) -> Mixture:
    space = RotationSpace(symmetry=crystal, specimen=specimen)
    generator = torch.Generator().manual_seed(seed)
    kappa = 0.5 + high * torch.rand(3, 1, dtype=torch.float64, generator=generator)
    weights = torch.tensor([0.2, 0.3, 0.5], dtype=torch.float64)
    kernels = AdaptiveKernels(space, space.uniform(3, generator), kappa, weights)
    return Mixture([kernels, UniformDensity(space)], [0.8, 0.2])


class Foreign(Density):
    """The same density, of which no closed form is known."""

    def __init__(self, own: Density) -> None:
        super().__init__(own.space)
        self.own = own

    def log_density(self, points: Tensor, beside: float = -math.inf) -> Tensor:
        return self.own.log_density(points, beside)

    def draw(self, count: int, generator: torch.Generator) -> Tensor:
        return self.own.draw(count, generator)


@settings(max_examples=12)
@given(crystal=GROUPS, specimen=GROUPS, seed=seeds)
def test_pole_densities_are_integrals_over_fibres(crystal: str, specimen: str, seed: int) -> None:
    density = texture(crystal, specimen, seed)
    rng = np.random.default_rng(seed)
    h, r = rng.normal(size=3), rng.normal(size=(4, 3))
    for axial in (True, False):
        exact, error = pole_density(density, h, r, axial=axial)
        assert error == 0
        numeric, off = pole_density(Foreign(density), h, r, axial=axial)
        assert off < 1e-6
        assert numeric == pytest.approx(exact, abs=1e-6)
    # the fibre by SciPy: first onto the direction, then about it
    unit, way = h / np.linalg.norm(h), r[0] / np.linalg.norm(r[0])
    first, _ = Rotation.align_vectors([way], [unit])
    angles: Any = 2 * np.pi * np.arange(256) / 256
    turns = Rotation.from_rotvec(np.outer(angles, way)) * first
    assert turns.apply(unit) == pytest.approx(np.tile(way, (256, 1)))
    mean = density.log_prob(torch.tensor(turns.as_quat()), measure="uniform").exp().mean()
    one, _ = pole_density(density, h, r[:1], axial=False)
    assert one[0] == pytest.approx(float(mean), abs=1e-7)


@settings(max_examples=8)
@given(crystal=GROUPS, specimen=GROUPS, seed=seeds)
def test_pole_densities_have_the_mean_one_and_the_symmetry(
    crystal: str, specimen: str, seed: int
) -> None:
    density = texture(crystal, specimen, seed, 12.0)
    space = density.space
    assert isinstance(space, RotationSpace)
    h = np.random.default_rng(seed).normal(size=3)
    # Gauss's rule on the sphere, exact for what is so smooth
    nodes, weights = np.polynomial.legendre.leggauss(24)
    turns = 2 * np.pi * np.arange(48) / 48
    z, phi = np.meshgrid(nodes, turns, indexing="ij")
    side = np.sqrt(1 - z**2)
    grid = np.stack([side * np.cos(phi), side * np.sin(phi), z], axis=-1).reshape(-1, 3)
    values = pole_density(density, h, grid)[0]
    assert values.reshape(24, 48).mean(axis=1) @ weights / 2 == pytest.approx(1, abs=1e-9)
    left, right = space.specimen_rotations[-1], space.crystal_rotations[-1]
    moved = pole_density(density, right.apply(h), left.apply(grid[:20]))[0]
    assert moved == pytest.approx(values[:20], abs=1e-9)
    # an inverse pole figure: other directions of the crystal along one of the specimen
    several = np.random.default_rng(seed + 1).normal(size=(5, 3))
    inverse = pole_density(density, several, grid[7])[0]
    one_by_one = [pole_density(density, way, grid[7])[0][0] for way in several]
    assert inverse == pytest.approx(one_by_one, abs=1e-9)


@settings(max_examples=5)
@given(crystal=GROUPS, specimen=GROUPS, seed=seeds)
def test_the_texture_index_is_the_mean_square(crystal: str, specimen: str, seed: int) -> None:
    density = texture(crystal, specimen, seed, 5.0)
    found = texture_index(density)
    assert found.error == 0
    count = 18
    angles = 2 * np.pi * np.arange(count) / count
    nodes, weights = np.polynomial.legendre.leggauss(count)
    grid = np.stack(np.meshgrid(angles, np.arccos(nodes), angles, indexing="ij"), axis=-1)
    turns = torch.tensor(Rotation.from_euler("ZXZ", grid.reshape(-1, 3)).as_quat())
    squares = (2 * density.log_prob(turns, measure="uniform")).exp().numpy()
    mean = squares.reshape(count, count, count).mean(axis=(0, 2)) @ weights / 2
    assert found.value == pytest.approx(mean, rel=1e-6)
    guess = texture_index(Foreign(density))
    assert guess.error > 0
    assert guess.value == pytest.approx(found.value, abs=6 * guess.error)


@pytest.mark.parametrize("kappa", [1e-3, 1.0, 300.0, 1e7])
def test_the_texture_index_of_one_kernel_is_an_integral_over_the_angle(kappa: float) -> None:
    space, one = RotationSpace(), torch.ones(1, dtype=torch.float64)
    center = torch.tensor([[0.0, 0.0, 0.0, 1.0]], dtype=torch.float64)
    density = AdaptiveKernels(space, center, kappa * one[:, None], one)

    def square(angle: float) -> float:
        at = torch.tensor([[math.sin(angle), 0.0, 0.0, math.cos(angle)]], dtype=torch.float64)
        return float((2 * density.log_prob(at, measure="uniform")).exp()) * 4 * math.sin(angle) ** 2

    reach = min(math.pi / 2, 12 * kappa**-0.5)
    mean = quad(square, 0, reach, limit=200)[0] / math.pi
    assert texture_index(density).value == pytest.approx(mean, rel=1e-6)


@settings(max_examples=12)
@given(crystal=GROUPS, specimen=GROUPS, seed=seeds)
def test_misorientations_are_the_smallest_angles_between_images(
    crystal: str, specimen: str, seed: int
) -> None:
    space = RotationSpace(symmetry=crystal, specimen=specimen)
    first, *others = Rotation.random(6, random_state=seed)
    points = torch.tensor(Rotation.concatenate(others).as_quat())
    found = misorientations(space, points, torch.tensor(first.as_quat()))
    least = [
        min(
            (left * first * space.crystal_rotations * other.inv()).magnitude().min()
            for left in space.specimen_rotations
        )
        for other in others
    ]
    assert found.numpy() == pytest.approx(np.array(least), abs=1e-7)


def test_fractions_near_an_orientation() -> None:
    space = RotationSpace(symmetry="O")
    even, cube = UniformDensity(space), torch.tensor([0.0, 0.0, 0.0, 1.0], dtype=torch.float64)
    reach = math.radians(15)
    found = fractions_near(even, [cube[None]], reach)[0]
    # 24 balls, each of the measure (w - sin w) / pi of SO(3)
    assert found.value == pytest.approx(
        24 * (reach - math.sin(reach)) / math.pi, abs=5 * found.error
    )
    one = torch.ones(1, dtype=torch.float64)
    other = torch.tensor([[0.5, 0.1, 0.1, 0.8]], dtype=torch.float64) / 0.91**0.5
    sharp = AdaptiveKernels(space, cube[None], 1e4 * one[:, None], one)
    assert fractions_near(sharp, [cube[None]], reach)[0].value == 1
    assert fractions_near(sharp, [other], reach)[0].value == 0


def test_what_is_no_texture_is_refused() -> None:
    with refused("densities", "rotations"):
        texture_index(UniformDensity(Sphere()))
    with refused("directions", "vectors"):
        pole_density(UniformDensity(RotationSpace()), [0, 0, 0], [[0, 0, 1]])
