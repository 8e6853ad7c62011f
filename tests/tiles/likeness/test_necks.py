"""The narrowest places of polygons, how much of an outline is hair, and gaps between parts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from awkward import NOT_SIMPLE, USELESS
from orbiflow.arrays import Complex
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import rotation_matrix
from orbiflow.tiles import complex_points, narrowest_neck, narrowest_slit, resampled
from orbiflow.tiles.likeness import Gaps, least_neck
from orbiflow.tiles.likeness.necks import MIN_OUTLINE, POINT_SPACING
from outlines import ANIMALS, SHAPES, animal, bar, comb, dumbbell, slit_square, star
from strategies import seeds

widths = st.floats(0.005, 0.2)


@settings(max_examples=6)
@given(st.floats(0.01, 1.0), st.floats(1.0, 30.0))
def test_a_bar_is_as_thin_as_it_is_wide(width: float, aspect: float) -> None:
    found = narrowest_neck(bar(aspect * width, width))
    assert found.width == pytest.approx(width, rel=2e-4)
    assert found.share == pytest.approx(aspect**-0.5, rel=2e-4)
    assert np.linalg.norm(found.ends[1] - found.ends[0]) == pytest.approx(found.width)
    assert narrowest_slit(bar(aspect * width, width)) is None


@settings(max_examples=7)
@given(widths, st.floats(0.001, 2.0))
def test_a_dumbbell_is_as_thin_as_its_neck(neck: float, length: float) -> None:
    found = narrowest_neck(dumbbell(neck, length))
    assert found.width == pytest.approx(neck, rel=1e-9)
    x, y = found.place
    assert 1 <= round(x, 9) <= 1 + length + 1e-9
    assert y == pytest.approx(0.5)


@settings(max_examples=6)
@given(widths, widths, st.floats(1.2, 2.0))
def test_a_comb_has_necks_and_slits(width: float, gap: float, length: float) -> None:
    ring = comb(5, width, gap, length, back=0.3)
    slit = narrowest_slit(ring)
    assert narrowest_neck(ring).width == pytest.approx(width, rel=1e-9)
    assert slit is not None
    assert slit.width == pytest.approx(gap, rel=1e-9)


@settings(max_examples=7)
@given(st.floats(0.001, 0.1))
def test_a_slit_is_seen_from_outside(width: float) -> None:
    ring = slit_square(width, 0.8)
    slit = narrowest_slit(ring)
    assert slit is not None
    assert slit.width == pytest.approx(width, rel=1e-9)
    assert slit.place[0] == pytest.approx(0.5)
    assert narrowest_neck(ring).width == pytest.approx(0.2)


@pytest.mark.parametrize("name", ["triangle", "square", "disc", "star"])
def test_corners_are_no_necks(name: str) -> None:
    found = narrowest_neck(SHAPES[name])
    assert found.share > 0.6
    assert narrowest_slit(SHAPES[name]) is None


def test_a_spike_is_measured_where_it_is_long_enough() -> None:
    ring = star(9, 0.25)
    edges = np.diff(np.vstack([ring[-1:], ring[:2]]), axis=0)
    cosine = -(edges[0] @ edges[1]) / np.prod(np.linalg.norm(edges, axis=1))
    opening = np.arccos(cosine)
    exact = MIN_OUTLINE * np.sin(opening / 2)
    assert exact <= narrowest_neck(ring).share <= (1 + 2 * POINT_SPACING / MIN_OUTLINE) * exact


@pytest.mark.parametrize("name", [*SHAPES, *ANIMALS])
@settings(max_examples=2)
@given(turn=st.floats(-3, 3), scale=st.floats(1e-3, 1e3), x=st.floats(-10, 10))
def test_similar_shapes_are_alike(name: str, turn: float, scale: float, x: float) -> None:
    ring = SHAPES[name] if name in SHAPES else np.asarray(animal(name).normal)
    moved = scale * (ring @ rotation_matrix(turn).T + [x, -x])
    for function in (narrowest_neck, narrowest_slit):
        before, after = function(ring), function(moved[::-1])
        assert (before is None) == (after is None)
        if before is not None and after is not None:
            assert after.width == pytest.approx(scale * before.width, rel=2e-3)
            assert after.share == pytest.approx(before.share, rel=2e-3)


@pytest.mark.parametrize("case", [*USELESS, *NOT_SIMPLE])
def test_what_is_no_polygon_is_refused(case: str) -> None:
    ring = USELESS[case] if case in USELESS else NOT_SIMPLE[case]
    for function in (narrowest_neck, narrowest_slit):
        with pytest.raises(OrbiflowError):
            function(ring)


def test_the_least_neck_of_an_outline_with_very_many_points() -> None:
    """A photo's outline: its steps are smaller than what is looked for."""
    plain = bar(20.0, 0.2)
    dense = resampled(plain, 20_000)
    assert least_neck(dense, 0.01) == pytest.approx(least_neck(plain, 0.01), rel=0.05)
    assert least_neck(dense, 0.1) == 0.1


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
