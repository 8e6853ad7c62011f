"""Which columns of a table are data, and what they are: as declared, by their names, or asked for."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from orbiflow.density.data.checks import codes_among
from orbiflow.density.data.names import (
    arrangements,
    check_columns,
    chosen_arrangement,
    is_number_name,
)
from orbiflow.density.data.proposals import proposed_role, undeclared
from orbiflow.density.data.roles import Asked, Role, role_named
from orbiflow.density.data.table import (
    HOURS,
    DataTable,
    UndeclaredError,
    found_column,
    is_clock,
    listing,
)
from orbiflow.density.data.units import DIRECTIONS, ROTATIONS, VECTORS, is_angular, words_of
from orbiflow.errors import SettingError, literal

Roles = tuple[Role | None, ...]
"""What columns are; None is a coordinate of the space."""

WIDTHS = {
    "klein-bottle": (2,), **dict.fromkeys(DIRECTIONS, (2, 3)), ROTATIONS: (3, 4, 9),
}  # fmt: skip
"""The numbers of columns that spaces take."""

LOOKED_AT = 100
"""Cells of a column of text that are looked at for times of day."""


@dataclass(frozen=True)
class Declaration:
    """What is known of the columns of a table before it is read.

    - `space`: The name of the space, or of the group, whose rules the data obey.
    - `asked`: The columns that are named, and what they are.
    - `unit`: The unit of angles that name none.
    - `widths`: The numbers of columns that the space may take. Default: those of its name.
    - `form_of`: Says how columns, by their names, write rotations.
    - `roles`: What so many columns are, of a space or a fit that is there already.
    - `names`: The columns of that fit, if they have names.
    """

    space: str
    asked: Asked = field(default_factory=dict[str | int, Role | None])
    unit: str | None = None
    widths: tuple[int, ...] | None = None
    form_of: Callable[[Sequence[str]], str | None] = lambda _: None
    roles: Callable[[int], Roles] | None = None
    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class ChosenColumns:
    """The columns of a table, by number from 0, that a density is of, and those that say more of rows.

    - `columns`: The space's own, in its order, and then those beside them.
    - `roles`: What each of them is; None is a coordinate of the space.
    - `unit`: The unit of the space's own angles, None if there are none.
    - `notes`: What was decided.
    - `side`: The columns of weights, counts and groups, by these words.
    - `space`: The name of the space whose rules they obey.
    """

    columns: Sequence[int]
    roles: Roles
    unit: str | None
    notes: Sequence[str]
    side: Mapping[str, int]
    space: str


def choose(table: DataTable, said: Declaration, apart: Collection[int] = ()) -> ChosenColumns:
    """Return the columns that a density is of; columns `apart` are none of them, such as covariates.

    Raises:
        UndeclaredError: For columns of which nothing says what they are.
        SettingError: For columns that there are not, or too many, and declarations that cannot be.
    """
    roles = {found_column(table, key): role for key, role in said.asked.items()}
    if len(roles) < len(said.asked):
        raise SettingError("{columns} names a column twice; name each once")
    side: dict[str, int] = {}
    for column, role in roles.items():
        if role is not None and role.kind == "word":
            raise SettingError(
                f"{literal(table.names[column])} is declared as word: a density may depend on words, "
                "with {given}, and is not of them"
            )
        if role is not None and role.is_side and role.kind != "ignore":
            if role.kind in side:
                raise SettingError(
                    f"{{columns}} names two columns of the role {role.kind}: leave one"
                )
            side[role.kind] = column
    data = {k: r for k, r in roles.items() if (r is None or not r.is_side) and k not in apart}
    free = [k for k in range(len(table.names)) if k not in apart and k not in roles]
    choice = _Choice(table, said, roles, data, free)
    if said.roles is not None:
        columns = choice.as_known(said.roles)
    else:
        columns = choice.on_torus() if said.space == "torus" else choice.in_space()
    names = [table.names[k] for k in columns[0]]
    for name in names if len(set(names)) < len(names) else ():
        if names.count(name) > 1:
            found_column(table, name)  # which says that there are several
    return ChosenColumns(*columns, side, said.space)


Columns = tuple[Sequence[int], Roles, str | None, list[str]]
"""Columns, what they are, the unit of the space's own, and notes."""


@dataclass(frozen=True)
class _Choice:
    """A table, what is declared, and its columns: all that are named, the data among them, others."""

    table: DataTable
    said: Declaration
    roles: Mapping[int, Role | None]
    data: Mapping[int, Role | None]
    free: Sequence[int]

    def _names(self, columns: Iterable[int]) -> list[str]:
        return [self.table.names[k] for k in columns]

    def _named(self, column: int) -> Role | None:
        """Return the role that a column's name says, if the columns have names."""
        return role_named(self.table.names[column]) if self.table.is_named else None

    def _role(self, column: int, role: Role | None) -> Role | None:
        """Return what a column is: as declared, by its name, or an angle of an array; or None."""
        role = role or self._named(column)
        if role is None and (self.table.is_array or not self.table.is_named):
            role = Role("angle")
        unit = self.said.unit or ("radians" if self.table.is_array else None)
        return None if role is None or role.kind == "ignore" else role.with_unit(unit)

    def _numeric(self) -> list[int]:
        """Return the columns of numbers that are not named, and that no name says to ignore."""
        roles = {k: self._named(k) for k in self.free if self.table.is_numeric(k)}
        return [k for k, role in roles.items() if role is None or role.kind != "ignore"]

    def _left_out(self, columns: Collection[int]) -> list[str]:
        """Return a note on columns that are not used, and were not said to be none of the data."""
        left = [k for k in self.free if k not in columns]
        numeric = [k for k in left if self.table.is_numeric(k)]
        words = [k for k in left if k not in numeric and self._named(k) is None]
        notes = [f"left out {listing(self._names(words))}: no numbers"] if words else []
        if any(map(self._has_clocks, words)):
            notes[0] += f"; to use times of day, {HOURS}"
        if numeric:
            notes.append(f"left out {listing(self._names(numeric))}: name all columns to use them")
        return notes

    def _has_clocks(self, column: int) -> bool:
        """Return whether a column of text holds times of day."""
        return any(is_clock(str(cell).strip()) for cell in self.table.cells(column)[:LOOKED_AT])

    def as_known(self, roles_of: Callable[[int], Roles]) -> Columns:
        """Return the columns of a space or a fit that is there already."""
        table, names, notes = self.table, list(self.said.names), list[str]()
        whose = f"the model was fitted to {', '.join(names)}"
        has_names = bool(names) and not all(map(is_number_name, names))
        columns = list(self.data)
        called = self._names(columns)
        if columns and called != names and sorted(called) == sorted(names):
            order = literal(f"'{','.join(names)}'")
            raise SettingError(literal(f"{whose}, in this order; give ") + f"{{columns}} {order}")
        if not columns and table.is_named and has_names:
            columns = [self._fitted(name) for name in names]
        elif not columns:
            columns, notes = self._by_names() if self.said.space != "torus" else ([], [])
            columns += [k for k in self.free if table.is_numeric(k) and k not in columns]
            if has_names:
                notes = [
                    f"{table.where}has no header: {whose}, and its columns are taken for these"
                ]
        self._check_count(
            columns, (len(names),) if names else self.said.widths, whose * bool(names)
        )
        roles = roles_of(len(columns))
        self._check_names(columns[: roles.count(None)])
        for column, role in zip(columns, roles, strict=True):
            declared = self.data.get(column)
            if declared is not None and role is not None and declared != role:
                raise SettingError(
                    literal(
                        f"{table.names[column]} is declared as {declared}, and is {role} in the "
                    )
                    + "space or the model: convert it"
                )
        return columns, roles, self.said.unit, notes

    def _fitted(self, name: str) -> int:
        """Return the column of a name of the fit, or that of strikes for the direction of dip."""
        names = self.table.names
        if words_of(name) == ["dipdir"] and name.casefold() not in map(str.casefold, names):
            strikes = [[k for k in names if word in words_of(k)] for word in ("dipdir", "strike")]
            name = next((hits[0] for hits in strikes if len(hits) == 1), name)
        try:
            return found_column(self.table, name)
        except SettingError as error:
            fitted = ", ".join(self.said.names)
            raise SettingError(
                literal(f"the model was fitted to {fitted}, and there is no {name} among ")
                + literal(listing(names))
                + ": specify with {columns} which they are, in this order"
            ) from error

    def on_torus(self) -> Columns:
        """Return columns that are angles, real numbers and cycles."""
        notes, wanted = list[str](), dict(self.data)
        if not wanted:
            named = {k for k in self.free if (role := self._named(k)) and not role.is_side}
            numeric = {
                *self._numeric(),
                *named,
            }  # cells of the latter that are no numbers are wrong
            wanted = {k: None for k in self.free if k in numeric}
            left = [k for k in self.free if k not in wanted]
            text = next((k for k in left if self.table.has_numbers_as_text(k)), None)
            if text is not None:
                name = self.table.names[text]
                what = f"column {name!r} holds numbers as text: convert it (pandas.to_numeric)"
                raise SettingError(
                    literal(f"{what}, or declare ") + f"{{columns}} {literal(name)}=ignore"
                )
            notes = self._left_out(wanted)
        if not wanted:
            clocks = [k for k in self.free if self._has_clocks(k)]
            raise SettingError(
                literal(f"no column of numbers is left among {listing(self.table.names)}")
                + (f": {HOURS}" if clocks else "; specify with {columns} which they are")
            )
        columns = {k: self._role(k, role) for k, role in wanted.items()}
        self._ask(columns)
        roles = tuple(columns.values())
        units = (role.unit for role in roles if role is not None and role.kind == "angle")
        return list(columns), roles, next(units, self.said.unit or "radians"), notes

    def in_space(self) -> Columns:
        """Return the columns of a space that is no torus, and those beside it."""
        said, notes = self.said, list[str]()
        cycles = [k for k in self.data if (role := self._named(k)) and role.kind == "cycle"]
        of_space = [k for k, role in self.data.items() if role is None and k not in cycles]
        of_space = of_space or [
            k for k, role in self.data.items() if role is not None and role.kind == "angle"
        ]
        beside = {k: self._role(k, role) for k, role in self.data.items() if k not in of_space}
        if not of_space:
            of_space, notes = self._by_names()
        self._check_count(of_space, WIDTHS.get(said.space, said.widths))
        self._check_names(of_space)
        unit, form = self._unit_of(of_space), said.form_of(self._names(of_space))
        lacks_unit = unit is None and is_angular(said.space, len(of_space), form)
        angles = {k: Role("angle") for k in of_space if lacks_unit}
        self._ask({**angles, **beside}, [k for k in of_space if not lacks_unit])
        return [*of_space, *beside], (*(None for _ in of_space), *beside.values()), unit, notes

    def _by_names(self) -> tuple[list[int], list[str]]:
        """Return the columns that a space takes by their names, and notes."""
        table, space, width = self.table, self.said.space, (self.said.widths or (None,))[0]
        way = chosen_arrangement(space, self._names(self.free), width) if table.is_named else None
        if way is None:
            numeric = self._numeric()
            if table.is_named and space in (*DIRECTIONS, "klein-bottle"):
                self._ask_for_space(self._names(numeric))
            return numeric, []
        of_space = [self.free[k] for k in way.columns]
        taken = (
            f"took {', '.join(self._names(of_space))} as {way.words}: results have this order, too"
        )
        notes = [taken] * (of_space != sorted(of_space)) + [way.note] * bool(way.note)
        return of_space, [*notes, *self._left_out(of_space)]

    def _ask_for_space(self, names: Sequence[str]) -> None:
        """Ask which columns are the space's own: names do not say it."""
        space = self.said.space
        what = (
            "theta and phi" if space == "klein-bottle" else "a latitude and a longitude, or x,y,z"
        )
        count = 3 if space in DIRECTIONS and len(names) == 3 else 2
        if space in DIRECTIONS and count == 2:  # what is beyond a latitude is none
            reach = {name: self._reach(name) for name in names}
            names = sorted(names, key=lambda name: reach[name] > 90)
        check_columns(space, names[:count])
        first = ",".join(names[:count]) or "NAME,NAME"
        raise UndeclaredError(
            literal(f"the {space} takes {what}, and the columns of numbers are {listing(names)}")
            + f"; say which, in this order, with {{columns}}, such as {{columns}} {literal(first)}",
            names,
            first,
        )

    def _reach(self, name: str) -> float:
        """Return the largest absolute value of a column."""
        values = self.table.numbers(found_column(self.table, name))
        return float(np.nanmax(np.abs(values), initial=0.0))

    def _check_count(
        self, columns: Sequence[int], widths: tuple[int, ...] | None, why: str = ""
    ) -> None:
        """Refuse another number of columns than the space takes."""
        if not columns or (widths is not None and len(columns) not in widths):
            takes = " or ".join(map(str, widths or ("one or more",)))
            why = why or f"the {self.said.space} takes {takes} columns of numbers"
            raise SettingError(
                literal(
                    f"{why}, and there are {len(columns)}: {listing(self._names(columns))} (of the "
                )
                + literal(f"columns {listing(self.table.names)}); specify with ")
                + "{columns} which they are, in this order"
            )

    def _check_names(self, own: Sequence[int]) -> None:
        if self.table.is_named:
            check_columns(self.said.space, self._names(own))

    def _unit_of(self, own: Sequence[int]) -> str | None:
        """Return the unit of a space's own columns, by what was declared or by their names."""
        roles = [
            role for k in own for role in (self.data.get(k), self._named(k)) if role is not None
        ]
        units = sorted({str(unit) for unit in (self.said.unit, *(r.unit for r in roles)) if unit})
        in_degrees = self.said.space in VECTORS
        if set(units) - ({"degrees"} if in_degrees else {*units[:1]}):
            wanted = "degrees" if in_degrees else "one unit"
            raise SettingError(
                literal(f"{listing(self._names(own))} are in {' and in '.join(units)}, and the ")
                + f"{literal(self.said.space)} takes {wanted}: convert them (numpy.degrees)"
            )
        return units[0] if units else "radians" if self.table.is_array and not in_degrees else None

    def _ask(self, roles: Mapping[int, Role | None], own: Sequence[int] = ()) -> None:
        """Ask for what nothing says of columns."""
        table = self.table
        unknown = {k: table.numbers(k) for k, r in roles.items() if r is None or r.lacks_unit}
        if not unknown:
            return
        is_sure = any(role is not None and role.is_round for role in roles.values())
        words = {k: str(role) for k, role in roles.items()}
        for k, values in unknown.items():
            words[k] = proposed_role(table.names[k], values, roles[k], by_size=not is_sure)
        has_values = any(np.isfinite(values).any() for values in unknown.values())
        if has_values and not own and all(Role.of(word).is_side for word in words.values()):
            raise SettingError(
                literal(f"{listing(self._names(words))} are no data, by their names and values: ")
                + "declare with {columns} what they are; of a sine and a cosine, give the angle itself "
                "(numpy.arctan2)"
            )
        words |= {k: str(r) for k, r in self.roles.items() if r is not None and r.is_side}
        entries = [*map(self._called, own), *(f"{self._called(k)}={w}" for k, w in words.items())]
        codes = {c for k, v in unknown.items() for c in codes_among(v, Role.of(words[k]).turn)}
        listed = ",".join(f"{code:.10g}" for code in sorted(codes))
        cure = f" {{missing_codes}} {listed} {{drop_missing}}" if codes and table.is_file else ""
        values = {table.names[k]: column for k, column in unknown.items()}
        left = "; ".join(self._left_out([*own, *roles])) if table.is_named else ""
        names = list(values)
        for way in arrangements("sphere", names) if self.said.space == "torus" else ():
            if len(way.columns) == 2:
                place = literal(",".join(names[k] for k in way.columns))
                cure += f", or, as directions, {{space}} sphere {{columns}} {place}"
        raise undeclared("columns", values, ",".join(entries), cure, left=left)

    def _called(self, column: int) -> str:
        """Return a column's name, or its number where the name would be read otherwise."""
        name = self.table.names[column]
        is_plain = self.table.is_named and not re.search(r"[,=]", name) and name == name.strip()
        return name if is_plain else str(column + 1)
