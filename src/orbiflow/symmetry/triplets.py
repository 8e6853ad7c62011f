"""Operators such as "-x,y+1/2,-z", in fractional coordinates of a cell; and the cells that they fit."""

import itertools
import re
import warnings
from collections.abc import Iterable
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arrays import Array
from orbiflow.errors import (
    GroupError,
    LatticeMismatchError,
    NotAnIsometryError,
    RoundedOperatorsWarning,
)
from orbiflow.settings import as_array, refusal
from orbiflow.symmetry.group import MAX_ORDER, CrystallographicGroup, checked_lattice, generated
from orbiflow.symmetry.isometry import Isometry, translation

AXES = "xyz"
MAX_LENGTH = 200
ROUNDING = 1e-13  # the error of a shift that is meant to be a simple fraction
LEAST = Fraction(1, 2000)  # three to five decimals of a shift are taken for rounded by so much
_NUMBER = r"(?:\d{1,9}(?:/0*[1-9]\d{0,8}|\.\d{0,20})?|\.\d{1,20})"
_TERM = re.compile(rf"([+-]?)({_NUMBER})?\*?([xyz]?)")


def group_from_operators(
    operators: Iterable[str], lattice: ArrayLike, *, name: str = ""
) -> CrystallographicGroup:
    """Return the group that operators in fractional coordinates generate on a lattice.

    The operators are texts such as "-x,y+1/2,-z" with d parts, 1 to 3: all of the group's modulo the
    lattice, or generators. `lattice` has the basis vectors of their cell as columns (d, d); if pure
    translations make it finer, the group is on the primitive one. Rounded thirds, sixths and the like,
    such as 0.3333, are read as the fractions they stand for, with a `RoundedOperatorsWarning`.

    Raises `GroupError` for a text that is no operator, or one that does not map the lattice to itself.

    >>> group_from_operators(["-x,-y", "-x+1/2,y+1/2"], [[1, 0], [0, 1.2]], name="pgg").order
    4
    """
    basis = checked_lattice(lattice)
    texts = list(itertools.islice(operators, MAX_ORDER + 1))
    if len(texts) > MAX_ORDER:
        raise GroupError(f"more than {MAX_ORDER} operators were given; generators are enough")
    d, inverse = len(basis), np.linalg.inv(basis)
    tables = [parse_operator(text, d) for text in texts]
    _warn_of_rounding(texts)
    try:
        isometries = [Isometry(basis @ t[:, :d] @ inverse, basis @ t[:, d]) for t in tables]
    except NotAnIsometryError as error:
        nearest = fitting_cell(np.stack(tables)[:, :, :d], basis)
        parameters, other = (
            np.round(cell, 6).tolist() for cell in (cell_parameters(basis), nearest or 0)
        )
        cure = f"the nearest that fits has {other}" if nearest else "they fit no cell"
        raise LatticeMismatchError(
            f"the operators do not fit a cell with lengths and angles {parameters}; {cure}"
        ) from error
    return generated(basis, isometries, name).primitive()


def parse_operator(text: str, dim: int) -> Array:
    """Return the table (d, d + 1) of an operator: its matrix and its shift.

    >>> parse_operator("-y, x-y, z+1/3", 3).round(3).tolist()
    [[0.0, -1.0, 0.0, 0.0], [1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.333]]
    """
    parts = text.lower().replace(" ", "").split(",") if len(text) <= MAX_LENGTH else []
    term = rf"(?:(?:{_NUMBER}\*?)?[{AXES[:dim]}]|{_NUMBER})"
    whole = re.compile(rf"[+-]?{term}(?:[+-]{term})*")
    if len(parts) != dim or not all(map(whole.fullmatch, parts)):
        example = ",".join(("-x", "y+1/2", "-z")[:dim])
        raise GroupError(f'{text[:60]!r} is no operator in {dim} dimensions, such as "{example}"')
    table = np.zeros((dim, dim + 1))
    for row, part in zip(table, parts, strict=True):
        for sign, number, axis in _TERM.findall(part):
            place = AXES.index(axis) if axis else dim
            exact = Fraction(f"{sign}{number or 1}") if number or axis else Fraction(0)
            row[place] += float(exact if axis else _unrounded(number, exact))
    return table


def _unrounded(text: str, value: Fraction) -> Fraction:
    """Return the 24th, or of two decimals the 6th, that a shift is, rounded or cut; or the value."""
    decimals = len(text.partition(".")[2])
    if decimals < 2:
        return value
    parts = 6 if decimals == 2 else 24
    nearest = Fraction(round(value * parts), parts)
    is_coarse = 3 <= decimals <= 5 and nearest.denominator > 1
    error = max(Fraction(1, 10**decimals), LEAST if is_coarse else Fraction(0))
    return nearest if abs(value - nearest) < error else value


def _warn_of_rounding(texts: Iterable[str]) -> None:
    """Warn where a shift is not what is written."""
    numbers = {number for text in texts for number in re.findall(r"\d*\.\d+", text)}
    pairs = ((number, _unrounded(number, Fraction(number))) for number in sorted(numbers))
    changed = [f"{text} as {value}" for text, value in pairs if abs(value - Fraction(text)) > 1e-9]
    if changed:
        warnings.warn(
            f"the operators are rounded: read {', '.join(changed[:8])}",
            RoundedOperatorsWarning,
            stacklevel=3,
        )


def operators(group: CrystallographicGroup, lattice: ArrayLike | None = None) -> list[str]:
    """Return the operators of a group, one for each coset, in fractional coordinates of a lattice.

    The lattice, basis vectors as columns (d, d), is by default the group's; a coarser one, such as a
    conventional cell, has more cosets. `group_from_operators` makes the group again of them.

    Raises `GroupError` for over 3 dimensions, or a lattice whose vectors are no translations of the
    group or that it does not map to itself.

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
    return [",".join(map(_part, table)) for table in tables.tolist()]


def _part(row: list[float]) -> str:
    """Return one part of an operator as text: "x-y+1/3"."""
    fraction = Fraction(row[-1]).limit_denominator(48)
    decimal = f"{row[-1]:.15f}".rstrip("0")
    shift = decimal if abs(fraction - row[-1]) > ROUNDING else str(fraction)
    terms = [f"{x:+.0f}*{axis}" for x, axis in zip(row[:-1], AXES, strict=False) if x]
    terms += [f"+{shift}"] if row[-1] > ROUNDING or not terms else []
    return re.sub(r"(?<!\d)1\*", "", "".join(terms)).removeprefix("+")


def cell_lattice(cell: ArrayLike) -> Array:
    """Return the lattice (3, 3) of a cell, basis vectors as columns: a along x, b in the xy-plane.

    `cell` is a, b, c and alpha, beta, gamma in degrees; or the lengths alone, if the angles are right;
    or a lattice, which is returned. Raises `GroupError` for a cell without volume.

    >>> cell_lattice((2, 2, 3, 90, 90, 120)).round(3).tolist()
    [[2.0, -1.0, 0.0], [0.0, 1.732, 0.0], [0.0, 0.0, 3.0]]
    """
    shape = np.shape(cell)
    if shape == (3, 3):
        return checked_lattice(as_array(cell, "cell", (3, 3)))
    if shape not in ((3,), (6,)):
        wanted = (
            "a,b,c or a,b,c,alpha,beta,gamma (lengths, and angles in degrees), or a (3, 3) lattice"
        )
        raise refusal("cell", wanted, cell)
    lengths, angles = (*as_array(cell, "cell", shape).reshape(-1, 3), np.full(3, 90.0))[:2]
    if lengths.min() <= 0:
        raise refusal("cell", "of lengths above 0", lengths.min())
    if abs(angles - 90).max() > 90:
        raise GroupError(
            f"no cell has the angles {angles.tolist()}: they lie from 0 to 180 degrees"
        )
    cosines = np.cos(np.radians(angles))
    exact = np.where(np.isin(angles, (60, 90, 120)), np.round(2 * cosines) / 2, cosines)
    unit = np.eye(3)
    unit[[1, 0, 0], [2, 2, 1]] = unit[[2, 2, 1], [1, 0, 0]] = exact
    try:
        return checked_lattice(np.linalg.cholesky(unit).T * lengths)
    except np.linalg.LinAlgError as error:
        raise GroupError(f"no cell has the angles {angles.tolist()}: it would be flat") from error


def cell_parameters(lattice: Array) -> tuple[float, ...]:
    """Return the lengths of basis vectors, a, b, c, and the angles alpha, beta, gamma in degrees.

    Of a plane lattice they are a, b and gamma.
    """
    lengths = np.linalg.norm(lattice, axis=0)
    cosines = lattice.T @ lattice / np.outer(lengths, lengths)
    pairs = reversed(list(itertools.combinations(range(len(lengths)), 2)))
    return (*lengths.tolist(), *(float(np.degrees(np.arccos(cosines[p]))) for p in pairs))


def fitting_cell(linear: Array, lattice: Array) -> tuple[float, ...] | None:
    """Return the parameters of the cell nearest to `lattice` that operators map to itself.

    Its metric is the mean over the group of their matrices (n, d, d); None if that is not finite.
    """
    before, metric = 0.0, lattice.T @ lattice
    for _ in range(64):  # generators are enough: repeated, their mean comes to that over the group
        before = metric
        metric = (metric + (linear.swapaxes(1, 2) @ metric @ linear).mean(axis=0)) / 2
    if not np.allclose(before, metric, rtol=1e-9, atol=1e-9 * np.trace(metric)):
        return None
    return cell_parameters(np.linalg.cholesky(metric).T)
