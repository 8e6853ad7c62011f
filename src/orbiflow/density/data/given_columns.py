"""What columns are on which a density depends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.density.data.frames import as_numbers
from orbiflow.density.data.proposals import lacks_unit, proposed_role, quoted, range_of
from orbiflow.density.data.roles import WORDS, Asked, Role, role_named
from orbiflow.density.data.source import UndeclaredError, short
from orbiflow.errors import SettingError, literal
from orbiflow.settings import is_a

FEW_ROWS = 20
"""Fewer may all have words of their own."""


def given_roles(
    names: Sequence[str],
    columns: Mapping[str, NDArray[Any]],
    asked: Asked,
    unit: str | None = None,
    *,
    are_asked: bool = True,
    where: str = "",
    option: str = "given",
) -> dict[str, Role]:
    """Return what columns are on which a density depends, by their names.

    Text is words. Numbers are as declared, or what the table of names says, or asked for; of arrays
    they are real.

    Args:
        names: The columns.
        columns: Their cells (N,).
        asked: What was declared, by names.
        unit: The unit of angles that name none.
        are_asked: Whether to ask what numbers are, as of a table, and not to take them as real.
        where: What messages begin with.
        option: The setting in which they are named.

    Raises:
        UndeclaredError: For columns of which nothing says what they are.
        SettingError: For words that are declared as numbers, and roles that covariates do not have.
    """
    lower = {str(key).casefold(): role for key, role in asked.items()}
    found: dict[str, Role | None] = {}
    numbers: dict[str, Array] = {}
    for name in names:
        role = lower.get(name.casefold())
        cells = columns[name]
        is_text = cells.dtype.kind in "USbO" and any(is_a(c, str | bool) for c in cells.tolist())
        if role is not None and role.is_side:
            raise SettingError(
                f"{{{option}}}: {literal(repr(name))} is declared as {role.kind}, and a density may "
                "depend on an angle, axial, cycle, linear, positive, bounded or word alone"
            )
        if is_text and role is not None and role.kind != "word":
            word = next(c for c in cells.tolist() if is_a(c, str | bool))
            raise SettingError(
                literal(f"{where}column {name!r} has {str(word)!r}, and is declared as {role}: ")
                + "correct it, or declare the column as word"
            )
        if not is_text:
            numbers[name] = as_numbers(cells, repr(name))
        if is_text:
            _refuse_many_words(name, cells, where)
            found[name] = Role("word")
        elif role is not None:
            found[name] = role.with_unit(unit)
        else:
            own = role_named(name)
            own = None if own is None or own.is_side else own.with_unit(unit)
            found[name] = Role("linear") if own is None and not are_asked else own
    unknown = [name for name, role in found.items() if role is None or lacks_unit(role)]
    if unknown:
        values = {name: numbers[name] for name in unknown}
        words = {name: str(role) for name, role in found.items() if role is not None}
        for name in unknown:
            word = proposed_role(name, values[name], found[name], by_size=False)
            words[name] = "linear" if Role.of(word).is_side else word
        proposal = ",".join(f"{name}={words[name]}" for name in names)
        ranges = ", ".join(f"{short(name)} ({range_of(values[name])})" for name in unknown)
        them = "it is" if len(unknown) == 1 else "they are"
        raise UndeclaredError(
            literal(f"{where}{ranges}: say what {them}; if this is right, declare: ")
            + f"{{{option}}} {literal(quoted(proposal))} (a role is {', '.join(WORDS[:7])})",
            unknown,
            proposal,
        )
    return {name: role for name, role in found.items() if role is not None}


def _refuse_many_words(name: str, cells: NDArray[Any], where: str) -> None:
    """Refuse words of which nearly every row has one of its own, as dates and names are."""
    words = {str(cell) for cell in cells.tolist()}
    if len(cells) >= FEW_ROWS and 2 * len(words) > len(cells):
        raise SettingError(
            literal(
                f"{where}column {name!r} has {len(words)} different words in {len(cells)} rows, "
                f"such as {min(words)!r}: "
            )
            + "a density depends on words that recur; of dates give numbers, such as the hour or the "
            "days since a first one, or leave the column out"
        )
