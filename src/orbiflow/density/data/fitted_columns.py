"""Which columns of a table are those to which a model was fitted."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from orbiflow.density.data.declaration import Chosen
from orbiflow.density.data.roles import Asked, Role
from orbiflow.density.data.source import Source, found_column, is_number_name, listing
from orbiflow.density.data.strike_names import dip_direction_among
from orbiflow.errors import SettingError, literal


def choose_as_fitted(
    source: Source, fitted: Mapping[str, Any], asked: Asked, others: Collection[int] = ()
) -> Chosen:
    """Return the columns of a table that are those to which a model was fitted.

    Args:
        source: The table.
        fitted: What the model keeps of them: "columns", their names; "roles", what they are, as text.
        asked: What was declared: the model's columns in their order, or weights and groups alone.
        others: Columns that are none of them.

    Raises:
        SettingError: For columns that there are not, or too many.
    """
    names = [str(name) for name in fitted.get("columns") or ()]
    roles = [role and Role.of(role) for role in fitted.get("roles") or [None] * len(names)]
    given = {found_column(source, key): role for key, role in asked.items()}
    side = {
        role.kind: k for k, role in given.items() if role and role.is_side and role.kind != "ignore"
    }
    aside = {*others, *(k for k, role in given.items() if role and role.is_side)}
    notes: tuple[str, ...] = ()
    own = [k for k in given if k not in aside]
    if not own and (not source.is_named or not names or all(map(is_number_name, names))):
        own = [k for k in range(len(source.names)) if k not in aside and source.is_numeric(k)]
        if names and not source.is_named and not all(map(is_number_name, names)):
            notes = (f"{source.where}has no header: its columns were taken for {', '.join(names)}",)
    elif not own:
        lower = {name.casefold() for name in source.names}
        wanted = [dip_direction_among(name, source.names) or name for name in names]
        missing = [name for name in wanted if name.casefold() not in lower]
        if missing:
            some = f"no {', '.join(missing)} among " if len(missing) < len(names) else ""
            raise SettingError(
                literal(
                    f"{source.where}the model was fitted to {', '.join(names)}, and the file has "
                    f"{some}{listing(source.names)}"
                )
                + ": specify with {columns} which they are, in this order"
            )
        own = [found_column(source, name) for name in wanted]
    else:
        called = [source.names[k] for k in own]
        if called != names and sorted(called) == sorted(names):
            raise SettingError(
                literal(
                    f"{source.where}the model was fitted to {', '.join(names)}, in this order; "
                )
                + "give {columns} "
                + literal(f"'{','.join(names)}'")
            )
    if names and len(own) != len(names):
        raise SettingError(
            literal(
                f"{source.where}{len(own)} column{'s' * (len(own) != 1)} "
                f"({listing([source.names[k] for k in own])}) cannot be those of the model, which was "
                f"fitted to {len(names)} ({', '.join(names)})"
            )
            + ": specify with {columns} which they are, in this order"
        )
    for column, fitted_role in zip(own, roles, strict=False):
        said = given.get(column)
        if said is not None and fitted_role is not None and said != fitted_role:
            raise SettingError(
                literal(
                    f"{source.where}{source.names[column]} is declared as {said}, and the model's "
                )
                + f"column is {fitted_role}: convert it"
            )
    return Chosen(tuple(own), tuple(roles) if roles else (None,) * len(own), None, side, notes)
