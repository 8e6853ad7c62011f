"""Space groups by number, Hermann-Mauguin or Hall symbol, from CIFs and as CIFs."""

import importlib
import re
import warnings
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arrays import Array
from orbiflow.errors import (
    DataWarning,
    GroupError,
    InputFileError,
    LatticeMismatchError,
    system_errors,
)
from orbiflow.settings import as_path, described, naming_extras
from orbiflow.symmetry.group import CrystallographicGroup, checked_lattice
from orbiflow.symmetry.group_symbols import (
    find_hall,
    find_setting,
    has_two_origins,
    settings_named,
    settings_numbered,
)
from orbiflow.symmetry.triplets import (
    cell_lattice,
    cell_parameters,
    fitting_cell,
    group_from_operators,
    operators,
    parse_operator,
)

MAX_CIF_BYTES = 64 * 2**20
_TYPICAL = (1.0, 1.1, 1.3, 80.0, 100.0, 95.0)  # without symmetry; all default cells come from it
_LENGTHS, _ANGLES = ("a", "b", "c"), ("alpha", "beta", "gamma")
_CELL = [*(f"_cell_length_{x}" for x in _LENGTHS), *(f"_cell_angle_{x}" for x in _ANGLES)]
_OPERATORS = ("_space_group_symop_operation_xyz", "_symmetry_equiv_pos_as_xyz")
_HALL = ("_space_group_name_hall", "_symmetry_space_group_name_hall")
_NAMES = (
    *("_space_group_name_h-m_alt", "_symmetry_space_group_name_h-m"),
    *("_space_group_name_h-m_full", "_space_group_name_h-m_ref"),
)
_SAID = "Hall: "  # before a symbol of Hall
_NUMBERS = ("_space_group_it_number", "_symmetry_int_tables_number")
_SYMBOLS = (*_HALL, *_NAMES, *_NUMBERS)


def space_group(
    name: int | str, cell: ArrayLike | None = None, *, origin: Literal[1, 2] | None = None
) -> CrystallographicGroup:
    """Return a space group by its number or symbol, on its primitive lattice.

    Needs the package gemmi, whose tables have 564 settings: `pip install "orbiflow[crystals]"`.

    Args:
        name: A number from 1 to 230, perhaps with a setting ("227:2", "62:cab"); a Hermann-Mauguin
            symbol as it is typeset or typed ("P2_1/c", "P 21/c", "P2(1)/c", "P 1 21/c 1", "Fd-3m:2",
            "R -3 m:R"); or a Hall symbol: "Hall: P 2", or without that word where nothing else is
            written so ("-P 2ybc", "F 4d 2 3 -1d"). Without more it means the unique axis b, and
            hexagonal axes unless only rhombohedral ones fit the cell. Where International Tables
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
        if not label.endswith(":H") or re.search(
            r':|^[-H]|[HR"]$', str(name).strip(), re.IGNORECASE
        ):
            raise
        return group_from_operators(_named(axes, None)[1], cell_lattice(cell), name=axes)


def _named(name: int | str, origin: int | None) -> tuple[str, list[str]]:
    """Return the name that a group goes by, and all its operators in the conventional cell."""
    gemmi, text = _gemmi(), str(name).strip()
    rows = settings_numbered(gemmi, text)
    if row := rows[0] if rows else find_setting(gemmi, text):
        if has_two_origins(rows or settings_named(gemmi, text)):
            if origin is None:
                raise GroupError(
                    f"{described(name)} has two origins in International Tables: write "
                    f"{text + ':1'!r} for the first, on a site of the highest symmetry, or "
                    f"{text + ':2'!r} for the second, on a centre of inversion"
                )
            row = gemmi.find_spacegroup_by_name(f"{row.hm}:{origin}")
        return row.xhm(), [op.triplet() for op in row.operations()]
    if operations := find_hall(gemmi, text):
        row = gemmi.find_spacegroup_by_ops(gemmi.GroupOps(operations))
        return row.xhm() if row else text, [op.triplet() for op in operations]
    raise GroupError(
        f"unknown space group {described(name)}: give a number from 1 to 230, a Hermann-Mauguin "
        'symbol such as "P 21 21 21" or "R -3 m:H", or a Hall symbol such as "Hall: -P 2ybc"'
    )


def group_from_cif(path: str | Path, cell: ArrayLike | None = None) -> CrystallographicGroup:
    """Return the group of the first structure of a CIF or mmCIF, on its primitive lattice.

    It is that of the operators, or else of the Hall symbol, the Hermann-Mauguin symbol or the number.
    `cell`, as for `space_group`, is used in the place of the file's. Needs gemmi.

    Raises `InputFileError` for a file that cannot be read, describes no group, or contradicts itself:
    operators, symbols and number must be of one type of group, and of one setting.
    """
    path = as_path(path, "path")
    with system_errors(InputFileError, f"{path}: cannot be read"):
        if path.stat().st_size > MAX_CIF_BYTES:
            raise InputFileError(f"{path}: over {MAX_CIF_BYTES:,} bytes, too large for a CIF")
        text = path.read_bytes().decode("latin-1")
    cif = _gemmi().cif
    try:
        blocks = (_values_by_tag(block, cif) for block in cif.read_string(text))
        values = next(table for table in blocks if table.keys() & {*_OPERATORS, *_SYMBOLS})
        if cell is None:
            cell = [cif.as_number(values.get(tag, "?")[0]) for tag in _CELL]
        if not np.isfinite(cell).all():
            raise GroupError("its cell is not complete: give one as the argument cell")
        listed = next((values[tag] for tag in _OPERATORS if tag in values), None)
        names, settings = _names(values)
        if listed is None:
            unambiguous = (name for name in names if not has_two_origins(_settings(_gemmi(), name)))
            group = space_group(next(unambiguous, names[0]), cell)
        else:
            basis = cell_lattice(cell)
            group = group_from_operators(listed, basis, name="".join(names[:1]).removeprefix(_SAID))
            if not names:
                _warn_of_finer_lattice(group, listed, basis)
            row = _row_of(operators(group, basis))
            if row is not None:
                settings[f"its {len(listed)} operators"] = [row]
                is_known = names and (_SAID in names[0] or _settings(_gemmi(), names[0]))
                group = group if is_known else replace(group, name=row.xhm())
            else:
                _check_type(group, listed, basis, settings)
        _check_agreement(settings)
        return group
    except StopIteration:
        raise InputFileError(f"{path}: it has neither operators nor a symbol of a group") from None
    except (RuntimeError, ValueError) as error:
        raise InputFileError(f"{path}: {error}") from error


def _names(values: dict[str, list[str]]) -> tuple[list[str], dict[str, list[Any]]]:
    """Return the names that a CIF gives its group, the most exact first, and what each may mean.

    A Hall symbol that is none is passed over, and the number 0, which says that it is not known.
    """
    gemmi = _gemmi()
    names: list[str] = []
    settings: dict[str, list[Any]] = {}
    for tag, text in ((tag, values[tag][0]) for tag in _SYMBOLS if tag in values):
        if tag in _HALL:
            if (hall := find_hall(gemmi, _SAID + text)) is None:
                continue
            rows = [row] if (row := _row_of([op.triplet() for op in hall])) else []
        elif tag in _NUMBERS and re.fullmatch("0+", text):
            continue
        else:
            rows = _settings(gemmi, text)
            if tag in _NUMBERS and not rows:
                raise GroupError(f"{tag} {described(text)} is no number of a group: 1 to 230 are")
        names.append(_SAID + text if tag in _HALL else text)
        if rows:
            settings[f"{tag} {text}"] = rows
    return names, settings


def _settings(gemmi: Any, text: str) -> list[Any]:
    """Return gemmi's rows that a number or a Hermann-Mauguin symbol may mean."""
    return settings_numbered(gemmi, text) or settings_named(gemmi, text)


def _check_agreement(settings: dict[str, list[Any]]) -> None:
    """Raise `GroupError` where what a CIF says has no type of group, or no setting, in common."""
    numbers = {what: {str(row.number) for row in rows} for what, rows in settings.items()}
    halls = {what: {str(row.hall) for row in rows} for what, rows in settings.items()}
    if not settings or _have_common(halls.values()):
        return
    if not _have_common(numbers.values()):
        said = ", ".join(f"{what} is of number {min(options)}" for what, options in numbers.items())
    else:
        named = {what: rows[0] for what, rows in settings.items() if not what.startswith(_NUMBERS)}
        said = ", ".join(f"{what} is of the setting {row.xhm()}" for what, row in named.items())
    raise GroupError(f"it contradicts itself: {said}; correct it, or remove what is wrong")


def _have_common(sets: Iterable[set[str]]) -> bool:
    first, *others = sets
    return bool(first.intersection(*others))


def _check_type(
    group: CrystallographicGroup, listed: list[str], basis: Array, settings: dict[str, list[Any]]
) -> None:
    """Raise `GroupError` where operators in a setting that no table has are not of a named type.

    Only rotations and screws, reflections and glides are compared, by their counts. The operators may
    imply no translations but those listed or of the names' own centring.
    """
    named = [row for rows in settings.values() for row in rows]
    most = max((len(row.operations().cen_ops) for row in named), default=np.inf)
    implied = _translations_in(group, basis)
    if implied > max(most, _translations_listed(listed)):
        raise GroupError(
            f"it contradicts itself: its operators imply {implied} translations within its cell and "
            f"its name {most:.0f}; one of them may be mistyped, or rounded too coarsely"
        )
    counts = element_counts(group)
    for what, rows in settings.items():
        if counts != element_counts(space_group(f"{_SAID}{rows[0].hall}")):
            raise GroupError(
                f"it contradicts itself: its {len(listed)} operators are of another type of group, of "
                f"order {group.order}, than {what}; correct it, or remove what is wrong"
            )


def element_counts(group: CrystallographicGroup) -> Counter[tuple[int, int, int, float]]:
    """Return how many cosets have a determinant, a trace, a screw or glide of an order, and a pitch.

    The order is how often the element is repeated until it equals one without a shift along itself.
    All four are the same in every right-handed basis and for every origin; only the pitch tells
    enantiomorphs apart.
    """
    counts: Counter[tuple[int, int, int, float]] = Counter()
    shifts = group.translations @ group.inverse_lattice.T
    nearby = np.stack(np.meshgrid(*[np.arange(-3, 4)] * 3), axis=-1).reshape(-1, 3)
    elements = zip(group.integral_parts, group.linear_parts, shifts, strict=True)
    for linear, turn, shift in elements:
        along = np.mean([np.linalg.matrix_power(linear, k) for k in range(12)], axis=0)
        apart = [abs((nearby - n * shift % 1) @ along.T).max(axis=1).min() for n in range(1, 7)]
        orders = (n for n, distance in enumerate(apart, start=1) if distance < 1e-6)
        pitch = _pitch(turn, group.lattice @ along @ shift, group.lattice @ along @ nearby.T)
        counts[round(np.linalg.det(linear)), round(np.trace(linear)), next(orders, 0), pitch] += 1
    return counts


def _pitch(turn: Array, shift: Array, steps: Array) -> float:
    """Return how far a rotation goes along its axis, as a share of the lattice's step there.

    The axis points to where the rotation is counter-clockwise. It is 0 for what has no such axis.
    """
    around = turn - turn.T
    axis = np.array([around[2, 1], around[0, 2], around[1, 0]])
    if np.linalg.det(turn) < 0 or np.linalg.norm(axis) < 1e-6:
        return 0.0
    heights = abs(axis @ steps)
    share = float(axis @ shift / heights[heights > 1e-6 * heights.max()].min())
    return round(share, 3) % 1


def _translations_in(group: CrystallographicGroup, basis: Array) -> int:
    return round(abs(float(np.linalg.det(basis))) / group.cell_volume)


def _translations_listed(listed: list[str]) -> int:
    tables = [parse_operator(text, 3) for text in listed]
    shifts = {tuple((t[:, 3] % 1).tolist()) for t in tables if np.allclose(t[:, :3], np.eye(3))}
    return len({*shifts, (0.0, 0.0, 0.0)})


def _warn_of_finer_lattice(group: CrystallographicGroup, listed: list[str], basis: Array) -> None:
    """Warn where operators that no name goes with imply translations that are not among them."""
    implied, stated = _translations_in(group, basis), _translations_listed(listed)
    if implied > stated:
        warnings.warn(
            f"the {len(listed)} operators imply {implied} translations within the cell and list "
            f"{stated}: its lattice is finer than the cell; is one mistyped, say 1/3 for 1/2?",
            DataWarning,
            stacklevel=3,
        )


def _row_of(triplets: list[str]) -> Any | None:
    """Return gemmi's row of the group of these operators, if its tables have their setting."""
    gemmi = _gemmi()
    try:
        return gemmi.find_spacegroup_by_ops(gemmi.GroupOps([gemmi.Op(t) for t in triplets]))
    except (RuntimeError, ValueError):  # a shift that is no 24th
        return None


def _values_by_tag(block: Any, cif: Any) -> dict[str, list[str]]:
    """Return the values in a block of a CIF, unquoted; the dots in mmCIF's tags become "_"."""
    columns: dict[str, list[str]] = {}
    for item in block:
        if item.pair:
            columns[item.pair[0]] = [item.pair[1]]
        elif item.loop:
            width, values = item.loop.width(), item.loop.values
            columns |= {tag: values[i::width] for i, tag in enumerate(item.loop.tags)}
    columns = {tag.lower().replace(".", "_"): values for tag, values in columns.items()}
    wanted = columns.keys() & {*_CELL, *_OPERATORS, *_SYMBOLS}
    texts = {tag: [cif.as_string(text) for text in columns[tag]] for tag in wanted}
    unknown = ({""}, {"."}, {"?"})  # as some programs write them, in quotes
    return {tag: values for tag, values in texts.items() if {*values} not in unknown}


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
