"""Isohedral classes, with their templates, groups, operators and lattice freedom."""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import Any, NamedTuple, TypeVar, cast, overload

import numpy as np

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_array, described, is_tensor
from orbiflow.symmetry import (
    CrystallographicGroup,
    Isometry,
    Line,
    Points,
    cast_like,
    reduced_basis,
    rotation,
    rotation_matrix,
    symmetry_elements,
    transflection,
)
from orbiflow.tiles.tilings.class_table import (
    CLASS_TABLE,
    TYPE_TABLE,
    ClassRow,
    Coefficients,
    OperatorRow,
    RotationRow,
    TypeRow,
)
from orbiflow.tiles.tilings.incidence import IncidenceSymbol
from orbiflow.tiles.tilings.tile_edges import (
    EdgeClass,
    EdgeIdentification,
    EdgeImage,
    Edges,
    edge_classes,
    edges,
)
from orbiflow.tiles.tilings.tiling import Tile, coset_and_cell


class PentagonGauge(NamedTuple):
    """A family of pentagons with a rotation centre at p0 and another at p2.

    p0 is the origin, p2 = (distance, 0) and p1 is free; p4 is p1 turned by `degrees_0` about p0
    and p3 is p1 turned by `degrees_2` about p2. Then p3 + p4, and with it the lattice and the
    group, depend on p2 alone. `default` is p1 at shape (0, 0).
    """

    distance: float
    default: tuple[float, float]
    degrees_0: float
    degrees_2: float


# The distances give all templates the area of the hexagon with unit sides, 3 sqrt(3) / 2.
_FLORET_DISTANCE = math.sqrt(6.0)
_CAIRO_DISTANCE = 3.0**0.75

PENTAGONS: dict[str, PentagonGauge] = {
    "floret": PentagonGauge(
        _FLORET_DISTANCE,
        # with sides 2, 1, 1, 1, 2 and angles 60, 120, ... degrees, p2 is (5, sqrt(3)) / 2
        (_FLORET_DISTANCE * 5 / 7, -_FLORET_DISTANCE * math.sqrt(3.0) / 7),
        60.0,
        -120.0,
    ),
    "cairo": PentagonGauge(
        _CAIRO_DISTANCE,
        # apex of the isosceles triangle over p0 p2 with base angles of 30 degrees
        (_CAIRO_DISTANCE / 2, -_CAIRO_DISTANCE / (2 * math.sqrt(3.0))),
        90.0,
        -90.0,
    ),
}


def hexagon() -> Array:
    """Return (6, 2) vertices p_k = (cos 60k, sin 60k), float64, counter-clockwise."""
    x, y = 0.5, math.sqrt(3.0) / 2
    return np.array([(1.0, 0.0), (x, y), (-x, y), (-1.0, 0.0), (-x, -y), (x, -y)])


def pentagon(gauge: PentagonGauge, shape: Points) -> Points:
    """Return vertices (..., 5, 2) of the pentagon whose p1 is moved by `shape` (..., 2).

    Counter-clockwise for small shapes. Differentiable in `shape`.

    >>> tile = pentagon(PENTAGONS["cairo"], np.zeros(2))
    >>> sides = np.linalg.norm(np.roll(tile, -1, axis=0) - tile, axis=1)
    >>> [round(float(side), 6) for side in sides / sides[0]]
    [1.0, 1.0, 1.0, 0.732051, 1.0]
    """

    def turn(degrees: float, vector: Points) -> Points:
        matrix = rotation_matrix(math.radians(degrees))
        if not is_tensor(vector):  # rounded as torch rounds it, so that both give the same template
            turned = vector[..., :1] * matrix[:, 0] + vector[..., 1:] * matrix[:, 1]
            return cast(Points, turned)
        return vector @ cast_like(matrix, shape).T

    functions = array_functions(shape)
    p1 = shape + cast_like(np.array(gauge.default), shape)
    p0 = functions.zeros_like(p1)
    p2 = p0 + cast_like(np.array((gauge.distance, 0.0)), shape)
    p3 = p2 + turn(gauge.degrees_2, p1 - p2)
    p4 = turn(gauge.degrees_0, p1)
    return functions.stack([p0, p1, p2, p3, p4], -2)


_ROUNDING_ERROR = 1e-9


def commutant(linear_parts: Array) -> Array:
    """Return an orthonormal basis (m, 2) of the (a, b) whose [[a, b], [b, -a]] commutes with a group.

    The mean over the group projects on them: R X R^T turns (a, b) as R turns directions, twice as
    far. The basis is made by Gram-Schmidt in the order a, b, so that it depends only on the group;
    saved parameters are coordinates in it.

    >>> commutant(np.array([np.eye(2), np.diag([1.0, -1.0])])).tolist()
    [[1.0, 0.0]]
    """
    units = np.array([[[1.0, 0.0], [0.0, -1.0]], [[0.0, 1.0], [1.0, 0.0]]])
    turned = np.einsum("gij,kjl,gml->kim", linear_parts, units, linear_parts) / len(linear_parts)
    basis: list[Array] = []
    for a, b in turned[:, 0]:
        rest = np.array([a, b])
        for vector in basis:
            rest = rest - (rest @ vector) * vector
        if np.linalg.norm(rest) > _ROUNDING_ERROR:
            rest = rest / np.linalg.norm(rest)
            # exact for a group in the frame of its axes
            near = np.round(rest)
            basis.append(near if np.abs(rest - near).max() < _ROUNDING_ERROR else rest)
    return np.array(basis).reshape(-1, 2)


def stretch_matrix(basis: Array, parameters: Points) -> Points:
    """Return unimodular symmetric maps (..., 2, 2) for parameters (..., m) over a basis of `commutant`.

    exp [[a, b], [b, -a]], where (a, b) = parameters @ basis. Differentiable, at zero too.
    """
    both = parameters @ cast_like(basis, parameters)
    a, b = both[..., 0], both[..., 1]
    cosh, sinhc = _cosh_sinhc(a * a + b * b)
    rows = [cosh + sinhc * a, sinhc * b, sinhc * b, cosh - sinhc * a]
    return array_functions(parameters).stack(rows, -1).reshape(*parameters.shape[:-1], 2, 2)


def array_functions(values: Any) -> Any:
    """Return the library that these values belong to, of which functions of both are used."""
    if not is_tensor(values):
        return np
    import torch

    return torch


# of NumPy arrays, rounded as torch rounds them
_cosh, _sinh = (np.vectorize(f, otypes=[float]) for f in (math.cosh, math.sinh))


def _cosh_sinhc(square: Any) -> tuple[Any, Any]:
    """Return cosh r and sinh(r) / r as functions of r^2, by their series where the root would hurt."""
    xp = array_functions(square)
    hyperbolic_cosh, hyperbolic_sinh = (xp.cosh, xp.sinh) if is_tensor(square) else (_cosh, _sinh)
    small = square < 1e-2
    root = xp.sqrt(xp.where(small, xp.ones_like(square), square))
    s = xp.where(small, square, xp.zeros_like(square))
    cosh = 1 + s / 2 * (1 + s / 12 * (1 + s / 30 * (1 + s / 56 * (1 + s / 90))))
    sinhc = 1 + s / 6 * (1 + s / 20 * (1 + s / 42 * (1 + s / 72 * (1 + s / 110))))
    return (
        xp.where(small, cosh, hyperbolic_cosh(root)),
        xp.where(small, sinhc, hyperbolic_sinh(root) / root),
    )


EdgePair = TypeVar("EdgePair", EdgeIdentification, EdgeImage)


class PaperOperator(NamedTuple):
    """One symmetrization operator of the paper: V -> sum_{k < terms} g^-k o V o g^k.

    `terms` is K for the (c, K)-rotation and 2 for a transflection (paper, section 4).
    """

    isometry: Isometry
    terms: int


@dataclass(frozen=True, eq=False)
class IsohedralClass:
    """A type of tiling by one shape, as a template polygon and a wallpaper group.

    Every tile of the class is the image of the template (with some shape parameters) under a
    diffeomorphism that commutes with the group, followed by a map of the lattice freedom and a
    similarity. Paper, section "Escherization"; design points 7, 8 and 18.

    >>> ih4 = isohedral_class("IH4")
    >>> ih4.group_name, ih4.group().order, ih4.template().shape, ih4.stretch_dim, ih4.shape_dim
    ('p2', 2, (6, 2), 2, 0)
    >>> ih26 = isohedral_class("IH26")
    >>> ih26.group_name, ih26.stabiliser_name, ih26.symbol
    ('cmm', 'D1', 'a+a-b+cb- a+b-c')
    """

    name: str
    row: TypeRow

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[str]]:
        return isohedral_class, (self.name,)  # there is one of each in a process

    @property
    def group_name(self) -> str:
        """The wallpaper group, such as "pgg"."""
        return self.row.group

    @property
    def symbol(self) -> str:
        """The incidence symbol, after Grünbaum and Shephard."""
        return self.row.symbol

    @cached_property
    def has_reflections(self) -> bool:
        """Whether the group has mirrors or glide reflections."""
        return any(g.determinant < 0 for g in self._group.cosets)

    @property
    def stabiliser(self) -> tuple[Isometry, ...]:
        """The elements of the group that take the template onto itself, the identity first."""
        return self._incidence.stabiliser

    @property
    def stabiliser_name(self) -> str:
        """The symmetry of the class's tiles: "D1" for a mirror, "C2" for a half-turn, "C1" for none."""
        mirrored = any(g.determinant < 0 for g in self.stabiliser)
        return f"{'D' if mirrored else 'C'}{len(self.stabiliser) // (1 + mirrored)}"

    @cached_property
    def identified_edges(self) -> tuple[EdgeIdentification, ...]:
        """Which edge of the template (edge k from p_k to p_{k+1}) is mapped onto which, and by what."""
        return tuple(sorted(self._edges.identifications, key=attrgetter("first")))

    @cached_property
    def edge_classes(self) -> tuple[EdgeClass, ...]:
        """The template's edges, those that are images of each other together."""
        return edge_classes(self._edges)

    @property
    def divisor(self) -> int:
        """A divisor of the number of steps round a tile whose edges of one class have as many each."""
        return math.gcd(*(len(edge_class.edges) for edge_class in self.edge_classes))

    @property
    def shape_dim(self) -> int:
        """Number of shape parameters of the template: 2 for the pentagons of the nine, else 0."""
        return 0

    @property
    def stretch_dim(self) -> int:
        """Number of parameters of the lattice freedom: 2, 1 or 0 (`commutant` of the point group)."""
        return len(self._freedom)

    @overload
    def template(self, shape: None = None) -> Array: ...
    @overload
    def template(self, shape: Points) -> Points: ...
    def template(self, shape: Any = None) -> Any:
        """Return vertices (..., K, 2) of the template, counter-clockwise.

        Parameters are (..., shape_dim), NumPy or torch (then differentiable); for the pentagons the
        displacement of p1 from its default. None means the default, as a NumPy array. Raises
        `OrbiflowError` if the last axis has another length.
        """
        if shape is None:
            return self._default.copy()
        return self._shaped(self._parameters(shape, self.shape_dim, "shape"))

    def stretch(self, parameters: Points) -> Points:
        """Return unimodular maps L (..., 2, 2) that commute with the point group.

        Parameters are (..., stretch_dim), NumPy or torch (then differentiable). Raises `OrbiflowError`
        if their last axis has another length.
        """
        checked = self._parameters(parameters, self.stretch_dim, "stretch")
        return stretch_matrix(self._freedom, checked)

    def group(self) -> CrystallographicGroup:
        """Return the group of the template; the same for all shape parameters."""
        return self._group

    def paper_operators(self) -> tuple[PaperOperator, ...]:
        """Return the paper's symmetrization operators, outermost first: V = O_1(O_2(...(F))).

        There are none for other classes than the nine.
        """
        return ()

    def facts(self) -> dict[str, str]:
        """Return what a table says of the class."""
        elements = symmetry_elements(self._group)
        orders = sorted({center.order for center in elements.centers})
        angles = {True: set[int](), False: set[int]()}  # of mirrors, and of glide lines
        for line in elements.lines:
            x, y = line.line.direction
            angles[line.is_mirror].add(round(math.degrees(math.atan2(y, x))) % 180)
        return {
            "class": self.name,
            "group": self.group_name,
            "tile": self.stabiliser_name,
            "symbol": self.symbol,
            "edges": str(len(self._default)),
            "identified": " ".join(pair.brief for pair in self.identified_edges),
            "rotations": ", ".join(map(str, orders)) or "-",
            "mirrors": str(len(angles[True]) or "-"),
            "glides": str(len(angles[False]) or "-"),
            "stretch": {0: "none", 1: "one axis", 2: "any"}[self.stretch_dim],
        }

    @cached_property
    def _incidence(self) -> IncidenceSymbol:
        return IncidenceSymbol(self.row.valences, self.row.symbol)

    @cached_property
    def _default(self) -> Array:
        return self._incidence.template

    @cached_property
    def _group(self) -> CrystallographicGroup:
        return self._incidence.group(self.row.group)

    @cached_property
    def _edges(self) -> Edges:
        return edges(Tile(self._default, self._group))

    @cached_property
    def _freedom(self) -> Array:
        return commutant(self._group.linear_parts)

    def _shaped(self, shape: Any) -> Any:
        vertices = cast_like(self._default, shape)
        return array_functions(shape).broadcast_to(vertices, (*shape.shape[:-1], *vertices.shape))

    def _parameters(self, values: Any, size: int, what: str) -> Any:
        if not is_tensor(values):
            values = as_array(values, f"{what} parameters", (...,))
        elif not values.is_floating_point():
            values = values.double()
        if values.ndim == 0 or values.shape[-1] != size:
            raise OrbiflowError(
                f"{self.name} has {size} {what} parameters: expected shape (..., {size}), "
                f"got {tuple(values.shape)}"
            )
        return values

    def __repr__(self) -> str:
        return f"IsohedralClass({self.name}, {self.group_name})"


@dataclass(frozen=True, eq=False, repr=False)
class PaperClass(IsohedralClass):
    """One of the paper's nine classes, with template and operators as the paper gives them."""

    paper: ClassRow

    @cached_property
    def identified_edges(self) -> tuple[EdgeIdentification, ...]:
        """Which edge of the template (edge k from p_k to p_{k+1}) is mapped onto which, and by what."""
        return tuple(map(self._exact, super().identified_edges))

    @cached_property
    def edge_classes(self) -> tuple[EdgeClass, ...]:
        """The template's edges, those that are images of each other together."""
        return tuple(
            EdgeClass(
                edge_class.edge,
                tuple(map(self._exact, edge_class.folds)),
                tuple(map(self._exact, edge_class.images)),
            )
            for edge_class in super().edge_classes
        )

    def _exact(self, pair: EdgePair) -> EdgePair:
        """Return an image with the isometry that the group has: searches feel the last digits."""
        coset, cell = coset_and_cell(self._group, pair.isometry)
        shift = np.array(cell) @ self._group.lattice.T + self._group.translations[coset]
        return pair._replace(isometry=Isometry(self._group.linear_parts[coset], shift))

    @property
    def shape_dim(self) -> int:
        """Number of shape parameters of the template: 0 for hexagons, 2 for pentagons."""
        return 2 if self._gauge else 0

    @property
    def _gauge(self) -> PentagonGauge | None:
        return PENTAGONS.get(self.paper.template)

    def paper_operators(self) -> tuple[PaperOperator, ...]:
        """Return the paper's symmetrization operators, outermost first: V = O_1(O_2(...(F)))."""
        return tuple(self._operator(row) for row in self.paper.operators)

    @cached_property
    def _default(self) -> Array:
        return pentagon(self._gauge, np.zeros(2)) if self._gauge else hexagon()

    @cached_property
    def _group(self) -> CrystallographicGroup:
        columns = [
            rotation_matrix(math.radians(vector.degrees)) @ self._point(vector.coefficients)
            for vector in self.paper.lattice
        ]
        # another basis of the paper's lattice: with the shortest, |k_i| <= Omega is isotropic
        basis = reduced_basis(np.stack(columns, axis=1))
        generators = [operator.isometry for operator in self.paper_operators()]
        return CrystallographicGroup.generate(basis, generators, name=self.row.group)

    def _shaped(self, shape: Any) -> Any:
        return pentagon(self._gauge, shape) if self._gauge else super()._shaped(shape)

    def _point(self, coefficients: Coefficients) -> Array:
        terms = [c * self._default[k] for k, c in coefficients.items()]
        return np.sum(terms, axis=0) if terms else np.zeros(2)

    def _operator(self, row: OperatorRow) -> PaperOperator:
        if isinstance(row, RotationRow):
            return PaperOperator(rotation(self._point(row.center), row.order), row.order)
        line = Line(self._point(row.point), self._point(row.direction))
        return PaperOperator(transflection(line, float(np.hypot(*self._point(row.shift)))), 2)


CLASSES: dict[str, IsohedralClass] = {
    name: PaperClass(name, TYPE_TABLE[name], row) for name, row in CLASS_TABLE.items()
}
"""The nine classes by name: every shape that tiles isohedrally occurs in one of them."""

ISOHEDRAL_TYPES: dict[str, IsohedralClass] = {
    name: CLASSES.get(name) or IsohedralClass(name, row) for name, row in TYPE_TABLE.items()
}
"""All 81 isohedral types of tilings by polygons, by name; the nine classes are among them."""


def isohedral_class(name: str | int | IsohedralClass) -> IsohedralClass:
    """Return the class called `name`, one of `ISOHEDRAL_TYPES`.

    "IH4", "ih4", "IH04", "4" and 4 are the same; a class is returned as it is.

    Raises `OrbiflowError` for anything but the 81.

    >>> isohedral_class("ih04")
    IsohedralClass(IH4, p2)
    """
    if isinstance(name, IsohedralClass):
        return name
    match = re.fullmatch(r"(?:IH[\s_-]?)?0*(\d+)", str(name).strip(), flags=re.IGNORECASE)
    number = int(match[1]) if match and len(match[1]) < 3 else 0
    key = f"IH{number}"
    if key in ISOHEDRAL_TYPES:
        return ISOHEDRAL_TYPES[key]
    if 0 < number <= 93:
        raise OrbiflowError(
            f"{key} is a type of tiles with marks: its outlines are those of another of the 81 types "
            "of polygons, which `orbiflow classes` lists"
        )
    raise OrbiflowError(
        f"unknown isohedral class {described(name)}; there are {', '.join(CLASSES)}, which have every "
        "shape of tile, and the other types that `orbiflow classes` lists"
    )
