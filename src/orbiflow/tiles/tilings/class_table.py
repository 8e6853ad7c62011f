"""The isohedral classes as data: the nine as the paper gives them, and all 81 by incidence symbol."""

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
    """A row of the table; operators are in the order in which the paper nests them, outermost first."""

    template: TemplateKind
    lattice: tuple[LatticeVector, LatticeVector]
    operators: tuple[OperatorRow, ...]


_HEXAGON_CELL = LatticeVector({0: 3}), LatticeVector({1: 1, 2: 1})

# source: the paper, table "The Symmetrization for the nine isohedral classes"
CLASS_TABLE: dict[str, ClassRow] = {
    "IH1": ClassRow("hexagon", (LatticeVector({0: 1, 1: 1}), LatticeVector({1: 1, 2: 1})), ()),
    "IH2": ClassRow(
        "hexagon",
        _HEXAGON_CELL,
        (
            TransflectionRow({0: 1 / 2, 1: 1 / 2}, {1: 1, 2: 1}, {1: 1 / 2, 2: 1 / 2}),
            TransflectionRow({0: 5 / 2, 2: 1 / 2}, {1: 1, 2: 1}, {1: 1 / 2, 2: 1 / 2}),
        ),
    ),
    "IH3": ClassRow(
        "hexagon",
        _HEXAGON_CELL,
        (
            TransflectionRow({0: 1 / 2, 1: 1 / 2}, {0: 1}, {0: 3 / 2}),
            TransflectionRow({1: 3 / 4, 2: 3 / 4}, {0: 1}, {0: 3 / 2}),
        ),
    ),
    "IH4": ClassRow(
        "hexagon",
        _HEXAGON_CELL,
        (
            RotationRow({0: 3 / 2, 1: 3 / 2}, 2),
            RotationRow({0: 1 / 2, 1: 1, 2: 1 / 2}, 2),
            RotationRow({0: 1 / 2, 1: 1 / 2}, 2),
            RotationRow({0: 3 / 2, 1: 1, 2: -1 / 2}, 2),
        ),
    ),
    "IH5": ClassRow(
        "hexagon",
        (LatticeVector({0: 6}), LatticeVector({1: 1, 2: 1})),
        (
            RotationRow({0: 11 / 2, 2: 1 / 2}, 2),
            RotationRow({0: 11 / 2, 1: 1 / 2, 2: 1}, 2),
            TransflectionRow({1: 1}, {0: 1}, {0: 3}),
            TransflectionRow({0: 7 / 2, 1: 1 / 2}, {1: 1, 2: 1}, {1: 1 / 2, 2: 1 / 2}),
        ),
    ),
    "IH6": ClassRow(
        "hexagon",
        (LatticeVector({0: 3}), LatticeVector({1: 2, 2: 2})),
        (
            RotationRow({0: 1 / 2, 1: 2, 2: 3 / 2}, 2),
            RotationRow({0: 5 / 2, 1: 3 / 2, 2: 2}, 2),
            TransflectionRow({}, {1: 1, 2: 1}, {1: 1, 2: 1}),
            TransflectionRow({1: 5 / 4, 2: 5 / 4}, {0: 1}, {0: 3 / 2}),
        ),
    ),
    "IH7": ClassRow(
        "hexagon", (LatticeVector({0: 3}), LatticeVector({1: 3})), (RotationRow({0: 2, 1: 1}, 3),)
    ),
    "IH21": ClassRow(
        "floret",
        (LatticeVector({3: 1, 4: 1}), LatticeVector({3: 1, 4: 1}, degrees=60)),
        (RotationRow({2: 1}, 3), RotationRow({0: 1}, 6)),
    ),
    "IH28": ClassRow(
        "cairo",
        (LatticeVector({2: 2}), LatticeVector({3: 1, 4: 1})),
        (RotationRow({2: 1}, 4), RotationRow({0: 1}, 4)),
    ),
}


class TypeRow(NamedTuple):
    """A row of the table: the group, the valences of the tile's corners, the incidence symbol.

    See `incidence.IncidenceSymbol` for how a symbol is read.
    """

    group: str
    valences: str
    symbol: str


TYPE_TABLE: dict[str, TypeRow] = {
    "IH1": TypeRow("p1", "3.3.3.3.3.3", "a+b+c+d+e+f+ d+e+f+a+b+c+"),
    "IH2": TypeRow("pg", "3.3.3.3.3.3", "a+b+c+d+e+f+ b-a-f+e-d-c+"),
    "IH3": TypeRow("pg", "3.3.3.3.3.3", "a+b+c+d+e+f+ c-e+a-f-b+d-"),
    "IH4": TypeRow("p2", "3.3.3.3.3.3", "a+b+c+d+e+f+ a+e+c+d+b+f+"),
    "IH5": TypeRow("pgg", "3.3.3.3.3.3", "a+b+c+d+e+f+ a+e+d-c-b+f+"),
    "IH6": TypeRow("pgg", "3.3.3.3.3.3", "a+b+c+d+e+f+ a+e-c+f-b-d-"),
    "IH7": TypeRow("p3", "3.3.3.3.3.3", "a+b+c+d+e+f+ b+a+d+c+f+e+"),
    "IH8": TypeRow("p2", "3.3.3.3.3.3", "a+b+c+a+b+c+ a+b+c+"),
    "IH9": TypeRow("pgg", "3.3.3.3.3.3", "a+b+c+a+b+c+ a+c-b-"),
    "IH10": TypeRow("p3", "3.3.3.3.3.3", "a+b+a+b+a+b+ b+a+"),
    "IH11": TypeRow("p6", "3.3.3.3.3.3", "a+a+a+a+a+a+ a+"),
    "IH12": TypeRow("cm", "3.3.3.3.3.3", "ab+c+dc-b- dc-b-a"),
    "IH13": TypeRow("pmg", "3.3.3.3.3.3", "ab+c+dc-b- db+c+a"),
    "IH14": TypeRow("cm", "3.3.3.3.3.3", "a+b+c+c-b-a- c-b-a-"),
    "IH15": TypeRow("pmg", "3.3.3.3.3.3", "a+b+c+c-b-a- a+b-c+"),
    "IH16": TypeRow("p31m", "3.3.3.3.3.3", "a+b+c+c-b-a- a-c+b+"),
    "IH17": TypeRow("cmm", "3.3.3.3.3.3", "ab+b-ab+b- ab+"),
    "IH18": TypeRow("p31m", "3.3.3.3.3.3", "ababab ba"),
    "IH20": TypeRow("p6m", "3.3.3.3.3.3", "aaaaaa a"),
    "IH21": TypeRow("p6", "3.3.3.3.6", "a+b+c+d+e+ a+c+b+e+d+"),
    "IH22": TypeRow("cm", "3.3.3.4.4", "a+b+c+d+e+ b-a-e+d-c+"),
    "IH23": TypeRow("p2", "3.3.3.4.4", "a+b+c+d+e+ a+b+e+d+c+"),
    "IH24": TypeRow("pmg", "3.3.3.4.4", "a+b+c+d+e+ a+b+e+d-c+"),
    "IH25": TypeRow("pgg", "3.3.3.4.4", "a+b+c+d+e+ b-a-e+d+c+"),
    "IH26": TypeRow("cmm", "3.3.3.4.4", "a+a-b+cb- a+b-c"),
    "IH27": TypeRow("pgg", "3.3.4.3.4", "a+b+c+d+e+ a+d-e-b-c-"),
    "IH28": TypeRow("p4", "3.3.4.3.4", "a+b+c+d+e+ a+c+b+e+d+"),
    "IH29": TypeRow("p4g", "3.3.4.3.4", "ab+c+c-b- ac+b+"),
    "IH30": TypeRow("p31m", "3.4.6.4", "a+b+c+d+ d+b-c-a+"),
    "IH31": TypeRow("p6", "3.4.6.4", "a+b+c+d+ d+c+b+a+"),
    "IH32": TypeRow("p6m", "3.4.6.4", "a+b+b-a- a-b-"),
    "IH33": TypeRow("p3", "3.6.3.6", "a+b+c+d+ d+c+b+a+"),
    "IH34": TypeRow("p6", "3.6.3.6", "a+b+a+b+ b+a+"),
    "IH36": TypeRow("p31m", "3.6.3.6", "a+a-b+b- b-a-"),
    "IH37": TypeRow("p6m", "3.6.3.6", "a+a-a+a- a-"),
    "IH38": TypeRow("p31m", "3.12.12", "a+b+c+ c+b-a+"),
    "IH39": TypeRow("p6", "3.12.12", "a+b+c+ c+b+a+"),
    "IH40": TypeRow("p6m", "3.12.12", "a+ba- a-b"),
    "IH41": TypeRow("p1", "4.4.4.4", "a+b+c+d+ c+d+a+b+"),
    "IH42": TypeRow("pm", "4.4.4.4", "a+b+c+d+ c+b-a+d-"),
    "IH43": TypeRow("pg", "4.4.4.4", "a+b+c+d+ c+d-a+b-"),
    "IH44": TypeRow("pg", "4.4.4.4", "a+b+c+d+ b-a-d-c-"),
    "IH45": TypeRow("cm", "4.4.4.4", "a+b+c+d+ c-b-a-d-"),
    "IH46": TypeRow("p2", "4.4.4.4", "a+b+c+d+ a+b+c+d+"),
    "IH47": TypeRow("p2", "4.4.4.4", "a+b+c+d+ c+b+a+d+"),
    "IH49": TypeRow("pmg", "4.4.4.4", "a+b+c+d+ a-b+c-d+"),
    "IH50": TypeRow("pmg", "4.4.4.4", "a+b+c+d+ c+b-a+d+"),
    "IH51": TypeRow("pgg", "4.4.4.4", "a+b+c+d+ c-b+a-d+"),
    "IH52": TypeRow("pgg", "4.4.4.4", "a+b+c+d+ c-d-a-b-"),
    "IH53": TypeRow("pgg", "4.4.4.4", "a+b+c+d+ b-a-c+d+"),
    "IH54": TypeRow("cmm", "4.4.4.4", "a+b+c+d+ a-b-c-d+"),
    "IH55": TypeRow("p4", "4.4.4.4", "a+b+c+d+ b+a+d+c+"),
    "IH56": TypeRow("p4g", "4.4.4.4", "a+b+c+d+ b+a+c-d-"),
    "IH57": TypeRow("p2", "4.4.4.4", "a+b+a+b+ a+b+"),
    "IH58": TypeRow("pmg", "4.4.4.4", "a+b+a+b+ a+b-"),
    "IH59": TypeRow("pgg", "4.4.4.4", "a+b+a+b+ b-a-"),
    "IH61": TypeRow("p4", "4.4.4.4", "a+b+a+b+ b+a+"),
    "IH62": TypeRow("p4", "4.4.4.4", "a+a+a+a+ a+"),
    "IH64": TypeRow("pm", "4.4.4.4", "ab+cb- cb-a"),
    "IH66": TypeRow("pmg", "4.4.4.4", "ab+cb- cb+a"),
    "IH67": TypeRow("cmm", "4.4.4.4", "a+ba-c a+bc"),
    "IH68": TypeRow("cm", "4.4.4.4", "a+b+b-a- b-a-"),
    "IH69": TypeRow("pmg", "4.4.4.4", "a+a-b+b- a+b+"),
    "IH71": TypeRow("p4g", "4.4.4.4", "a+b+b-a- b+a+"),
    "IH72": TypeRow("pmm", "4.4.4.4", "abab ab"),
    "IH73": TypeRow("p4g", "4.4.4.4", "abab ba"),
    "IH74": TypeRow("cmm", "4.4.4.4", "a+a-a+a- a+"),
    "IH76": TypeRow("p4m", "4.4.4.4", "aaaa a"),
    "IH77": TypeRow("p6m", "4.6.12", "a+b+c+ a-b-c-"),
    "IH78": TypeRow("cmm", "4.8.8", "a+b+c+ a-b+c-"),
    "IH79": TypeRow("p4", "4.8.8", "a+b+c+ c+b+a+"),
    "IH81": TypeRow("p4g", "4.8.8", "a+b+c+ c+b-a+"),
    "IH82": TypeRow("p4m", "4.8.8", "a+ba- a-b"),
    "IH83": TypeRow("cm", "6.6.6", "a+b+c+ b-a-c-"),
    "IH84": TypeRow("p2", "6.6.6", "a+b+c+ a+b+c+"),
    "IH85": TypeRow("pmg", "6.6.6", "a+b+c+ a-b+c+"),
    "IH86": TypeRow("pgg", "6.6.6", "a+b+c+ b-a-c+"),
    "IH88": TypeRow("p6", "6.6.6", "a+b+c+ b+a+c+"),
    "IH90": TypeRow("p6", "6.6.6", "a+a+a+ a+"),
    "IH91": TypeRow("cmm", "6.6.6", "a+a-b a+b"),
    "IH93": TypeRow("p6m", "6.6.6", "aaa a"),
}
