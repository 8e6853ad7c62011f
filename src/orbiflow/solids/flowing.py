"""Solids that fill space by a flow: a Dirichlet cell of the group, moved until it fits a body."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.fields import FourierField
from orbiflow.flows import Flow
from orbiflow.solids.closing import Function, close_tile
from orbiflow.solids.complexes import cell_complex
from orbiflow.solids.crossings import crossing_pairs
from orbiflow.solids.matched import MatchedSurface
from orbiflow.solids.mesh import Mesh
from orbiflow.solids.surfaces import tile_surface
from orbiflow.symmetry import CrystallographicGroup

CELLS = 1_000  # of the Dirichlet cell
SITES, NEAR = 300, 40  # places tried for its site; copies of the site that bound it
REACH = 0.12  # the farthest that a point is asked to go in one step
STEEPEST = 0.4  # of a step: an edge changes by less than this share of its length
SMOOTHNESS = 2.0  # of the fields, as `FourierField` has it
TENSION, OUTER_TENSION = 0.002, 0.3
SOLVER_STEPS, DAMPING = 6, 1e-3
REPAIRS = 6


class Stage(NamedTuple):
    """A part of the fit: the shortest waves of its fields, its steps, and its longest edges."""

    wavelength: float
    steps: int
    edge: float


STAGES = (Stage(0.6, 20, 0.12), Stage(0.35, 30, 0.08), Stage(0.22, 30, 0.06), Stage(0.16, 20, 0.045))


@dataclass
class _Carried:
    """A surface that is moved by fields, one after another, and where its points are now."""

    start: MatchedSurface
    now: Array
    fields: list[FourierField]

    @property
    def mesh(self) -> Mesh:
        return Mesh(self.now, self.start.mesh.faces)

    @property
    def edge_lengths(self) -> Array:
        a, b = self.now[self.start.mesh.edges.T]
        return np.linalg.norm(a - b, axis=1)

    def move(self, field: FourierField) -> None:
        self.fields.append(field)
        self.now = carried([field], self.now)

    def divide(self, wanted: Array) -> None:
        before = len(self.now)
        self.start, _ = self.start.divided(wanted, self.edge_lengths)
        self.now = np.concatenate([self.now, carried(self.fields, self.start.mesh.points[before:])])

    def restart(self, start: MatchedSurface) -> None:
        self.start, self.now = start, carried(self.fields, start.mesh.points)

    def divide_longer(self, edge: float) -> None:
        while (long := self.edge_lengths > edge).any():
            self.divide(long)


def carried(fields: Sequence[FourierField], points: Array) -> Array:
    if not fields or not len(points):
        return points
    with torch.no_grad():
        return Flow(fields, steps=1, method="midpoint", warn=False).carried(torch.from_numpy(points)).numpy()


def best_site(function: Function, points: Array, group: CrystallographicGroup) -> Array:
    """Return the point whose Dirichlet cell holds most of the points at which a function is positive."""
    rng = np.random.default_rng(0)
    held = points[function(points) > 0]
    held = held[rng.permutation(len(held))[:2000]]
    sites = np.concatenate([held.mean(axis=0)[None], held[:SITES]])
    shares: list[float] = []
    for site in sites:
        near = np.array([g(site) for g in group.elements_near(site, 3.0)[1:NEAR]])
        away = ((held[:, None] - near) ** 2).sum(axis=2).min(axis=1)
        shares.append(float(np.mean(((held - site) ** 2).sum(axis=1) < away)))
    return sites[int(np.argmax(shares))]


def dirichlet_cell(group: CrystallographicGroup, site: Array, cells: int = CELLS) -> MatchedSurface:
    def nearness(points: Array) -> Array:
        return -((points - site) ** 2).sum(axis=1)

    complex = cell_complex(group, cells)
    tile = close_tile(nearness, site - 0.8, site + 0.8, complex)
    return MatchedSurface.of(complex.group, tile_surface(tile, nearness))


def areas_and_gradients(mesh: Mesh, weights: Array) -> tuple[Array, Array]:
    """Return the areas (N,) around points, and the gradient (N, 3) of the weighted area."""
    vectors = mesh.face_vectors
    sizes = np.linalg.norm(vectors, axis=1, keepdims=True)
    opposite = np.roll(mesh.corners, -2, axis=1) - np.roll(mesh.corners, -1, axis=1)
    flat = vectors / np.maximum(sizes, 1e-300) * weights[mesh.faces].mean(axis=1)[:, None] / 2
    areas = mesh._sums(np.repeat(sizes, 3, axis=0) / 6)[:, 0]
    return areas, mesh._sums(np.cross(flat[:, None], opposite).reshape(-1, 3))


def step_towards(function: Function, field: FourierField, mesh: Mesh) -> FourierField:
    """Return the field that moves a surface to where the function is as large on both sides."""
    points, normals = torch.from_numpy(mesh.points), torch.from_numpy(mesh.normals)
    depth = np.clip(function(mesh.points), -REACH, REACH)
    tension = TENSION + OUTER_TENSION * np.maximum(-depth, 0)
    area, gradient = areas_and_gradients(mesh, tension)
    areas, wanted, pull = map(torch.from_numpy, (area, depth, -gradient))

    def pulled(values: Tensor) -> Tensor:
        return field.adjoint(points, (areas * values)[:, None] * normals)

    found = torch.zeros(field.size, dtype=torch.float64)
    rest = pulled(wanted) + field.adjoint(points, pull)
    way, square = rest.clone(), rest @ rest
    for _ in range(SOLVER_STEPS):
        along = (field.with_parameters(way)(points) * normals).sum(dim=1)
        image = pulled(along) + DAMPING * way
        share = square / (way @ image)
        found, rest = found + share * way, rest - share * image
        new = rest @ rest
        way, square = rest + new / square * way, new
    return field.with_parameters(found)


def flowed(function: Function, points: Array, group: CrystallographicGroup, stages=STAGES, log=None, start=None):
    with torch.no_grad():
        start = start or dirichlet_cell(group, best_site(function, points, group))
        own = _Carried(start, start.mesh.points, [])
        for stage in stages:
            field = FourierField(group, round((group.cell_volume) ** (1 / 3) / stage.wavelength), smoothness=SMOOTHNESS)
            own.restart(start)
            for k in range(stage.steps):
                own.divide_longer(stage.edge)
                found = step_towards(function, field, own.mesh)
                a, b = own.start.mesh.edges.T
                v = found(torch.from_numpy(own.now)).numpy()
                slope = np.linalg.norm(v[a] - v[b], axis=1) / own.edge_lengths
                share = min(1.0, STEEPEST / slope.max())
                own.move(field.with_parameters(share * found.parameters_))
                if log: log(stage, k, field, own, share, np.linalg.norm(v,axis=1).mean())
    return own
