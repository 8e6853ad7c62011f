"""Elastic bodies with parts that keep their shape."""

import numpy as np
import pytest

from orbiflow.arrays import Complex
from orbiflow.tiles import plane_points, resampled
from orbiflow.tiles.likeness import Elastic, Pinned
from orbiflow.tiles.likeness.rigid_parts import SHAPE_WEIGHT
from outlines import animal

RING = resampled(animal("squirrel.dat").normal, 60)
PLAIN = Elastic(RING)
NEAR = abs(PLAIN.rest - PLAIN.rest[3]) < 0.35
PARTS = [np.flatnonzero(NEAR), np.flatnonzero(abs(PLAIN.rest - PLAIN.rest[30]) < 0.25)]


def body(keep_angle: bool = False) -> Pinned:
    return Pinned(RING, PARTS, keep_angle=keep_angle)


def shapes(count: int, seed: int = 0) -> Complex:
    noise = np.random.default_rng(seed).normal(size=(len(PLAIN), count, 2))
    moved = 0.03 * (noise[..., 0] + 1j * noise[..., 1])
    return PLAIN.rest[:, None] * np.exp(0.2j) + moved


def whole_matrix(pinned: Pinned) -> Complex:
    taken: Complex = pinned._low @ pinned._low.conj().T
    return pinned.matrix.astype(complex) - taken


@pytest.mark.parametrize("keep_angle", [False, True])
def test_the_matrix_and_the_forces_are_the_energy(keep_angle: bool) -> None:
    """z^H A z - 2 Re b^H z differs from the energy and the pose's by what does not depend on z."""
    pinned, z = body(keep_angle), shapes(1)
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
    y, other = shapes(1, 1), shapes(1, 2)
    assert quadratic(y) - quadratic(other) == pytest.approx(energy(y) - energy(other), rel=1e-9)


def test_the_whole_matrix_has_a_minimum() -> None:
    values = np.linalg.eigvalsh(whole_matrix(body()))
    assert values[0] > 0


def test_condensed_is_the_whole_solved_for_the_inside() -> None:
    pinned, z = body(), shapes(2)
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
    pinned = body()
    turned = 1.3 * pinned.rest[:, None] * np.exp(0.7j) + 2
    assert pinned.energy(turned) == pytest.approx(PLAIN.energy(turned), rel=1e-9)
    assert pinned.misfit(turned[: pinned.size, 0]) == pytest.approx(0, abs=1e-6)
    bent = turned.copy()
    bent[PARTS[0][0]] += 0.1
    assert pinned.energy(bent)[0] > PLAIN.energy(bent)[0] + 0.001 * SHAPE_WEIGHT / len(pinned)


def test_a_part_follows_at_once() -> None:
    """A single step turns a pinned part: stiffness alone would let it turn by a share."""
    pinned = body()
    towards = pinned.rest[:60, None].copy()
    on = PARTS[0][PARTS[0] < 60]
    middle = towards[on].mean()
    towards[on] = middle + (towards[on] - middle) * np.exp(0.4j)
    z = pinned.pulled(pinned.rest[:, None], towards, 3000.0, 1)
    turn = np.angle(pinned.parts[0].factor(z)[0])
    assert 0.2 < turn < 0.4
    held = body(keep_angle=True).pulled(pinned.rest[:, None], towards, 3000.0, 1)
    assert abs(np.angle(pinned.parts[0].factor(held)[0])) < 0.1


def test_small_parts_are_left_out_and_misfits_need_an_outline() -> None:
    inner = np.flatnonzero(abs(PLAIN.rest) < 0.2)
    inner = inner[inner >= 60]
    assert len(inner) >= 3
    pinned = Pinned(RING, [np.array([0, 1]), inner])
    assert len(pinned.parts) == 1
    assert pinned.misfit(pinned.rest[:60]) is None


def test_what_is_stiff_all_over_holds_its_parts_no_less() -> None:
    soft, stiff = body(), Pinned(RING, PARTS, stiff=np.full(60, 100.0))
    assert stiff.parts[0].weight > 5 * soft.parts[0].weight
    ring = plane_points(soft.rest[:60])
    assert Pinned(ring, PARTS, stiff=np.full(60, 1e6)).pulled(
        soft.rest[:, None], soft.rest[:60, None], 1.0, 2
    ) == pytest.approx(soft.rest[:, None], abs=1e-6)
