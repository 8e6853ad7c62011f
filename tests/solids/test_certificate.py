"""Proofs that copies fill space, and refusals."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.solids import Mesh, certify_solid
from orbiflow.solids.certificate import face_partners
from orbiflow.solids.crossings import crossing_pairs, orientation_signs
from orbiflow.solids.mesh import joined
from orbiflow.solids.surfaces import tile_surface
from solids.known_solids import CELLS, dirichlet_solid, group_named, random_tile, seeds


@cache
def small_solid():
    tile, function = random_tile("P 1 21 1", 2, cubes=300)
    return tile.complex.group, tile_surface(tile, function).mesh


@pytest.mark.parametrize("name", sorted(CELLS))
def test_dirichlet_domains_are_certified(name):
    group = group_named(name)
    solid = dirichlet_solid(group)
    partners, error = face_partners(group, solid)
    assert (partners >= 0).all()
    assert error < 1e-12
    certificate = certify_solid(group, solid)
    assert certificate.is_ball, certificate.reasons
    assert certificate.neighbors >= 6
    assert certificate.overlap is not None
    assert certificate.overlap < 1e-9


@given(seeds)
def test_a_point_that_is_moved_by_a_hundred_thousandth_is_noticed(seed):
    group, mesh = small_solid()
    rng = np.random.default_rng(seed)
    points = mesh.points.copy()
    step = rng.normal(size=3)
    points[rng.integers(len(points))] += 1e-5 * step / np.linalg.norm(step)
    certificate = certify_solid(group, Mesh(points, mesh.faces))
    assert not certificate.valid
    assert certificate.unpaired_faces >= 3
    assert any("match no other" in reason for reason in certificate.reasons)


def test_what_is_no_tile_of_the_group_is_refused():
    group, mesh = small_solid()
    cases = {
        "volume": mesh.moved(1.001 * np.eye(3)),
        "not closed": Mesh(mesh.points, mesh.faces[1:]),
        "clockwise": Mesh(mesh.points, mesh.faces[:, ::-1]),
        "2 pieces": joined([mesh, mesh.moved(np.eye(3), [5.0, 0.0, 0.0])]),
    }
    for word, wrong in cases.items():
        assert any(word in reason for reason in certify_solid(group, wrong).reasons), word
    other = certify_solid(group_named("P 21 21 21"), mesh)
    assert other.unpaired_faces > 0
    assert other.overlap is None


def test_triangles_on_sides_of_a_box_do_not_cross_and_those_through_it_do():
    box = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    assert crossing_pairs(box, np.array([[0, 1, 2], [4, 5, 6]])).size == 0
    assert len(crossing_pairs(box, np.array([[0, 1, 7], [2, 3, 4]]))) == 1


@given(st.lists(st.integers(-3, 3), min_size=12, max_size=12))
def test_signs_are_those_of_integers(values):
    a, b, c, d = np.array(values, float).reshape(4, 1, 3)
    exact = round(np.linalg.det(np.concatenate([b - a, c - a, d - a])))
    assert orientation_signs(a, b, c, d)[0] == np.sign(exact)


def test_signs_are_exact_where_rounding_spoils_determinants():
    rng = np.random.default_rng(0)
    a, b, c = rng.normal(size=(3, 200, 3))
    weights = rng.integers(1, 4, (200, 1)) / 4
    d = a + weights * (b - a)  # nearly in the plane: what its rounding decides
    from fractions import Fraction

    def exact(k):
        rows = [[Fraction(x) for x in row[k].tolist()] for row in (a, b, c, d)]
        u, v, w = ([x - y for x, y in zip(row, rows[0], strict=True)] for row in rows[1:])
        value = sum(
            u[i] * (v[j] * w[k] - v[k] * w[j]) for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
        )
        return (value > 0) - (value < 0)

    assert orientation_signs(a, b, c, d).tolist() == [exact(k) for k in range(200)]


def meets_by_linear_programming(p, q, shared):
    """Return whether triangles meet, by the weights of their corners in a common point."""
    from scipy.optimize import linprog

    equal = np.zeros((5, 6))
    equal[:3, :3], equal[:3, 3:], equal[3, :3], equal[4, 3:] = p.T, -q.T, 1, 1
    costs = [0, -1, -1, 0, -1, -1] if shared else np.zeros(6)
    found = linprog(costs, A_eq=equal, b_eq=[0, 0, 0, 1, 1], bounds=(0, None))
    return found.status == 0 and (not shared or float(found.fun or 0) < -1e-9)


@given(st.lists(st.integers(0, 3), min_size=18, max_size=18), st.booleans())
def test_triangles_meet_as_linear_programming_says(values, shared):
    points = np.array(values, float).reshape(6, 3)
    faces = np.array([[0, 1, 2], [0, 4, 5] if shared else [3, 4, 5]])
    first, second = points[faces]
    areas = [np.linalg.norm(np.cross(t[1] - t[0], t[2] - t[0])) for t in (first, second)]
    if min(areas) > 0:
        expected = meets_by_linear_programming(first, second, shared)
        assert (len(crossing_pairs(points, faces)) > 0) == expected


def test_hinges_meet_only_where_they_lie_on_one_another():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0.7, 0], [0, -1, 0], [0, 1, 1e-9]])
    for other, count in (((1, 0, 3), 1), ((1, 0, 4), 0), ((1, 0, 5), 0), ((1, 2, 0), 1)):
        assert len(crossing_pairs(points, np.array([(0, 1, 2), other]))) == count
