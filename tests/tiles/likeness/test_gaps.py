"""What is missing to gaps between the parts of an outline."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.arrays import Complex
from orbiflow.tiles import complex_points, resampled
from orbiflow.tiles.likeness import Gaps
from strategies import seeds


def fork(gap: float) -> Complex:
    """A bar with two legs, `gap` apart; below 0 the left leg reaches over the right one."""
    inner, low = -gap / 2, -0.6
    ring = [(-0.5, 0.3), (-0.5, 0.0), (inner - 0.3, low), (inner, low), (-0.15, 0.0)]
    right = [(-x, y) for x, y in reversed(ring)]
    return complex_points(resampled(np.array([*ring, *right]), 240))


def waisted(neck: float) -> Complex:
    """Two wedges joined by a neck; below 0 its sides have changed places."""
    half = [(-0.6, -0.4), (0.0, -neck / 2), (0.6, -0.4)]
    return complex_points(resampled(np.array([*half, *((-x, -y) for x, y in half)]), 240))


def missing_gaps(ring: Complex, width: float) -> tuple[float, Complex]:
    """Return what is missing on a ring itself, and its gradient."""
    return Gaps(ring, width).missing(ring)


@pytest.mark.parametrize("wide", [0.02, 0.05])
def test_nothing_is_missing_where_gaps_and_necks_are_wide(wide: float) -> None:
    assert missing_gaps(fork(0.06), wide)[0] == 0
    assert missing_gaps(fork(0.06), 0.08)[0] > 0


def test_more_is_missing_the_narrower_a_gap_or_neck_and_most_beyond() -> None:
    found = [missing_gaps(fork(gap), 0.03)[0] for gap in (0.025, 0.015, 0.005, -0.01, -0.03, -0.08)]
    assert (np.diff(found) > 0).all()
    found = [missing_gaps(waisted(neck), 0.03)[0] for neck in (0.025, 0.015, 0.005, -0.005, -0.02)]
    assert (np.diff(found) > 0).all()


def test_a_step_against_the_gradient_parts_what_has_crossed() -> None:
    ring = fork(-0.02)
    value = missing_gaps(ring, 0.02)[0]
    for _ in range(200):
        value, along = missing_gaps(ring, 0.02)
        ring = ring - 1e-4 * along
    assert value < 0.01
    assert missing_gaps(ring, 0.002)[0] == 0


@given(seeds, st.sampled_from([-0.05, -0.01, 0.004, 0.012]))
def test_gradient(seed: int, gap: float) -> None:
    rng = np.random.default_rng(seed)
    ring = fork(gap) + 1e-3 * complex_points(rng.normal(size=(240, 2)))
    way = complex_points(rng.normal(size=(240, 2)))
    gaps, moved = Gaps(ring, 0.03), ring + 0.01 * way
    for at in (ring, moved):
        value, along = gaps.missing(at)
        ahead, behind = (gaps.missing(at + step * way)[0] for step in (1e-6, -1e-6))
        assert value > 0
        assert (ahead - behind) / 2e-6 == pytest.approx(
            (np.conj(along) @ way).real, rel=1e-4, abs=1e-4
        )
