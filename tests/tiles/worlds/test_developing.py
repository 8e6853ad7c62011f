"""The maps of patterns to other worlds: elliptic functions, triangles by mpmath, turns."""

from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from orbiflow.symmetry import CrystallographicGroup, Isometry, wallpaper_group
from orbiflow.tiles.worlds.curved import curvature, form
from orbiflow.tiles.worlds.developing import Development
from orbiflow.tiles.worlds.pattern import FLAT, Pattern, Weierstrass
from orbiflow.tiles.worlds.potential import Potential

triples: Any = st.tuples(*[st.integers(2, 7)] * 3).filter(curvature)
quadruples: Any = st.tuples(*[st.integers(2, 7)] * 4).filter(curvature)
lattices: Any = st.tuples(
    st.floats(-0.5, 0.5), st.floats(0.9, 2.0), st.floats(0, 6.3), st.floats(0.3, 3.0)
)


def elliptic_of(drawn: Any) -> Weierstrass:
    x, y, turn, size = drawn
    assume(x * x + y * y > 1)
    first = complex(size * np.exp(1j * turn))
    return Weierstrass(first, first * complex(x, y))


def half_turns(drawn: Any) -> Pattern:
    own = elliptic_of(drawn)
    lattice = np.array([[own.first.real, own.second.real], [own.first.imag, own.second.imag]])
    turn = Isometry(-np.eye(2), np.array([0.3, -0.2]))
    group = CrystallographicGroup.generate(lattice, [turn], name="p2")
    return Pattern.near(group, np.array([0.1, 0.4]))


@settings(max_examples=15)
@given(lattices, st.complex_numbers(min_magnitude=0.1, max_magnitude=3))
def test_weierstrass_keeps_its_equation_and_its_periods(drawn: Any, z: complex) -> None:
    own = elliptic_of(drawn)
    near = abs(own.nearest(np.array([z]))[0])
    assume(near > 0.05 * abs(own.first))
    points = np.array([z, z + 2 * own.first - 3 * own.second, -z])
    found = own.series(points, np.full(3, near))
    value, slope = found[:, 0] / near**2, found[:, 1] / near**3
    assert np.allclose(value, value[0], rtol=1e-9)
    assert np.allclose(slope * [1, 1, -1], slope[0], rtol=1e-9, atol=1e-9 / near**3)
    second, third = own.invariants
    sizes = abs(4 * value[0] ** 3) + abs(second * value[0]) + abs(third)
    assert abs(slope[0] ** 2 - 4 * value[0] ** 3 + second * value[0] + third) < 1e-9 * sizes
    # Taylor's series, and Laurent's about 0, say the same nearby
    step = 0.3 * near * np.exp(1j)
    there = own.series(points[:1] + step, np.ones(1))[0, 0]
    assert np.polyval(found[0, ::-1] / near**2, step / near) == pytest.approx(there, rel=1e-9)
    reach = 0.3 * abs(own.first)
    small = own.nearest(np.array([z]))[0] / near * 0.5 * reach
    laurent = np.polyval(own.series_at_pole(reach)[::-1], small / reach) / small**2
    assert laurent == pytest.approx(own.series(np.array([small]), np.ones(1))[0, 0], rel=1e-9)


@settings(max_examples=6)
@given(st.sampled_from(["p3", "p4", "p6"]), triples, st.complex_numbers(max_magnitude=4))
def test_the_map_is_a_quotient_of_hypergeometric_functions(name, orders, w: complex) -> None:
    assume(w.imag > 0.05)
    assume(abs(w - 1) > 0.05)
    assume(abs(w) > 0.05)
    mpmath.mp.dps = 30
    a, b = (mpmath.mpf(own) for own in FLAT[name][:2])
    root = mpmath.mpc(w) ** (1 / a)
    above = mpmath.mpc(0, 1) ** (1 / a)  # not past the second vertex, where it is infinite
    z = a * mpmath.quad(lambda x: (1 - x**a) ** (1 / b - 1), [0, above, root])
    p, q, r = (1 / mpmath.mpf(own) for own in orders)

    def s(x: Any) -> Any:
        e, f, g = (1 + p - q - r) / 2, (1 + p - q + r) / 2, 1 + p
        upper = mpmath.hyp2f1(e, f, g, x)
        return mpmath.mpc(x) ** p * upper / mpmath.hyp2f1(e - g + 1, f - g + 1, 2 - g, x)

    side = (mpmath.cos(mpmath.pi * r) + mpmath.cos(mpmath.pi * p) * mpmath.cos(mpmath.pi * q)) / (
        mpmath.sin(mpmath.pi * p) * mpmath.sin(mpmath.pi * q)
    )
    end = mpmath.sqrt(abs((1 - side) / (1 + side)))  # where the second corner is
    expected = complex(s(w) / s(1) * end)
    pattern = Pattern.near(wallpaper_group(name), np.array([0.2, 0.3]))
    first, second, _ = pattern.corners
    length = mpmath.beta(1 / a, 1 / b)
    point = complex(first + complex(z / length) * (second - first))
    (upper, lower), _ = Development.of(pattern, orders).reached(point).T
    assert abs(upper / lower - expected) < 1e-12 * max(1, abs(expected))


def check_turns(found: Development) -> None:
    """The turns have their orders, fix their corners, and their product is the identity."""
    diagonal, corners, whole, big = form(found.sign), found.corners, np.eye(3), 1.0
    for k, (turn, order) in enumerate(zip(found.rotations, found.orders, strict=True)):
        wide, far = np.abs(turn).max(), np.abs(corners).max()
        assert np.abs(turn.T * diagonal @ turn - np.diag(diagonal)).max() < 1e-10 * wide**2
        assert abs(np.trace(turn) - 1 - 2 * np.cos(2 * np.pi / order)) < 1e-10 * wide
        assert np.abs(turn @ corners[k] - corners[k]).max() < 1e-10 * wide * far
        ahead = np.linalg.solve(found.frame(k), corners[[k, (k + 1) % len(corners)]].T)
        assert np.abs(ahead[:, 0] - (0, 0, 1)).max() < 1e-10 * far**2
        assert abs(ahead[1, 1]) < 1e-10 * far**2
        assert ahead[0, 1] > 0
        whole, big = whole @ turn, big * wide
    assert np.abs(whole - np.eye(3)).max() < 1e-10 * big
    assert np.abs(corners[0] - (0, 0, 1)).max() < 1e-12


@settings(max_examples=10)
@given(st.sampled_from(["p3", "p4", "p6"]), triples)
def test_turns_about_three_centres(name: str, orders: Any) -> None:
    pattern = Pattern.near(wallpaper_group(name), np.array([0.2, 0.3]))
    check_turns(Development.of(pattern, orders))


@settings(max_examples=4)
@given(lattices, quadruples)
def test_turns_about_four_centres_keep_one_hyperbolic_plane(drawn: Any, orders: Any) -> None:
    pattern = half_turns(drawn)
    found = Development.of(pattern, orders)
    check_turns(found)
    # a disc, not only a group that keeps one: all of the polygon is inside
    shares = np.random.default_rng(0).uniform(0.05, 0.95, (20, 2))
    first, second, _, last = pattern.corners
    points = first + shares @ [second - first, last - first]
    values = np.array([found.reached(complex(point))[:, 0] for point in points])
    assert (np.abs(values[:, 0]) < np.abs(values[:, 1])).all()


@settings(max_examples=2)
@given(lattices, quadruples, st.floats(0.2, 0.8), st.floats(0.2, 0.8))
def test_solutions_are_those_of_the_equation(drawn: Any, orders: Any, a: float, b: float) -> None:
    pattern = half_turns(drawn)
    found = Development.of(pattern, orders)
    first, second, _, last = pattern.corners
    end = complex(first + a * (second - first) + b * (last - first))
    way, potential = end - pattern.middle, found.potential
    assert isinstance(potential, Potential)
    strengths = (1 - (2 / np.array(orders)[pattern.corner_of]) ** 2) / 4
    elliptic = pattern.elliptic

    def slopes(t: float, y: Any) -> Any:
        away = pattern.middle + t * way - pattern.centres
        values = elliptic.series(away, np.ones(len(away)))[:, 0] + elliptic.constant
        return np.array([y[1], -(strengths @ values + potential.free) * y[0]]) * way

    def solved(values: Any) -> Any:
        return solve_ivp(slopes, (0, 1), values, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]

    reach = np.abs(pattern.to_centres(np.array([pattern.middle]))).min()
    expected = found.start @ np.stack([solved([1 + 0j, 0]), solved([0j, 1 / reach])])
    assert np.abs(found.reached(end) - expected).max() < 1e-8 * np.abs(expected).max()
