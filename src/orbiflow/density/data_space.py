"""The space of a table of data: what its columns are, in which unit, and which are beside a space."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, cast

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.data import (
    NAN_CURE,
    ROTATIONS,
    Data,
    check_columns,
    check_form,
    doubts_of_line,
    is_angular,
    refuse_codes_of,
    require_table,
    require_values,
    rotation_form,
    unit_of,
)
from orbiflow.density.inference import axes_named, refuse_codes_beside
from orbiflow.density.spaces import (
    MixedTorus,
    ProductSpace,
    QuotientSpace,
    RotationSpace,
    Space,
    Torus,
    space_for,
)
from orbiflow.errors import DataWarning, SettingError, literal
from orbiflow.settings import as_number, is_a


class DataInSpace(NamedTuple):
    """A space, data (N, k) in the order of its columns, and the names of these, if they have names."""

    space: Space
    values: Array
    names: tuple[str, ...] | None


@dataclass(frozen=True)
class DataColumns:
    """What is known of columns before the data are seen.

    - `space`: The name of a space or group, or the space.
    - `unit`: The unit of angles, None to look.
    - `linear`: Columns that are real, by name or number from 0; `period`: the periods of others.
    - `seed`: That of choices which the data leave open.
    """

    space: str | Space
    unit: str | None = None
    linear: Sequence[str | int] = ()
    period: Mapping[str | int, float] = field(default_factory=dict[str | int, float])
    seed: int = 0

    @property
    def name(self) -> str:
        """The name of the space whose rules the data obey."""
        return self.space.data_name if isinstance(self.space, Space) else str(self.space)

    def beside(self, data: Data) -> Collection[str | int]:
        """Return the columns beside those of the space, by names or numbers from 0."""
        if isinstance(self.space, ProductSpace):
            width = data.values.shape[-1]
            return range(width - self.space.beside.dim, width)
        return (*self.linear, *self.period)

    def of(self, values: Array, names: tuple[str, ...] | None) -> DataInSpace:
        """Return the space of data (N, k), once they are known to be of it.

        Columns beside a space that is no torus come last.

        Warns:
            DataWarning: Of what is doubtful, at the caller's caller, who gave the data.

        Raises:
            OrbiflowError: For data that are not of the space, columns in another order, and others.
        """
        require_table(values)
        require_values(values, names)
        called = names or tuple(f"column{k}" for k in range(1, values.shape[1] + 1))
        periods = self._periods(called)
        sides = sorted(periods)
        own_names = [called[k] for k in sides]
        refuse_codes_of(values[:, sides], own_names, [periods[k] for k in sides], NAN_CURE)
        for k in (k for k in sides if periods[k] is None):
            for doubt in doubts_of_line(called[k], values[:, k]):
                warnings.warn(doubt.text, DataWarning, stacklevel=4)
        own = self.space
        if isinstance(own, MixedTorus | ProductSpace):
            return DataInSpace(self._given(own, values, names, bool(periods)), values, names)
        if not periods:
            found = self._plain(values, names)
            return DataInSpace(found, values, names)
        if own == "torus":
            return DataInSpace(self._mixed(values, names, called, periods), values, names)
        if isinstance(own, Torus):
            raise SettingError(
                "{linear} and {period} are part of a MixedTorus: give names of spaces"
            )
        order = [k for k in range(values.shape[1]) if k not in periods] + sorted(periods)
        if names is None and order != list(range(len(order))):
            raise SettingError(
                f"columns beside the {self.name} must come last where columns have no names: put "
                f"column {order[0]} first"
            )
        values, names = values[:, order], names and tuple(names[k] for k in order)
        count = len(order) - len(periods)
        if not count:
            raise SettingError(literal(f"no column is left for the {self.name}"))
        base = self._plain(values[:, :count], names and names[:count])
        sides = {k: periods[column] for k, column in enumerate(order[count:])}
        labels = [called[k] for k in order[count:]]
        beside = MixedTorus.for_columns(values[:, count:], sides, labels)
        return DataInSpace(
            ProductSpace(base, beside.axes, from_zero=beside.from_zero), values, names
        )

    def _periods(self, names: Sequence[str]) -> dict[int, float | None]:
        """Return the periods of columns by number, None of real ones."""
        if not is_a(self.period, Mapping):
            raise SettingError(
                f"{{period}} must hold periods by column, such as {{hour: 24}}, got {self.period!r}"
            )
        numbers = axes_named([*self.linear, *self.period], names)
        values = [as_number(one, f"the period of {name!r}") for name, one in self.period.items()]
        return dict(zip(numbers, [*(None for _ in self.linear), *values], strict=True))

    def _given(
        self,
        own: MixedTorus | ProductSpace,
        values: Array,
        names: tuple[str, ...] | None,
        more: bool,
    ) -> Space:
        """Return the space, of which data must have the columns."""
        if more or values.shape[1] not in own.widths:
            widths = " or ".join(map(str, own.widths))
            raise SettingError(f"the space says which of {widths} columns are real: give no others")
        called = names or own.columns
        if isinstance(own, ProductSpace) and names:
            check_columns(own.data_name, names[: len(names) - own.beside.dim])
        refuse_codes_beside(own, values, called, NAN_CURE)
        if isinstance(own, MixedTorus):
            self._angle_unit(values, names, own.is_angle, str(own.unit))
        return own

    def _angle_unit(
        self, values: Array, names: tuple[str, ...] | None, angles: Array, unit: str | None
    ) -> str:
        kept = np.flatnonzero(angles).tolist()
        if not kept:
            return unit or "radians"
        beside = tuple(names[k] for k in kept) if names else None
        return unit_of("torus", values[:, kept], beside, unit, stacklevel=7)

    def _mixed(
        self,
        values: Array,
        names: tuple[str, ...] | None,
        called: Sequence[str],
        periods: dict[int, float | None],
    ) -> Space:
        angles = np.array([k not in periods for k in range(values.shape[1])])
        unit = self._angle_unit(values, names, angles, self.unit)
        return MixedTorus.for_columns(values, periods, called, unit=unit)

    def _plain(self, values: Array, names: tuple[str, ...] | None) -> Space:
        """Return the space of data without others beside them."""
        own = self.space if isinstance(self.space, Space) else None
        name, unit, form = self.name, self.unit, None
        if isinstance(own, RotationSpace):
            form = own.form_of(values.shape[1])
            check_form(name, names or (), form)
        elif name in ROTATIONS:
            form = rotation_form(name, names, values.shape[1])
        if own is not None and is_angular(own.name, values.shape[1], form):
            unit = str(getattr(own, "angle_unit", own.unit))
            if self.unit not in (None, unit):
                raise SettingError(f"{{unit}} {self.unit} is not the space's, {unit}: leave it out")
        found = unit_of(name, values, names, unit, form=form, stacklevel=6)
        if isinstance(own, QuotientSpace):
            own.warn_of_fractions(values, stacklevel=6)
        if own is not None:
            return own
        return space_for(cast(str, self.space), values, unit=found, seed=self.seed, form=form)
