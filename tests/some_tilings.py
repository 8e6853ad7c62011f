"""Tilings to test with: of all 17 groups, with tiles that have a symmetry, with several prototiles."""

import itertools
import math
from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
import shapely
from hypothesis import assume
from hypothesis import strategies as st

from orbiflow.arrays import Array
from orbiflow.symmetry import (
    WALLPAPER_GROUPS,
    CrystallographicGroup,
    Isometry,
    rotation_matrix,
    symmetry_elements,
    wallpaper_group,
)
from orbiflow.tiles import Placed, Tiling, dirichlet_tiling, isohedral_class, orient
from strategies import lattices, seeds, wallpaper_groups

Field: TypeAlias = Callable[[Array], Array]

P4M = wallpaper_group("p4m")
SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])

NAMED: dict[str, tuple[Tiling, tuple[int, ...]]] = {
    "the square cell": (Tiling(P4M, [SQUARE]), (8,)),
    "its quarter, cut by both diagonals": (Tiling(P4M, [[[0, 0], [0.5, -0.5], [0.5, 0.5]]]), (2,)),
    "its quarter, cut by both axes": (Tiling(P4M, [SQUARE / 2 + 0.25]), (2,)),
    "its eighth": (Tiling(P4M, [[[0, 0], [0.5, 0], [0.5, 0.5]]]), (1,)),
    "hexagons and triangles": (
        Tiling(
            wallpaper_group("p6m"),
            [
                [[math.cos(a) / 2, math.sin(a) / 2] for a in np.arange(6) * math.pi / 3],
                [[0.5, 0], [0.75, math.sqrt(3) / 4], [0.25, math.sqrt(3) / 4]],
            ],
        ),
        (12, 6),
    ),
}
"""With the orders of their stabilisers."""


@st.composite
def moved(draw: st.DrawFn, tiling: Tiling) -> Tiling:
    """Turned, scaled, moved and perhaps mirrored."""
    angle, scale = draw(st.floats(-3, 3)), draw(st.sampled_from([0.01, 1.0, 300.0]))
    flip = np.diag([1.0, draw(st.sampled_from([1.0, -1.0]))])
    offset = scale * np.array(draw(st.tuples(st.floats(-5, 5), st.floats(-5, 5))))
    return tiling.transformed(scale * rotation_matrix(angle) @ flip, offset)


def waving(group: CrystallographicGroup, seed: int, size: float) -> Field:
    """A vector field that commutes with the group, at most about `size` long."""
    rng = np.random.default_rng(seed)
    frequencies, phases = rng.integers(-2, 3, (6, 2)), rng.uniform(0, 2 * np.pi, 6)
    amplitudes = size * rng.normal(size=(6, 2)) / 6

    def field(points: Array) -> Array:
        angles = 2 * np.pi * points @ group.inverse_lattice.T @ frequencies.T + phases
        return np.cos(angles) @ amplitudes

    return lambda points: np.mean([field(g(points)) @ g.linear for g in group.cosets], axis=0)


def bent(group: CrystallographicGroup, rings: list[Array], seed: int, size: float) -> Tiling:
    """The rings with all vertices moved by a field that commutes with the group."""
    field = waving(group, seed, size * math.sqrt(group.cell_volume / group.order))
    rings = [ring + field(ring) for ring in rings]
    assume(all(shapely.Polygon(ring).is_valid for ring in rings))
    return Tiling(group, rings)


def with_points(ring: Array, pieces: int) -> Array:
    """Each side divided into so many."""
    share = np.arange(pieces)[:, None] / pieces
    return np.concatenate(
        [a + share * (b - a) for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True)]
    )


def shared_lengths(tiling: Tiling, placed: Sequence[Placed]) -> dict[tuple[int, int], float]:
    """The lengths of boundary that pairs of tiles share, by areas that shapely measures.

    A tile made wider by a little overlaps what it shares boundary with by that times the length. What
    it meets at a small angle it overlaps by the square of that: by four times as much if twice as wide.
    """
    little = 1e-8 * math.sqrt(tiling.tile_area)
    shapes = [shapely.Polygon(g(tiling.prototiles[g.prototile].polygon)) for g in placed]
    wide, wider = ([s.buffer(k * little, join_style="mitre") for s in shapes] for k in (1, 2))
    found: dict[tuple[int, int], float] = {}
    for i, j in itertools.permutations(range(len(shapes)), 2):
        once, twice = (near[i].intersection(shapes[j]).area for near in (wide, wider))
        length = (2 * once - twice / 2) / little
        if length > 20 * little:
            found[i, j] = length
    return found


@st.composite
def sites(draw: st.DrawFn, group: CrystallographicGroup) -> Array:
    """A point anywhere, or a rotation centre, or a point on a mirror.

    On a fine grid, so that what is almost special is special: 1e-10 away would be neither.
    """
    elements = symmetry_elements(group)
    mirrors = [line.line for line in elements.lines if line.is_mirror]
    kinds = ["anywhere", *["centre"] * bool(elements.centers), *["mirror"] * bool(mirrors)]
    share = np.array(draw(st.tuples(*[st.integers(0, 10**6)] * 2))) / 1e6
    match draw(st.sampled_from(kinds)):
        case "centre":
            return draw(st.sampled_from(elements.centers)).point
        case "mirror":
            line = draw(st.sampled_from(mirrors))
            return line.point + share[0] * math.sqrt(group.cell_volume) * line.direction
    return group.lattice @ share


def fixing(group: CrystallographicGroup, point: Array) -> list[Isometry]:
    """The elements that leave a point where it is."""
    return group.elements_near(point, 1e-7 * math.sqrt(group.cell_volume), source=point)


@st.composite
def dirichlet_tilings(draw: st.DrawFn, most: int = 3, names: tuple[str, ...] = ()) -> Tiling:
    """Cells of one to three points of any of the 17 groups, straight or bent.

    Points are kept away from each other and from special positions that they do not have, where cells
    are needles.
    """
    group = draw(wallpaper_groups(names or tuple(WALLPAPER_GROUPS)))
    size = math.sqrt(group.cell_volume / group.order)
    points = [draw(sites(group)) for _ in range(draw(st.integers(1, most)))]
    for k, point in enumerate(points):
        for other in points[: k + 1]:
            near = group.elements_near(point, size, source=other)
            away = [np.linalg.norm(g(other) - point) for g in near]
            assume(all(d > 0.2 * size or (other is point and d < 1e-9 * size) for d in away))
    tiling = dirichlet_tiling(group, points)
    rings = [prototile.polygon for prototile in tiling.prototiles]
    steps = [np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1) for ring in rings]
    assume(min(float(step.min()) for step in steps) > 0.02 * size)
    if draw(st.booleans()):
        return tiling
    return bent(group, [with_points(ring, 6) for ring in rings], draw(seeds), 0.1)


@st.composite
def cut_in_two(draw: st.DrawFn) -> Tiling:
    """A hexagon of a class of p1, p2 or pgg, cut along a random path and bent."""
    kind = isohedral_class(draw(st.sampled_from(["IH1", "IH4", "IH5", "IH6"])))
    rng = np.random.default_rng(draw(seeds))
    linear = kind.stretch(rng.uniform(-0.4, 0.4, kind.stretch_dim))
    group = kind.group().conjugate(linear)
    ring = with_points(kind.template(), 4) @ linear.T
    first = int(rng.integers(len(ring)))
    second = (first + int(rng.integers(5, len(ring) - 4))) % len(ring)
    first, second = min(first, second), max(first, second)
    start, end = ring[first], ring[second]
    share = np.linspace(0, 1, int(rng.integers(2, 9)))[1:-1, None]
    across = np.array([start[1] - end[1], end[0] - start[0]])
    path = start + share * (end - start) + rng.uniform(-0.15, 0.15, share.shape) * across
    one = np.concatenate([ring[first : second + 1], path[::-1]])
    other = np.concatenate([ring[second:], ring[: first + 1], path])
    whole = shapely.Polygon(ring)
    for part in (one, other):
        assume(
            shapely.Polygon(part).is_valid and whole.contains(shapely.Polygon(part).buffer(-1e-9))
        )
        assume(shapely.Polygon(part).area > 0.02 * whole.area)
    parts = [orient(one), orient(other)]
    return bent(group, parts, draw(seeds), 0.05)


@st.composite
def mirror_tiles(draw: st.DrawFn) -> Tiling:
    """Under pm and cmm, tiles that are their own mirror images, with random edges elsewhere."""
    rng = np.random.default_rng(draw(seeds))
    share = np.linspace(0, 1, 8)
    if draw(st.booleans()):
        group = wallpaper_group("pm", draw(lattices("rectangular")))
        # between mirrors at 1/2, about the one at 0: what is below is what is above
        half = 0.2 * rng.normal(size=4)
        low = np.stack([share - 0.5, np.concatenate([half, half[::-1]])], axis=1)
        ring = np.concatenate([low, low[::-1] + np.array([0.0, 1.0])])
        return Tiling(group, [_placed(group.lattice, ring)])
    group = wallpaper_group("cmm", draw(lattices("rhombic")))
    # between the mirrors y = 0 and 1/2 of the rectangular cell, about the mirror x = 0; on the right
    # an edge with a half-turn at (1/4, 1/4)
    bend = 0.06 * rng.normal(size=8)
    right = np.stack([0.25 + bend - bend[::-1], share / 2], axis=1)
    ring = np.concatenate([right, right[::-1] * (-1.0, 1.0)])
    u, v = group.lattice.T
    return Tiling(group, [_placed(np.stack([u + v, u - v], axis=1), ring)])


def _placed(axes: Array, ring: Array) -> Array:
    placed = orient(ring @ axes.T)
    assume(shapely.Polygon(placed).is_valid)
    return placed


tilings = st.one_of(
    st.sampled_from([tiling for tiling, _ in NAMED.values()]).flatmap(moved),
    dirichlet_tilings(),
    cut_in_two(),
    mirror_tiles(),
)
"""Any of these."""
