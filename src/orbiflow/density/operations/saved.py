"""Saved densities, the tables that fit them, and the marginal and conditional ones made of them.

Their folder holds a model that other commands read, and of one or two angles a table and a picture.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from orbiflow.arrays import Array
from orbiflow.density import inference, pictures, tables
from orbiflow.density.data import Declaration, TableRows, check_form, in_file
from orbiflow.density.fitting import Progress as InProgress
from orbiflow.density.models import Density, Mixture, density_to_bytes, read_density
from orbiflow.density.operations import covariates
from orbiflow.density.regions import size_unit
from orbiflow.density.run_folder import SAMPLES, write_files
from orbiflow.density.spaces import RotationSpace, Space, Torus
from orbiflow.density.tables import TableSettings, to_csv
from orbiflow.errors import InputFileError, SettingError, literal
from orbiflow.runtime import Note, Outcome, ResultFolder, Sink, ignore

if TYPE_CHECKING:
    from orbiflow.density.operations.queries import PartialSettings


def model_at(path: Path) -> tuple[Density, dict[str, Any]]:
    """Return the density in a file or in the folder of a fit, and what was saved with it."""
    file = path / pictures.MODEL if path.is_dir() else path
    if not file.exists():
        what = f"{pictures.MODEL} in it" if path.is_dir() else "such folder"
        raise InputFileError(
            f"cannot read {path}: there is no {what}; give the folder that `orbiflow density fit` wrote"
        )
    return read_density(file)


def split_given(
    path: Path, given: Sequence[str], tell: Sink
) -> tuple[Density, dict[str, Any], list[str], dict[str, Any]]:
    """Return a model where covariates are known, what was saved, what else is given, and covariates.

    `given` are texts such as temperature=295: those of covariates choose the density, all others are
    left.
    """
    found = covariates.conditional_in(path)
    own = {} if found is None else {one.casefold(): one for one in found[0].covariates.names}
    pairs = [(text.rpartition("=")[0].strip().casefold(), text) for text in given]
    left = [text for name, text in pairs if name not in own]
    known = [covariates.pair_of(text) for name, text in pairs if name in own]
    if found is None or not known:
        return *model_at(path), left, {}
    density = covariates.density_at(found[0], known, tell)
    values = covariates.values_of(found[0], known)
    return density, found[1], left, {name: cell[0].item() for name, cell in values.items()}


def density_given(path: Path, given: Sequence[str], tell: Sink) -> tuple[Density, dict[str, Any]]:
    """Return a model where covariates are as texts such as temperature=295 say, and what was saved."""
    density, extra, left, _ = split_given(path, given, tell)
    if left:
        raise SettingError(
            "{at}: "
            + literal(f"{path} has no covariate {left[0].rpartition('=')[0]!r}")
            + "; `density conditional` fixes columns of the data"
        )
    return density, extra


def some_columns(density: Density, kept: Sequence[int] | None, count: int) -> Mixture:
    """Return a density of all its `count` columns, or of some of them, as a mixture."""
    if kept is not None:
        axes = inference.chosen_columns(density.space, kept, count).axes
        return inference.marginal(density, axes)
    return density if isinstance(density, Mixture) else Mixture([density], [1.0])


def names_of(density: Density, extra: dict[str, Any]) -> list[str]:
    """Return what the columns of a density's data are called."""
    names = [str(name) for name in extra.get("columns") or ()]
    return names if len(names) == len(density.space.columns) else list(density.space.columns)


def rows_of_model(
    data: Path,
    settings: TableSettings,
    density: Density,
    extra: dict[str, Any],
    tell: Sink,
    given: Sequence[str] = (),
) -> TableRows:
    """Return the rows of a table that can be of a model, and warn of what is doubtful.

    The columns are those of the fit, where none were chosen.
    """
    space = density.space
    names = tuple(extra.get("columns") or space.columns)
    if len(names) not in space.widths:
        names = space.columns
    said = Declaration(space.data_name, widths=space.widths, roles=space.roles, names=tuple(names))
    rows = tables.read_rows(data, settings, tell, fitted=said, given=given)
    own = [k for k, role in enumerate(space.roles(len(rows.columns))) if role is None]
    try:
        base = getattr(space, "base", space)
        if isinstance(base, RotationSpace) and rows.source.is_named:
            names = [rows.columns[k] for k in own]
            check_form(space.data_name, names, base.form_of(len(names)))
        doubts = inference.data_doubts(density, rows.values, rows.columns, rows.place)
    except SettingError as error:
        raise in_file(error, f"{data}: ") from error
    for doubt in doubts:
        tell(Note(f"WARNING: {data}: {doubt}"))
    return rows


PICTURE = "density.png"

TABLE_ROWS = {1: 720, 2: 120}
"""Rows of the table along an angle, by the number of angles."""

SHARE_BEFORE_FILES = 0.7
"""Share of the work that is done when a density is found, and its files are to be made."""

HISTOGRAM_SAMPLES = 20_000
"""Samples in the picture of one angle."""


def axes_of(wanted: Sequence[str], names: Sequence[str], tell: Sink = ignore) -> list[int]:
    """Return the numbers, from 0, of angles given by name, or else by number from 1.

    Columns without a name have the numbers of their table, of which the model may have some alone. Of
    those with names, the user is told which one a number means.

    >>> axes_of(["psi", "1"], ["phi", "psi"]), axes_of(["3"], ["column2", "column3"])
    ([1, 0], [1])
    """
    lower = {name.casefold() for name in names}
    numbers = {str(number): number - 1 for number in range(1, len(names) + 1)}
    unnamed = [re.fullmatch(r"column(\d+)", name) for name in names]
    if all(unnamed):
        numbers = {found[1]: axis for axis, found in enumerate(unnamed) if found}
    asked = [one if one.casefold() in lower else numbers.get(one, one) for one in wanted]
    found = inference.axes_named(asked, names)
    for one, axis in zip(wanted, found, strict=True):
        if one.isdigit() and not all(unnamed):
            place = f"number {one} among the model's columns ({', '.join(names)})"
            tell(Note(f"took {one} for {names[axis]}, {place}"))
    return found


def condition_of(
    space: Space,
    names: list[str],
    pairs: Sequence[tuple[str, float]],
    columns: Sequence[str] | None,
    tell: Sink,
) -> tuple[dict[str, float], dict[int, float], list[int]]:
    """Return what is known by name in the data's unit and by chart coordinate, and columns to keep.

    All others are kept, or those of `columns`. The user is warned of angles that seem to be in another
    unit.
    """
    axes = axes_of([name for name, _ in pairs], names, tell)
    values = list(zip(axes, (value for _, value in pairs), strict=True))
    given = inference.given_named(space, values, names)
    known = {names[axis]: value for axis, value in values}
    kept = [axis for axis in range(len(names)) if axis not in axes]
    if columns is not None:
        kept = axes_of(columns, names, tell)
        both = [names[axis] for axis in kept if axis in axes]
        if both:
            raise SettingError(
                literal(repr(both[0])) + " is both among {columns} and {at}; name it in one of them"
            )
    for doubt in inference.given_doubts(space, known, names):
        tell(Note(f"WARNING: {doubt}"))
    return known, given, kept


def evidence_of(density: Density, given: dict[int, float]) -> float:
    """Return the log density of known chart coordinates relative to the uniform one."""
    at = [[given.get(axis, math.nan) for axis in range(density.space.chart_dim)]]
    points = torch.tensor(at, dtype=torch.float64)
    return float(inference.log_prob_observed(density, points, measure="uniform"))


def in_first_part(progress: InProgress) -> InProgress:
    """Return a function that tells the same progress, as that of the work before files are made."""
    return lambda share, what: progress(SHARE_BEFORE_FILES * share, what)


def write_derived(
    density: Mixture,
    names: list[str],
    origin: dict[str, Any],
    folder: ResultFolder,
    settings: PartialSettings,
    progress: InProgress,
    tell: Sink,
) -> Outcome:
    """Write the folder of a density of fewer angles; `origin` says in the report where it is from."""
    space = density.space
    named = {"space": {"name": space.name, **space.settings()}, "columns": names}
    errors = {"error": density.error, "largest_error": density.largest_error}
    document = {**named, "report": errors, **origin}
    if settings.sample is not None:
        document["samples"] = settings.sample
    files: dict[str, str | bytes] = {
        pictures.MODEL: density_to_bytes(density, columns=names),
        pictures.REPORT: json.dumps(document, allow_nan=False, indent=1),
    }
    if settings.sample is not None:
        progress(SHARE_BEFORE_FILES, "drawing samples")
        drawn = density.sample((settings.sample,), torch.Generator().manual_seed(settings.seed))
        files[SAMPLES] = to_csv(names, space.from_chart(drawn))
        for text in _sample_notes(density):
            tell(Note(text))
    progress(0.8, "drawing")
    if space.dim in TABLE_ROWS and isinstance(space, Torus):
        files[pictures.TABLE] = to_csv((*names, "density"), _table(density, space))
    if space.has_square and space.dim in TABLE_ROWS:
        progress(0.9, "drawing")
        files[PICTURE] = _picture(density, names)
    progress(1.0, "writing")
    write_files(folder, files, tell)
    if density.error > settings.accuracy:
        tell(
            Note(
                f"WARNING: the density cannot be approximated to within {settings.accuracy:g} nats"
            )
        )
    tell(Note(_words(density, names, folder.path)))
    summary = {"folder": str(folder.path), "files": list(files), "columns": names}
    return Outcome({**summary, **errors})


def _sample_notes(density: Mixture) -> list[str]:
    """Return of what is drawn with weights how many draws count, in words."""
    found: list[str] = []
    for own, weight in zip(density.components, density.weights.tolist(), strict=True):
        share = own.effective_share()
        if share < 1:
            found.append(
                f"{100 * weight:.1f}% of the samples are chosen among weighed draws, of which "
                f"{100 * share:.2g}% count (effective sample size)"
            )
    return found


def _words(density: Density, names: list[str], out: Path) -> str:
    exact = "in closed form"
    if density.error:
        exact = (
            f"its logarithm right within {density.error:.1e} nats (root mean square) where it is "
            f"dense, and {density.largest_error:.1e} anywhere"
        )
    per = re.sub(r"\b(degree|turn|radian|steradian|unit)s\b", r"\1", size_unit(density.space))
    return f"the density of {', '.join(names)}, per {per}, {exact}; written to {out}"


def _table(density: Density, space: Torus) -> Array:
    """Return angles from minus half a turn on, and the density in their unit: (N, d + 1)."""
    count = TABLE_ROWS[space.dim]
    lines = [axis.even(count) for axis in space.axes]
    data = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, space.dim)
    with torch.no_grad():
        logs = density.log_prob(space.to_chart(data), measure="natural")
    return np.column_stack([data, logs.exp().numpy()])


def _picture(density: Density, names: list[str]) -> bytes:
    settings = pictures.PlotSettings(names=tuple(names))
    if density.space.dim == 2:
        return pictures.density_picture(density, settings=settings).file()
    drawn = density.sample((HISTOGRAM_SAMPLES,), torch.Generator().manual_seed(0))
    return pictures.corner_picture(density, None, drawn, settings).file()
