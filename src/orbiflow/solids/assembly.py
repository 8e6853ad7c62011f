"""Whether copies of a tile can be put together, piece by piece, by straight moves.

A piece can be drawn out along a direction if nothing lies ahead of it on any line of that direction.
To begin with it must not be pushed into a face that it touches, which leaves few directions to try.
Other moves, such as turns, or two pieces at once, are not tried.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np
from manifold3d import Manifold

from orbiflow.arrays import Array
from orbiflow.drawing import nearest_triangles
from orbiflow.solids.bodies import as_mesh, common_volume
from orbiflow.solids.contacts import Contact, FreeCone, contacts, free_cone
from orbiflow.solids.mesh import Mesh
from orbiflow.solids.offsets import offset_body
from orbiflow.solids.stacks import StackedCopy, copy_centers
from orbiflow.symmetry import CrystallographicGroup

LINES = 120
"""Lines across a tile, of which each asks what lies ahead."""

OVERLAP = 1e-4
"""Length, as a share of the tile's size, that may lie ahead on a line: rounding."""

PUSHED = 0.03
"""How hard a piece may be pushed into what it would touch, where there is a gap: as a mean sine."""

BLOCKED = 1e-4
"""Share of a tile's lines that may be blocked: those that run along a wall."""

SPREAD, ASKED = 400, 12
"""Directions all around that are looked at where a tile leaves a stack on one side, and how many of
them, those that push it least into what it touches, are asked on lines."""


class Leaving(NamedTuple):
    """How a piece leaves others.

    - `direction`: The direction (3,) in which it is drawn out.
    - `blocked`: Share of the piece's lines along it on which another piece lies ahead; 0 if it leaves.
    """

    direction: Array
    blocked: float

    @property
    def is_free(self) -> bool:
        """Whether the piece can be drawn out."""
        return self.blocked <= BLOCKED


class Step(NamedTuple):
    """A piece of a cluster, and the direction (3,) in which it is put in: against that it leaves in."""

    piece: int
    direction: Array


@dataclass(frozen=True)
class Assembly:
    """In which order a cluster of copies is put together.

    - `steps`: The pieces in this order; the first just lies there.
    - `stuck`: Pieces that no straight move of one piece takes apart.
    """

    steps: tuple[Step, ...]
    stuck: tuple[int, ...]

    @property
    def is_interlocked(self) -> bool:
        """Whether some pieces cannot be put together one by one."""
        return bool(self.stuck)

    @property
    def words(self) -> str:
        """What came of it, in a sentence."""
        count = len(self.steps) + len(self.stuck)
        if not self.stuck:
            return f"{count} copies can be put together one by one, each by a straight move."
        return (
            f"{len(self.stuck)} of {count} copies are interlocked: none can be drawn out by a "
            "straight move."
        )


class Pieces:
    """A tile and its neighbours, of which one asks whether they come apart.

    Args:
        group: The group whose copies of the tile fill space.
        tile: The tile.
        clearance: The gap between copies, each of which is smaller by half of it; in units of the tile.
    """

    def __init__(self, group: CrystallographicGroup, tile: Mesh, clearance: float = 0.0) -> None:
        self.group, self.tile, self.clearance = group, tile, clearance
        self.piece = as_mesh(offset_body(tile, -clearance / 2)) if clearance else tile
        self.size = float(np.ptp(tile.points, axis=0).max())

    @cached_property
    def contacts(self) -> list[Contact]:
        """The neighbours that the tile touches, the largest contact first."""
        return contacts(self.group, self.tile)

    @cached_property
    def cones(self) -> list[FreeCone]:
        """For each neighbour the directions in which the tile may leave it, to begin with."""
        return [free_cone(self.tile.face_vectors[contact.faces]) for contact in self.contacts]

    def leaving_neighbour(self, number: int) -> Leaving | None:
        """Return how the tile is best drawn away from a neighbour; None if it is locked to it."""
        element, cone = self.contacts[number].element, self.cones[number]
        other = self.piece.moved(element.linear, element.translation)
        return _best(
            _directions(cone), lambda way, most: self.blocked(self.piece, [other], way, most)
        )

    def leaving_stack(self, turns: Array | None = None) -> Leaving:
        """Return how the tile is best drawn out of a stack that fills all space on one side of it.

        For a direction d, copies are there whose centres are at most as far along d as the tile's.
        The tile's free directions and `SPREAD` others are tried.

        Args:
            turns: Linear parts (n, 3, 3) of elements whose copies leave by the same move, of which the
                one that is blocked most counts. Default: all, where they do leave, else the tile alone.
        """
        if turns is None:
            leaving = self._all_leave
            if leaving and (leaving.is_free or self.group.order == 1):
                return leaving
            turns = np.eye(3)[None]
        center = self.tile.centroid
        radius = float(np.linalg.norm(self.tile.points - center, axis=1).max())
        near = self.group.elements_near(center, 2 * radius, source=center)[1:]
        meshes = [self.piece.moved(g.linear, g.translation) for g in near]
        shifts = np.array([g.linear @ center + g.translation - center for g in near])
        rays = [ray for cone in self.cones for ray in cone.rays]
        close = 1e-6 * radius

        def pushed(directions: Array) -> Array:
            return np.sum([self._pushed(directions @ turn, close) for turn in turns], axis=0)

        def blocked(direction: Array, most: float) -> float:
            worst = 0.0
            for way in direction @ turns:  # how the move looks to the tile itself
                before = [m for m, s in zip(meshes, shifts, strict=True) if s @ way < close]
                worst = max(worst, self.blocked(self.piece, before, way, most))
                if worst > most:
                    break
            return worst

        leaving = _best(least_pushed(pushed, np.reshape(rays, (-1, 3))), blocked)
        assert leaving is not None
        return leaving

    @cached_property
    def _all_leave(self) -> Leaving | None:
        """Return how all copies leave by one move, in groups that keep directions."""
        group = self.group
        return self.leaving_stack(group.linear_parts) if keeps_directions(group) else None

    def _pushed(self, directions: Array, near: float) -> Array:
        """Return how hard (n,) a tile is pushed into neighbours that are not ahead along directions."""
        center = self.tile.centroid
        pushed = np.zeros(len(directions))
        for contact in self.contacts:
            shift = contact.element.linear @ center + contact.element.translation - center
            into = np.clip(self.tile.face_vectors[contact.faces] @ directions.T, 0, None).sum(
                axis=0
            )
            pushed += np.where(shift @ directions.T < near, into, 0.0)
        return pushed.round(9)

    def assembly(self, copies: Sequence[StackedCopy]) -> Assembly:
        """Return an order in which some copies are put together, each by a straight move.

        They are taken apart one by one, and put together the other way round. That finds an order if
        there is one: a piece that can leave some others can leave fewer, too. Where all copies leave a
        stack by one move, they go in by that.
        """
        leaving = self._all_leave
        if leaving and leaving.is_free and (order := self.order_along(copies, leaving.direction)):
            return Assembly(tuple(Step(k, -leaving.direction) for k in order[::-1]), ())
        meshes = [self.piece.moved(copy.linear, copy.shift) for copy in copies]
        touching = self._touching(copies)
        left, taken = list(range(len(copies))), list[Step]()
        centers = copy_centers(self.tile, copies)
        while len(left) > 1:
            middle = centers[left].mean(axis=0)
            outer = sorted(left, key=lambda k: -float(np.linalg.norm(centers[k] - middle)))
            loose = next(
                (
                    (k, move)
                    for k in outer
                    if (move := self._leaving(k, left, meshes, touching, copies))
                ),
                None,
            )
            if loose is None:
                return Assembly(tuple(taken[::-1]), tuple(left))
            taken.append(Step(loose[0], -loose[1].direction))
            left.remove(loose[0])
        first = Step(left[0], np.array([0.0, 0.0, -1.0]))
        return Assembly((first, *taken[::-1]), ())

    def order_along(self, copies: Sequence[StackedCopy], direction: Array) -> list[int] | None:
        """Return an order in which copies are taken away along one direction; None if there is none."""
        meshes = [self.piece.moved(copy.linear, copy.shift) for copy in copies]
        left, order = list(range(len(copies))), list[int]()
        left.sort(key=lambda k: -float(meshes[k].centroid @ direction))
        while left:
            others = {k: [meshes[j] for j in left if j != k] for k in left}
            free = (
                k for k in left if self.blocked(meshes[k], others[k], direction, BLOCKED) <= BLOCKED
            )
            if (loose := next(free, None)) is None:
                return None
            order.append(loose)
            left.remove(loose)
        return order

    def _touching(self, copies: Sequence[StackedCopy]) -> dict[tuple[int, int], Contact]:
        """Return for pairs of copies that touch, which contact of the tile that is."""
        touching = dict[tuple[int, int], Contact]()
        for first, second in combinations(range(len(copies)), 2):
            for k, j in ((first, second), (second, first)):
                linear = copies[k].linear.T @ copies[j].linear
                shift = copies[k].linear.T @ (copies[j].shift - copies[k].shift)
                for contact in self.contacts:
                    same = np.abs(contact.element.linear - linear).max() < 1e-6
                    if (
                        same
                        and np.abs(contact.element.translation - shift).max() < 1e-6 * self.size
                    ):
                        touching[k, j] = contact
        return touching

    def _leaving(
        self,
        piece: int,
        left: Sequence[int],
        meshes: Sequence[Mesh],
        touching: dict[tuple[int, int], Contact],
        copies: Sequence[StackedCopy],
    ) -> Leaving | None:
        """Return how a piece is drawn out of those that are left, if it can."""
        others = [k for k in left if k != piece]
        faces = [touching[piece, k].faces for k in others if (piece, k) in touching]
        numbers = np.unique(np.concatenate(faces)) if faces else np.zeros(0, np.int64)
        cone = free_cone(self.tile.face_vectors[numbers])
        directions = _directions(cone)
        if self.clearance:  # the piece may be pushed a little into what it would touch
            vectors = self.tile.face_vectors[numbers]
            area = np.linalg.norm(vectors, axis=1).sum() + 1e-300

            def pushed(tried: Array) -> Array:
                return np.clip(vectors @ tried.T, 0, None).sum(axis=0) / area

            least = least_pushed(pushed, np.zeros((0, 3)))
            least = least[pushed(least) < PUSHED]
            directions = np.concatenate([directions, least])
        directions = directions @ copies[piece].linear.T
        rest = [meshes[k] for k in others]
        for direction in directions:
            if self.blocked(meshes[piece], rest, direction, BLOCKED) <= BLOCKED:
                return Leaving(direction, 0.0)
        return None

    def blocked(
        self, piece: Mesh, others: Sequence[Mesh], direction: Array, most: float = 1.0
    ) -> float:
        """Return the share of a piece's lines along a direction on which another piece lies ahead.

        On each of some ten thousand lines the rear end of the piece is compared with the front end of
        the others, exactly: a piece is drawn out freely if it is behind on none. Once the share is
        above `most` no more pieces are asked.
        """
        axes = axes_along(direction)
        seen = piece.corners @ axes
        low, high = seen.min(axis=(0, 1)), seen.max(axis=(0, 1))
        scale = LINES / float((high - low)[:2].max())
        # a little off, so that no line runs along a wall
        offset = np.array([0.318, 0.271, 0.0]) - low * (1, 1, 0) * scale
        width, height = (int(n) + 1 for n in (high - low)[:2] * scale + 1)
        rear = nearest_triangles(_steep_left_out(seen * (1, 1, -1)) * scale + offset, width, height)
        count, hit = max(1, int(rear.covered.sum())), np.zeros(rear.depth.shape, bool)
        for other in others:
            corners = _reaching(other, axes, low, high, OVERLAP * self.size)
            if corners is None:
                continue
            front = nearest_triangles(_steep_left_out(corners) * scale + offset, width, height)
            both = rear.covered & front.covered
            hit[both] |= (front.depth + rear.depth)[both] > OVERLAP * self.size * scale
            if hit.sum() > most * count:
                break
        return float(hit.sum() / count)


def keeps_directions(group: CrystallographicGroup) -> bool:
    """Return whether all elements keep each direction up to its sign, as in P 1 and P -1."""
    turns = group.linear_parts
    return all(np.allclose(turn, turn[0, 0] * np.eye(3)) for turn in turns)


def _best(directions: Array, blocked: Callable[[Array, float], float]) -> Leaving | None:
    """Return the direction in which least is in the way; what is above the least need not be exact."""
    best = None
    for direction in directions:
        share = blocked(direction, 1.0 if best is None else best.blocked)
        if best is None or share < best.blocked:
            best = Leaving(direction, share)
        if best.is_free:
            break
    return best


def greatest_overlap(
    moving: Manifold, fixed: Manifold, direction: Array, *, distance: float, steps: int = 24
) -> float:
    """Return the greatest volume that a body shares with another one on its way along a direction.

    The way is asked in steps that are small to begin with. What is measured is independent of how the
    direction was found.

    Args:
        moving, fixed: The bodies.
        direction: The direction (3,).
        distance: How far it moves.
        steps: How often it is asked, the start and the end included.
    """
    unit = np.asarray(direction, float) / np.linalg.norm(direction)
    ways = (distance * np.linspace(0, 1, steps) ** 1.5).tolist()
    return max(common_volume(moving.translate((way * unit).tolist()), fixed) for way in ways)


def sphere(count: int) -> Array:
    """Return unit vectors (n, 3) all around, evenly spread along a spiral."""
    z = 1 - (2 * np.arange(count) + 1) / count
    angle = 2.399963 * np.arange(count)
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)


def least_pushed(pushed: Callable[[Array], Array], more: Array) -> Array:
    """Return the directions (`ASKED`, 3) that push a piece least into what it touches, the least first.

    `pushed` says how hard directions (n, 3) do. `SPREAD` of them all around are tried, `more` (n, 3),
    and others close to the best.
    """
    tried = np.unique(np.concatenate([more, sphere(SPREAD)]).round(9), axis=0)
    around = sphere(16)
    for radius in (0.08, 0.04, 0.02, 0.01, 0.005):
        best = tried[np.argsort(pushed(tried).round(9), kind="stable")[:ASKED]]
        near = (best[:, None] + radius * around).reshape(-1, 3)
        tried = np.concatenate([best, near / np.linalg.norm(near, axis=1, keepdims=True)])
    return tried[np.argsort(pushed(tried).round(9), kind="stable")[:ASKED]]


def _directions(cone: FreeCone) -> Array:
    """Return the directions of a cone that are tried: the middle, the rays, and between them."""
    if cone.middle is None:
        return np.zeros((0, 3))
    rays = cone.rays[:: max(1, len(cone.rays) // 12)]
    tried = [cone.middle, *rays, *(cone.middle + ray for ray in rays)]
    tried = [direction for direction in tried if np.linalg.norm(direction) > 1e-6]
    return np.stack([direction / np.linalg.norm(direction) for direction in tried])


def axes_along(direction: Array) -> Array:
    """Return three unit vectors as columns (3, 3), the last of them the direction."""
    unit = direction / np.linalg.norm(direction)
    aside = np.cross(unit, np.eye(3)[np.abs(unit).argmin()])
    aside /= np.linalg.norm(aside)
    return np.stack([aside, np.cross(unit, aside), unit], axis=1)


def _reaching(other: Mesh, axes: Array, low: Array, high: Array, near: float) -> Array | None:
    """Return the triangles of a body that may lie ahead of a box along the third axis, if any do."""
    points = other.points @ axes
    least, most = points.min(axis=0), points.max(axis=0)
    if most[2] <= low[2] + near or (least[:2] >= high[:2]).any() or (most[:2] <= low[:2]).any():
        return None
    first, second, third = (points[other.faces[:, k]] for k in range(3))
    most, least = np.maximum(np.maximum(first, second), third), np.minimum(first, second)
    least = np.minimum(least, third)
    ahead = (most[:, 2] > low[2] + near) & (most[:, 0] > low[0]) & (most[:, 1] > low[1])
    ahead &= (least[:, 0] < high[0]) & (least[:, 1] < high[1])
    return points[other.faces[ahead]] if ahead.any() else None


def _steep_left_out(corners: Array) -> Array:
    """Return triangles without those that are seen from their edge."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return corners[np.abs(across[:, 2]) > 1e-7 * np.maximum(np.linalg.norm(across, axis=1), 1e-300)]
