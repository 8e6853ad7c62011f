"""Which columns of a table are data, and what they are: as declared, by their names, or asked for."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from orbiflow.density.data.checks import codes_among
from orbiflow.density.data.columns import (
    DIRECTIONS,
    ROTATIONS,
    VECTORS,
    check_columns,
    chosen_arrangement,
)
from orbiflow.density.data.proposals import (
    lacks_unit,
    proposed_role,
    quoted,
    range_of,
    turn_of,
    unit_by_size,
)
from orbiflow.density.data.roles import WORDS, Asked, Role, role_named
from orbiflow.density.data.source import Source, UndeclaredError, found_column, listing, short
from orbiflow.density.data.units import is_angular
from orbiflow.errors import SettingError, literal


@dataclass(frozen=True)
class Chosen:
    """The columns of a table, by number from 0, that a density is of, and those that say more of rows.

    - `own`: The space's own, in its order, and then those beside them.
    - `roles`: What each of them is; None is a coordinate of the space.
    - `unit`: The unit of the space's own angles, None if there are none.
    - `side`: The columns of weights, counts and groups, by these words.
    - `notes`: What was decided.
    """

    own: tuple[int, ...]
    roles: tuple[Role | None, ...]
    unit: str | None
    side: Mapping[str, int] = field(default_factory=dict[str, int])
    notes: tuple[str, ...] = ()


def choose(
    source: Source,
    space: str,
    asked: Asked,
    unit: str | None = None,
    *,
    width: int | None = None,
    others: Collection[int] = (),
) -> Chosen:
    """Return the columns that a density on a space is of.

    Args:
        source: The table.
        space: The name of the space, or of a group.
        asked: What was declared.
        unit: The unit of angles that name none.
        width: The number of columns that a group's space takes.
        others: Columns that are none of the data, such as covariates.

    Raises:
        UndeclaredError: For columns of which nothing says what they are.
        SettingError: For columns that there are not, and declarations that cannot be.
    """
    given = {found_column(source, key): role for key, role in asked.items()}
    if len(given) < len(asked):
        raise SettingError(literal(source.where) + "{columns} names a column twice; name each once")
    side: dict[str, int] = {}
    for column, role in given.items():
        if role is not None and role.is_side and role.kind != "ignore":
            if role.kind in side:
                raise SettingError(
                    f"{{columns}} names two columns of the role {role.kind}: leave one"
                )
            side[role.kind] = column
        if role is not None and role.kind == "word":
            raise SettingError(
                f"{literal(source.names[column])} is declared as word: a density may depend on words, "
                "with {given}, and is not of them"
            )
    data = {k: r for k, r in given.items() if (r is None or not r.is_side) and k not in others}
    aside = {*others, *(k for k, r in given.items() if r is not None and r.is_side)}
    left = [k for k in range(len(source.names)) if k not in aside and k not in data]
    free = [k for k in left if source.is_numeric(k) or _is_named_data(source, k)]
    table = _Table(source, space, unit, given, width)
    found = table.torus(data, free) if space == "torus" else table.space_columns(data, left)
    return Chosen(found.own, found.roles, found.unit, side, found.notes)


def _is_named_data(source: Source, column: int) -> bool:
    """Return whether a column is data by its name: cells that are no numbers are then at fault."""
    role = _named(source, column)
    return role is not None and not role.is_side


def _named(source: Source, column: int) -> Role | None:
    """Return the role that a column's name says, if the columns have names."""
    return role_named(source.names[column]) if source.is_named else None


@dataclass(frozen=True)
class _Table:
    """A table, the space of its rows, the unit of angles that name none, and what was declared."""

    source: Source
    space: str
    unit: str | None
    given: Mapping[int, Role | None]
    width: int | None

    def torus(self, data: Mapping[int, Role | None], free: Sequence[int]) -> Chosen:
        """Return columns that are angles, real numbers and cycles."""
        notes: list[str] = []
        wanted = dict(data)
        if not data:
            ignored = [k for k in free if self._is_ignored(k)]
            wanted = dict.fromkeys(k for k in free if k not in ignored)
            notes += self._left_out([k for k in range(len(self.source.names)) if k not in wanted])
        if not wanted:
            raise SettingError(
                literal(f"{self.source.where}no column of numbers is left for the {self.space}; ")
                + literal(f"it has {listing(self.source.names)}")
                + ": choose with {columns}"
            )
        roles = {k: self._role(k, role) for k, role in wanted.items()}
        self._refuse_unknown(roles)
        known = {k: role for k, role in roles.items() if role is not None}
        unit = next((r.unit for r in known.values() if r.kind == "angle"), self.unit or "radians")
        return Chosen(tuple(known), tuple(known.values()), unit, notes=tuple(notes))

    def _role(self, column: int, role: Role | None) -> Role | None:
        """Return what a column is: as declared, by its name, or an angle of an array; or None."""
        role = role or _named(self.source, column)
        if role is None and (self.source.is_array or not self.source.is_named):
            role = Role("angle")
        if role is not None and role.kind == "ignore":
            return None
        return role and role.with_unit(self.unit or ("radians" if self.source.is_array else None))

    def _is_ignored(self, column: int) -> bool:
        role = _named(self.source, column)
        return role is not None and role.kind == "ignore"

    def _left_out(self, columns: Iterable[int]) -> list[str]:
        """Return a note on columns that are not used, and were not said to be none of the data."""
        numeric = [k for k in columns if k not in self.given and self.source.is_numeric(k)]
        names = [self.source.names[k] for k in numeric]
        return [f"left out {listing(names)}: name all columns to use them"] if names else []

    def space_columns(self, data: Mapping[int, Role | None], left: Sequence[int]) -> Chosen:
        """Return the columns of a space that is no torus, and those beside it."""
        source, notes = self.source, list[str]()
        own = [k for k, role in data.items() if role is None and not self._is_cycle(k)]
        own = own or [k for k, role in data.items() if role is not None and role.kind == "angle"]
        beside = {k: self._role(k, data[k]) for k in data if k not in own}
        if not own:
            own, notes = self._by_names([k for k in left if k not in beside])
        names = [source.names[k] for k in own]
        self._check_count(names)
        if source.is_named:
            try:
                check_columns(self.space, names)
            except SettingError as error:
                raise SettingError(literal(source.where) + error.template) from error
        unit = self._unit_of(own, {k: data.get(k) for k in own})
        self._refuse_unknown(beside, own)
        roles = (*(None for _ in own), *beside.values())
        return Chosen((*own, *beside), roles, unit, notes=tuple(notes))

    def _is_cycle(self, column: int) -> bool:
        role = _named(self.source, column)
        return role is not None and role.kind == "cycle"

    def _by_names(self, free: Sequence[int]) -> tuple[list[int], list[str]]:
        """Return the columns that a space takes by their names, and notes."""
        source = self.source
        names = [source.names[k] for k in free]
        found = None
        if source.is_named:
            try:
                found = chosen_arrangement(self.space, names, self.width)
            except SettingError as error:
                raise SettingError(literal(source.where) + error.template) from error
        if found is not None:
            own = [free[k] for k in found.columns]
            listed = ", ".join(source.names[k] for k in own)
            notes = [f"took {listed} as {found.words}: results have this order, too"]
            notes = notes if own != sorted(own) else []
            notes += [found.note] if found.note else []
            return own, [*notes, *self._left_out(k for k in free if k not in own)]
        free = [k for k in free if source.is_numeric(k) and not self._is_ignored(k)]
        names = [source.names[k] for k in free]
        if source.is_named and self.space in (*DIRECTIONS, "klein-bottle"):
            self._ask_for_space(names)
        self._check_count(names)
        notes = self._left_out([k for k in range(len(source.names)) if k not in free])
        return list(free), notes

    def _ask_for_space(self, names: Sequence[str]) -> None:
        """Ask which columns are the space's own: names do not say it."""
        what = {"klein-bottle": "theta and phi"}.get(
            self.space, "a latitude and a longitude, or unit vectors x,y,z"
        )
        count = 3 if self.space in DIRECTIONS and len(names) == 3 else 2
        first = ",".join(names[:count]) or "NAME,NAME"
        raise UndeclaredError(
            literal(f"{self.source.where}the {self.space} takes {what}, ")
            + literal("and the columns of numbers are ")
            + literal(listing(names) or "none")
            + "; say which, in this order, with {columns}, such as {columns} "
            + literal(first),
            names,
            first,
        )

    def _check_count(self, names: Sequence[str]) -> None:
        """Refuse another number of columns than the space takes."""
        widths: tuple[int, ...] | None = None if self.width is None else (self.width,)
        if self.space in DIRECTIONS:
            widths = (2, 3)
        elif self.space in ROTATIONS:
            widths = (3, 4, 9)
        elif self.space == "klein-bottle":
            widths = (2,)
        if widths is not None and len(names) not in widths:
            listed = " or ".join(map(str, widths))
            raise SettingError(
                literal(
                    f"{self.source.where}the {self.space} takes {listed} columns of numbers, and "
                )
                + literal(
                    f"there are {len(names)}: {listing(names)}" if names else "there are none"
                )
                + literal(f" (its columns: {listing(self.source.names)})")
                + "; choose with {columns}"
            )

    def _unit_of(self, own: Sequence[int], roles: Mapping[int, Role | None]) -> str | None:
        """Return the unit of a space's own columns, by what was declared or by their names."""
        source = self.source
        said = {role.unit for role in roles.values() if role is not None and role.unit}
        names = [source.names[k] for k in own]
        if source.is_named:
            said |= {r.unit for name in names if (r := role_named(name)) is not None and r.unit}
        if self.space in VECTORS:
            if wrong := sorted(unit for unit in said if unit != "degrees"):
                raise SettingError(
                    literal(
                        f"{source.where}{listing(names)} are declared or named in {wrong[0]}, and "
                    )
                    + f"the {self.space} takes degrees: convert them (numpy.degrees)"
                )
            return self.unit or ("degrees" if said else None)
        said |= {self.unit} if self.unit else set()
        if len(said) > 1:
            raise SettingError(
                literal(f"{source.where}{listing(names)} are in {' and in '.join(sorted(said))}")
                + ": convert them to one unit"
            )
        if said:
            return next(iter(said))
        return "radians" if source.is_array else None

    def ask_unit(self, own: Sequence[int]) -> None:
        """Ask for the unit of a space's own angles."""
        values = [self.source.numbers(k) for k in own]
        proposal = next((u for u in map(unit_by_size, values) if u != "radians"), "radians")
        names = [self.source.names[k] for k in own]
        ranges = " and ".join(f"{n} ({range_of(v)})" for n, v in zip(names, values, strict=True))
        raise UndeclaredError(
            literal(f"{self.source.where}nothing gives the unit of the angles {ranges}")
            + f"; if this is right, give {{unit}} {proposal} (degrees, radians or turns)",
            names,
            ",".join(f"{name}=angle:{proposal}" for name in names),
        )

    def _refuse_unknown(self, roles: Mapping[int, Role | None], own: Sequence[int] = ()) -> None:
        """Ask for what nothing says of columns, and print the words that answer it."""
        unknown = [k for k, role in roles.items() if role is None or lacks_unit(role)]
        if not unknown:
            return
        source = self.source
        values = {k: source.numbers(k) for k in unknown}
        sure = any(role is not None and role.is_round for role in roles.values())
        proposed = {
            k: proposed_role(source.names[k], values[k], roles[k], by_size=not sure)
            for k in unknown
        }
        words = {k: str(role) for k, role in roles.items() if role is not None} | proposed
        sides = {k: str(r) for k, r in self.given.items() if r is not None and r.is_side}
        entries = [*(self._called(k) for k in own)]
        entries += [f"{self._called(k)}={word}" for k, word in {**words, **sides}.items()]
        proposal = ",".join(entries)
        ranges = ", ".join(f"{short(source.names[k])} ({range_of(values[k])})" for k in unknown)
        codes = sorted(
            {code for k in unknown for code in codes_among(values[k], turn_of(proposed[k]))}
        )
        also = ""
        if codes:
            listed = ",".join(f"{code:.10g}" for code in codes)
            also = f" {{missing_codes}} {listed} {{drop_missing}}"
        them = "it is" if len(unknown) == 1 else "they are"
        raise UndeclaredError(
            literal(f"{source.where}{ranges}: say what {them}; if this is right, declare: ")
            + f"{{columns}} {literal(quoted(proposal))}{also}"
            + f" (a role is {', '.join(WORDS)})",
            [source.names[k] for k in unknown],
            proposal,
        )

    def _called(self, column: int) -> str:
        """Return a column's name, or its number where the name would be read otherwise."""
        name = self.source.names[column]
        if not self.source.is_named:
            return str(column + 1)
        return str(column + 1) if re.search(r"[,=]", name) or name != name.strip() else name


def require_unit(source: Source, space: str, chosen: Chosen, form: str | None) -> None:
    """Ask for the unit of a space's own angles, once it is known how they are written."""
    own = [k for k, role in zip(chosen.own, chosen.roles, strict=True) if role is None]
    if chosen.unit is None and is_angular(space, len(own), form):
        _Table(source, space, None, {}, None).ask_unit(own)
