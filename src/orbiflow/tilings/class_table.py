"""The nine isohedral classes as data, transcribed from the paper's table of symmetrizations.

A coefficient vector {k: c_k} stands for the point or vector sum_k c_k p_k over the vertices p_k of
the class's template. Edge k runs from p_k to p_{k+1}.

Every row closes as printed: the tests check that the group is finite modulo the lattice, that its
order times the template's area is |det B|, and that the identified edges are those the group maps
onto each other.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple, TypeAlias

Coefficients: TypeAlias = Mapping[int, float]
TemplateKind: TypeAlias = Literal["hexagon", "floret", "cairo"]
EdgeKind: TypeAlias = Literal["translation", "rotation", "glide"]


class LatticeVector(NamedTuple):
    """The vector `coefficients` over the template, turned counter-clockwise by `degrees`."""

    coefficients: Coefficients
    degrees: float = 0.0


class RotationRow(NamedTuple):
    """The paper's (c, K)-rotation: centre and order K."""

    center: Coefficients
    order: int


class TransflectionRow(NamedTuple):
    """The paper's (l, mu)-transflection: l through `point` along `direction`, mu = |shift|."""

    point: Coefficients
    direction: Coefficients
    shift: Coefficients


OperatorRow: TypeAlias = RotationRow | TransflectionRow


class EdgePair(NamedTuple):
    """Edge `first` is mapped onto edge `second` by an element of the group.

    `first == second` means a 2-fold centre at the edge's midpoint: the edge is `folded`.
    """

    first: int
    second: int
    kind: EdgeKind

    @property
    def folded(self) -> bool:
        """Whether the edge is its own partner, turned over about its midpoint."""
        return self.first == self.second

    @property
    def reversed(self) -> bool:
        """Whether the start of `first` goes to the end of `second`: unless it is a glide."""
        return self.kind != "glide"

    @property
    def brief(self) -> str:
        """In brief: = translation, ~ glide, > rotation, o an edge turned over about its middle.

        >>> EdgePair(0, 3, "translation").brief, EdgePair(2, 2, "rotation").brief
        ('0=3', '2o')
        """
        if self.folded:
            return f"{self.first}o"
        sign = {"translation": "=", "glide": "~", "rotation": ">"}[self.kind]
        return f"{self.first}{sign}{self.second}"


class ClassRow(NamedTuple):
    """A row of the table; operators in the order in which the paper nests them, outermost first."""

    group: str
    template: TemplateKind
    lattice: tuple[LatticeVector, LatticeVector]
    operators: tuple[OperatorRow, ...]
    edges: tuple[EdgePair, ...]


_HEXAGON_CELL = LatticeVector({0: 3}), LatticeVector({1: 1, 2: 1})

CLASS_TABLE: dict[str, ClassRow] = {
    "IH1": ClassRow(
        group="p1",
        template="hexagon",
        lattice=(LatticeVector({0: 1, 1: 1}), LatticeVector({1: 1, 2: 1})),
        operators=(),
        edges=(
            EdgePair(0, 3, "translation"),
            EdgePair(1, 4, "translation"),
            EdgePair(2, 5, "translation"),
        ),
    ),
    "IH2": ClassRow(
        group="pg",
        template="hexagon",
        lattice=_HEXAGON_CELL,
        operators=(
            TransflectionRow({0: 1 / 2, 1: 1 / 2}, {1: 1, 2: 1}, {1: 1 / 2, 2: 1 / 2}),
            TransflectionRow({0: 5 / 2, 2: 1 / 2}, {1: 1, 2: 1}, {1: 1 / 2, 2: 1 / 2}),
        ),
        edges=(
            EdgePair(0, 5, "glide"),
            EdgePair(1, 4, "translation"),
            EdgePair(2, 3, "glide"),
        ),
    ),
    "IH3": ClassRow(
        group="pg",
        template="hexagon",
        lattice=_HEXAGON_CELL,
        operators=(
            TransflectionRow({0: 1 / 2, 1: 1 / 2}, {0: 1}, {0: 3 / 2}),
            TransflectionRow({1: 3 / 4, 2: 3 / 4}, {0: 1}, {0: 3 / 2}),
        ),
        edges=(
            EdgePair(0, 2, "glide"),
            EdgePair(1, 4, "translation"),
            EdgePair(3, 5, "glide"),
        ),
    ),
    "IH4": ClassRow(
        group="p2",
        template="hexagon",
        lattice=_HEXAGON_CELL,
        operators=(
            RotationRow({0: 3 / 2, 1: 3 / 2}, 2),
            RotationRow({0: 1 / 2, 1: 1, 2: 1 / 2}, 2),
            RotationRow({0: 1 / 2, 1: 1 / 2}, 2),
            RotationRow({0: 3 / 2, 1: 1, 2: -1 / 2}, 2),
        ),
        edges=(
            EdgePair(0, 0, "rotation"),
            EdgePair(1, 4, "translation"),
            EdgePair(2, 2, "rotation"),
            EdgePair(3, 3, "rotation"),
            EdgePair(5, 5, "rotation"),
        ),
    ),
    "IH5": ClassRow(
        group="pgg",
        template="hexagon",
        lattice=(LatticeVector({0: 6}), LatticeVector({1: 1, 2: 1})),
        operators=(
            RotationRow({0: 11 / 2, 2: 1 / 2}, 2),
            RotationRow({0: 11 / 2, 1: 1 / 2, 2: 1}, 2),
            TransflectionRow({1: 1}, {0: 1}, {0: 3}),
            TransflectionRow({0: 7 / 2, 1: 1 / 2}, {1: 1, 2: 1}, {1: 1 / 2, 2: 1 / 2}),
        ),
        edges=(
            EdgePair(0, 5, "glide"),
            EdgePair(1, 4, "translation"),
            EdgePair(2, 2, "rotation"),
            EdgePair(3, 3, "rotation"),
        ),
    ),
    "IH6": ClassRow(
        group="pgg",
        template="hexagon",
        lattice=(LatticeVector({0: 3}), LatticeVector({1: 2, 2: 2})),
        operators=(
            RotationRow({0: 1 / 2, 1: 2, 2: 3 / 2}, 2),
            RotationRow({0: 5 / 2, 1: 3 / 2, 2: 2}, 2),
            TransflectionRow({}, {1: 1, 2: 1}, {1: 1, 2: 1}),
            TransflectionRow({1: 5 / 4, 2: 5 / 4}, {0: 1}, {0: 3 / 2}),
        ),
        edges=(
            EdgePair(0, 2, "glide"),
            EdgePair(1, 4, "glide"),
            EdgePair(3, 3, "rotation"),
            EdgePair(5, 5, "rotation"),
        ),
    ),
    "IH7": ClassRow(
        group="p3",
        template="hexagon",
        lattice=(LatticeVector({0: 3}), LatticeVector({1: 3})),
        operators=(RotationRow({0: 2, 1: 1}, 3),),
        edges=(
            EdgePair(0, 5, "rotation"),
            EdgePair(1, 2, "rotation"),
            EdgePair(3, 4, "rotation"),
        ),
    ),
    "IH21": ClassRow(
        group="p6",
        template="floret",
        lattice=(LatticeVector({3: 1, 4: 1}), LatticeVector({3: 1, 4: 1}, degrees=60)),
        operators=(RotationRow({2: 1}, 3), RotationRow({0: 1}, 6)),
        edges=(
            EdgePair(0, 4, "rotation"),
            EdgePair(1, 2, "rotation"),
            EdgePair(3, 3, "rotation"),
        ),
    ),
    "IH28": ClassRow(
        group="p4",
        template="cairo",
        lattice=(LatticeVector({2: 2}), LatticeVector({3: 1, 4: 1})),
        operators=(RotationRow({2: 1}, 4), RotationRow({0: 1}, 4)),
        edges=(
            EdgePair(0, 4, "rotation"),
            EdgePair(1, 2, "rotation"),
            EdgePair(3, 3, "rotation"),
        ),
    ),
}
"""Source: the paper, table "The Symmetrization for the nine isohedral classes"."""
