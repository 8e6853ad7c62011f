"""The base of the four identification spaces: a chart, a group, measures, distances."""

from __future__ import annotations

import inspect
import math
from abc import ABC, abstractmethod
from functools import cached_property, lru_cache
from typing import Any, ClassVar, Self

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arguments import as_choice, as_tensor, is_a
from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup, DirichletDomain, identification_group
from orbiflow.typed_torch import linalg

MEASURES = ("natural", "square", "uniform")
"""Measures of densities. "natural" is the user's units, or round area in steradians; "square" is the
area of the canonical square; "uniform" is the uniform distribution, for which a density of 1 means no
structure at all.

Functions of chart points (`log_prob`, `entropy`) use the square by default, as torch does for a
distribution over them. Functions of data in the user's units (`DensityEstimator`, the commands) and
pictures use the natural measure."""

CHART = "square"
"""The default measure of functions of chart points."""

named_group = lru_cache(maxsize=4)(identification_group)
"""The group of a space by its name, made once."""


class Space(ABC):
    """An identification space: the unit cube modulo a crystallographic group (design point 12).

    Points in the chart are float tensors (..., d); `project` brings them to the canonical cube
    [0, 1)^d. Data are arrays (N, k) in the user's units. Spheres of any dimension have no such chart
    (`UnitVectorSpace`): their chart points are unit vectors.

    - `name`: Its name, such as "klein-bottle".
    - `group`: The group that acts on R^d, under which densities are invariant.
    - `columns`: Names of the data's columns.
    - `unit`: Unit of angles, None if the natural measure is in steradians.
    - `is_round`: Whether the natural measure is the area of the unit sphere.
    - `has_chart`: Whether chart points are those of the unit cube, not unit vectors.

    Spaces of the same class, settings and group are equal.
    """

    name: str
    group: CrystallographicGroup
    columns: tuple[str, ...]
    unit: str | None = None
    is_round: ClassVar[bool] = False
    has_chart: ClassVar[bool] = True

    @classmethod
    @abstractmethod
    def for_data(cls, data: Array, *, unit: str = "radians", seed: int = 0) -> Self:
        """Return the space that suits data (N, k) in its dimension, unit and rotation."""

    @property
    def dim(self) -> int:
        """The dimension d of the space."""
        return self.group.dim

    @property
    def chart_dim(self) -> int:
        """The number of a chart point's coordinates."""
        return self.dim

    @property
    def is_planar(self) -> bool:
        """Whether the chart is the square, on which densities are drawn and tabulated."""
        return self.has_chart and self.dim == 2

    @property
    def dimensions(self) -> str:
        """The dimension, as a message says it that asks for two."""
        return str(self.dim) if self.has_chart else f"{self.dim} and no chart of the square"

    @property
    def widths(self) -> tuple[int, ...]:
        """The numbers of columns that data may have."""
        return (len(self.columns),)

    @property
    def is_torus(self) -> bool:
        """Whether the group is that of the integer translations alone."""
        if not self.has_chart or self.group.order > 1:
            return False
        return np.array_equal(self.group.lattice, np.eye(self.dim))

    @cached_property
    def domain(self) -> DirichletDomain:
        """The canonical cube, as the Dirichlet domain of its centre."""
        return DirichletDomain(self.group, np.full(self.dim, 0.5))

    def project(self, points: Tensor) -> Tensor:
        """Return canonical representatives in [0, 1]^d of points (..., d).

        The function is differentiable almost everywhere.
        """
        return self.domain.project(self._checked(points))

    def _checked(self, points: Tensor) -> Tensor:
        points = as_tensor(points, "points")
        if not points.dim() or points.shape[-1] != self.chart_dim:
            raise OrbiflowError(
                f"expected points (..., {self.chart_dim}), got {tuple(points.shape)}"
            )
        return points

    def log_area(self, points: Tensor) -> Tensor:
        """Return the logarithm of natural area over chart area (...,) at points (..., d)."""
        return torch.full_like(points[..., 0], math.log(self.volume))

    @property
    @abstractmethod
    def volume(self) -> float:
        """The natural measure of the whole space."""

    @abstractmethod
    def to_chart(self, data: ArrayLike) -> Tensor:
        """Return the canonical points (N, d), float64, of data (N, k)."""

    @abstractmethod
    def from_chart(self, points: Tensor) -> Array:
        """Return the data (N, k) of chart points (N, d)."""

    def cover(self, data: ArrayLike) -> Tensor:
        """Return points (N, d) of the plane for data (N, k): `to_chart`, or images of it."""
        return self.to_chart(data)

    @abstractmethod
    def data_gradient(self, data: ArrayLike, points: Tensor, gradient: Tensor) -> Array:
        """Return gradients (N, k) in the data's own coordinates.

        They are per unit of each angle; on round spaces per degree of latitude and longitude or, for
        unit vectors, the vector of R^3 that is tangent to the sphere, per radian.

        `points` are `cover` of the data (N, k), and `gradient` (N, d) those in the chart there.
        """

    def step_angle(self, step: float) -> float:
        """Return, in radians of the kernels, a step in the unit of the data."""
        return 2 * math.pi * step / self.volume ** (1 / self.dim)

    @abstractmethod
    def settings(self) -> dict[str, Any]:
        """Return the options that, with `name`, make the same space again, for JSON."""

    def log_density_factor(self, points: Tensor, measure: str) -> Tensor:
        """Return what to add to a log density of the square at points (..., d) for another measure."""
        check_measure(measure)
        if measure == "square":
            return torch.zeros_like(points[..., 0])
        shift = math.log(self.volume) if measure == "uniform" else 0.0
        return shift - self.log_area(points)

    def displacement(self, start: Tensor, end: Tensor) -> Tensor:
        """Return the shortest flat displacement (..., d) from `start` to an image of `end`."""
        images = self._images_of(end) - start
        nearest = (images**2).sum(dim=-1).argmin(dim=0)
        return torch.take_along_dim(images, nearest[None, ..., None], dim=0)[0]

    def distance(self, start: Tensor, end: Tensor) -> Tensor:
        """Return the geodesic distance (...,) in the flat metric of the chart, over group images."""
        return linalg.vector_norm(self.displacement(start, end), dim=-1)

    def squared_distances(self, start: Tensor, end: Tensor) -> Tensor:
        """Return squares (N, M) of `distance` between all of `start` (N, d) and `end` (M, d)."""
        images = self._images_of(end)
        dot = images @ start.mT
        square = (images**2).sum(dim=-1, keepdim=True) - 2 * dot
        return (square.amin(dim=0).mT + (start**2).sum(dim=-1, keepdim=True)).clamp_min(0.0)

    def features(self, points: Tensor, which: slice = slice(None)) -> Tensor:
        """Return what kernels see of the E images of points (N, d), themselves first: (E, N, m).

        They are cosines and sines of the lattice's angles, or unit vectors on round spaces; `which`
        chooses among the images. The function is differentiable.
        """
        angles = 2 * math.pi * self.group.images(points) / rectangle(self).to(points)
        return torch.cat([angles.cos(), angles.sin()], dim=-1)[which]

    def from_features(self, features: Tensor) -> Tensor:
        """Return the canonical points (N, d) that have these features (N, m)."""
        cos, sin = features.chunk(2, dim=-1)
        return self.project(torch.atan2(sin, cos) / (2 * math.pi) * rectangle(self))

    def uniform(self, count: int, generator: torch.Generator) -> Tensor:
        """Draw chart points that are uniform in natural measure."""
        return torch.rand(count, self.dim, dtype=torch.float64, generator=generator)

    def __eq__(self, other: object) -> bool:
        """Return whether both have the same class, settings and group."""
        if not isinstance(other, Space):
            return NotImplemented
        return (
            type(other) is type(self)
            and other.settings() == self.settings()
            and (not self.has_chart or other.group == self.group)
        )

    def __hash__(self) -> int:
        return hash((type(self), self.dim))

    @cached_property
    def sides(self) -> list[float]:
        """The lengths of the sides of the lattice's rectangle, in sides of the square."""
        lattice = self.group.lattice
        sides = np.diag(lattice)
        if not np.allclose(lattice, np.diag(sides)):
            raise OrbiflowError(f"the lattice of this {self.name} is not rectangular")
        return sides.tolist()

    @cached_property
    def _near(self) -> tuple[Array, Array]:
        # an image of one point is within a diagonal of any other, and both of their cube's centre
        diagonal = math.sqrt(self.dim)
        center = np.full(self.dim, 0.5)
        elements = self.group.elements_near(center, 2 * diagonal, source=center)
        return (np.stack([g.linear for g in elements]), np.stack([g.translation for g in elements]))

    def _images_of(self, points: Tensor) -> Tensor:
        """Return all images (E, ..., d) of canonical points that can be nearest to one of the cube."""
        linear, shift = (
            torch.as_tensor(a, dtype=points.dtype, device=points.device) for a in self._near
        )
        flat = self.project(points).reshape(1, -1, self.dim)
        moved = flat @ linear.mT + shift[:, None, :]
        return moved.reshape(len(linear), *points.shape)

    def __repr__(self) -> str:
        options = ", ".join(f"{k}={v!r}" for k, v in self.settings().items())
        return f"{type(self).__name__}({options})"


SPACES = ("torus", "sphere", "klein-bottle", "projective-plane")
"""Names of the four spaces whose chart is the square, or the cube."""


def space_class(name: str) -> type[Space]:
    """Return the class of a space, by its name."""
    from orbiflow.density import spaces  # whose classes import this file

    kinds = (
        spaces.Torus, spaces.Sphere, spaces.KleinBottle, spaces.ProjectivePlane, spaces.Hypersphere,
        spaces.ProjectiveSpace, spaces.RotationSpace, spaces.CubicOrientations,
        spaces.HexagonalOrientations,
    )  # fmt: skip
    known: dict[str, type[Space]] = {kind.name: kind for kind in kinds}
    if not is_a(name, str) or name not in known:
        raise OrbiflowError(f"unknown space {name!r}; there are {', '.join(known)}")
    return known[name]


def make_space(name: str, **options: Any) -> Space:
    """Return a space by its name, with the options of its class.

    >>> make_space("torus", dim=2, unit="degrees")
    Torus(dim=2, unit='degrees')
    """
    kind = space_class(name)
    wrong = [key for key in options if key not in inspect.signature(kind).parameters]
    if wrong:
        raise OrbiflowError(f"the {name} has no option {', '.join(wrong)}")
    return kind(**options)


def check_measure(measure: str) -> None:
    """Check that a measure is one of `MEASURES`."""
    as_choice(measure, MEASURES, "measure")


def rectangle(space: Space) -> Tensor:
    """Return the lengths (d,) of the sides of the lattice's rectangle, in sides of the square."""
    return torch.tensor(space.sides)


def row_count(count: int) -> str:
    """Return how many rows are as wrong as the one that a message names, if there are others.

    >>> row_count(1), row_count(3)
    ('', ' (3 such rows)')
    """
    return f" ({count} such rows)" if count > 1 else ""


def checked_table(data: ArrayLike, widths: tuple[int, ...], what: str) -> Array:
    """Return data as a finite float64 array (N, k)."""
    try:
        table = np.asarray(data, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise OrbiflowError(f"{what}: expected numbers, got {error}") from error
    if table.ndim != 2 or table.shape[1] not in widths:
        expected = " or ".join(f"(N, {k})" for k in widths)
        raise OrbiflowError(f"{what}: expected an array {expected}, got shape {table.shape}")
    bad = np.flatnonzero(~np.isfinite(table).all(axis=1))
    if len(bad):
        raise OrbiflowError(
            f"{what}: row {bad[0] + 1} has a missing or infinite value{row_count(len(bad))}: remove "
            f"{'it' if len(bad) == 1 else 'them'} first"
        )
    return table
