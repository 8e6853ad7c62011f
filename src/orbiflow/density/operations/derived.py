"""Marginal and conditional densities: which angles are meant, and the folder that is written.

It holds a model that other commands read, and of one or two angles a table and a picture.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from orbiflow.arrays import Array
from orbiflow.density.inference import axes_named, given_named, log_prob_observed
from orbiflow.density.models import Density, density_to_bytes
from orbiflow.density.operations.saved import unit_warning
from orbiflow.density.pictures import (
    MODEL,
    REPORT,
    TABLE,
    PlotSettings,
    corner_picture,
    density_picture,
)
from orbiflow.density.spaces import Space, Torus
from orbiflow.density.tables import to_csv
from orbiflow.errors import OrbiflowError, SettingError, literal
from orbiflow.runtime import (
    Cancel,
    Note,
    Outcome,
    Progress,
    ResultFolder,
    Sink,
    Written,
    write_atomic,
)

PICTURE = "density.png"

ROWS = {1: 720, 2: 120}
"""Rows of the table along an angle, by the number of angles."""

DRAWN = 20_000
"""Samples in the picture of one angle."""


def axes_of(wanted: Sequence[str], names: Sequence[str]) -> list[int]:
    """Return the numbers, from 0, of angles given by name, or else by number from 1, as in tables.

    >>> axes_of(["psi", "1"], ["phi", "psi"])
    [1, 0]
    """
    lower = {name.casefold() for name in names}
    return axes_named(
        [
            int(one) - 1
            if one.casefold() not in lower and one.isdecimal() and 1 <= int(one) <= len(names)
            else one
            for one in wanted
        ],
        names,
    )


@dataclass(frozen=True)
class Condition:
    """Some angles of a torus that are known, and those of the others that are kept.

    - `names`: The names of all angles.
    - `values`: What is known by name, in the torus' unit.
    - `given`: The same in turns, by the angles' numbers.
    - `kept`: The numbers of the angles to keep.
    - `notes`: What the user should know.
    """

    names: list[str]
    values: dict[str, float]
    given: dict[int, float]
    kept: list[int]
    notes: tuple[str, ...]

    @property
    def columns(self) -> list[str]:
        """The names of the angles to keep."""
        return [self.names[axis] for axis in self.kept]

    @property
    def words(self) -> str:
        """What is known, such as "psi = -45"."""
        return ", ".join(f"{name} = {value:g}" for name, value in self.values.items())

    def evidence(self, density: Density) -> float:
        """Return the log density of what is known, relative to the uniform one."""
        at = torch.full((1, len(self.names)), torch.nan, dtype=torch.float64)
        at[0, list(self.given)] = torch.tensor(list(self.given.values()), dtype=torch.float64)
        return float(log_prob_observed(density, at, measure="uniform"))


def condition_of(
    space: Space,
    names: list[str],
    pairs: Sequence[tuple[str, float]],
    columns: Sequence[str] | None,
) -> Condition:
    """Return which angles are known, and which of the others are kept: all, or those of `columns`."""
    axes = axes_of([name for name, _ in pairs], names)
    values = [(axis, value) for axis, (_, value) in zip(axes, pairs, strict=True)]
    given = given_named(space, values, names)
    known = {names[axis]: value for axis, value in values}
    warning = unit_warning(space, np.array([list(known.values())]), list(known))
    kept = [axis for axis in range(len(names)) if axis not in given]
    if columns is not None:
        kept = axes_of(columns, names)
        both = [names[axis] for axis in kept if axis in given]
        if both:
            raise SettingError(
                literal(repr(both[0]))
                + " is both among {columns} and {given}; name it in one of them"
            )
    return Condition(names, known, given, kept, (f"WARNING: {warning}",) if warning else ())


def write_derived(
    density: Density,
    names: list[str],
    origin: dict[str, Any],
    folder: ResultFolder,
    tell: Sink,
    cancel: Cancel,
) -> Outcome:
    """Write the folder of a density of fewer angles."""
    cancel.check()
    space = density.space
    document = {
        "space": {"name": space.name, **space.settings()},
        "columns": names,
        "report": {"error": density.error},
        **origin,
    }
    files: dict[str, str | bytes] = {
        MODEL: density_to_bytes(density, columns=names),
        REPORT: json.dumps(document, allow_nan=False, indent=1),
    }
    if space.dim in ROWS:
        tell(Progress(0.5, "drawing"))
        files[TABLE] = to_csv((*names, "density"), _table(density))
        files[PICTURE] = _picture(density, names)
    cancel.check()
    with folder.replaced() as staged:
        for name, content in files.items():
            write_atomic(staged / name, content)
    for name in files:
        tell(Written(folder.path / name))
    tell(Note(_words(density, names, folder.path)))
    summary = {"folder": str(folder.path), "files": list(files), "columns": names}
    return Outcome({**summary, "error": density.error})


def _words(density: Density, names: list[str], out: Path) -> str:
    exact = "in closed form"
    if density.error:
        exact = f"its logarithm right within {density.error:.1e} nats (root mean square)"
    per = f"per {str(density.space.unit).removesuffix('s')}"
    power = "" if len(names) == 1 else f"^{len(names)}"
    return f"the density of {', '.join(names)}, {per}{power}, {exact}; written to {out}"


def _table(density: Density) -> Array:
    """Angles from minus half a turn on, and the density (N, d + 1) in their unit."""
    space = density.space
    if not isinstance(space, Torus):
        raise OrbiflowError(f"a table of angles needs a torus, not the {space.name}")
    line = (np.arange(ROWS[space.dim]) / ROWS[space.dim] - 0.5) * space.period
    data = np.stack(np.meshgrid(*[line] * space.dim, indexing="ij"), axis=-1).reshape(-1, space.dim)
    with torch.no_grad():
        logs = density.log_prob(space.to_chart(data), measure="natural")
    return np.column_stack([data, logs.exp().numpy()])


def _picture(density: Density, names: list[str]) -> bytes:
    settings = PlotSettings(names=tuple(names))
    if density.space.dim == 2:
        return density_picture(density, settings=settings).file()
    drawn = density.sample((DRAWN,), torch.Generator().manual_seed(0))
    return corner_picture(density, None, drawn, settings).file()
