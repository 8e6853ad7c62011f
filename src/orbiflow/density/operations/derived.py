"""Marginal and conditional densities: which angles are meant, and the folder that is written.

It holds a model that other commands read, and of one or two angles a table and a picture.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from orbiflow.arrays import Array
from orbiflow.density import inference, pictures
from orbiflow.density.models import Density, density_to_bytes
from orbiflow.density.operations.saved import unit_warning
from orbiflow.density.run_folder import write_files
from orbiflow.density.spaces import Space, Torus
from orbiflow.density.tables import to_csv
from orbiflow.errors import OrbiflowError, SettingError, literal
from orbiflow.runtime import Cancel, Note, Outcome, Progress, ResultFolder, Sink

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
    return inference.axes_named(
        [
            int(one) - 1
            if one.casefold() not in lower and one.isdecimal() and 1 <= int(one) <= len(names)
            else one
            for one in wanted
        ],
        names,
    )


def condition_of(
    space: Space,
    names: list[str],
    pairs: Sequence[tuple[str, float]],
    columns: Sequence[str] | None,
    tell: Sink,
) -> tuple[dict[str, float], dict[int, float], list[int]]:
    """Return the known angles by name in the torus' unit and by number in turns, and which to keep.

    All others are kept, or those of `columns`. A warning is told of angles that seem to be in another
    unit.
    """
    axes = axes_of([name for name, _ in pairs], names)
    values = [(axis, value) for axis, (_, value) in zip(axes, pairs, strict=True)]
    given = inference.given_named(space, values, names)
    known = {names[axis]: value for axis, value in values}
    kept = [axis for axis in range(len(names)) if axis not in given]
    if columns is not None:
        kept = axes_of(columns, names)
        both = [names[axis] for axis in kept if axis in given]
        if both:
            raise SettingError(
                literal(repr(both[0]))
                + " is both among {columns} and {given}; name it in one of them"
            )
    warning = unit_warning(space, np.array([list(known.values())]), list(known))
    if warning:
        tell(Note(f"WARNING: {warning}"))
    return known, given, kept


def evidence_of(density: Density, given: dict[int, float]) -> float:
    """Return the log density of known angles, in turns, relative to the uniform one."""
    at = torch.full((1, density.space.dim), torch.nan, dtype=torch.float64)
    at[0, list(given)] = torch.tensor(list(given.values()), dtype=torch.float64)
    return float(inference.log_prob_observed(density, at, measure="uniform"))


def write_derived(
    density: Density,
    names: list[str],
    origin: dict[str, Any],
    folder: ResultFolder,
    tell: Sink,
    cancel: Cancel,
) -> Outcome:
    """Write the folder of a density of fewer angles; `origin` says in the report where it is from."""
    cancel.check()
    space = density.space
    document = {
        "space": {"name": space.name, **space.settings()},
        "columns": names,
        "report": {"error": density.error},
        **origin,
    }
    files: dict[str, str | bytes] = {
        pictures.MODEL: density_to_bytes(density, columns=names),
        pictures.REPORT: json.dumps(document, allow_nan=False, indent=1),
    }
    if space.dim in ROWS:
        tell(Progress(0.5, "drawing"))
        files[pictures.TABLE] = to_csv((*names, "density"), _table(density))
        files[PICTURE] = _picture(density, names)
    cancel.check()
    write_files(folder, files, tell)
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
    """Return angles from minus half a turn on, and the density in their unit: (N, d + 1)."""
    space = density.space
    if not isinstance(space, Torus):
        raise OrbiflowError(f"a table of angles needs a torus, not the {space.name}")
    line = (np.arange(ROWS[space.dim]) / ROWS[space.dim] - 0.5) * space.period
    data = np.stack(np.meshgrid(*[line] * space.dim, indexing="ij"), axis=-1).reshape(-1, space.dim)
    with torch.no_grad():
        logs = density.log_prob(space.to_chart(data), measure="natural")
    return np.column_stack([data, logs.exp().numpy()])


def _picture(density: Density, names: list[str]) -> bytes:
    settings = pictures.PlotSettings(names=tuple(names))
    if density.space.dim == 2:
        return pictures.density_picture(density, settings=settings).file()
    drawn = density.sample((DRAWN,), torch.Generator().manual_seed(0))
    return pictures.corner_picture(density, None, drawn, settings).file()
