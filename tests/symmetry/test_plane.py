"""Rotations and transflections against the paper's formulas."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.errors import GroupError
from orbiflow.symmetry import Line, rotation, rotation_matrix, transflection
from refusals import refused
from strategies import angles, random_points, seeds

coordinates = st.tuples(st.floats(-3, 3), st.floats(-3, 3))
orders = st.integers(1, 12)
lines = st.builds(
    lambda c, angle, length: Line(c, (length * math.cos(angle), length * math.sin(angle))),
    coordinates,
    angles,
    st.floats(0.1, 10),
)
shifts = st.floats(-3, 3)


@given(lines, shifts, seeds)
def test_transflection_is_the_papers_formula(line, mu, seed):
    p = random_points(seed, 7, 2)
    c, d = line.point, line.direction
    mirrored = 2 * c - p + 2 * ((p - c) @ d)[:, None] * d
    np.testing.assert_allclose(transflection(line, mu)(p), mirrored + mu * d, atol=1e-13)


@given(coordinates, orders, seeds)
def test_rotation_multiplies_the_complex_offset_by_a_root_of_unity(center, order, seed):
    p = random_points(seed, 7, 2)
    c = complex(*center)
    turned = c + np.exp(2j * np.pi / order) * (p[:, 0] + 1j * p[:, 1] - c)
    expected = np.stack([turned.real, turned.imag], axis=-1)
    np.testing.assert_allclose(rotation(center, order)(p), expected, atol=1e-13)


@given(coordinates, orders)
def test_a_negative_order_turns_clockwise(center, order):
    assert rotation(center, -order).is_close(rotation(center, order).inverse(), 1e-13)


@given(st.integers(-9, 9))
def test_quarter_turns_are_exact(quarters):
    assert set(np.abs(rotation_matrix(quarters * math.pi / 2)).ravel().tolist()) == {0.0, 1.0}


@pytest.mark.parametrize("order", [0, 2.5])
def test_an_order_that_is_no_integer_is_refused(order):
    with refused("order", order, kind=GroupError):
        rotation((0.0, 0.0), order)


@pytest.mark.parametrize(
    ("point", "direction", "match"),
    [
        ((0.0, 0.0), (0.0, 0.0), "must not be zero"),
        ((0.0, np.nan), (1.0, 0.0), "the point of a line"),
        ((0.0, 0.0), (1.0, 0.0, 0.0), "the direction of a line"),
    ],
)
def test_lines_that_are_none_are_refused(point, direction, match):
    with pytest.raises(GroupError, match=match):
        Line(point, direction)
