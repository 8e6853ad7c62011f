"""Fidelity: blind to motions and scale, strict on notches, threads and lost parts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from orbiflow.tiles import complex_points, fidelity, resampled
from outlines import animal, limb

SQUIRREL = complex_points(resampled(animal("squirrel.dat").normal, 240))


@given(st.floats(0.1, 10), st.floats(-3.2, 3.2), st.complex_numbers(max_magnitude=100))
def test_motions_and_scale_cost_nothing(scale: float, turn: float, shift: complex) -> None:
    found = fidelity(SQUIRREL, scale * np.exp(1j * turn) * SQUIRREL + shift, 0.0)
    assert found.score > 0.999
    assert max(found.pieces) < 1e-5
    assert found.necks == 0


@given(st.integers(0, 239))
def test_where_the_outline_begins_does_not_matter(first: int) -> None:
    bent = SQUIRREL + 0.02 * np.sin(7 * SQUIRREL.real) * 1j
    rolled = fidelity(np.roll(SQUIRREL, first), np.roll(bent, first), 0.1)
    assert rolled.score == pytest.approx(fidelity(SQUIRREL, bent, 0.1).score, abs=1e-9)


def bar(height: float = 0.4) -> NDArray[np.complex128]:
    corners = np.array([0, 3, 3 + 1j * height, 1j * height])
    sides = zip(corners, np.roll(corners, -1), strict=True)
    return np.concatenate([a + np.arange(40) / 40 * (b - a) for a, b in sides])


def test_a_bent_bar_is_better_than_a_notched_and_a_pinched_one() -> None:
    rest = bar()
    bent = rest * np.exp(0.08j * rest.real)  # bent as a bow
    dent = np.exp(-(((rest.real - 1.5) / 0.05) ** 2))
    notched = rest - 0.25j * dent * (rest.imag > 0.3)
    pinched = rest - 0.38j * dent * (rest.imag > 0.3)
    scores = [fidelity(rest, shape, 0.1).score for shape in (bent, notched, pinched)]
    assert scores == sorted(scores, reverse=True)
    assert fidelity(rest, notched, 0.1).notches > 3 * fidelity(rest, bent, 0.1).notches
    assert fidelity(rest, pinched, 0.1).necks > 0 == fidelity(rest, bent, 0.1).necks


def test_a_lost_limb_costs_more_than_a_bent_one() -> None:
    bent, lost = (fidelity(limb(), shape, 0.1) for shape in (limb(0.3), limb(length=0.05)))
    assert lost.score < bent.score
    assert lost.pieces[1] > bent.pieces[1]


@given(st.floats(0, 3), st.floats(0.01, 3))
def test_what_costs_more_scores_less(cost: float, more: float) -> None:
    cheap, dear = (fidelity(SQUIRREL, SQUIRREL, value) for value in (cost, cost + more))
    assert dear.damage > cheap.damage
    assert dear.score < cheap.score
