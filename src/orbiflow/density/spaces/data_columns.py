"""The space of a table of data: what its columns are, in which unit, and which are beside a space."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.data import (
    DIRECTIONS,
    ROTATIONS,
    Chosen,
    Frame,
    Role,
    TableRows,
    arrangements,
    asked_roles,
    check_columns,
    check_form,
    check_unit,
    check_values,
    choose,
    found_column,
    is_angular,
    require_table,
    require_unit,
    require_values,
    rotation_form,
    rows_of,
    with_dip_directions,
)
from orbiflow.density.spaces.flat import Torus
from orbiflow.density.spaces.product import ProductSpace
from orbiflow.density.spaces.quotient import QuotientSpace
from orbiflow.density.spaces.rotations import RotationSpace
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
        asked = asked_roles(self.columns)
        source = Frame.of(X)
        if not source.is_named and asked and all(isinstance(key, str) for key in asked):
            names = [str(key) for key in asked]
            if len(names) != len(source.names):
                raise SettingError(
                    f"{{columns}} must name the {len(source.names)} columns of the data, got "
                    f"{literal(', '.join(names))}"
                )
            source = Frame.of(X, names=names)
        elif not source.is_named and asked and self.name == "torus":
            # those of an array that are not named are angles, as all of it would be
            known = {found_column(source, key): role for key, role in asked.items()}
            asked = {k: known.get(k) for k in range(len(source.names))}
        apart = {found_column(source, name) for name in others}
        chosen = self.chosen(source, asked, apart)
        rows = rows_of(source, chosen, given=others)
        require_table(rows.values)
        require_values(rows.values, (source.is_named and rows.columns) or None)
        notes = [note for note in chosen.notes if note.startswith("took")]
        if self.name in DIRECTIONS:
            rows, note = with_dip_directions(rows)
            notes += [] if note is None else [note]
        form = self._form(rows)
        if not isinstance(self.space, Space):
            require_unit(source, self.name, chosen, form)
        unit = self.unit if self.name in DIRECTIONS else rows.unit
        doubts = check_values(
            self.name, rows.values, rows.columns, rows.roles, unit, form=form, place=rows.place
        )
        for text in (*notes, *doubts):
            warnings.warn(text, DataWarning, stacklevel=stacklevel)
        return rows

    def chosen(self, source: Frame, asked: Any, apart: set[int]) -> Chosen:
        """Return the columns of the space."""
        if not isinstance(self.space, Space):
            width = group_by_name(self.name).dim if is_group_name(self.name) else None
            return choose(source, self.name, asked, self.unit, width=width, others=apart)
        own = self.space
        given = {found_column(source, key): role for key, role in asked.items()}
        side = {r.kind: k for k, r in given.items() if r is not None and r.is_side}
        aside = {*apart, *side.values()}
        columns = [k for k in given if k not in aside]
        columns = columns or [
            k for k in range(len(source.names)) if k not in aside and source.is_numeric(k)
        ]
        beside = own.beside.dim if isinstance(own, ProductSpace) else 0
        notes: tuple[str, ...] = ()
        names = [source.names[k] for k in columns[: len(columns) - beside]]
        ways = [way for way in arrangements(self.name, names) if len(way.columns) == len(names)]
        if source.is_named and ways and list(ways[0].columns) != sorted(ways[0].columns):
            columns = [*(columns[k] for k in ways[0].columns), *columns[len(names) :]]
            listed = ", ".join(source.names[k] for k in columns)
            notes = (f"took {listed} as {ways[0].words}: results have this order, too",)
        if len(columns) not in own.widths:
            widths = " or ".join(map(str, own.widths))
            raise SettingError(
                literal(f"the {own.name} takes {widths} columns, and there are {len(columns)}: ")
                + "name its own in {columns}"
            )
        side.pop("ignore", None)
        roles, unit = own.roles(len(columns)), own.data_unit(len(columns))
        if isinstance(own, QuotientSpace):
            own.warn_of_fractions(
                np.stack([source.numbers(k) for k in columns], axis=1), stacklevel=6
            )
        if self.unit not in (None, unit) and unit is not None:
            raise SettingError(f"{{unit}} {self.unit} is not the space's, {unit}: leave it out")
        return Chosen(tuple(columns), roles, unit, side, notes)

    def _form(self, rows: TableRows) -> str | None:
        """Return how rotations are written."""
        own = self.space if isinstance(self.space, Space) else None
        base = own.base if isinstance(own, ProductSpace) else own
        names = rows.own_names
        named = rows.source.is_named
        if isinstance(base, RotationSpace):
            form = base.form_of(len(names))
            check_form(self.name, names if named else (), form)
            return form
        if own is not None and named:
            check_columns(self.name, names)
        if self.name in ROTATIONS:
            return rotation_form(self.name, names if named else None, len(names))
        return None

    def of(self, rows: TableRows) -> Space:
        """Return the space of rows that `read` has checked, or that were read from a file."""
        if isinstance(self.space, ProductSpace | Torus):
            return self.space
        own = rows.own
        if self.name == "torus":
            return torus_of(
                rows.values, [role for role in rows.roles if role], rows.columns, rows.unit
            )
        if not own:
            raise SettingError(literal(f"no column is left for the {self.name}"))
        base, form = self.space, self._form(rows)
        if not isinstance(base, Space):
            has_unit = is_angular(self.name, len(own), form)
            base = space_for(
                cast(str, self.space),
                rows.values[:, own],
                unit=rows.unit if rows.unit and has_unit else "radians",
                seed=self.seed,
                form=form,
            )
        sides = [role for role in rows.roles if role is not None]
        if not sides:
            return base
        names = rows.columns[len(own) :]
        return ProductSpace(base, Torus.for_columns(rows.values[:, len(own) :], sides, names).axes)


def torus_of(values: Array, roles: Sequence[Role], names: Sequence[str], unit: str | None) -> Torus:
    """Return the torus of columns (N, k), which may be angles, cycles and real numbers."""
    unit = unit or "radians"
    if all(role.kind == "angle" and role.unit in (None, unit) for role in roles):
        return Torus.for_data(values, unit=unit)
    return Torus.for_columns(values, roles, names, unit=unit)
