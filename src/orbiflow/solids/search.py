"""The search for solids that fill space: pose, bend, close (design point 22)."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple, TypeVar

import numpy as np
from scipy.spatial import cKDTree

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import NEVER, Cancel, Cancelled, Sink, Team, cores, ignore
from orbiflow.settings import naming_extras
from orbiflow.solids.bending import QUICK_STAGES, STAGES, BentBody, Stages, bent
from orbiflow.solids.body import Body, Weight
from orbiflow.solids.closing import Function, ball_of_cells, box_around
from orbiflow.solids.distance import SignedDistance, points_inside, surface_points
from orbiflow.solids.families import USUAL_GROUPS, GroupFamily
from orbiflow.solids.likeness import SolidLikeness, measured, rigid_motion
from orbiflow.solids.mesh import Mesh
from orbiflow.solids.painting import Painting, checked_painting
from orbiflow.solids.poses import FINENESS, Pose, best_poses, polished
from orbiflow.solids.separable import SEPARABLE_GROUPS, check_separable, separable_tile
from orbiflow.solids.settings import EmphasisSphere, FillSettings
from orbiflow.solids.solid import EscherSolid
from orbiflow.solids.surfaces import tile_surface
from orbiflow.symmetry import CrystallographicGroup

GRAIN = 0.058  # of the points inside a body by which poses are compared
FINE = 0.03  # of the points on its surface
PROBES = 5_000  # points of space that are asked how many copies hold them
SMALLEST, LARGEST, USUAL_SIZE = 15.0, 400.0, 60.0  # longest sides in mm that are printed
MOST_STRAIN = 0.5  # of a body that did not come apart while it bent
STRAIN_COST = 0.25  # of strain, in shares of space that are uncovered or covered twice


AXES = {
    "x": ((0, 1, 0), (0, 0, 1), (1, 0, 0)),
    "y": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
}
"""What is right, backwards and up where each axis points up."""


class Effort(NamedTuple):
    """How much is tried, and how finely.

    - `groups`: Number of groups.
    - `tried`, `climbed`, `steps`, `per_group`: Of each, random poses, climbs and their steps, and poses
      that go on.
    - `polishing`: Steps of a second climb of those, with finer bins.
    - `quick`, `full`, `closed`: Of all, quick bends, bends, and solids that are made of these; more if
      more solids are wanted, or some cannot be made.
    - `rough`, `fine`: Spacings of a body's nodes in quick bends and in others.
    - `grain`: Spacing of the points on the bent surface that a solid is made of.
    - `stages`: Of the bends that solids are made of.
    """

    groups: int
    tried: int
    climbed: int
    steps: int
    per_group: int
    polishing: int
    quick: int
    full: int
    closed: int
    rough: float = 0.085
    fine: float = 0.055
    grain: float = 0.02
    stages: Stages = STAGES


EFFORTS = {
    "fast": Effort(4, 1000, 8, 250, 4, 300, 16, 4, 2),
    "normal": Effort(len(USUAL_GROUPS), 1500, 24, 500, 4, 400, 40, 12, 4),
}


@dataclass(frozen=True, eq=False)
class SolidGoal:
    """What solids are to look like.

    - `name`: What it is called.
    - `mesh`: Its surface, with volume 1 and its centre of mass at 0.
    - `weight`: How much more points matter, in its coordinates, or None.
    - `millimetres`: The length of one unit.
    - `axes`: What is right, backwards and up for it, as columns (3, 3).
    """

    name: str
    mesh: Mesh
    weight: Weight | None
    millimetres: float
    axes: Array

    @classmethod
    def of(
        cls,
        mesh: Mesh,
        settings: FillSettings,
        name: str = "solid",
        painting: Painting | None = None,
    ) -> SolidGoal:
        """Return the goal of a closed mesh in mm, on which something may be painted.

        Raises:
            OrbiflowError: If it is not closed or has no volume, or lacks the paint that settings need.
        """
        if not mesh.is_closed or mesh.volume <= 0:
            raise OrbiflowError(
                "the mesh must be closed, with faces counter-clockwise from outside"
            )
        side, center = mesh.volume ** (1 / 3), mesh.centroid
        unit = Mesh((mesh.points - center) / side, mesh.faces)
        longest = float(np.ptp(unit.points, axis=0).max())
        size = settings.size or usual_size(mesh)
        millimetres = size / longest if size else side
        weights = [
            emphasis.weights
            if isinstance(emphasis, EmphasisSphere)
            else partial(checked_painting(painting).weights, emphasis.weight)
            for emphasis in settings.emphasised
        ]
        weight = partial(_product, weights, center, side) if weights else None
        return cls(name, unit, weight, millimetres, np.array(AXES[settings.up or "z"]).T)

    @cached_property
    def inner_points(self) -> tuple[Array, Array]:
        """Points (n, 3) evenly inside, and more of them, for a second climb of poses."""
        return points_inside(self.mesh, GRAIN), points_inside(self.mesh, GRAIN / FINENESS)

    def body(self, spacing: float) -> Body:
        """Return the body that bends, with nodes so far from each other."""
        distance = SignedDistance.of_mesh(self.mesh, FINE)
        return Body.of(distance, self.mesh.bounds, spacing, self.weight)


def usual_size(mesh: Mesh) -> float | None:
    """Return the longest side in mm of a mesh whose own is no size to print, else None."""
    longest = float(np.ptp(mesh.points, axis=0).max())
    return None if SMALLEST <= longest <= LARGEST else USUAL_SIZE


def _product(weights: Sequence[Weight], center: Array, side: float, points: Array) -> Array:
    """Return the product (n,) of weights that are given in the coordinates of the file."""
    return np.prod([weight(center + side * points) for weight in weights], axis=0)


def fill(
    mesh: Mesh,
    settings: FillSettings | None = None,
    *,
    name: str = "solid",
    painting: Painting | None = None,
    on_solid: Callable[[EscherSolid], object] = lambda _: None,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> list[EscherSolid]:
    """Return solids that look like a mesh and fill space, certified, the best first.

    Args:
        mesh: A closed mesh, in mm.
        settings: Which groups are tried, and how much.
        name: What results call it.
        painting: Where the mesh is painted, as `read_mesh` finds it, for `emphasis` "painted".
        on_solid: Called with each solid that is found.
        on_event: Called with `Progress`.
        cancel: Checked before each step. Solids that were found by then are returned.

    Raises:
        GroupError: For a group that is unknown, or has mirrors, or where none comes apart as asked for.
        OrbiflowError: If the mesh is not closed, or too thin to be followed.
        Cancelled: If the token was cancelled before a solid was found.
    """
    settings = settings or FillSettings()
    make = _tile_maker(settings)
    effort, goal = EFFORTS[settings.effort], SolidGoal.of(mesh, settings, name, painting)
    usual = SEPARABLE_GROUPS if settings.separable else USUAL_GROUPS[: effort.groups]
    families = [GroupFamily.named(group_name) for group_name in settings.groups or usual]
    if settings.separable:
        effort = effort._replace(per_group=effort.quick)  # of few groups more poses
        for family in families:
            check_separable(family.base)
    team = Team(__name__, settings.workers or cores(), on_event, cancel)
    seeds = np.random.SeedSequence(settings.seed).spawn(len(families))
    jobs = list(zip(families, seeds, strict=True))
    placed = team.each(partial(starting_poses, effort, goal.inner_points), jobs, "placing", 0.1)
    poses = [pose for some in placed for pose in some]
    poses.sort(key=lambda pose: -pose.cover)
    rough = goal.body(effort.rough)
    quick = team.each(partial(quick_bend, rough), poses[: effort.quick], "bending", 0.35)
    order = np.argsort([cost for cost, _ in quick], kind="stable")
    best = [poses[k] for k in order[: effort.full]]
    body = goal.body(effort.fine)
    bodies = team.each(partial(_bent, goal, body, effort.stages), best, "bending in detail", 0.6)
    waiting = _by_groups([candidate for candidate in bodies if candidate is not None])
    solids = list[EscherSolid]()

    def keep(solid: EscherSolid | None) -> None:
        if solid is not None:
            solids.append(solid)
            on_solid(solid)

    wanted = max(effort.closed, settings.tiles)
    try:
        while waiting and len(solids) < wanted:
            missing = wanted - len(solids)
            some, waiting = waiting[:missing], waiting[missing:]
            team.each(partial(_solid, goal, body, make, effort.grain), some, "closing", 0.9, keep)
    except Cancelled:
        if not solids:
            raise
    return sorted(_by_groups(solids)[: settings.tiles], key=_rank)


class BentPose(NamedTuple):
    """A body bent with all detail, of which a solid may be made.

    - `family`, `stretches`, `nodes`: The body in its place, as of `BentBody`.
    - `mesh`, `target`: The goal's surface, bent, and moved over it.
    - `importance`: How much the points (N,) of the bent surface matter.
    - `likeness`: How much it looks like the target. Solids of bodies that do so more do so more, too.
    - `seconds`: How long it took.
    """

    family: GroupFamily
    stretches: Array
    nodes: Array
    mesh: Mesh
    target: Mesh
    importance: Array
    likeness: SolidLikeness
    seconds: float

    @property
    def group_name(self) -> str:
        """The name of its group."""
        return self.family.name


Kind = TypeVar("Kind", BentPose, EscherSolid)


def _rank(candidate: BentPose | EscherSolid) -> float:
    return -candidate.likeness.score


def _by_groups(every: Sequence[Kind]) -> list[Kind]:
    """Return all, the best first: the best of each group before others of one."""
    ordered = sorted(every, key=_rank)
    firsts = {entry.group_name: entry for entry in reversed(ordered)}.values()
    others = [entry for entry in ordered if not any(entry is first for first in firsts)]
    return [*sorted(firsts, key=_rank), *others]


def starting_poses(
    effort: Effort, points: tuple[Array, Array], job: tuple[GroupFamily, np.random.SeedSequence]
) -> list[Pose]:
    """Return the poses of a body in a family that cover most, the best first, by a goal's points."""
    family, seed = job
    random, (few, many) = np.random.default_rng(seed), points
    poses = best_poses(
        family, few, random, tried=effort.tried, climbed=effort.climbed, steps=effort.steps
    )
    return polished(poses[: effort.per_group], many, random, effort.polishing)


def quick_bend(body: Body, pose: Pose) -> tuple[float, Pose]:
    """Return what a pose costs once its body has bent a little."""
    bent_body = bent(BentBody.of(body, pose), QUICK_STAGES)
    lost, twice = coverage(bent_body)
    return lost + twice + STRAIN_COST * bent_body.strain, pose


def coverage(bent_body: BentBody) -> tuple[float, float]:
    """Return the share of space that copies of a bent body leave uncovered, and cover twice or more."""
    low, high = bent_body.surface.bounds
    lattice, counts = bent_body.lattice, np.zeros(PROBES, dtype=int)
    corners = np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3)
    box = np.linalg.solve(lattice, corners.T).T
    ranges = [
        np.arange(np.floor(a), np.ceil(b) + 1) for a, b in zip(box.min(0), box.max(0), strict=True)
    ]
    cells = np.stack(np.meshgrid(*ranges, indexing="ij"), axis=-1).reshape(-1, 3)
    probes = np.random.default_rng(0).uniform(size=(PROBES, 3))
    for turn, shift in zip(bent_body.family.turns, bent_body.family.shifts, strict=True):
        at = probes @ turn.T + shift
        images = ((at - np.floor(at) - 1)[:, None] + cells).reshape(-1, 3) @ lattice.T
        near = np.flatnonzero(((images >= low) & (images <= high)).all(axis=1))
        inside = near[bent_body.distance(images[near]) < 0]
        counts += np.bincount(inside // len(cells), minlength=PROBES)
    return float((counts == 0).mean()), float(np.maximum(counts - 1, 0).mean())


def _bent(goal: SolidGoal, body: Body, stages: Stages, pose: Pose) -> BentPose | None:
    """Return the body of a pose, bent with all detail, or None if it came apart."""
    begin = time.process_time()
    bent_body = bent(BentBody.of(body, pose), stages)
    if not bent_body.strain < MOST_STRAIN:
        return None
    fine = Mesh(body.carried(bent_body.nodes, goal.mesh.points), goal.mesh.faces)
    turn, shift = rigid_motion(body.rest, bent_body.nodes)
    target = goal.mesh.moved(turn, shift)
    importance = body.importance[cKDTree(bent_body.surface.points).query(fine.points)[1]]
    likeness = measured(fine, target, fine, importance, bent_body.strain)
    place = bent_body.family, bent_body.stretches, bent_body.nodes
    return BentPose(*place, fine, target, importance, likeness, time.process_time() - begin)


def _solid(
    goal: SolidGoal, body: Body, make: TileMaker, grain: float, pose: BentPose
) -> EscherSolid | None:
    """Return the solid of a bent body, or None if it is not one piece without handles."""
    begin = time.process_time()
    bent_body, group = BentBody(body, *pose[:3]), pose.family.group(pose.stretches)
    tile = make(_depth(pose.mesh, bent_body, grain), pose.mesh, group)
    if tile is None:
        return None
    turn, _ = rigid_motion(body.rest, pose.nodes)
    likeness = measured(tile, pose.target, pose.mesh, pose.importance, pose.likeness.strain)
    solid = EscherSolid(
        name=goal.name,
        group=group,
        tile=tile,
        target=pose.target,
        bent=pose.mesh,
        millimetres=goal.millimetres,
        likeness=likeness,
        upright=turn @ goal.axes,
        seconds=pose.seconds + time.process_time() - begin,
    )
    return solid if solid.certificate.valid else None


TileMaker = Callable[[Function, Mesh, CrystallographicGroup], Mesh | None]
"""Makes a tile of a group that is like a body, given how deep points are in it; None if it cannot."""


def _tile_maker(settings: FillSettings) -> TileMaker:
    if settings.separable:
        return partial(separable_tile, settings.detail)
    if settings.method == "bending":
        return partial(_closed_tile, settings.detail)
    with naming_extras("method 'flow'"):
        from orbiflow.solids.flowing import flowed_tile
    return flowed_tile


def _closed_tile(
    detail: int, depth: Function, fine: Mesh, group: CrystallographicGroup
) -> Mesh | None:
    ball = ball_of_cells(depth, box_around(fine), group, detail)
    return None if ball is None else tile_surface(ball, depth).mesh


def _depth(fine: Mesh, bent_body: BentBody, grain: float) -> Callable[[Array], Array]:
    """Return how deep points are inside a bent surface, times how much its parts matter there.

    So overlaps are settled at the cost of the less important side. Outside it is minus the distance,
    and gaps go to the nearest copy: with weights, parts would be claimed that nothing holds.
    """
    points, normals = surface_points(fine, grain)
    near = cKDTree(bent_body.surface.points).query(points, 4)[1]
    weights = bent_body.body.importance[near].mean(axis=1)
    distance = SignedDistance(points, normals, grain, weights)
    return lambda x: -distance(x)
