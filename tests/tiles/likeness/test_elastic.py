"""The silhouette as an elastic body, with parts that keep their shape, laid onto outlines."""

from functools import cache
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.arrays import Array, Complex
from orbiflow.tiles import plane_points, resampled
from orbiflow.tiles.likeness import Elastic, Pinned, Stiffness, mutual_iou
from orbiflow.tiles.likeness.rigid_parts import SHAPE_WEIGHT
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


RING = resampled(animal("squirrel.dat").normal, 60)
PLAIN = Elastic(RING)
NEAR = abs(PLAIN.rest - PLAIN.rest[3]) < 0.35
PARTS = [np.flatnonzero(NEAR), np.flatnonzero(abs(PLAIN.rest - PLAIN.rest[30]) < 0.25)]


def body_of_rigid(keep_angle: bool = False) -> Pinned:
    return Pinned(RING, PARTS, keep_angle=keep_angle)


def shapes_of_rigid(count: int, seed: int = 0) -> Complex:
    noise = np.random.default_rng(seed).normal(size=(len(PLAIN), count, 2))
    moved = 0.03 * (noise[..., 0] + 1j * noise[..., 1])
    return PLAIN.rest[:, None] * np.exp(0.2j) + moved


def whole_matrix(pinned: Pinned) -> Complex:
    taken: Complex = pinned._low @ pinned._low.conj().T
    return pinned.matrix.astype(complex) - taken


@pytest.mark.parametrize("keep_angle", [False, True])
def test_the_matrix_and_the_forces_are_the_energy(keep_angle: bool) -> None:
    """z^H A z - 2 Re b^H z differs from the energy and the pose's by what does not depend on z."""
    pinned, z = body_of_rigid(keep_angle), shapes_of_rigid(1)
    rotations, goals = pinned.rotations(z), pinned._goals(z)
    copy, _ = pinned.copies(z)

    def energy(y: Complex) -> float:
        strain, bent = pinned._misfits(y, rotations)
        total = pinned._w @ abs(strain) ** 2 + pinned._rod_cost @ abs(bent) ** 2
        total += sum(p.cost(y, goal) for p, goal in zip(pinned.parts, goals, strict=True))
        return float((total + pinned.stiffness.pose * (abs(y - copy) ** 2).mean(axis=0))[0])

    def quadratic(y: Complex) -> float:
        return float(np.vdot(y, whole_matrix(pinned) @ y - 2 * force).real)

    force = pinned.forces(z)
    y, other = shapes_of_rigid(1, 1), shapes_of_rigid(1, 2)
    assert quadratic(y) - quadratic(other) == pytest.approx(energy(y) - energy(other), rel=1e-9)


def test_the_whole_matrix_has_a_minimum() -> None:
    values = np.linalg.eigvalsh(whole_matrix(body_of_rigid()))
    assert values[0] > 0


def test_condensed_is_the_whole_solved_for_the_inside() -> None:
    pinned, z = body_of_rigid(), shapes_of_rigid(2)
    matrix, n, forces = whole_matrix(pinned), pinned.size, pinned.forces(z)
    condensed = pinned.condensed
    assert condensed.low is not None
    outline = condensed.outline - condensed.low @ condensed.low.conj().T
    inner = np.linalg.inv(matrix[n:, n:])
    schur = matrix[:n, :n] - matrix[:n, n:] @ inner @ matrix[n:, :n]
    assert outline == pytest.approx(schur, rel=1e-6, abs=1e-6)
    expected = inner @ (forces[n:] - matrix[n:, :n] @ z[:n])
    assert condensed.whole(z[:n], forces)[n:] == pytest.approx(expected, abs=1e-7)
    on_outline = forces[:n] - matrix[:n, n:] @ inner @ forces[n:]
    assert condensed.forces(forces) == pytest.approx(on_outline, rel=1e-6, abs=1e-5)


def test_similar_copies_cost_what_their_size_does() -> None:
    pinned = body_of_rigid()
    turned = 1.3 * pinned.rest[:, None] * np.exp(0.7j) + 2
    assert pinned.energy(turned) == pytest.approx(PLAIN.energy(turned), rel=1e-9)
    assert pinned.misfit(turned[: pinned.size, 0]) == pytest.approx(0, abs=1e-6)
    bent = turned.copy()
    bent[PARTS[0][0]] += 0.1
    assert pinned.energy(bent)[0] > PLAIN.energy(bent)[0] + 0.001 * SHAPE_WEIGHT / len(pinned)


def test_a_part_follows_at_once() -> None:
    """A single step turns a pinned part: stiffness alone would let it turn by a share."""
    pinned = body_of_rigid()
    towards = pinned.rest[:60, None].copy()
    on = PARTS[0][PARTS[0] < 60]
    middle = towards[on].mean()
    towards[on] = middle + (towards[on] - middle) * np.exp(0.4j)
    z = pinned.pulled(pinned.rest[:, None], towards, 3000.0, 1)
    turn = np.angle(pinned.parts[0].factor(z)[0])
    assert 0.2 < turn < 0.4
    held = body_of_rigid(keep_angle=True).pulled(pinned.rest[:, None], towards, 3000.0, 1)
    assert abs(np.angle(pinned.parts[0].factor(held)[0])) < 0.1


def test_small_parts_are_left_out_and_misfits_need_an_outline() -> None:
    inner = np.flatnonzero(abs(PLAIN.rest) < 0.2)
    inner = inner[inner >= 60]
    assert len(inner) >= 3
    pinned = Pinned(RING, [np.array([0, 1]), inner])
    assert len(pinned.parts) == 1
    assert pinned.misfit(pinned.rest[:60]) is None


def test_what_is_stiff_all_over_holds_its_parts_no_less() -> None:
    soft, stiff = body_of_rigid(), Pinned(RING, PARTS, stiff=np.full(60, 100.0))
    assert stiff.parts[0].weight > 5 * soft.parts[0].weight
    ring = plane_points(soft.rest[:60])
    assert Pinned(ring, PARTS, stiff=np.full(60, 1e6)).pulled(
        soft.rest[:, None], soft.rest[:60, None], 1.0, 2
    ) == pytest.approx(soft.rest[:, None], abs=1e-6)


BENT_RING = resampled(animal("squirrel.dat").normal, 120)
BODY = Elastic(BENT_RING)


def waved(amount: float) -> np.ndarray:
    x, y = BENT_RING.T
    return np.stack([x + amount * np.sin(5 * y), y + amount * np.cos(4 * x)], axis=-1)


def test_mutual_iou_is_that_of_the_best_overlay() -> None:
    turned = BENT_RING @ np.array([[np.cos(0.15), -np.sin(0.15)], [np.sin(0.15), np.cos(0.15)]])
    alike = mutual_iou([BENT_RING, 2 * turned + 3, waved(0.15)])
    assert alike(0, 1) == pytest.approx(1, abs=1e-3)
    assert alike(1, 0) == alike(0, 1)
    assert alike(0, 2) < 0.9
    plain = shapely.Polygon(BENT_RING), shapely.Polygon(waved(0.15))
    assert alike(0, 2) > plain[0].intersection(plain[1]).area / plain[0].union(plain[1]).area - 0.1
