"""Co-deformation: a body bends as rigidly as it can until its copies meet (design point 22)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from orbiflow.arrays import Array, Integers
from orbiflow.solids.body import Body
from orbiflow.solids.distance import FAR, SignedDistance
from orbiflow.solids.families import GroupFamily
from orbiflow.solids.mesh import Mesh
from orbiflow.solids.poses import Pose

Stages = tuple[tuple[float, int], ...]

STAGES: Stages = ((0.2, 10), (0.6, 10), (2.0, 12), (6.0, 14))
"""How strongly the surface is pulled to where copies meet, and for how many steps."""
QUICK_STAGES: Stages = ((0.3, 6), (1.0, 6), (3.0, 8))

REACH = 0.12  # the widest gap or overlap that is closed in one step
INNER_REACH = 3.0  # from any place deep in a body to a node inside it, in spacings of its surface
OWN_REACH = (0.035, 0.07, 0.11)  # where along its normal a body's own other side is looked for
DAMPING, MOST_REFIT, REFIT_WIDTH = 0.02, 0.02, 0.06


@dataclass(frozen=True, eq=False)
class BentBody:
    """A body bent in its place among the copies of a group.

    - `body`: The body at rest.
    - `family`, `stretches`: The group.
    - `nodes`: Where its nodes lie (N, 3).
    """

    body: Body
    family: GroupFamily
    stretches: Array
    nodes: Array

    @classmethod
    def of(cls, body: Body, pose: Pose) -> BentBody:
        """Return a body in a pose, not yet bent."""
        return cls(body, pose.family, pose.stretches, pose.moved(body.rest))

    @cached_property
    def lattice(self) -> Array:
        """Basis vectors of the lattice as columns (3, 3)."""
        return self.family.lattice(self.stretches)

    @cached_property
    def surface(self) -> Mesh:
        """Its surface."""
        return self.body.surface(self.nodes)

    @cached_property
    def distance(self) -> SignedDistance:
        """The signed distance to its surface."""
        return SignedDistance(self.surface.points, self.surface.normals, self.body.spacing)

    @cached_property
    def _inner_tree(self) -> cKDTree:
        return cKDTree(self.nodes[self.body.size :])

    def may_touch(self, points: Array) -> Array:
        """Return which points (n, 3) are less than `REACH` from its surface or inside, and some others.

        Bodies with limbs have many copies, most of whose surface is far from them.
        """
        spacing = self.body.spacing
        reach = max(REACH, FAR * spacing)
        near = np.isfinite(self.distance.tree.query(points, distance_upper_bound=reach)[0])
        rest = np.flatnonzero(~near)
        deep = self._inner_tree.query(points[rest], distance_upper_bound=INNER_REACH * spacing)[0]
        near[rest] = np.isfinite(deep)
        return near

    @property
    def strain(self) -> float:
        """By how much, of their lengths, its springs are longer or shorter than at rest."""
        return self.body.strain(self.nodes)

    def with_nodes(self, nodes: Array) -> BentBody:
        """Return the body with its nodes elsewhere."""
        return BentBody(self.body, self.family, self.stretches, nodes)

    def copies(self) -> GroupElements:
        """Return the elements, but the identity, whose copies of the body may touch it."""
        points, lattice = self.surface.points, self.lattice
        inverse, low, high = np.linalg.inv(lattice), points.min(axis=0), points.max(axis=0)
        corners = (
            np.array(np.meshgrid(*zip(low - REACH, high + REACH, strict=True))).reshape(3, -1).T
        )
        box = corners @ inverse.T
        cosets, shifts = list[int](), list[Array]()
        for k, (turn, shift) in enumerate(zip(self.family.turns, self.family.shifts, strict=True)):
            copy = box @ turn.T + shift
            ranges = [
                np.arange(np.ceil(a - d), np.floor(b - c) + 1)
                for a, b, c, d in zip(box.min(0), box.max(0), copy.min(0), copy.max(0), strict=True)
            ]
            cells = np.stack(np.meshgrid(*ranges, indexing="ij"), axis=-1).reshape(-1, 3)
            linear = lattice @ turn @ inverse
            boxes = corners @ linear.T
            moves = (shift + cells) @ lattice.T
            near = ((boxes.min(0) + moves < high) & (boxes.max(0) + moves > low)).all(axis=1)
            if k == 0:
                near &= cells.any(axis=1)
            cosets += [k] * int(near.sum())
            shifts += list(cells[near])
        return GroupElements(np.array(cosets, dtype=np.intp), np.reshape(shifts, (-1, 3)))


class GroupElements(NamedTuple):
    """Elements of a group: a coset's number (n,) and a cell of the lattice (n, 3) each."""

    cosets: Integers
    cells: Array


class Contacts(NamedTuple):
    """What is next to each point of a body's surface.

    - `gaps`: (N,) how far the next surface is, negative for overlaps, at most `REACH`.
    - `copy`: (N,) which of the copies' it is, or -1.
    - `point`: (N,) which point of that copy is the nearest.
    """

    copies: GroupElements
    gaps: Array
    copy: Integers
    point: Integers


def contacts(bent: BentBody) -> Contacts:
    """Return what is next to each point of a body's surface: another copy, or its own other side."""
    points, normals, copies = bent.surface.points, bent.surface.normals, bent.copies()
    lattice = bent.lattice
    inverse, n = np.linalg.inv(lattice), len(points)
    low, high = points.min(axis=0) - REACH, points.max(axis=0) + REACH
    gaps, copy, point = np.full(n, REACH), np.full(n, -1), np.full(n, -1)
    for k, (coset, cell) in enumerate(zip(*copies, strict=True)):
        linear = lattice @ bent.family.turns[coset] @ inverse
        back = (points - lattice @ (bent.family.shifts[coset] + cell)) @ linear
        some = np.flatnonzero(((back > low) & (back < high)).all(axis=1))
        some = some[bent.may_touch(back[some])]
        if len(some):
            away, near = bent.distance.with_nearest(back[some])
            less = away < gaps[some]
            gaps[some[less]], copy[some[less]], point[some[less]] = away[less], k, near[less]
    for reach in OWN_REACH:
        # limbs would swell into free room until they meet other parts of the same body
        open_ = np.flatnonzero(gaps > reach)
        hit = open_[bent.distance(points[open_] + reach * normals[open_]) < 0]
        gaps[hit] = 0.0
        copy[hit] = -1
    return Contacts(copies, np.maximum(gaps, -REACH), copy, point)


def bent(start: BentBody, stages: Stages = STAGES) -> BentBody:
    """Return a body bent until its copies meet.

    Each point of the surface is pulled over a share of the gap or overlap: who matters more yields
    less. In every second step the lattice and the body's place follow, too.

    Args:
        start: The body in its place.
        stages: How strongly it is pulled, and for how many steps.
    """
    bent_body, importance = start, start.body.importance
    size = start.body.size
    for strength, steps in stages:
        pulled = start.body.pulled(strength)
        for step in range(steps):
            near = contacts(bent_body)
            if step % 2 == 0:
                bent_body = refitted(bent_body, near)
                near = contacts(bent_body)
            other = np.where(near.copy >= 0, importance[near.point], importance[:size])
            share = other / (importance[:size] + other)
            surface = bent_body.surface
            places = surface.points + surface.normals * (share * near.gaps)[:, None]
            bent_body = bent_body.with_nodes(pulled.solved(bent_body.nodes, places))
    return bent_body


def refitted(bent_body: BentBody, near: Contacts) -> BentBody:
    """Return the body in another place, and another lattice, with smaller gaps and overlaps.

    One step of Gauss and Newton over the stretches of the lattice, the shift and the rotation.
    """
    family, touching = bent_body.family, np.flatnonzero(near.copy >= 0)
    if not len(touching):
        return bent_body
    points, normals, free = bent_body.surface.points, bent_body.surface.normals, family.freedom
    copy, other = near.copy[touching], near.point[touching]
    turns = family.turns[near.copies.cosets[copy]]
    shifts = family.shifts[near.copies.cosets[copy]] + near.copies.cells[copy]
    lattice = bent_body.lattice
    linear = lattice @ turns @ np.linalg.inv(lattice)
    facing = np.einsum("nij,nj->ni", linear, normals[other])
    middle = points.mean(axis=0)
    at = np.linalg.solve(lattice, middle)

    def moved(values: Array, some: Array) -> tuple[Array, Array]:
        own_lattice = family.lattice(bent_body.stretches + values[:free])
        turn = Rotation.from_rotvec(values[free + 3 :]).as_matrix()
        return own_lattice, (some - middle) @ turn.T + own_lattice @ at + values[free : free + 3]

    def gaps(values: Array) -> Array:
        own_lattice, placed = moved(values, points)
        back = placed[other] @ np.linalg.inv(own_lattice).T
        images = (np.einsum("nij,nj->ni", turns, back) + shifts) @ own_lattice.T
        return ((placed[touching] - images) * facing).sum(axis=1)

    count, step = free + 6, 1e-4
    slopes = np.stack([gaps(step * row) - gaps(-step * row) for row in np.eye(count)], axis=1)
    slopes /= 2 * step
    weight = 1 / (1 + (near.gaps[touching] / REFIT_WIDTH) ** 2)
    square = (slopes * weight[:, None]).T @ slopes
    square[np.diag_indices(count)] += DAMPING * np.trace(square) / count
    values = -np.linalg.solve(square, slopes.T @ (weight * near.gaps[touching]))
    values *= min(1.0, MOST_REFIT / max(float(abs(values).max()), 1e-12))
    _, nodes = moved(values, bent_body.nodes)
    return BentBody(bent_body.body, family, bent_body.stretches + values[:free], nodes)
