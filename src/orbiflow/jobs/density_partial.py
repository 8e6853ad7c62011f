"""Marginal and conditional densities: the jobs that make a model of fewer angles."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import torch

from orbiflow.arrays import Array
from orbiflow.density import (
    MODEL,
    REPORT,
    TABLE,
    Density,
    PlotSettings,
    Torus,
    axes_named,
    conditional,
    corner_picture,
    density_picture,
    density_to_bytes,
    given_named,
    log_prob_observed,
    marginal,
    to_csv,
)
from orbiflow.errors import OrbiflowError
from orbiflow.jobs.density_folder import written_files
from orbiflow.jobs.density_models import model_at, unit_warning
from orbiflow.jobs.density_requests import DensityConditionalRequest, DensityMarginalRequest
from orbiflow.jobs.place import check_folder
from orbiflow.jobs.run import Sink
from orbiflow.runtime import (
    Cancel,
    Finished,
    Note,
    Progress,
    RecordError,
    ResultFolder,
    Written,
    one_thread,
    write_atomic,
)

PICTURE = "density.png"

ROWS = {1: 720, 2: 120}
"""Of the table along an angle, by the number of angles."""

DRAWN = 20_000
"""Samples of the picture of one angle."""


@one_thread()
def density_marginal(request: DensityMarginalRequest, tell: Sink, cancel: Cancel) -> Finished:
    """The density of some angles alone, as a model in a folder of its own.

    Returns:
        `summary`: `folder`, the names of its `files`, `columns` and `error` in nats.

    Raises:
        OrbiflowError: for anything that the user can mend.
        Cancelled: if it was told to stop; nothing is written.
    """
    check_folder(request.out, request.model, what="model")
    density, extra = model_at(request.model)
    names = _names(density, extra)
    axes = _axes(request.columns, names)
    folder = ResultFolder(request.out, written_files)
    tell(Progress(0.0, "integrating"))
    found = marginal(density, axes)
    own = [names[axis] for axis in axes]
    said = {"marginal": own, "model": str(request.model)}
    return _written(found, own, said, folder, request.out, tell, cancel)


@one_thread()
def density_conditional(request: DensityConditionalRequest, tell: Sink, cancel: Cancel) -> Finished:
    """The density of the other angles where some are known, as a model in a folder of its own.

    Returns:
        `summary`: `folder`, the names of its `files`, `columns` and `error` in nats.

    Raises:
        OrbiflowError: for anything that the user can mend.
        Cancelled: if it was told to stop; nothing is written.
    """
    check_folder(request.out, request.model, what="model")
    density, extra = model_at(request.model)
    names = _names(density, extra)
    pairs = [_pair(text) for text in request.given]
    axes = _axes([name for name, _ in pairs], names)
    values = list(zip(axes, (value for _, value in pairs), strict=True))
    given = given_named(density.space, values, names)
    warning = unit_warning(
        density.space, np.array([[value for _, value in values]]), [names[axis] for axis in axes]
    )
    if warning:
        tell(Note(f"WARNING: {warning}"))
    left = [axis for axis in range(len(names)) if axis not in given]
    kept = left
    if request.columns is not None:
        kept = _axes(request.columns, names)
        known = [names[axis] for axis in kept if axis in given]
        if known:
            raise RecordError(
                f"{known[0]!r} is both among {{columns}} and {{given}}: keep or know it"
            )
    folder = ResultFolder(request.out, written_files)
    tell(Progress(0.0, "integrating"))
    found = conditional(density, given, kept)
    at = torch.full((1, len(names)), torch.nan, dtype=torch.float64)
    at[0, list(given)] = torch.tensor(list(given.values()), dtype=torch.float64)
    evidence = float(log_prob_observed(density, at, measure="uniform"))
    own = [names[axis] for axis in kept]
    said = {
        "given": {names[axis]: value for axis, value in values},
        "log_density_of_given_over_uniform": evidence,
        "model": str(request.model),
    }
    words = ", ".join(f"{names[axis]} = {value:g}" for axis, value in values)
    tell(
        Note(
            f"the density at {words} is {np.exp(evidence):.3g} times that of even angles"
            + ("; few data lie there, or none" if evidence < -3 else "")
        )
    )
    return _written(found, own, said, folder, request.out, tell, cancel)


def _names(density: Density, extra: dict[str, Any]) -> list[str]:
    """The columns of a model."""
    names = [str(name) for name in extra.get("columns") or ()]
    return names if len(names) == density.space.dim else list(density.space.columns)


def _axes(wanted: tuple[str, ...] | list[str], names: list[str]) -> list[int]:
    """By name, else by number from 1, as in tables."""
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


def _pair(text: str) -> tuple[str, float]:
    """ "psi=-45" in two."""
    name, sign, value = text.rpartition("=")
    try:
        if not sign or not name.strip():
            raise ValueError
        return name.strip(), float(value)
    except ValueError:
        raise RecordError(f"{{given}} needs angles such as psi=-45, got {text!r}") from None


def _written(
    density: Density,
    names: list[str],
    said: dict[str, Any],
    folder: ResultFolder,
    out: Path,
    tell: Sink,
    cancel: Cancel,
) -> Finished:
    """The folder: the model, what it is, and of one or two angles a table and a picture."""
    cancel.check()
    space = density.space
    document = {
        "space": {"name": space.name, **space.settings()},
        "columns": names,
        "report": {"error": density.error},
        **said,
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
        tell(Written(out / name))
    tell(Note(_words(density, names, out)))
    summary = {"folder": str(out), "files": list(files), "columns": names}
    return Finished("done", {**summary, "error": density.error})


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
