"""The four surfaces respect the identifications of the square, and their meshes close."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.density import KleinBottle, ProjectivePlane, Sphere, Torus
from orbiflow.density.pictures import immersion, viewpoint
from orbiflow.density.pictures.surfaces import EYE, boy_surface, mesh, normals
from refusals import refused
from strategies import random_orthogonal, seeds

TURN = random_orthogonal(np.random.default_rng(5), 3)
SPACES = [Torus(2), KleinBottle(), Sphere(rotation=TURN), ProjectivePlane(rotation=TURN)]
EULER = {"torus": 0, "klein-bottle": 0, "sphere": 2, "projective-plane": 1}

spaces = st.sampled_from(SPACES)


def square(seed, count):
    return torch.tensor(np.random.default_rng(seed).random((count, 2)))


@given(spaces, seeds)
def test_identified_points_are_one_point_of_the_surface(space, seed):
    points = square(seed, 20)
    here = immersion(space)(points)
    middle = np.full(2, 0.5)
    for element in space.group.elements_near(middle, 2.1, source=middle):
        np.testing.assert_allclose(immersion(space)(element(points)), here, atol=1e-9)


@given(spaces, seeds)
def test_points_that_are_not_identified_are_apart_along_short_paths(space, seed):
    points = square(seed, 30) * 0.8 + 0.1
    angle = 2 * np.pi * torch.tensor(np.random.default_rng(seed).random(30))
    step = 1e-3 * torch.stack([angle.cos(), angle.sin()], dim=-1)
    moved = np.linalg.norm(immersion(space)(points + step) - immersion(space)(points), axis=1)
    assert moved.min() > 1e-5
    assert moved.max() < 3e-2


def welded(space, resolution):
    """Number of the vertex of the closed mesh that each point of the square's mesh is."""
    grid = mesh(space, resolution)
    images = space.group.images(grid.points)
    reduced = torch.tensor(np.asarray(space.group.wrap(images.reshape(-1, 2).numpy())))
    steps = (reduced * resolution).round().long() % torch.tensor(
        np.rint(np.diag(space.group.lattice) * resolution), dtype=torch.long
    )
    code = (steps[:, 0] * 10_000 + steps[:, 1]).reshape(images.shape[:-1]).amin(dim=0)
    return grid, np.unique(code.numpy(), return_inverse=True)[1].reshape(-1)


@pytest.mark.parametrize("space", SPACES, ids=lambda s: s.name)
def test_mesh_closes_to_the_right_surface(space):
    grid, number = welded(space, 12)
    triangles = number[grid.triangles]
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    counts = np.unique(edges, axis=0, return_counts=True)[1]
    # two edges beside a cone point may have the same ends, which keeps the counts even
    assert (counts % 2 == 0).all()
    euler = (number.max() + 1) - counts.sum() // 2 + len(triangles)
    assert euler == EULER[space.name]


@pytest.mark.parametrize("space", SPACES, ids=lambda s: s.name)
def test_welded_vertices_are_one_place(space):
    grid, number = welded(space, 12)
    places = immersion(space)(grid.points)
    first = np.unique(number, return_index=True)[1]
    np.testing.assert_allclose(places, places[first][number], atol=1e-9)


@pytest.mark.parametrize("space", SPACES, ids=lambda s: s.name)
def test_normals_are_unit_and_perpendicular(space):
    grid = mesh(space, 10)
    found = normals(space, grid.points)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-6)
    inner = ((grid.points > 0.15) & (grid.points < 0.85)).all(dim=1)
    points, step = grid.points[inner], torch.tensor([[1e-5, 2e-5]], dtype=torch.float64)
    along = immersion(space)(points + step) - immersion(space)(points - step)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    assert abs((along * found[inner.numpy()]).sum(axis=1)).max() < 1e-4


def test_normals_of_the_sphere_are_radial():
    points = mesh(SPACES[2], 16).points
    found = normals(SPACES[2], points)
    radial = abs((found * SPACES[2].vectors(points)).sum(axis=1))
    assert radial.min() > 0.99  # beside a cone point the normal is of a place near by


@given(seeds)
def test_boy_surface_is_the_same_at_opposite_vectors(seed):
    vectors = np.random.default_rng(seed).normal(size=(30, 3))
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    np.testing.assert_allclose(boy_surface(-vectors), boy_surface(vectors), atol=1e-12)


def test_boy_surface_is_continuous_over_the_equator_and_finite_at_the_triple_point():
    angle = np.linspace(0, 2 * np.pi, 40)
    above, below = (
        np.stack([np.cos(angle), np.sin(angle), np.full(40, s * 1e-7)], axis=-1) for s in (1, -1)
    )
    np.testing.assert_allclose(boy_surface(above), boy_surface(below), atol=1e-5)
    radius = ((3 - 5**0.5) / 2) ** (1 / 3)  # a root of w^6 + sqrt(5) w^3 - 1
    vector = np.array([[2 * radius, 0, radius**2 - 1]]) / (1 + radius**2)
    assert np.linalg.norm(boy_surface(vector)) < 1e-6


@pytest.mark.parametrize("dim", [1, 3])
def test_other_dimensions_are_refused(dim):
    with refused("two", "dimensions"):
        mesh(Torus(dim), 8)


@pytest.mark.parametrize("resolution", [1, 251])
def test_resolution_out_of_range_is_refused(resolution):
    with refused("resolution"):
        mesh(Torus(2), resolution)


# towards the reader on the outside of the ring, under it, and on the wall of its hole
PLACES = [(0.1, 0.05), (0.7, 0.89), (0.4, 0.5), (0.85, 0.3), (0.55, 0.7), (0.25, 0.62)]


@pytest.mark.parametrize("space", SPACES, ids=lambda s: s.name)
@pytest.mark.parametrize("place", PLACES)
def test_the_first_view_faces_a_place(space, place):
    at = torch.tensor(place, dtype=torch.float64)
    yaw, pitch, cut = viewpoint(space, at)
    toward = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
    cloud = immersion(space)(mesh(space, 120).points)
    center = (cloud.min(axis=0) + cloud.max(axis=0)) / 2
    radius = np.linalg.norm(cloud - center, axis=1).max()
    spot = immersion(space)(at[None])[0]
    sight = center + EYE * radius * toward - spot
    sight /= np.linalg.norm(sight)
    along = (cloud - spot) @ sight
    aside = np.linalg.norm(cloud - spot - along[:, None] * sight, axis=1)
    kept = (cloud - center) @ toward <= (1 - cut / 50) * radius
    assert not (kept & (along > 0.15 * radius) & (aside < 0.04 * radius)).any()
    assert ((spot - center) @ toward < (1 - cut / 50) * radius) or cut == 0
    assert abs(normals(space, at[None])[0] @ sight) > 0.4
