"""Rotations and transflections against the paper's formulas."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from orbiflow.errors import GroupError
from orbiflow.symmetry import (
    Line,
    identity,
    reflection,
    rotation,
    rotation_matrix,
    transflection,
    translation,
)
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


@given(lines, shifts)
def test_transflection_twice_is_a_translation_by_twice_mu(line, mu):
    g = transflection(line, mu)
    assert (g @ g).is_close(translation(2 * mu * line.direction), 1e-13)


@given(lines, st.floats(-3, 3))
def test_reflection_fixes_its_line(line, along):
    on_line = line.point + along * line.direction
    np.testing.assert_allclose(reflection(line)(on_line), on_line, atol=1e-13)
    assert reflection(line).determinant == -1


@given(coordinates, orders, seeds)
def test_rotation_multiplies_the_complex_offset_by_a_root_of_unity(center, order, seed):
    p = random_points(seed, 7, 2)
    c = complex(*center)
    turned = c + np.exp(2j * np.pi / order) * (p[:, 0] + 1j * p[:, 1] - c)
    expected = np.stack([turned.real, turned.imag], axis=-1)
    np.testing.assert_allclose(rotation(center, order)(p), expected, atol=1e-13)


@given(coordinates, orders)
def test_rotation_has_its_order_and_no_smaller_one(center, order):
    g, power = rotation(center, order), identity(2)
    for k in range(1, order + 1):
        power = g @ power
        assert power.is_close(identity(2), 1e-12) == (k == order)


@given(coordinates, orders)
def test_a_negative_order_turns_clockwise(center, order):
    assert rotation(center, -order).is_close(rotation(center, order).inverse(), 1e-13)


@given(st.integers(-9, 9))
def test_quarter_turns_are_exact(quarters):
    assert set(np.abs(rotation_matrix(quarters * math.pi / 2)).ravel().tolist()) == {0.0, 1.0}


@given(angles, angles)
def test_rotation_matrices_add_their_angles(a, b):
    np.testing.assert_allclose(
        rotation_matrix(a) @ rotation_matrix(b), rotation_matrix(a + b), atol=1e-14
    )


@given(lines)
def test_a_line_keeps_a_direction_of_length_one(line):
    assert np.linalg.norm(line.direction) == pytest.approx(1.0, abs=1e-15)


@given(coordinates, angles, st.floats(-3, 3))
def test_a_line_does_not_depend_on_which_of_its_points_is_given(point, angle, along):
    direction = np.array([math.cos(angle), math.sin(angle)])
    other = np.array(point) + along * direction
    assert reflection(Line(point, direction)).is_close(reflection(Line(other, direction)), 1e-13)


@given(lines, lines)
def test_two_mirrors_make_a_direct_isometry(first, second):
    assume(abs(first.direction @ second.direction) < 0.99)
    assert (reflection(first) @ reflection(second)).determinant == 1


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
