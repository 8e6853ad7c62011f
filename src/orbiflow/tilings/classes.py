"""The nine isohedral classes: template, group, paper's operators, lattice freedom."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, overload

import numpy as np
import torch

from orbiflow.arguments import described, numbers
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import (
    CrystallographicGroup,
    Isometry,
    Line,
    rotation,
    rotation_matrix,
    transflection,
)
from orbiflow.symmetry.isometry import Array, Points
from orbiflow.symmetry.lattices import reduced_basis
from orbiflow.tilings.class_table import (
    CLASS_TABLE,
    ClassRow,
    Coefficients,
    OperatorRow,
    RotationRow,
)
from orbiflow.tilings.edge_identification import EdgeIdentification
from orbiflow.tilings.lattice_freedom import commutant, stretch_matrix
from orbiflow.tilings.templates import template_vertices


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
    similarity. Paper, section "Escherization"; design points 7 and 8.

    >>> ih4 = isohedral_class("IH4")
    >>> ih4.group_name, ih4.group().order, ih4.template().shape, ih4.stretch_dim, ih4.shape_dim
    ('p2', 2, (6, 2), 2, 0)
    """

    name: str
    row: ClassRow

    @property
    def group_name(self) -> str:
        """The wallpaper group, such as "pgg"."""
        return self.row.group

    @cached_property
    def identified_edges(self) -> tuple[EdgeIdentification, ...]:
        """Which edge of the template (edge k from p_k to p_{k+1}) is mapped onto which, and by what."""
        return tuple(
            EdgeIdentification(first, second, self._edge_isometry(first, second))
            for first, second in self.row.edges
        )

    @property
    def shape_dim(self) -> int:
        """Number of shape parameters of the template: 0 for hexagons, 2 for pentagons."""
        return 0 if self.row.template == "hexagon" else 2

    @property
    def stretch_dim(self) -> int:
        """Number of parameters of the lattice freedom: 2, 1 or 0 (`commutant` of the point group)."""
        return len(self._freedom)

    @overload
    def template(self, shape: None = None) -> Array: ...
    @overload
    def template(self, shape: Points) -> Points: ...
    def template(self, shape: Any = None) -> Any:
        """Vertices (..., K, 2) of the template, counter-clockwise.

        Args:
            shape: (..., shape_dim), NumPy or torch (then differentiable); for the pentagons the
                displacement of p1 from its default. None means the default, as a NumPy array.

        Raises:
            OrbiflowError: if the last axis of `shape` is not `shape_dim` long.
        """
        if shape is None:
            return self._default.copy()
        tensor = self._parameters(shape, self.shape_dim, "shape")
        return _same_kind(template_vertices(self.row.template, tensor), shape)

    def stretch(self, parameters: Points) -> Points:
        """Unimodular maps L (..., 2, 2) that commute with the point group.

        Args:
            parameters: (..., stretch_dim), NumPy or torch (then differentiable).

        Raises:
            OrbiflowError: if the last axis of `parameters` is not `stretch_dim` long.
        """
        tensor = self._parameters(parameters, self.stretch_dim, "stretch")
        return _same_kind(stretch_matrix(self._freedom, tensor), parameters)

    def group(self) -> CrystallographicGroup:
        """The group of the template; the same for all shape parameters."""
        return self._group

    def generators(self) -> tuple[Isometry, ...]:
        """The paper's rotations and transflections, in the table's order."""
        return tuple(operator.isometry for operator in self.paper_operators())

    def paper_operators(self) -> tuple[PaperOperator, ...]:
        """The paper's symmetrization operators, outermost first: V = O_1(O_2(...(F)))."""
        return tuple(self._operator(row) for row in self.row.operators)

    def _edge_isometry(self, first: int, second: int) -> Isometry:
        """The element that takes an edge onto another, and the tile to its other side."""
        vertices = self._default
        start, end = vertices[first], vertices[(first + 1) % len(vertices)]
        ends = vertices[second], vertices[(second + 1) % len(vertices)]
        for sign, goal, goal_end in ((-1, *ends), (1, *ends[::-1])):
            for element in self._group.elements_near(goal, 1e-6, source=start):
                if element.determinant == sign and np.allclose(element(end), goal_end, atol=1e-6):
                    return element
        raise RuntimeError(f"{self.name}: no element takes edge {first} onto edge {second}")

    @cached_property
    def _default(self) -> Array:
        return template_vertices(
            self.row.template, torch.zeros(self.shape_dim, dtype=torch.float64)
        ).numpy()

    @cached_property
    def _group(self) -> CrystallographicGroup:
        columns = [
            rotation_matrix(math.radians(vector.degrees)) @ self._point(vector.coefficients)
            for vector in self.row.lattice
        ]
        # another basis of the paper's lattice: with the shortest, |k_i| <= Omega is isotropic
        basis = reduced_basis(np.stack(columns, axis=1))
        return CrystallographicGroup.generate(basis, self.generators(), name=self.row.group)

    @cached_property
    def _freedom(self) -> Array:
        return commutant(self._group.linear_parts)

    def _point(self, coefficients: Coefficients) -> Array:
        terms = [c * self._default[k] for k, c in coefficients.items()]
        return np.sum(terms, axis=0) if terms else np.zeros(2)

    def _operator(self, row: OperatorRow) -> PaperOperator:
        if isinstance(row, RotationRow):
            return PaperOperator(rotation(self._point(row.center), row.order), row.order)
        line = Line(self._point(row.point), self._point(row.direction))
        return PaperOperator(transflection(line, float(np.hypot(*self._point(row.shift)))), 2)

    def _parameters(self, values: Array | torch.Tensor, size: int, what: str) -> torch.Tensor:
        tensor = values
        if not isinstance(tensor, torch.Tensor):
            tensor = torch.as_tensor(numbers(tensor, f"{what} parameters", (...,)))
        elif not tensor.is_floating_point():
            tensor = tensor.double()
        if tensor.ndim == 0 or tensor.shape[-1] != size:
            raise OrbiflowError(
                f"{self.name} has {size} {what} parameters: expected shape (..., {size}), "
                f"got {tuple(tensor.shape)}"
            )
        return tensor

    def __repr__(self) -> str:
        return f"IsohedralClass({self.name}, {self.group_name})"


def _same_kind(result: torch.Tensor, like: Points) -> Points:
    if isinstance(like, torch.Tensor):
        return result
    return result.numpy().copy()


CLASSES: dict[str, IsohedralClass] = {
    name: IsohedralClass(name, row) for name, row in CLASS_TABLE.items()
}
"""The nine classes by name."""


def isohedral_class(name: str | int | IsohedralClass) -> IsohedralClass:
    """The class called `name`: "IH4", "ih4", "IH04", "4" and 4 are the same; a class is itself.

    Raises:
        OrbiflowError: for anything but the nine.

    >>> isohedral_class("ih04")
    IsohedralClass(IH4, p2)
    """
    if isinstance(name, IsohedralClass):
        return name
    match = re.fullmatch(r"(?:IH[\s_-]?)?0*(\d+)", str(name).strip(), flags=re.IGNORECASE)
    key = f"IH{match[1]}" if match else ""
    if key not in CLASSES:
        raise OrbiflowError(
            f"unknown isohedral class {described(name)}; the nine are {', '.join(CLASSES)}: "
            "every tile shape of an isohedral tiling occurs in one of them"
        )
    return CLASSES[key]
