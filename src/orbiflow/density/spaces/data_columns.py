"""The space of a table of data: what its columns are, in which unit, and which are beside a space."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from orbiflow.arrays import Array
from orbiflow.density.data import (
    ROTATIONS,
    DataTable,
    Declaration,
    Role,
    TableRows,
    asked_roles,
    check_unit,
    checked_rows,
    found_column,
    is_angular,
    rotation_form,
)
from orbiflow.density.spaces.flat import Torus
from orbiflow.density.spaces.product import ProductSpace
from orbiflow.density.spaces.quotient import QuotientSpace
from orbiflow.density.spaces.space import Space, space_for
from orbiflow.errors import DataWarning, SettingError, literal
from orbiflow.symmetry import group_by_name, is_group_name


@dataclass(frozen=True)
class DataColumns:
    """What is known of columns before the data are seen.

    - `space`: The name of a space or group, or the space.
    - `unit`: The unit of angles that name none.
    - `columns`: What the columns are, as `asked_roles` takes it.
    - `seed`: That of choices which the data leave open.
    """

    space: str | Space
    unit: str | None = None
    columns: Any = None
    seed: int = 0

    @property
    def name(self) -> str:
        """The name of the space whose rules the data obey."""
        return self.space.data_name if isinstance(self.space, Space) else str(self.space)

    def read(self, X: Any, others: Sequence[str] = (), *, stacklevel: int = 4) -> TableRows:
        """Return the rows of data, an array or a data frame, in the order of the space.

        Columns of the names `others` are none of them, and are kept as what is given.

        Warns:
            DataWarning: Of what is doubtful, and of another order than the frame's, at so many calls
                from here.

        Raises:
            OrbiflowError: For data that are not of the space, and columns of which nothing says what
                they are.
        """
        check_unit(self.name, self.unit)
        declared, table = asked_roles(self.columns), DataTable.of(X)
        if not table.is_named and declared and all(isinstance(key, str) for key in declared):
            names = [str(key) for key in declared]
            if len(names) != len(table.names):
                raise SettingError(
                    f"{{columns}} must name the {len(table.names)} columns of the data, got "
                    f"{literal(', '.join(names))}"
                )
            table = DataTable.of(X, names=names)
        elif not table.is_named and declared and self.name == "torus":
            # those of an array that are not named are angles, as all of it would be
            roles = {found_column(table, key): role for key, role in declared.items()}
            declared = (
                {k: roles.get(k) for k in range(len(table.names))}
                if len(roles) == len(declared)
                else declared
            )
        rows = checked_rows(table, self._said(declared), given=others)
        notes = [note for note in rows.notes if note.startswith("took")]
        for text in (*notes, *rows.doubts):
            warnings.warn(text, DataWarning, stacklevel=stacklevel)
        if isinstance(self.space, QuotientSpace):
            self.space.warn_of_fractions(rows.values, stacklevel=stacklevel + 1)
        return rows

    def _said(self, asked: Any) -> Declaration:
        space = self.space
        if not isinstance(space, Space):
            widths = (group_by_name(self.name).dim,) if is_group_name(self.name) else None
            return Declaration(self.name, asked, self.unit, widths, self._form)
        units = {unit for width in space.widths if (unit := space.data_unit(width))}
        if self.unit is not None and units and self.unit not in units:
            raise SettingError(
                f"{{unit}} {self.unit} is not the space's, {min(units)}: leave it out"
            )
        unit = self.unit or next(iter(units), None)
        is_whole = isinstance(space, Torus | ProductSpace)
        roles = space.roles if is_whole else None
        return Declaration(self.name, asked, unit, space.widths, self._form, roles)

    def _form(self, names: Sequence[str]) -> str | None:
        """Return how rotations are written in columns of these names, or numbers."""
        if isinstance(self.space, Space):
            return self.space.form_in(names)
        return rotation_form(self.name, names, len(names)) if self.name == ROTATIONS else None

    def of(self, rows: TableRows) -> Space:
        """Return the space of rows that `read` has checked, or that were read from a file."""
        if isinstance(self.space, ProductSpace | Torus):
            return self.space
        count = len(rows.own)
        if self.name == "torus":
            roles = [role for role in rows.roles if role]
            return torus_of(rows.values, roles, rows.columns, rows.unit)
        base, form = self.space, self._form(rows.own_names)
        if not isinstance(base, Space):
            has_unit = rows.unit and is_angular(self.name, count, form)
            unit = rows.unit if rows.unit and has_unit else "radians"
            values = rows.values[:, rows.own]
            base = space_for(str(base), values, unit=unit, seed=self.seed, form=form)
        sides = [role for role in rows.roles if role is not None]
        if not sides:
            return base
        values, names = rows.values[:, count:], rows.columns[count:]
        return ProductSpace(base, Torus.for_columns(values, sides, names).axes)


def torus_of(values: Array, roles: Sequence[Role], names: Sequence[str], unit: str | None) -> Torus:
    """Return the torus of columns (N, k), which may be angles, cycles and real numbers."""
    unit = unit or "radians"
    if all(role.kind == "angle" and role.unit in (None, unit) for role in roles):
        return Torus.for_data(values, unit=unit)
    return Torus.for_columns(values, roles, names, unit=unit)
