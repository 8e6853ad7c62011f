"""The silhouette as an elastic body."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.arrays import Array, Complex
from orbiflow.tiles import resampled
from orbiflow.tiles.likeness import Elastic, Stiffness
from outlines import ANIMALS, SHAPES, animal
from refusals import refused
from strategies import angles, seeds

RINGS: dict[str, Array] = {
    "squirrel": resampled(animal("squirrel.dat").normal, 80),
    "spider": resampled(animal(ANIMALS[1]).normal, 160),
    "comb": resampled(SHAPES["comb"], 100),
    "star": SHAPES["star"],
}
names = st.sampled_from(sorted(RINGS))
STIFFNESSES = (Stiffness(), Stiffness(salience=0, bend=0), Stiffness(pose=0, forgiven=(0.02, 0.5)))


@cache
def body(name: str, stiffness: Stiffness = STIFFNESSES[0]) -> Elastic:
    return Elastic(RINGS[name], stiffness)


def shapes(of: Elastic, seed: int, count: int = 3, size: float = 0.05) -> Complex:
    """Bent a little, some points a lot."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(2, len(of), count)) * size * rng.exponential(1, (len(of), count))
    smooth = of.rest[:, None] ** 2 * rng.uniform(-0.3, 0.3, count)
    return of.rest[:, None] + smooth + noise[0] + 1j * noise[1]


def pose_energy(of: Elastic, z: Complex) -> Array:
    copies, _ = of.copies(z)
    return of.stiffness.pose * (abs(z - copies) ** 2).mean(axis=0)


@given(names, angles, st.complex_numbers(max_magnitude=10))
def test_moving_costs_nothing(name: str, turn: float, shift: complex) -> None:
    own = body(name)
    z = own.rest[:, None] * np.exp(1j * turn) + shift
    assert own.energy(z).max() < 1e-20 * (1 + abs(shift)) ** 2
    assert own.forgiving_energy(z).max() < 1e-12
    assert own.displacement(z).max() < 1e-25 * (1 + abs(shift)) ** 2
    assert own.displacement(3 * z).max() < 1e-25 * (1 + abs(shift)) ** 2
    assert own.energy(1.1 * z).min() > 1e-3


@given(names, seeds, angles, st.complex_numbers(max_magnitude=5))
def test_it_does_not_matter_where_and_how_a_shape_lies(name, seed, turn, shift: complex) -> None:
    own = body(name)
    z = shapes(own, seed)
    moved = z * np.exp(1j * turn) + shift
    for energy in (own.energy, own.forgiving_energy, own.displacement):
        assert energy(moved) == pytest.approx(energy(z), rel=1e-9)
    assert own.rotations(moved) == pytest.approx(own.rotations(z) * np.exp(1j * turn), abs=1e-6)
    assert own.displacement(2 * moved) == pytest.approx(own.displacement(z), rel=1e-9)


@pytest.mark.parametrize("stiffness", STIFFNESSES)
@settings(max_examples=5)
@given(name=names, seed=seeds)
def test_the_rotations_are_the_best(name: str, seed: int, stiffness: Stiffness) -> None:
    own = body(name, stiffness)
    z = shapes(own, seed)
    r = own.rotations(z)
    assert abs(r) == pytest.approx(1)
    other = r * np.exp(1j * np.random.default_rng(seed).normal(size=r.shape) * 0.1)
    strain, bent = own._misfits(z, other)
    worse = own._w @ abs(strain) ** 2 + own._rod_cost @ abs(bent) ** 2
    assert (own.energy(z) <= worse + 1e-12).all()


@pytest.mark.parametrize("stiffness", STIFFNESSES)
@settings(max_examples=5)
@given(name=names, seed=seeds)
def test_the_system_is_half_the_derivative(name: str, seed: int, stiffness: Stiffness) -> None:
    """At fixed rotations and pose, which are the best: so of the energies themselves, too."""
    own = body(name, stiffness)
    z = shapes(own, seed, 1)
    half = own.matrix @ z - own.forces(z)
    rng = np.random.default_rng(seed)
    way = rng.normal(size=z.shape) + 1j * rng.normal(size=z.shape)
    way /= np.linalg.norm(way)

    def total(step: float) -> float:
        return float((own.energy(z + step * way) + pose_energy(own, z + step * way))[0])

    step = 1e-5
    slope = (8 * (total(step) - total(-step)) - (total(2 * step) - total(-2 * step))) / (12 * step)
    assert 2 * np.vdot(half, way).real == pytest.approx(slope, rel=1e-5, abs=1e-5 * total(0))


@pytest.mark.parametrize("stiffness", STIFFNESSES)
@settings(max_examples=5)
@given(name=names, seed=seeds)
def test_forgiving_costs_less(name: str, seed: int, stiffness: Stiffness) -> None:
    own = body(name, stiffness)
    z = shapes(own, seed)
    assert (own.forgiving_energy(z) <= own.energy(z)).all()
    # of what hardly bends nothing is forgiven
    gentle = own.rest[:, None] * (1 + 1e-5) + 1e-6 * own.rest[:, None] ** 2
    assert own.forgiving_energy(gentle) == pytest.approx(own.energy(gentle), rel=1e-3)


@settings(max_examples=5)
@given(names, seeds)
def test_the_forgiving_body_has_the_same_slope(name: str, seed: int) -> None:
    own = body(name)
    z = shapes(own, seed, 1, 0.02)  # from 0.03 on rotations may have several minima
    touching = own.forgiving(z)
    rng = np.random.default_rng(seed)
    way = rng.normal(size=z.shape) + 1j * rng.normal(size=z.shape)
    way /= np.linalg.norm(way)
    step = 1e-5

    def slope(energy) -> float:
        return float((energy(z + step * way) - energy(z - step * way))[0] / (2 * step))

    expected = slope(own.forgiving_energy)
    assert slope(touching.energy) == pytest.approx(expected, rel=1e-3, abs=1e-4)


@settings(max_examples=5)
@given(names, seeds)
def test_the_condensed_system_solves_the_same(name: str, seed: int) -> None:
    own = body(name)
    n, condensed = own.size, own.condensed
    z = shapes(own, seed)
    forces = own.forces(z)
    rng = np.random.default_rng(seed)
    springs = np.diag(rng.uniform(0.5, 2.0, n))
    goal = rng.normal(size=(n, z.shape[1])) + 0j
    full = own.matrix.copy()
    full[:n, :n] += springs
    right = forces.copy()
    right[:n] += springs @ goal
    expected = np.linalg.solve(full, right)
    pulls = condensed.forces(forces) + springs @ goal
    outline: Any = np.linalg.solve(condensed.outline + springs, pulls)
    assert condensed.whole(outline, forces) == pytest.approx(expected, abs=1e-9)


@settings(max_examples=5)
@given(names, seeds, st.floats(0.1, 3000.0))
def test_springs_pull_downhill(name: str, seed: int, strength: float) -> None:
    own = body(name)
    n = own.size
    z = shapes(own, seed)
    towards = shapes(own, seed + 1)[:n]

    def objective(points: Complex) -> Array:
        pulls = strength / n * (abs(points[:n] - towards) ** 2).sum(axis=0)
        return own.energy(points) + pose_energy(own, points) + pulls

    before = objective(z)
    for _ in range(5):
        z = own.pulled(z, towards, strength, 1)
        after = objective(z)
        assert (after <= before * (1 + 1e-9)).all()
        before = after


def test_stiff_parts_bend_less() -> None:
    ring = RINGS["squirrel"]
    factors = np.where(ring[:, 1] > 0, 100.0, 1.0)
    free, stiff = Elastic(ring), Elastic(ring, stiff=factors)
    rng = np.random.default_rng(0)
    towards = free.rest[: free.size, None] + 0.1 * rng.normal(size=(free.size, 1))
    upper = ring[:, 1] > 0.2

    def moved(own: Elastic) -> float:
        z = own.pulled(own.rest[:, None], towards, 30.0, 10)
        bends = own._rod @ z[: own.size] - own.rotations(z)[: own.size] * own._curved[:, None]
        return float((abs(bends[upper]) ** 2).mean())

    assert moved(stiff) < 0.2 * moved(free)
    for wrong in (np.ones(3), np.zeros(len(ring)), -factors):
        with refused("stiff"):
            Elastic(ring, stiff=wrong)


def test_a_body_without_points_inside() -> None:
    own = Elastic(SHAPES["triangle"])
    assert own.energy(own.rest[:, None] * 1j).max() < 1e-20
    assert own.condensed.outline.shape == (own.size, own.size)
