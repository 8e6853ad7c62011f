"""Solids that fill space by a flow: a simple fundamental domain, moved until it fits a body."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.sparse
import torch
from scipy.spatial import cKDTree
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.fields import FourierField
from orbiflow.flows import Flow
from orbiflow.runtime import one_thread
from orbiflow.solids.closing import CellTile, Function, box_around, close_tile
from orbiflow.solids.complexes import cell_complex
from orbiflow.solids.crossings import crossing_pairs
from orbiflow.solids.matched import MatchedSurface
from orbiflow.solids.mesh import Mesh
from orbiflow.solids.surfaces import tile_surface
from orbiflow.symmetry import CrystallographicGroup

START_CELLS = (4_000, 1_500, 600)
"""Cells of the ball that is moved: fewer where more are none."""

DIRICHLET_CELLS, SITES, NEAR = 1_000, 300, 40
REACH = 0.12  # the farthest that a point is asked to go in one step
STEEPEST = 0.4  # an edge changes in one step by less than this share of its length
SMOOTHNESS = 2.0  # of the fields, as `FourierField` has it

TENSION, OUTER_TENSION = 0.001, 0.05
"""What area costs, everywhere and per unit of distance outside the body: membranes retract."""

THINNEST = 0.5
"""The share of its own thickness by which a part may become thinner in one step."""

SLIDING, DAMPING, SOLVER_STEPS = 1.0, 1e-2, 6
EVENNESS = 0.15  # how far points move to the means of their neighbours after each step
SMOOTHINGS, MOST_CROSSINGS = 24, 1000


class Stage(NamedTuple):
    """A part of the fit: the shortest waves of its fields, its steps, and its longest edges."""

    wavelength: float
    steps: int
    edge: float


STAGES = (Stage(0.35, 9, 0.1), Stage(0.22, 15, 0.07), Stage(0.16, 9, 0.055))


def flowed_tile(
    function: Function,
    body: Mesh,
    group: CrystallographicGroup,
    *,
    stages: Sequence[Stage] = STAGES,
) -> Mesh:
    """Return a solid that fits a body and fills space, as a symmetric flow makes it; always one piece.

    It starts as a ball of few cells, or where none is possible as a Dirichlet cell of the group. Each
    step moves its surface by the flow of a field that commutes with the group, which is fitted by
    least squares to where the surface is wanted (Sobolev descent, design point 10). Then points move a
    little to the means of their neighbours, by orbits. So faces stay in pairs and the volume is exact.
    Where triangles cross the surface is smoothed; where that is in vain the stage ends before it.

    Args:
        function: How deep points are in the body, negative outside, as for `close_tile`.
        body: The body in its place.
        group: A space group without mirrors, whose tiles have the volume 1.
        stages: Fields and steps, the coarse ones first.
    """
    surface = starting_surface(function, body, group)
    smoother = Smoother(group, surface)
    for stage in stages:
        waves = max(1, round(group.cell_volume ** (1 / 3) / stage.wavelength))
        field = FourierField(group, waves, smoothness=SMOOTHNESS)
        for step in range(stage.steps):
            fine = divided_to(surface, stage.edge)
            if step == 0 or fine is not surface:
                smoother = Smoother(group, fine)
            evened = uncrossed(smoother.evened(moved(function, field, fine), EVENNESS), smoother)
            if evened is None:
                break
            surface = evened
    return surface.mesh


def starting_surface(
    function: Function, body: Mesh, group: CrystallographicGroup
) -> MatchedSurface:
    """Return the surface of a ball of few cells that is like the body, or of a Dirichlet cell."""
    box = box_around(body)
    for cells in START_CELLS:
        tile = close_tile(function, *box, cell_complex(group, cells))
        if tile.is_ball:
            surface = _surface(tile, function)
            if not len(crossing_pairs(surface.mesh.points, surface.mesh.faces)):
                return surface
    return dirichlet_cell(group, best_site(body, group))


def best_site(body: Mesh, group: CrystallographicGroup) -> Array:
    """Return the point (3,), of some in a body, whose Dirichlet cell holds most of the others."""
    random = np.random.default_rng(0)
    a, b = random.integers(0, len(body.points), (2, 4 * SITES))
    # between two points of the surface: deep ones are likelier
    held = (body.points[a] + body.points[b] + 2 * body.centroid) / 4
    sites, shares = np.vstack([body.centroid, held[:SITES]]), list[float]()
    for site in sites:
        near = np.array([g(site) for g in group.elements_near(site, 3.0)[1:NEAR]])
        away = np.linalg.norm(held[:, None] - near, axis=2).min(axis=1)
        shares.append(float(np.mean(np.linalg.norm(held - site, axis=1) < away)))
    return sites[int(np.argmax(shares))]


def dirichlet_cell(
    group: CrystallographicGroup, site: Array, cells: int = DIRICHLET_CELLS
) -> MatchedSurface:
    """Return the surface of the points that are nearer to a site than to its copies."""

    def nearness(points: Array) -> Array:
        return -((points - site) ** 2).sum(axis=1)

    return _surface(
        close_tile(nearness, site - 0.8, site + 0.8, cell_complex(group, cells)), nearness
    )


def _surface(tile: CellTile, function: Function) -> MatchedSurface:
    return MatchedSurface.of(tile.complex.group, tile_surface(tile, function))


def divided_to(surface: MatchedSurface, edge: float) -> MatchedSurface:
    """Return a surface without edges longer than `edge`; the same if it has none."""
    while (long := surface.edge_lengths > edge).any():
        surface = surface.divided(long)
    return surface


def moved(function: Function, field: FourierField, surface: MatchedSurface) -> MatchedSurface:
    """Return a surface moved by the flow of a field towards where the function is 0.

    The field is shortened so that none of the edges changes by much of its length.
    """
    with one_thread(), torch.no_grad():
        fitted = fitted_field(function, field, surface.mesh)
        points = torch.from_numpy(surface.mesh.points)
        a, b = torch.from_numpy(surface.mesh.edges.T)
        speeds = fitted(points)
        changes = (speeds[a] - speeds[b]).norm(dim=1) / (points[a] - points[b]).norm(dim=1)
        share = min(1.0, STEEPEST / max(float(changes.max()), 1e-12))
        flow = Flow(fitted.with_parameters(share * fitted.parameters_), steps=1, warn=False)
        return surface.with_points(flow.carried(points).numpy())


def fitted_field(function: Function, field: FourierField, mesh: Mesh) -> FourierField:
    """Return the field that moves a surface to where it is wanted: some steps of conjugate gradients.

    Faces and their partners both pull: so the surface goes to the middle of gaps and overlaps.
    """
    depth = np.clip(function(mesh.points), -REACH, REACH)
    area, tension = areas_and_pull(mesh, TENSION + OUTER_TENSION * np.maximum(-depth, 0))
    depth = np.maximum(depth, -THINNEST * thickness(mesh))
    points, normals = torch.from_numpy(mesh.points), torch.from_numpy(mesh.normals)
    areas, wanted, pull = map(torch.from_numpy, (area[:, None], depth[:, None], tension))

    def resisted(values: Tensor) -> Tensor:
        moves = field.with_parameters(values)(points)
        along = (moves * normals).sum(dim=1, keepdim=True) * normals
        return field.adjoint(points, areas * (along + SLIDING * moves)) + DAMPING * values

    solution = torch.zeros(field.size, dtype=torch.float64)
    rest = field.adjoint(points, areas * wanted * normals + pull)
    way, square = rest.clone(), rest @ rest
    for _ in range(SOLVER_STEPS):
        if not square > 0:
            break
        image = resisted(way)
        share = square / (way @ image)
        solution, rest = solution + share * way, rest - share * image
        before, square = square, rest @ rest
        way = rest + square / before * way
    return field.with_parameters(solution)


def areas_and_pull(mesh: Mesh, tension: Array) -> tuple[Array, Array]:
    """Return the areas (N,) around points, and how tension (N,) in the surface pulls them (N, 3)."""
    n, where = len(mesh.points), mesh.faces.ravel()
    vectors = mesh.face_vectors
    sizes = np.linalg.norm(vectors, axis=1)
    flat = vectors / np.maximum(sizes, 1e-300)[:, None] * tension[mesh.faces].mean(axis=1)[:, None]
    opposite = np.roll(mesh.corners, -1, axis=1) - np.roll(mesh.corners, -2, axis=1)
    pulls = np.cross(flat[:, None], opposite).reshape(-1, 3) / 2
    areas = np.bincount(where, np.repeat(sizes / 6, 3), n)
    return areas, mesh.sums_at_points(pulls)


def thickness(mesh: Mesh) -> Array:
    """Return how far behind each point (N,) the surface turns the other way, at most 1."""
    away, near = cKDTree(mesh.points).query(mesh.points, min(24, len(mesh.points)))
    steps = mesh.points[near] - mesh.points[:, None]
    facing = np.einsum("nki,ni->nk", mesh.normals[near], mesh.normals) < 0
    behind = np.einsum("nki,ni->nk", steps, mesh.normals) < -0.5 * away
    return np.where(facing & behind, away, 1.0).min(axis=1)


class Smoother:
    """Moves points of a matched surface to the means of their neighbours, orbit by orbit."""

    def __init__(self, group: CrystallographicGroup, surface: MatchedSurface) -> None:
        edges, n = surface.mesh.edges, len(surface.mesh.points)
        beside = scipy.sparse.coo_array((np.ones(len(edges)), edges.T), (n, n)).tocsr()
        self.beside = scipy.sparse.csr_array(beside + beside.T)
        self._counts = self.beside.sum(axis=1)[:, None]
        self._means = surface.orbit_means(group)

    def moves(self, points: Array, shares: Array | float) -> Array:
        """Return moves (N, 3) of points over shares (N, 1) of the ways to their neighbours' means."""
        pull = (self.beside @ points / self._counts - points) * shares
        return (self._means @ pull.ravel()).reshape(-1, 3)

    def evened(self, surface: MatchedSurface, share: float) -> MatchedSurface:
        """Return a surface all of whose points have moved over a share of the way."""
        return surface.with_points(surface.mesh.points + self.moves(surface.mesh.points, share))


def uncrossed(surface: MatchedSurface, smoother: Smoother) -> MatchedSurface | None:
    """Return a surface smoothed where triangles cross, or None if some still do."""
    points, faces, changed = surface.mesh.points, surface.mesh.faces, None
    bad = np.empty((0, 2), np.int64)
    for round_ in range(SMOOTHINGS):
        kept = bad if changed is None else bad[~changed[bad].any(axis=1)]
        bad = np.concatenate([kept, crossing_pairs(points, faces, changed)])
        if not len(bad):
            return surface.with_points(points)
        if len(bad) > MOST_CROSSINGS:
            return None
        hit = np.zeros(len(points))
        hit[faces[np.unique(bad)]] = 1
        for _ in range(1 + round_ // 5):  # the longer it takes, the wider
            hit = np.minimum(hit + 0.5 * (smoother.beside @ hit > 0), 1)
        moves = smoother.moves(points, 0.6 * hit[:, None])
        points = points + moves
        changed = np.any(np.any(moves != 0, axis=1)[faces], axis=1)
    return None
