"""Smooth surfaces of tiles, whose faces match under the group."""

import numpy as np
import pytest
from hypothesis import given, settings

from orbiflow.solids import certify_solid
from orbiflow.solids.surfaces import tile_surface
from solids.known_solids import names, random_tile, seeds


@given(names, seeds)
@settings(max_examples=6)
def test_a_surface_is_certified_and_knows_what_is_behind_each_face(name, seed):
    tile, function = random_tile(name, seed)
    surface = tile_surface(tile, function)
    group, mesh = tile.complex.group, surface.mesh
    certificate = certify_solid(group, mesh)
    assert certificate.is_ball, certificate.reasons
    assert certificate.pair_error < 1e-12
    assert certificate.volume_error < 1e-12
    partners, corners = surface.partners, mesh.corners
    np.testing.assert_array_equal(partners[partners], np.arange(len(partners)))
    linear = group.linear_parts[surface.cosets]
    moves = group.translations[surface.cosets] + surface.shifts @ group.lattice.T
    images = np.einsum("nij,nkj->nki", linear, corners[partners]) + moves[:, None]
    distances = np.linalg.norm(images[:, :, None] - corners[:, None], axis=3)
    assert distances.min(axis=2).max() < 1e-9


@pytest.mark.parametrize("name", ["P 1", "P 21 21 21", "P 31", "P 21 3"])
def test_points_lie_where_the_function_is_the_same_on_both_sides(name):
    tile, function = random_tile(name, 5, cubes=1000)
    surface = tile_surface(tile, function)
    rough = tile_surface(tile)
    group, spacing = tile.complex.group, tile.complex.spacing

    def excess(own):
        x = own.mesh.corners.mean(axis=1)
        moves = group.translations[own.cosets] + own.shifts @ group.lattice.T
        back = np.einsum("nji,nj->ni", group.linear_parts[own.cosets], x - moves)
        return np.abs(function(x) - function(back))

    assert np.median(excess(surface)) < 0.05 * spacing
    assert np.median(excess(surface)) < 0.5 * np.median(excess(rough))
    assert surface.taken_back < 0.5


def test_smoothing_takes_the_steps_of_the_grid_away():
    tile, function = random_tile("P 21 21 21", 3, cubes=4000)
    mesh = tile_surface(tile, function).mesh
    normals = mesh.face_vectors / np.linalg.norm(mesh.face_vectors, axis=1, keepdims=True)
    half = np.sort(mesh.half_edges, axis=1)
    order = np.lexsort(half.T)
    first, second = order[::2] // 3, order[1::2] // 3
    turns = np.degrees(np.arccos(np.clip((normals[first] * normals[second]).sum(axis=1), -1, 1)))
    assert np.median(turns) < 4
    assert np.mean(turns > 30) < 0.08
