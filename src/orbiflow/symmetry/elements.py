"""What a group makes of space: rotation centres, mirror and glide lines, Dirichlet domains.

Dirichlet domains contain one point of each orbit. All are found from the group itself.
"""

import itertools
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arrays import Array
from orbiflow.errors import GroupError
from orbiflow.settings import is_a, is_tensor, refusal
from orbiflow.symmetry.group import CrystallographicGroup
from orbiflow.symmetry.isometry import TOLERANCE, Isometry, Line, Points, cast_like


class RotationCenter(NamedTuple):
    """A point (2,) about which 2 pi / order is the group's smallest angle of rotation."""

    point: Array
    order: int


class GlideLine(NamedTuple):
    """A line along which `shift` is the group's smallest glide; a mirror if it is zero."""

    line: Line
    shift: float

    @property
    def is_mirror(self) -> bool:
        """Whether the line is a mirror."""
        return self.shift == 0.0


class SymmetryElements(NamedTuple):
    """The rotation centres and the mirror and glide lines that `symmetry_elements` finds."""

    centers: tuple[RotationCenter, ...]
    lines: tuple[GlideLine, ...]


def symmetry_elements(
    group: CrystallographicGroup, center: Array | None = None, radius: float | None = None
) -> SymmetryElements:
    """Return the rotation centres in a disc, and the mirror and glide lines that cross it.

    Args:
        group: A group of the plane.
        center: The centre (2,) of the disc. Default: the middle of the cell B [0, 1)^2.
        radius: The radius of the disc. Default: the cell's, so that every orbit is represented.

    Raises `GroupError` if the group is not one of the plane.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> found = symmetry_elements(wallpaper_group("p4"), np.zeros(2), 0.1)
    >>> [(c.order, c.point.tolist()) for c in found.centers], found.lines
    ([(4, [0.0, 0.0])], ())
    """
    if group.dim != 2:
        raise GroupError(
            f"rotation centres and lines need a plane group, got dimension {group.dim}"
        )
    cell = np.abs(group.lattice).sum(axis=1)
    middle = group.lattice.sum(axis=1) / 2 if center is None else np.asarray(center, dtype=float)
    reach = float(np.linalg.norm(cell)) / 2 if radius is None else radius
    # a rotation about a point of the disc moves the middle by at most twice the radius; the least
    # glide along a line adds less than a cell
    elements = group.elements_near(middle, 2 * reach + float(np.linalg.norm(cell)))
    centers = _centers([g for g in elements if g.determinant > 0], middle, reach)
    lines = _lines([g for g in elements if g.determinant < 0], middle, reach)
    return SymmetryElements(tuple(centers), tuple(lines))


def _centers(elements: list[Isometry], middle: Array, reach: float) -> list[RotationCenter]:
    centers: list[RotationCenter] = []
    for g in sorted(elements, key=_angle):
        if _angle(g) < 1e-6:
            continue
        point = np.linalg.solve(np.eye(2) - g.linear, g.translation)
        if np.linalg.norm(point - middle) > reach * (1 + 1e-9):
            continue
        if all(np.linalg.norm(point - other.point) > 1e-6 * reach for other in centers):
            centers.append(RotationCenter(point, round(2 * np.pi / _angle(g))))
    return centers


def _angle(g: Isometry) -> float:
    return abs(float(np.arctan2(g.linear[1, 0], g.linear[0, 0])))


def _lines(elements: list[Isometry], middle: Array, reach: float) -> list[GlideLine]:
    lines: list[GlideLine] = []
    for line in sorted((_axis(g, middle, reach) for g in elements), key=lambda item: item.shift):
        distance = float(np.linalg.norm(line.line.point - middle))
        if distance <= reach * (1 + 1e-9) and not any(_same(line, other, reach) for other in lines):
            lines.append(line)
    return lines


def _axis(g: Isometry, middle: Array, reach: float) -> GlideLine:
    """Return the line (its point nearest to `middle`) and glide of a reversing isometry."""
    angle = np.arctan2(g.linear[1, 0], g.linear[0, 0]) / 2
    direction = np.array([np.cos(angle), np.sin(angle)])
    moved = g(middle) - middle
    shift = float(moved @ direction)
    point = middle + (moved - shift * direction) / 2
    return GlideLine(Line(point, direction), abs(shift) if abs(shift) > 1e-9 * reach else 0.0)


def _same(first: GlideLine, second: GlideLine, reach: float) -> bool:
    # the points are feet of perpendiculars from one point, so equal lines have equal points
    (ux, uy), (vx, vy) = first.line.direction, second.line.direction
    apart = np.linalg.norm(first.line.point - second.line.point)
    return bool(abs(ux * vy - uy * vx) < 1e-6 and apart < 1e-6 * reach)


def lattice_along(group: CrystallographicGroup, along: str) -> Array:
    """Return the basis vectors (d, r) of a group's lattice that lie along some of its axes.

    They and the coset representatives make a group that is periodic along r directions alone: a frieze
    ("x"), a rod ("z"), a layer ("xy") or, with none (""), a point group.

    Raises `GroupError` if they make none, `SettingError` for anything but axes.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> lattice_along(wallpaper_group("pmg"), "x").tolist()
    [[1.0], [0.0]]
    """
    axes = "xyz"[: group.dim]
    if not is_a(along, str) or not set(along) <= set(axes) or len(set(along)) < len(along):
        raise refusal("along", f"some of the letters {', '.join(axes)}", along)
    kept = [axes.index(axis) for axis in along]
    across = np.delete(np.eye(group.dim), kept, axis=0)
    size = np.abs(group.lattice).max()
    inside = np.abs(across @ group.lattice).max(axis=0, initial=0.0) <= TOLERANCE * size
    # a finite group fixes a point: without the other translations, this one
    center = across.T @ across @ group.translations.mean(axis=0)
    moved = (group.linear_parts @ center + group.translations - center) @ across.T
    turned = (group.linear_parts[:, :, kept]).swapaxes(1, 2) @ across.T
    off = max(np.abs(turned).max(initial=0.0), np.abs(moved).max(initial=0.0) / size)
    if inside.sum() != len(kept) or off > 1e-7:
        raise GroupError(
            f"{group!r} is not periodic along {along!r} alone: without its other translations, an "
            "element turns these axes, or screws or glides across them, or the lattice does not split"
        )
    return group.lattice[:, inside]


TRIED_SITES = 512
"""Points of the cell among which `central_site` chooses."""


def central_site(group: CrystallographicGroup) -> Array:
    """Return a point (d,) far from its own images, always the same, for a round Dirichlet domain.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> site = central_site(wallpaper_group("p4m"))
    >>> bool(min(abs(site[0]), abs(site[1]), abs(abs(site[0]) - abs(site[1]))) > 0.1)
    True
    """
    center, reach = _cell_ball(group)
    size = (group.cell_volume / group.order) ** (1 / group.dim)
    elements = group.elements_near(center, 2 * (reach + size))[1:]
    # Kronecker's sequence of the powers of the root of x^(d + 1) = x + 1 is even in any dimension
    root = 2.0
    for _ in range(64):
        root = (1 + root) ** (1 / (group.dim + 1))
    steps = np.arange(TRIED_SITES)[:, None] * root ** -np.arange(1.0, group.dim + 1)
    points = np.mod(0.5 + steps, 1.0) @ group.lattice.T
    nearest = np.full(TRIED_SITES, np.inf)
    for g in elements:
        nearest = np.minimum(nearest, np.linalg.norm(g(points) - points, axis=1))
    return points[int(nearest.argmax())]


def _cell_ball(group: CrystallographicGroup) -> tuple[Array, float]:
    """Return the centre (d,) of the cell B [0, 1)^d and the radius of the ball around it."""
    signs = np.array(list(itertools.product((-0.5, 0.5), repeat=group.dim)))
    return group.lattice.sum(axis=1) / 2, float(
        np.linalg.norm(signs @ group.lattice.T, axis=1).max()
    )


class DirichletDomain:
    """The fundamental domain of the points nearer to `site` than to any other point of its orbit.

    It is a convex polytope of any dimension. For the four identification spaces and the site (1/2,
    1/2) it is the paper's canonical square, and `project` the canonical projection (paper, section 5.2;
    design point 12).

    Args:
        group: Any crystallographic group.
        site: A point (d,) that every element but the identity moves. Default: `central_site`.

    Raises `GroupError` if an element fixes the site.
    """

    def __init__(self, group: CrystallographicGroup, site: ArrayLike | None = None) -> None:
        self.group = group
        self.site = central_site(group) if site is None else np.asarray(site, dtype=np.float64)
        if self.site.shape != (group.dim,) or not np.isfinite(self.site).all():
            raise GroupError(f"the site must be {group.dim} finite numbers, got {site!r}")
        size = group.cell_volume ** (1 / group.dim)
        for g in group.elements_near(self.site, 1e-6 * size)[1:]:
            raise GroupError(f"the site {self.site.tolist()} is fixed by {g!r}: choose another")

    @cached_property
    def _candidates(self) -> list[Isometry]:
        # by Babai's rounding, every point has an image of the site within half the root of the sum of
        # the basis vectors' squares
        center, reach = _cell_ball(self.group)
        near = float(np.linalg.norm(self.group.lattice)) / 2
        return self.group.elements_near(center, (reach + near) * (1 + 1e-9), source=self.site)

    @cached_property
    def _sites(self) -> Array:
        return np.stack([g(self.site) for g in self._candidates])

    def corners(self) -> Array:
        """Return the domain's vertices (M, d), in the plane as a counter-clockwise ring.

        >>> from orbiflow.symmetry import wallpaper_group
        >>> DirichletDomain(wallpaper_group("p4"), [0.5, 0.25]).corners().round(9).tolist()
        [[0.0, 0.0], [1.0, 0.0], [0.5, 0.5]]
        """
        from scipy.spatial import Voronoi

        # neighbours are at most twice as far as the domain's farthest point
        reach = 2 * float(np.linalg.norm(self.group.lattice)) * (1 + 1e-9)
        sites = [g(self.site) for g in self.group.elements_near(self.site, reach)]
        diagram = Voronoi(np.stack(sites))
        place = diagram.vertices[diagram.regions[diagram.point_region[0]]]
        _, first = np.unique(place.round(9), axis=0, return_index=True)
        offset = place[first] - self.site
        order = np.arctan2(offset[:, 1], offset[:, 0]).argsort() if self.group.dim == 2 else ...
        return offset[order] + self.site

    def project(self, points: Points) -> Points:
        """Return the points (..., d) of the domain in the orbits of `points` (..., d).

        Differentiable almost everywhere for torch tensors.
        """
        wrapped = self.group.wrap(points)
        values: Any = wrapped
        plain: Array = values.detach().cpu().numpy() if is_tensor(values) else values
        flat = np.asarray(plain, dtype=np.float64).reshape(-1, self.group.dim)
        nearest = np.empty(len(flat), dtype=np.int64)
        for start in range(0, len(flat), 16384):  # bounds the distance table
            block = flat[start : start + 16384]
            squared = (self._sites**2).sum(axis=1) - 2.0 * block @ self._sites.T
            nearest[start : start + 16384] = squared.argmin(axis=1)
        chosen = nearest.reshape(plain.shape[:-1])
        linear = np.stack([g.linear for g in self._candidates])[chosen]
        shift = np.stack([g.translation for g in self._candidates])[chosen]
        offset = wrapped - cast_like(shift, wrapped)
        # inverse of an isometry: transpose of the linear part
        return (offset[..., None, :] @ cast_like(linear, wrapped))[..., 0, :]
