"""Tiles by a symmetric flow, and smooth surfaces whose faces match under the group."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings

from orbiflow.fields import FourierField
from orbiflow.solids import Mesh, certify_solid
from orbiflow.solids.distance import SignedDistance, points_inside
from orbiflow.solids.flowing import (
    Smoother,
    Stage,
    best_site,
    dirichlet_cell,
    flowed_tile,
    moved,
    uncrossed,
)
from orbiflow.solids.matched import MatchedSurface
from orbiflow.solids.surfaces import tile_surface
from orbiflow.symmetry import CrystallographicGroup, DirichletDomain
from solids.known_solids import group_named, names, random_tile, seeds

QUICK = (Stage(0.6, 4, 0.25),)


def cell_of(group: CrystallographicGroup) -> MatchedSurface:
    return dirichlet_cell(group, DirichletDomain(group).site, 150)


def mean_overlap(one: Mesh, other: Mesh) -> float:
    both = [{*map(bytes, np.rint(points_inside(m, 0.05) / 0.05).astype(int))} for m in (one, other)]
    return len(both[0] & both[1]) / len(both[0] | both[1])


def ellipsoid(center: np.ndarray) -> Mesh:
    """Return a body of volume 1, longer than wide."""
    unit = dirichlet_cell(group_named("P 1"), np.array([0.2, 0.3, 0.1]), 300).mesh
    points = unit.points - unit.centroid
    points = points / np.linalg.norm(points, axis=1, keepdims=True) * (0.8, 0.6, 0.5)
    return Mesh(points + center, unit.faces)


@given(names, seeds)
@settings(max_examples=3)
def test_a_divided_surface_that_a_flow_moves_fills_space(name, seed):
    group, random = group_named(name), np.random.default_rng(seed)
    own = cell_of(group)
    own = own.divided(random.uniform(size=len(own.mesh.edges)) < 0.2)
    size = 0.05 / len(own.mesh.points)

    def function(points):
        return size * np.sin(points @ random.normal(size=(3, 4))).sum(axis=1)

    with torch.no_grad():
        own = moved(function, FourierField(group, 2, smoothness=2.0), own)
    own = uncrossed(own, Smoother(group, own))
    assert own is not None
    proof = certify_solid(group, own.mesh, boolean=False)
    assert proof.valid, proof.reasons
    assert proof.is_ball
    assert proof.pair_error < 1e-9
    assert proof.volume_error < 1e-12


@given(names, seeds)
@settings(max_examples=3)
def test_parts_of_divided_faces_are_partners_as_the_certificate_finds_them(name, seed):
    group, random = group_named(name), np.random.default_rng(seed)
    own = cell_of(group)
    for _ in range(2):
        own = own.divided(random.uniform(size=len(own.mesh.edges)) < 0.1)
    assert own.mesh.is_closed
    assert own.mesh.euler_number == 2
    np.testing.assert_array_equal(own.partners[own.partners], np.arange(len(own.partners)))
    moves = Smoother(group, own).moves(
        own.mesh.points, random.uniform(0, 0.1, (len(own.mesh.points), 1))
    )
    proof = certify_solid(group, own.with_points(own.mesh.points + moves).mesh, boolean=False)
    assert not proof.unpaired_faces


def test_a_flow_fits_a_body_and_gives_the_same_each_time(monkeypatch):
    monkeypatch.setattr("orbiflow.solids.flowing.START_CELLS", (120,))
    group = group_named("P -1")
    body = ellipsoid(DirichletDomain(group).site)
    distance = SignedDistance.of_mesh(body, 0.05)
    start = dirichlet_cell(group, best_site(body, group), 250).mesh
    given = (lambda points: -distance(points)), body, group
    tile, again = (flowed_tile(*given, stages=QUICK) for _ in range(2))
    np.testing.assert_array_equal(tile.points, again.points)
    assert certify_solid(group, tile).is_ball
    assert mean_overlap(tile, body) > mean_overlap(start, body)


def test_what_no_ball_is_like_starts_as_a_dirichlet_cell(monkeypatch):
    group = group_named("P 21 21 21")
    body = ellipsoid(DirichletDomain(group).site)
    distance = SignedDistance.of_mesh(body, 0.05)
    monkeypatch.setattr("orbiflow.solids.flowing.START_CELLS", ())
    monkeypatch.setattr("orbiflow.solids.flowing.SITES", 60)
    start = dirichlet_cell(group, best_site(body, group), 250)
    monkeypatch.setattr("orbiflow.solids.flowing.dirichlet_cell", lambda *_: start)
    tile = flowed_tile(lambda points: -distance(points), body, group, stages=QUICK)
    assert certify_solid(group, tile).is_ball
    assert mean_overlap(tile, body) > mean_overlap(start.mesh, body) + 0.02


@given(names, seeds)
@settings(max_examples=4)
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


@pytest.mark.parametrize("name", ["P 21 21 21", "P 31", "P 21 3"])
def test_points_lie_where_the_function_is_the_same_on_both_sides(name):
    tile, function = random_tile(name, 5, cubes=600)
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
