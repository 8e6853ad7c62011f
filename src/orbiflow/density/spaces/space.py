"""The base of all spaces: a chart, a group, measures, distances."""

from __future__ import annotations

import inspect
import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from functools import cached_property, lru_cache
from typing import Any, ClassVar, Self

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.data import Role
from orbiflow.density.spaces.axes import Axis
from orbiflow.density.spaces.frame import LatticeFrame, frame_of
from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.settings import as_choice, as_tensor, as_whole, is_a
from orbiflow.symmetry import (
    CrystallographicGroup,
    DirichletDomain,
    cast_like,
    identification_group,
    is_group_name,
)
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

MOST_MIDPOINTS = 10**8
"""The most points of a grid."""

named_group = lru_cache(maxsize=4)(identification_group)
"""The group of a space by its name, made once."""


SPACE_CLASSES: dict[str, type[Space]] = {}
"""The classes of spaces that `make_space` and files know, by their names."""


class Space(ABC):
    """R^d modulo a crystallographic group (design points 12 and 19), or a sphere modulo a finite one.

    Points in the chart are float tensors (..., d), and any point of an orbit stands for it. Data are
    arrays (N, k) in the user's units.

    **The chart.** Its unit of length is such that the quotient has volume 1: the lattice's cell has the
    volume |G|. `domain` holds one point of each orbit, to which `project` brings all others. It is a
    Dirichlet domain, which is a convex polytope of volume 1 and not, in general, a cube: nothing may
    assume that coordinates are between 0 and 1, unless `has_square` says so. An integral over the space
    is one over the lattice's cell, divided by |G|: no domain is needed for it. Spheres of any dimension
    have no such chart (`UnitVectorSpace`): their chart points are unit vectors.

    **A space of your own** is a subclass with a `group`, the names of its `columns` and what is
    abstract below. With a `name` in its class body it can be saved, as `make_space(name,
    **space.settings())` makes it again.

    - `name`: Its name, such as "klein-bottle".
    - `group`: The group that acts on R^d, under which densities are invariant.
    - `data_group`: The same group in the data's own coordinates, if data are points that it moves.
    - `columns`: Names of the data's columns.
    - `unit`: Unit of the data, None if the natural measure is in steradians.
    - `is_round`: Whether the natural measure is the area of the unit sphere.
    - `has_square`: Whether the domain is the unit cube, with the site (1/2, ..., 1/2).
    - `has_chart`: Whether chart points are in R^d. On spheres of any dimension they are unit vectors
      (`UnitVectorSpace`).
    - `axes`: The circles and lines of a torus, otherwise none.
    - `parts`: The spaces of a product, otherwise none.

    Spaces of the same class, settings and group are equal.
    """

    name: str
    group: CrystallographicGroup
    data_group: CrystallographicGroup | None = None
    columns: tuple[str, ...]
    unit: str | None = None
    is_round: ClassVar[bool] = False
    has_square: ClassVar[bool] = False
    has_chart: ClassVar[bool] = True
    axes: tuple[Axis, ...] = ()
    parts: tuple[Space, ...] = ()

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if not isinstance(cls.__dict__.get("name"), str):
            return
        holder = SPACE_CLASSES.setdefault(cls.name, cls)
        if (holder.__module__, holder.__qualname__) != (cls.__module__, cls.__qualname__):
            raise OrbiflowError(
                f"the space {cls.name!r} is a {holder.__name__}: choose another name"
            )
        SPACE_CLASSES[cls.name] = cls

    @classmethod
    @abstractmethod
    def for_data(cls, data: Array, *, unit: str = "radians", seed: int = 0) -> Self:
        """Return the space that suits data (N, k) in its dimension, unit and rotation."""

    @property
    def data_name(self) -> str:
        """The name of the space whose data, in their columns, are like its own."""
        return self.name

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
        return self.has_square and self.dim == 2

    @property
    def is_surface(self) -> bool:
        """Whether the square, its edges glued, is a surface that can be turned and flowed on."""
        return self.is_planar

    @property
    def is_of_angles(self) -> bool:
        """Whether it is a torus whose columns are all angles."""
        return False

    @property
    def dimensions(self) -> str:
        """The dimension, as a message says it that asks for a chart of the square."""
        return str(self.dim) if self.has_square else f"{self.dim}, but no square for a chart"

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
        """The fundamental domain: the unit cube or, where that is none, a round one."""
        return DirichletDomain(self.group, np.full(self.dim, 0.5) if self.has_square else None)

    @cached_property
    def frame(self) -> LatticeFrame:
        """The group on a lattice whose coordinates kernels are products in."""
        return frame_of(self.group)

    def project(self, points: Tensor) -> Tensor:
        """Return the canonical representatives, in `domain`, of points (..., d).

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

    def log_kernel_factor(self, points: Tensor, measure: str) -> Tensor:
        """Return what to add to a log density per area of kernels: of the chart, or round area."""
        if not self.is_round:
            return self.log_density_factor(points, measure)
        if measure == CHART:
            return self.log_area(points)
        shift = math.log(self.volume) if measure == "uniform" else 0.0
        return torch.full_like(points[..., 0], shift)

    def retracted(self, points: Tensor) -> Tensor:
        """Return chart points (..., d) for points that were moved a little off the chart."""
        return points

    def of_axes(self, axes: Sequence[int]) -> Space:
        """Return the space of some chart coordinates alone, by their numbers from 0.

        Raises `OrbiflowError` if these have no meaning without the others.
        """
        del axes
        raise OrbiflowError(
            f"on the {self.name} no coordinate has a meaning without the others: marginal and "
            "conditional densities are of angles on a torus, or of columns beside another space"
        )

    @property
    def together(self) -> int:
        """How many of the first chart coordinates have a meaning together alone."""
        return self.chart_dim

    def factors_of(self, axes: Sequence[int]) -> list[int]:
        """Return which concentrations of kernels are of some chart coordinates."""
        return list(axes)

    def displacement(self, start: Tensor, end: Tensor) -> Tensor:
        """Return the shortest flat displacement (..., d) from `start` to an image of `end`."""
        nearest: tuple[Tensor, Tensor] | None = None
        for move in self._moves(start, self.project(end)):
            square = (move**2).sum(dim=-1)
            if nearest is None:
                nearest = move, square
                continue
            nearer = square < nearest[1]
            best = torch.where(nearer[..., None], move, nearest[0])
            nearest = best, torch.minimum(square, nearest[1])
        assert nearest is not None
        return nearest[0]

    def _moves(self, start: Tensor, end: Tensor) -> Iterator[Tensor]:
        """Yield displacements (..., d) to images of `end`, the shortest one among them."""
        frame = self.frame.group
        lattice, inverse = (cast_like(a, end).T for a in (frame.lattice, frame.inverse_lattice))
        # with orthogonal vectors rounding finds the nearest image, else a neighbour of it
        near = (0.0,) if self.frame.is_rectangular else (-1.0, 0.0, 1.0)
        for g in frame.cosets:
            turned, shift = g.push(end), cast_like(g.translation, end)
            steps = ((turned + shift - start).detach() @ inverse).round()
            for beside in itertools.product(near, repeat=self.dim):
                # lattice vectors first: where they are whole numbers no digit is lost
                yield turned + (shift - (steps + steps.new_tensor(beside)) @ lattice) - start

    def roles(self, width: int) -> tuple[Role | None, ...]:
        """Return what each of so many columns of data is; None is a coordinate of the space."""
        return (None,) * width

    @property
    def periods(self) -> tuple[float, ...]:
        """After what each column of the data begins again, 0 where it does not."""
        return (0.0,) * len(self.columns)

    def data_unit(self, width: int) -> str | None:
        """Return the unit of data of so many columns, None if they have none."""
        del width
        return None

    def form_in(self, names: Sequence[str]) -> str | None:
        """Return how rotations are written in columns of these names; refuse another form's names."""
        del names
        return None

    def distance(self, start: Tensor, end: Tensor) -> Tensor:
        """Return the geodesic distance (...,) in the flat metric of the chart, over group images."""
        return linalg.vector_norm(self.displacement(start, end), dim=-1)

    def squared_distances(self, start: Tensor, end: Tensor) -> Tensor:
        """Return squares (N, M) of `distance` between all of `start` (N, d) and `end` (M, d)."""
        table = self.displacement(start[:, None], end[None])
        return (table**2).sum(dim=-1)

    def features(self, points: Tensor, which: slice = slice(None)) -> Tensor:
        """Return what kernels see of the E images of points (N, d), themselves first: (E, N, m).

        They are cosines and sines of the coordinates in the frame's basis, or unit vectors on round
        spaces; `which` chooses among the images. The function is differentiable.
        """
        frame = self.frame.group
        linear, shift, inverse = (
            cast_like(a, points)
            for a in (frame.linear_parts[which], frame.translations[which], frame.inverse_lattice)
        )
        images = points @ linear.mT + shift[:, None]
        angles = 2 * math.pi * (images @ inverse.T)
        return torch.cat([angles.cos(), angles.sin()], dim=-1)

    @property
    def spheres(self) -> tuple[int, ...]:
        """The dimensions of the spheres on which kernels are products: circles, unless it is round.

        Feature i is a coordinate of sphere i modulo their number.
        """
        return (self.dim,) if self.is_round else (1,) * self.dim

    @property
    def moves(self) -> Array:
        """How the images that kernels have permute these spheres: (E, F, F)."""
        if self.is_round:
            return np.ones((self.kernel_images, 1, 1))
        count, frame = self.frame.own, self.frame.group
        return np.abs(frame.inverse_lattice @ frame.linear_parts[:count] @ frame.lattice).round()

    @property
    def kernel_images(self) -> int:
        """The number of images, the first ones, that kernels have; the others are those of points."""
        return self.frame.own

    def from_features(self, features: Tensor) -> Tensor:
        """Return the canonical points (N, d) that have these features (N, m), or an image of them."""
        return self.project(self.lifted(features))

    def lifted(self, features: Tensor) -> Tensor:
        """Return chart points (N, d) that have these features (N, m) themselves: no image is taken.

        A kernel that is not the same along all axes must stay where it is.
        """
        cos, sin = features.chunk(2, dim=-1)
        return self.from_turns(torch.atan2(sin, cos) / (2 * math.pi) % 1)

    def from_turns(self, turns: Tensor) -> Tensor:
        """Return chart vectors (..., d) of coordinates in the basis of the frame."""
        return turns @ cast_like(self.frame.group.lattice, turns).T

    def step_angle(self, step: float) -> float:
        """Return, in radians of the kernels, a step in the unit of the data."""
        return 2 * math.pi * step / (self.volume ** (1 / self.dim) * float(self.sides.max()))

    def midpoints(self, resolution: int) -> Tensor:
        """Return points (resolution^d, d) at which a mean is an integral over the space, float64.

        They are the midpoints of an even grid on the unit cube or, where that is not the domain, on the
        lattice's cell.
        """
        as_whole(resolution, "resolution", 1, 10**6)
        if resolution**self.dim > MOST_MIDPOINTS:
            raise OrbiflowError(
                f"a grid of {resolution} points along each of {self.dim} axes has too many: take a "
                f"resolution of {int(MOST_MIDPOINTS ** (1 / self.dim))} at most"
            )
        t = (torch.arange(resolution, dtype=torch.float64) + 0.5) / resolution
        grid = torch.stack(torch.meshgrid(*[t] * self.dim, indexing="ij"), dim=-1)
        return self._of_cell(grid.reshape(-1, self.dim))

    def uniform(self, count: int, generator: torch.Generator) -> Tensor:
        """Draw chart points that are uniform in natural measure."""
        drawn = torch.rand(count, self.dim, dtype=torch.float64, generator=generator)
        return drawn if self.has_square else self.project(self._of_cell(drawn))

    def _of_cell(self, shares: Tensor) -> Tensor:
        """Return points (N, d) of the cube, or of the lattice's cell, from numbers between 0 and 1."""
        return shares if self.has_square else shares @ cast_like(self.group.lattice, shares).T

    def __eq__(self, other: object) -> bool:
        """Return whether both have the same class, settings and group.

        From where angles are written makes no other space.
        """
        if not isinstance(other, Space):
            return NotImplemented
        if self.parts:
            return self.parts == other.parts
        here, there = ({**space.settings(), "from_zero": None} for space in (self, other))
        return (
            type(other) is type(self)
            and here == there
            and (not self.has_chart or other.group == self.group)
        )

    def __hash__(self) -> int:
        return hash((type(self), self.dim))

    @cached_property
    def sides(self) -> Tensor:
        """The lengths (d,) of the frame's sides, the kernels' periods, shorter alike if it is oblique.

        Their product is the volume of its cell.
        """
        lengths: Array = np.linalg.norm(self.frame.group.lattice, axis=0)
        share = self.frame.group.cell_volume / float(np.prod(lengths))
        return torch.tensor(lengths * share ** (1 / self.dim))

    def __repr__(self) -> str:
        options = ", ".join(f"{k}={v!r}" for k, v in self.settings().items())
        return f"{type(self).__name__}({options})"


def by_sphere(features: Tensor, count: int) -> Tensor:
    """Return features (..., m) of kernels as the coordinates (..., m / F, F) on each of F spheres."""
    return features.reshape(*features.shape[:-1], -1, count)


SPACES = ("torus", "sphere", "klein-bottle", "projective-plane")
"""Names of the four spaces with a canonical square."""


def space_class(name: str) -> type[Space]:
    """Return the class of a space, by its name."""
    from orbiflow.density import spaces  # whose classes import this file

    # whose files hold all classes
    _ = spaces.ProductSpace, spaces.Sphere, spaces.RotationSpace, spaces.QuotientSpace
    if not is_a(name, str) or name not in SPACE_CLASSES:
        raise OrbiflowError(
            f"unknown space {name!r}; there are {', '.join(SPACE_CLASSES)}, and groups such as p4m, "
            "hantzsche-wendt or 'P 21 21 21'"
        )
    return SPACE_CLASSES[name]


def make_space(name: str, **options: Any) -> Space:
    """Return a space by its name, with the options of its class.

    The name may also be that of a group (`orbiflow.symmetry.group_by_name`), with its `cell`.

    >>> make_space("torus", axes=2, unit="degrees")
    Torus(axes=2, unit='degrees')
    >>> make_space("hantzsche-wendt").dim
    3
    """
    if is_group_name(name) and name not in SPACE_CLASSES:
        name, options = "quotient", {"group": name, **options}
    kind = space_class(name)
    wrong = [key for key in options if key not in inspect.signature(kind).parameters]
    if wrong:
        raise OrbiflowError(f"the {name} has no option {', '.join(wrong)}")
    return kind(**options)


def space_for(
    name: str, data: Array, *, unit: str = "radians", seed: int = 0, form: str | None = None
) -> Space:
    """Return the space of a name that suits data (N, k); `form` says how rotations are written."""
    if form is not None:
        return make_space(name, form=form, unit=unit)
    if name in SPACE_CLASSES or not is_group_name(name):
        return space_class(name).for_data(data, unit=unit, seed=seed)
    return make_space(name)


def check_measure(measure: str, space: Space | None = None) -> None:
    """Check that a measure is one of `MEASURES`, and that the space has such a one if it is given."""
    as_choice(measure, MEASURES, "measure")
    if space is not None and measure == CHART and not space.has_square:
        raise SettingError(
            f"{{measure}} square is for spaces that have one ({', '.join(SPACES)}), not for the "
            f"{space.name}: choose natural or uniform"
        )
