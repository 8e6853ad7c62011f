"""Space groups by number, Hermann-Mauguin or Hall symbol, from CIFs and as CIFs."""

import importlib
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arrays import Array
from orbiflow.errors import GroupError, InputFileError, LatticeMismatchError, system_errors
from orbiflow.settings import as_path, described, naming_extras
from orbiflow.symmetry.group import CrystallographicGroup, checked_lattice
from orbiflow.symmetry.triplets import (
    cell_lattice,
    cell_parameters,
    fitting_cell,
    group_from_operators,
    operators,
    parse_operator,
)

MAX_CIF_BYTES = 64 * 2**20
MAX_NAME = 60
_TYPICAL = (1.0, 1.1, 1.3, 80.0, 100.0, 95.0)  # without symmetry; all default cells come from it
_LENGTHS, _ANGLES = ("a", "b", "c"), ("alpha", "beta", "gamma")
_CELL = [*(f"_cell_length_{x}" for x in _LENGTHS), *(f"_cell_angle_{x}" for x in _ANGLES)]
_OPERATORS = ("_space_group_symop_operation_xyz", "_symmetry_equiv_pos_as_xyz")
_HALL = ("_space_group_name_Hall", "_symmetry_space_group_name_Hall")
_NAMES = ("_space_group_name_H-M_alt", "_symmetry_space_group_name_H-M")
_SAID = "Hall: "  # before a symbol of Hall
_NUMBERS = ("_space_group_IT_number", "_symmetry_Int_Tables_number")
_SYMBOLS = (*_HALL, *_NAMES, *_NUMBERS)


def space_group(
    name: int | str, cell: ArrayLike | None = None, *, origin: Literal[1, 2] | None = None
) -> CrystallographicGroup:
    """Return a space group by its number or symbol, on its primitive lattice.

    Needs the package gemmi, whose tables have 564 settings: `pip install "orbiflow[crystals]"`.

    Args:
        name: A number from 1 to 230, perhaps with an origin or axes ("227:2", "166:R"); a short
            Hermann-Mauguin symbol ("P2_1/c", "P 21/c", "P 1 21/c 1", "Fd-3m:2", "R -3 m:R"); or a Hall
            symbol ("Hall: -P 2ybc"). Without more it means the unique axis b, and hexagonal axes
            unless only rhombohedral ones fit the cell. Where International Tables
            have two origins, which 24 groups have, the name says which one: "227:1" or "227:2".
        cell: The conventional cell, as for `cell_lattice`. Default: one of its system with a = 1.
        origin: The origin of a name that does not say it, for work in which it does not matter.

    Raises `GroupError` for an unknown name, one that may mean two origins, or a cell that the group
    does not fit.

    >>> space_group("P 21 21 21", (5.0, 6.0, 7.0)).order
    4
    >>> diamond = space_group("227:1")
    >>> diamond.name, diamond.order, round(diamond.cell_volume, 9)
    ('F d -3 m:1', 48, 0.25)
    """
    if origin not in (None, 1, 2):
        raise GroupError(f"origin must be 1 or 2, got {origin!r}")
    label, texts = _named(name, origin)
    if cell is None:
        linear = np.stack([parse_operator(text, 3)[:, :3] for text in texts])
        a, b, c, *angles = fitting_cell(linear, cell_lattice(_TYPICAL)) or _TYPICAL
        cell = [1.0, round(b / a, 2), round(c / a, 2), *map(round, angles)]
    try:
        return group_from_operators(texts, cell_lattice(cell), name=label)
    except LatticeMismatchError:
        axes = label.removesuffix(":H") + ":R"  # which are meant if they fit and none are named
        if not label.endswith(":H") or re.search(r":", str(name)):
            raise
        return group_from_operators(_named(axes, None)[1], cell_lattice(cell), name=axes)


def _named(name: int | str, origin: int | None) -> tuple[str, list[str]]:
    """Return the name that a group goes by, and all its operators in the conventional cell."""
    text = str(name).strip()
    if text.startswith(_SAID):
        operations = _hall_operators(text)
        row = _gemmi().find_spacegroup_by_ops(_gemmi().GroupOps(operations))
        return row.xhm() if row else text, [op.triplet() for op in operations]
    row = _row(text)
    if has_two_origins(row, text):
        if origin is None:
            raise GroupError(
                f"{described(name)} has two origins in International Tables: write "
                f"{text + ':1'!r} for the first, on a site of the highest symmetry, or "
                f"{text + ':2'!r} for the second, on a centre of inversion"
            )
        row = _gemmi().find_spacegroup_by_name(f"{row.hm}:{origin}")
    return row.xhm(), [op.triplet() for op in row.operations()]


def _row(text: str) -> Any:
    """Return gemmi's row of a number or a Hermann-Mauguin symbol.

    Blanks and "_" may be left out; where they stand, they stand as in the symbol: "P 2 1" is not P 21,
    and "P3_21" not P 3 2 1.
    """
    gemmi = _gemmi()
    row: Any = None
    if numbered := re.fullmatch(r"([1-9]\d{0,2})(?::([12HR]))?", text):
        row = gemmi.find_spacegroup_by_number(int(numbered[1]))
        if row is not None and numbered[2]:
            row = gemmi.find_spacegroup_by_name(f"{row.hm}:{numbered[2]}")
    elif len(text) < MAX_NAME and re.fullmatch(r"[PABCFIR](_(?<=[2346]_)(?=[1-5])|[^_])+", text):
        symbol = text.replace("_", "")
        row = gemmi.find_spacegroup_by_name(symbol)
        parts = symbol.partition(":")[0].split()
        listed: list[str] = row.hm.split() if row else []
        screws = [part for part in listed if re.match(r"[2346][1-5]", part)]
        if (len(parts) > 2 and parts != listed) or text.count("_") not in (0, len(screws)):
            row = None
        if row is not None and ":" in text and text.rpartition(":")[2] != row.ext:
            row = None
    if row is None:
        raise GroupError(
            f"unknown space group {described(text)}: give a number from 1 to 230, a Hermann-Mauguin "
            'symbol such as "P 21 21 21" or "R -3 m:H", or a Hall symbol such as "Hall: -P 2ybc"'
        )
    return row


def has_two_origins(row: Any, text: str) -> bool:
    """Return whether a group has two origins in the tables and its name does not say which."""
    return row.ext in ("1", "2") and ":" not in text


def _hall_operators(text: str) -> list[Any]:
    try:
        if "_" in text:  # which gemmi takes for a blank, and people for a subscript
            raise ValueError("a symbol of Hall has blanks and no underscores")
        return list(_gemmi().symops_from_hall(text.removeprefix(_SAID).strip()))
    except (RuntimeError, ValueError) as error:
        raise GroupError(f"unknown space group {described(text)}: {error}") from error


def group_from_cif(path: str | Path, cell: ArrayLike | None = None) -> CrystallographicGroup:
    """Return the group of the first structure of a CIF, on its primitive lattice.

    It is that of the operators, or else of the Hall symbol, the Hermann-Mauguin symbol or the number.
    `cell`, as for `space_group`, is used in the place of the file's. Needs gemmi.

    Raises `InputFileError` for a file that cannot be read, describes no group, or contradicts itself:
    the number, and the orders of the groups that operators and symbols mean, must agree.
    """
    path = as_path(path, "path")
    with system_errors(InputFileError, f"{path}: cannot be read"):
        if path.stat().st_size > MAX_CIF_BYTES:
            raise InputFileError(f"{path}: over {MAX_CIF_BYTES:,} bytes, too large for a CIF")
        text = path.read_bytes().decode("latin-1")
    cif = _gemmi().cif
    try:
        for block in cif.read_string(text):
            names = _names(block, cif)
            listed = [cif.as_string(text) for tag in _OPERATORS for text in block.find_values(tag)]
            if names or listed:
                break
        else:
            raise GroupError("it has neither operators nor a symbol of a group")
        if cell is None:
            cell = [cif.as_number(block.find_value(tag) or "?") for tag in _CELL]
        if not np.isfinite(cell).all():
            raise GroupError("its cell is not complete: give one as the argument cell")
        return _agreed(names, listed, cell_lattice(cell))
    except (RuntimeError, ValueError) as error:
        raise InputFileError(f"{path}: {error}") from error


def _names(block: Any, cif: Any) -> list[str]:
    """Return the names that a block of a CIF gives its group, the most exact first."""
    values = {tag: cif.as_string(block.find_value(tag) or "?") for tag in _SYMBOLS}
    texts = {tag: text for tag, text in values.items() if text not in ("", "?", ".", "0")}
    return [_SAID + text if tag in _HALL else text for tag, text in texts.items()]


def _agreed(names: list[str], listed: list[str], basis: Array) -> CrystallographicGroup:
    """Return the group that operators list or names mean, if they agree.

    Raises `GroupError` where they have no setting of the tables in common, or not the order and the
    translations, and for a name that is none.
    """
    settings = {name: _settings(name) for name in names}
    named = [row for rows in settings.values() for row in rows]
    if listed:
        group = group_from_operators(listed, basis, name="".join(names[:1]).removeprefix(_SAID))
        row = _row_of(operators(group, basis))
        settings[f"its {len(listed)} operators"] = [row] if row else []
        group = replace(group, name=row.xhm()) if row else group
    else:
        sure = (name for name, rows in settings.items() if len(rows) < 2 or name.isdigit())
        group = space_group(next(sure, names[0]), basis)
    halls = [{row.hall for row in rows} for rows in settings.values() if rows]
    implied = round(abs(float(np.linalg.det(basis))) / group.cell_volume)
    is_one = not halls or bool(set[str].intersection(*halls))
    if named and not settings.get(f"its {len(listed)} operators", named):
        is_one = implied <= max(len(row.operations().cen_ops) for row in named)
        is_one &= element_counts(group) == element_counts(space_group(f"{_SAID}{named[0].hall}"))
    if not is_one:
        said = ", ".join(
            f"{what} is of {rows[0].xhm()} (number {rows[0].number})"
            if rows
            else f"{what} are of order {group.order} and imply {implied} translations in the cell"
            for what, rows in settings.items()
        )
        raise GroupError(f"it contradicts itself: {said}; correct it, or remove what is wrong")
    return group


def element_counts(group: CrystallographicGroup) -> Counter[tuple[int, int, int]]:
    """Return how many cosets have a determinant, a trace, and a screw or glide of an order.

    The order is how often the element is repeated until it equals one without a shift along itself.
    All three are the same in every basis and for every origin, and for enantiomorphs.
    """
    counts: Counter[tuple[int, int, int]] = Counter()
    shifts = group.translations @ group.inverse_lattice.T
    nearby = np.stack(np.meshgrid(*[np.arange(-3, 4)] * 3), axis=-1).reshape(-1, 3)
    for linear, shift in zip(group.integral_parts, shifts, strict=True):
        along = np.mean([np.linalg.matrix_power(linear, k) for k in range(12)], axis=0)
        apart = [abs((nearby - n * shift % 1) @ along.T).max(axis=1).min() for n in range(1, 7)]
        orders = (n for n, distance in enumerate(apart, start=1) if distance < 1e-6)
        counts[round(np.linalg.det(linear)), round(np.trace(linear)), next(orders, 0)] += 1
    return counts


def _row_of(triplets: list[str]) -> Any | None:
    """Return gemmi's row of the group of these operators, if its tables have their setting."""
    gemmi = _gemmi()
    try:
        return gemmi.find_spacegroup_by_ops(gemmi.GroupOps([gemmi.Op(t) for t in triplets]))
    except (RuntimeError, ValueError):  # a shift that is no 24th
        return None


def _settings(name: str) -> list[Any]:
    """Return gemmi's rows that a name in a CIF may mean: a number may mean all its settings."""
    gemmi = _gemmi()
    if name.startswith(_SAID):
        row = gemmi.find_spacegroup_by_ops(gemmi.GroupOps(_hall_operators(name)))
        return [row] if row else []
    row = _row(name)
    if name.isdigit():
        return [other for other in gemmi.spacegroup_table() if other.number == row.number]
    if has_two_origins(row, name):
        return [gemmi.find_spacegroup_by_name(f"{row.hm}:{origin}") for origin in (1, 2)]
    return [row]


def cif_text(group: CrystallographicGroup, lattice: ArrayLike | None = None) -> str:
    """Return a CIF with the cell and the operators of a space group, which other programs read.

    The lattice is as for `operators`. A CIF has lengths and angles only: the orientation is lost.

    >>> cif_text(space_group("P -1")).splitlines()[-2:]
    ["'x,y,z'", "'-x,-y,-z'"]
    """
    if group.dim != 3:
        raise GroupError(f"a CIF needs a group of 3 dimensions, got {group.dim}")
    basis = group.lattice if lattice is None else checked_lattice(lattice)
    cell = [f"{tag} {x:.12g}" for tag, x in zip(_CELL, cell_parameters(basis), strict=True)]
    loop = ["loop_", "_space_group_symop_operation_xyz"]
    quoted = [f"'{operator}'" for operator in operators(group, basis)]
    return "\n".join(["data_group", *cell, *loop, *quoted, ""])


def _gemmi() -> Any:
    with naming_extras("reading names of space groups and CIFs"):
        return importlib.import_module("gemmi")
