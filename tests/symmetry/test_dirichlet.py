"""Reduction of points to a fundamental domain."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.errors import GroupError
from orbiflow.symmetry import (
    IDENTIFICATION_SPACES,
    DirichletDomain,
    identification_group,
    wallpaper_group,
)
from refusals import refused
from strategies import elements, groups, random_points, seeds

spaces = st.sampled_from(sorted(IDENTIFICATION_SPACES))
GENERIC = np.array([0.137, 0.291, 0.413])


def square(space):
    return DirichletDomain(identification_group(space), (0.5, 0.5))


def generic_domain(group):
    return DirichletDomain(group, group.lattice @ GENERIC[: group.dim])


@given(spaces, seeds)
def test_canonical_projection_lands_in_the_unit_square(space, seed):
    q = square(space).project(random_points(seed, 50, 2, size=30.0))
    assert q.min() >= -1e-12
    assert q.max() <= 1 + 1e-12


@given(st.data(), seeds)
def test_projection_is_constant_on_orbits(data, seed):
    group = data.draw(groups)
    domain = generic_domain(group)
    p = random_points(seed, 20, group.dim)
    g = data.draw(elements(group))
    np.testing.assert_allclose(domain.project(g(p)), domain.project(p), atol=1e-11)


@given(groups, seeds)
def test_the_representative_is_an_image_of_the_point(group, seed):
    (p,) = random_points(seed, 1, group.dim)
    q = generic_domain(group).project(p[None])[0]
    size = group.cell_volume ** (1 / group.dim)
    assert group.elements_near(q, 1e-9 * size, source=p)


@given(groups, seeds)
def test_no_image_of_the_site_is_nearer_than_the_site(group, seed):
    domain = generic_domain(group)
    for q in domain.project(random_points(seed, 5, group.dim)):
        own = float(np.linalg.norm(q - domain.site))
        nearest = group.elements_near(q, own * (1 + 1e-9) + 1e-12, source=domain.site)[0]
        assert np.linalg.norm(nearest(domain.site) - q) == pytest.approx(own, abs=1e-11)


@given(spaces, seeds, st.sampled_from([(torch.float64, 1e-13), (torch.float32, 2e-6)]))
def test_torch_and_numpy_agree(space, seed, kind):
    dtype, tolerance = kind
    p = random_points(seed, 4, 5, 2)
    q = square(space).project(torch.tensor(p, dtype=dtype))
    assert q.dtype == dtype
    # in single precision a point by an edge may come out at the identified one
    distance = np.abs(q.numpy() - square(space).project(p)).max(axis=-1)
    inside = np.abs(square(space).project(p) - 0.5).max(axis=-1) < 0.5 - 1e-5
    assert distance[inside].max() <= tolerance


def test_projection_has_an_orthogonal_derivative():
    domain = square("sphere")
    p = torch.tensor([3.2, -1.4], dtype=torch.float64)
    jacobian = torch.autograd.functional.jacobian(domain.project, p)
    assert isinstance(jacobian, torch.Tensor)
    np.testing.assert_allclose((jacobian @ jacobian.mT).numpy(), np.eye(2), atol=1e-15)


def test_many_points_project_as_they_do_one_by_one():
    p = random_points(0, 70_000, 2, size=5.0)
    q = square("projective-plane").project(p)
    np.testing.assert_array_equal(q[-3:], square("projective-plane").project(p[-3:]))


@pytest.mark.parametrize(
    ("name", "site"), [("p2", (0.0, 0.0)), ("p4", (0.5, 0.5)), ("pm", (0.0, 0.37))]
)
def test_a_site_fixed_by_an_element_is_refused(name, site):
    with refused("site", "Isometry", kind=GroupError):
        DirichletDomain(wallpaper_group(name), site)


@pytest.mark.parametrize("site", [(0.1,), (0.1, np.nan), (0.1, 0.2, 0.3)])
def test_a_site_that_is_no_point_is_refused(site):
    with refused("site", kind=GroupError):
        DirichletDomain(wallpaper_group("p1"), site)
