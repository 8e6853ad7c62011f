"""Operators such as "-x,y+1/2,-z", in fractional coordinates of a cell: groups from them and back."""

import itertools
import re
from collections.abc import Iterable
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arrays import Array
from orbiflow.errors import GroupError
from orbiflow.symmetry.cells import check_cell
from orbiflow.symmetry.group import MAX_ORDER, CrystallographicGroup, checked_lattice, generated
from orbiflow.symmetry.isometry import TOLERANCE, Isometry, translation

Operator = tuple[Array, Array]
"""The matrix W (d, d) and the shift w (d,) of x' = W x + w."""

AXES = "xyz"
MAX_LENGTH = 200
_NUMBER = r"\d{1,9}(?:/\d{1,9}|\.\d{0,20})?|\.\d{1,20}"
_TERM = re.compile(rf"([+-])(?:({_NUMBER})\*?)?([xyz])?")


def group_from_operators(
    operators: Iterable[str], lattice: ArrayLike, *, name: str = ""
) -> CrystallographicGroup:
    """Return the group that operators in fractional coordinates generate on a lattice.

    The operators may be all of the group's, modulo the lattice, or generators alone. If there are pure
    translations among them or their products, the group's lattice is the finer one (`primitive`).

    Args:
        operators: Texts such as "-x,y+1/2,-z", with as many parts as there are dimensions, 1 to 3.
        lattice: The basis vectors as columns (d, d) of the cell that the coordinates refer to.
        name: A name for people to read.

    Raises `GroupError` for a text that is no operator, or one that does not map the lattice to itself.

    >>> group_from_operators(["-x,-y", "-x+1/2,y+1/2"], [[1, 0], [0, 1.2]], name="pgg").order
    4
    """
    basis = checked_lattice(lattice)
    texts = list(itertools.islice(operators, MAX_ORDER + 1))
    if len(texts) > MAX_ORDER:
        raise GroupError(f"more than {MAX_ORDER} operators were given; generators are enough")
    parsed = [parse_operator(text, len(basis)) for text in texts]
    check_cell(basis, np.array([w for w, _ in parsed]).reshape(-1, *basis.shape), texts)
    inverse = np.linalg.inv(basis)
    isometries = [Isometry(basis @ w @ inverse, basis @ shift) for w, shift in parsed]
    return generated(basis, isometries, name).primitive()


def parse_operator(text: str, dim: int) -> Operator:
    """Return the matrix (d, d) and the shift (d,) of an operator such as "x-y,x,z+1/3".

    Raises `GroupError` for any other text.

    >>> parse_operator("-y, x-y, z+1/3", 3)[0].tolist()
    [[0.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    parts = text.lower().split(",") if len(text) <= MAX_LENGTH else []
    rows = [_row(part.replace(" ", ""), dim) for part in parts]
    if len(rows) != dim or None in rows:
        example = ",".join(("-x", "y+1/2", "-z")[:dim])
        raise GroupError(f'{text[:60]!r} is no operator in {dim} dimensions, such as "{example}"')
    table = np.array(rows, dtype=np.float64)
    return table[:, :dim], table[:, dim]


def _row(text: str, dim: int) -> list[float] | None:
    """Return the coefficients of the axes and the constant of one part of an operator."""
    signed = text if text[:1] in ("+", "-") else f"+{text}"
    terms = list(_TERM.finditer(signed))
    if "".join(term[0] for term in terms) != signed:
        return None
    row = [Fraction(0)] * (dim + 1)
    for sign, number, axis in (term.groups() for term in terms):
        place = AXES.index(axis) if axis else dim
        if not (number or axis) or place > dim - bool(axis) or re.search("/0+$", number or ""):
            return None
        row[place] += Fraction(f"{sign}{number or 1}")
    return [float(entry) for entry in row]


def operators(group: CrystallographicGroup, lattice: ArrayLike | None = None) -> list[str]:
    """Return the operators of a group, one for each coset, in fractional coordinates of a lattice.

    The lattice, basis vectors as columns (d, d), is by default the group's; with a coarser one, such as
    a conventional cell, there are more. `group_from_operators` makes the group again of them.

    Raises `GroupError` for a group of over 3 dimensions, or a lattice whose vectors are no translations
    of the group or that it does not map to itself.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> operators(wallpaper_group("pgg"))
    ['x,y', '-x,-y', '-x+1/2,y+1/2', 'x+1/2,-y+1/2']
    """
    if group.dim > len(AXES):
        raise GroupError(f"operators have at most {len(AXES)} parts, got {group.dim} dimensions")
    coarse = group
    if lattice is not None:
        shifts = [translation(vector) for vector in group.lattice.T]
        coarse = generated(lattice, [*shifts, *group.cosets])
        if not np.isclose(coarse.cell_volume * group.order, group.cell_volume * coarse.order):
            raise GroupError("the vectors of the lattice are no translations of the group")
    shifts = coarse.translations @ coarse.inverse_lattice.T
    tables = np.concatenate([coarse.integral_parts, shifts[:, :, None]], axis=2)
    return [",".join(_part(row) for row in table) for table in tables.tolist()]


def _part(row: list[float]) -> str:
    """Return one part of an operator as text: "x-y+1/3"."""
    terms = [
        f"{x:+.0f}*{axis}" if abs(x) > 1 else f"{x:+.0f}"[0] + axis
        for x, axis in zip(row[:-1], AXES, strict=False)
        if x
    ]
    fraction = Fraction(row[-1]).limit_denominator(48)
    shift = f"{row[-1]:+.12g}" if abs(fraction - row[-1]) > TOLERANCE else f"+{fraction}"
    return "".join([*terms, shift if row[-1] > TOLERANCE or not terms else ""]).removeprefix("+")
