"""The nine isohedral classes as data, transcribed from the paper's table of symmetrizations.

A coefficient vector {k: c_k} stands for the point or vector sum_k c_k p_k over the vertices p_k of
the class's template. Edge k runs from p_k to p_{k+1}.

Every row closes as printed: the tests check that the group is finite modulo the lattice, that its
order times the template's area is |det B|, and that the identified edges are those the group maps
onto each other.
"""

from collections.abc import Mapping
from typing import Literal, NamedTuple, TypeAlias

Coefficients: TypeAlias = Mapping[int, float]
TemplateKind: TypeAlias = Literal["hexagon", "floret", "cairo"]


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


class ClassRow(NamedTuple):
    """A row of the table.

    Operators are in the order in which the paper nests them, outermost first. Edges are identified
    in pairs, equal where an edge is its own partner; the group has the isometry.
    """

    group: str
    template: TemplateKind
    lattice: tuple[LatticeVector, LatticeVector]
    operators: tuple[OperatorRow, ...]
    edges: tuple[tuple[int, int], ...]


_HEXAGON_CELL = LatticeVector({0: 3}), LatticeVector({1: 1, 2: 1})

# source: the paper, table "The Symmetrization for the nine isohedral classes"
CLASS_TABLE: dict[str, ClassRow] = {
    "IH1": ClassRow(
        group="p1",
        template="hexagon",
        lattice=(LatticeVector({0: 1, 1: 1}), LatticeVector({1: 1, 2: 1})),
        operators=(),
        edges=((0, 3), (1, 4), (2, 5)),
    ),
    "IH2": ClassRow(
        group="pg",
        template="hexagon",
        lattice=_HEXAGON_CELL,
        operators=(
            TransflectionRow({0: 1 / 2, 1: 1 / 2}, {1: 1, 2: 1}, {1: 1 / 2, 2: 1 / 2}),
            TransflectionRow({0: 5 / 2, 2: 1 / 2}, {1: 1, 2: 1}, {1: 1 / 2, 2: 1 / 2}),
        ),
        edges=((0, 5), (1, 4), (2, 3)),
    ),
    "IH3": ClassRow(
        group="pg",
        template="hexagon",
        lattice=_HEXAGON_CELL,
        operators=(
            TransflectionRow({0: 1 / 2, 1: 1 / 2}, {0: 1}, {0: 3 / 2}),
            TransflectionRow({1: 3 / 4, 2: 3 / 4}, {0: 1}, {0: 3 / 2}),
        ),
        edges=((0, 2), (1, 4), (3, 5)),
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
        edges=((0, 0), (1, 4), (2, 2), (3, 3), (5, 5)),
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
        edges=((0, 5), (1, 4), (2, 2), (3, 3)),
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
        edges=((0, 2), (1, 4), (3, 3), (5, 5)),
    ),
    "IH7": ClassRow(
        group="p3",
        template="hexagon",
        lattice=(LatticeVector({0: 3}), LatticeVector({1: 3})),
        operators=(RotationRow({0: 2, 1: 1}, 3),),
        edges=((0, 5), (1, 2), (3, 4)),
    ),
    "IH21": ClassRow(
        group="p6",
        template="floret",
        lattice=(LatticeVector({3: 1, 4: 1}), LatticeVector({3: 1, 4: 1}, degrees=60)),
        operators=(RotationRow({2: 1}, 3), RotationRow({0: 1}, 6)),
        edges=((0, 4), (1, 2), (3, 3)),
    ),
    "IH28": ClassRow(
        group="p4",
        template="cairo",
        lattice=(LatticeVector({2: 2}), LatticeVector({3: 1, 4: 1})),
        operators=(RotationRow({2: 1}, 4), RotationRow({0: 1}, 4)),
        edges=((0, 4), (1, 2), (3, 3)),
    ),
}
