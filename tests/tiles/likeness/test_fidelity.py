"""Fidelity: blind to motions and scale, strict on notches, threads, lost parts and lost corners."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from orbiflow.tiles import Fidelity, Rating, complex_points, fidelity, plane_points, resampled
from orbiflow.tiles.likeness import least_neck, narrowest_neck, neck_factor
from orbiflow.tiles.likeness.faithful import GOOD_MARK
from outlines import animal, limb

SQUIRREL = complex_points(resampled(animal("squirrel.dat").normal, 240))


@given(st.floats(0.1, 10), st.floats(-3.2, 3.2), st.complex_numbers(max_magnitude=100))
def test_motions_and_scale_cost_nothing(scale: float, turn: float, shift: complex) -> None:
    found = fidelity(SQUIRREL, scale * np.exp(1j * turn) * SQUIRREL + shift, 0.0)
    assert found.score > 0.999
    assert (
        max(
            *found.pieces,
            found.stretched,
            found.thickness,
            found.blunted,
            found.moved,
            found.merged,
        )
        < 1e-5
    )
    assert found.lost == []


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
    bent = rest * np.exp(0.04j * rest.real)  # bent as a bow
    dent = np.exp(-(((rest.real - 1.5) / 0.05) ** 2))
    notched = rest - 0.25j * dent * (rest.imag > 0.3)
    pinched = rest - 0.38j * dent * (rest.imag > 0.3)
    scores = [fidelity(rest, shape, 0.1).score for shape in (bent, notched, pinched)]
    assert scores == sorted(scores, reverse=True)
    bowed, cut, thread = (fidelity(rest, shape, 0.1) for shape in (bent, notched, pinched))
    assert bowed.lost == []
    assert cut.stretched > 3 * bowed.stretched
    assert thread.stretched > cut.stretched
    assert min(cut.thickness, thread.thickness) > 3 * bowed.thickness
    # that it is a mere thread counts, too, whatever is lost
    necks = [narrowest_neck(plane_points(shape)).share for shape in (rest, pinched)]
    assert neck_factor(necks[1], least_neck(plane_points(rest), 0.01)) < 0.5
    assert necks[1] < 0.05 < necks[0]


def test_corners_that_become_round_are_blunted_and_limbs_that_turn_are_moved() -> None:
    rest = bar()
    smooth = rest.copy()
    for _ in range(30):
        smooth = (np.roll(smooth, 1) + 2 * smooth + np.roll(smooth, -1)) / 4
    rounded, turned = fidelity(rest, smooth, 0.1), fidelity(limb(), limb(0.8), 0.1)
    assert rounded.blunted > 1
    assert rounded.moved < 1e-3
    assert turned.moved > 10 * fidelity(limb(), limb(0.1), 0.1).moved


@st.composite
def measured(draw: st.DrawFn) -> Fidelity:
    """Any values."""
    short, long, one, two, three, four, five = (draw(st.floats(0, 2)) for _ in range(7))
    length = draw(st.floats(3, 15))
    return Fidelity((short, long), one, two, three, four, five, 0.2, length)


@given(measured(), st.integers(0, 6), st.floats(0.01, 3))
def test_whatever_is_lost_lowers_the_mark(kept: Fidelity, which: int, more: float) -> None:
    values = [*kept.pieces, kept.stretched, kept.thickness, kept.blunted, kept.moved, kept.merged]
    values[which] += more
    short, long, one, two, three, four, five = values
    worse = Fidelity((short, long), one, two, three, four, five, kept.cost, kept.length)
    assert worse.mark < kept.mark
    assert worse.score <= kept.score
    assert worse.losses[which] > kept.losses[which]


@given(measured())
def test_a_score_is_a_probability_that_the_stars_know(kept: Fidelity) -> None:
    assert 0 <= kept.score <= 1
    if 1e-8 < kept.score < 1 - 1e-8:
        apart = Rating.of_likeness(kept.score).stars - Rating.of_mark(kept.mark).stars
        assert abs(apart) <= 0.5  # halves may be rounded otherwise
        middle = Rating.of_likeness(0.5)
        assert (kept.score > 0.5) == (kept.mark > GOOD_MARK)
        assert (Rating.of_likeness(kept.score).stars >= middle.stars) or kept.score < 0.5
