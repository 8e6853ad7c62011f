"""Densities of some columns of a saved one, and the folders of the commands that find them.

They hold a model that other commands read, and of one or two angles a table and a picture.
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

from orbiflow import runtime
from orbiflow.arrays import Array
from orbiflow.density import inference, pictures, tables
from orbiflow.density.models import Density, Mixture, density_to_bytes
from orbiflow.density.operations.saved import SavedDensity, number_of, pair_of
from orbiflow.density.regions import size_unit
from orbiflow.density.run_folder import write_files, written_files
from orbiflow.density.spaces import Torus
from orbiflow.errors import SettingError, literal

if TYPE_CHECKING:
    from orbiflow.density.operations.queries import PartialSettings

PICTURE = "density.png"

TABLE_ROWS = {1: 720, 2: 120}
"""Rows of the table along an angle, by the number of angles."""

SHARE_BEFORE_FILES = 0.7
"""Share of the work that is done when a density is found, and its files are to be made."""

HISTOGRAM_SAMPLES = 20_000
"""Samples in the picture of one angle."""


class Partial:
    """What comes of a saved density: a density of some of its columns, and a folder of it.

    Args:
        saved: The density.
        out: The folder.
        settings: How well the density is found.
        tell: Hears of the work.
        cancel: Stops it.
    """

    def __init__(
        self,
        saved: SavedDensity,
        out: Path,
        settings: PartialSettings,
        tell: runtime.Sink,
        cancel: runtime.Cancel,
    ) -> None:
        self.saved, self.settings, self.tell = saved, settings, tell
        self.folder = runtime.ResultFolder(out, written_files)
        self.progress = runtime.progress_events(tell, cancel)
        self.how: dict[str, Any] = {"accuracy": settings.accuracy, "progress": self._before_files}

    def marginal(self, columns: Sequence[str]) -> runtime.Outcome:
        """Find the density of columns alone."""
        saved = self.saved
        names, axes = self._chosen(saved.axes(columns, self.tell))
        self.progress(0.0, "integrating")
        density = inference.marginal(saved.density, axes, **self.how)
        return self._write(density, names, {"marginal": names})

    def conditional(self, texts: Sequence[str], columns: Sequence[str] | None) -> runtime.Outcome:
        """Find the density of columns, default all others, where some are as texts say."""
        saved, tell = self.saved, self.tell
        pairs = [(name, number_of(name, text)) for name, text in map(pair_of, texts)]
        density, names = saved.density, saved.columns
        if not pairs:
            numbers = range(len(names)) if columns is None else saved.axes(columns, tell)
            whole = density if isinstance(density, Mixture) else Mixture([density], [1.0])
            if columns is not None:
                names, axes = self._chosen(numbers)
                whole = inference.marginal(density, axes)
            return self._write(whole, list(names), {"given": dict(saved.at)})
        fixed = saved.axes([name for name, _ in pairs], tell)
        values = [(axis, value) for axis, (_, value) in zip(fixed, pairs, strict=True)]
        conditions = {names[axis]: value for axis, value in values}
        chart = inference.given_named(density.space, values, names)
        numbers = [axis for axis in range(len(names)) if axis not in fixed]
        if columns is not None:
            numbers = saved.axes(columns, tell)
            if both := [names[axis] for axis in numbers if axis in fixed]:
                raise SettingError(
                    literal(repr(both[0]))
                    + " is both among {columns} and {at}; name it in one of them"
                )
        for doubt in inference.given_doubts(density.space, conditions, names):
            tell(runtime.Note(f"WARNING: {doubt}"))
        kept_names, axes = self._chosen(numbers)
        self.progress(0.0, "integrating")
        part = inference.conditional(density, chart, axes, **self.how)
        evidence = evidence_of(density, chart)
        rare = "; few data lie there, or none" if evidence < -3 else ""
        words = ", ".join(f"{name} = {value:g}" for name, value in conditions.items())
        ratio = f"{math.exp(evidence):.3g} times that of the uniform density{rare}"
        tell(runtime.Note(f"the density at {words} is {ratio}"))
        origin = {
            "given": {**saved.at, **conditions},
            "log_density_of_given_over_uniform": evidence,
        }
        return self._write(part, kept_names, origin)

    def _before_files(self, share: float, what: str) -> None:
        """Tell the progress of the work before files are made."""
        self.progress(SHARE_BEFORE_FILES * share, what)

    def _chosen(self, columns: Sequence[int]) -> tuple[list[str], Sequence[int]]:
        """Return the names of columns, by their numbers, and their chart coordinates."""
        names = self.saved.columns
        numbers, axes = inference.chosen_columns(self.saved.density.space, columns, len(names))
        return [names[number] for number in numbers], axes

    def _write(self, density: Mixture, names: list[str], origin: dict[str, Any]) -> runtime.Outcome:
        """Write the folder of a density of fewer columns; `origin` says where it is from."""
        space = density.space
        named = {"space": {"name": space.name, **space.settings()}, "columns": names}
        errors = {"error": density.error, "largest_error": density.largest_error}
        document = {**named, "report": errors, **origin, "model": str(self.saved.path)}
        files: dict[str, str | bytes] = {
            pictures.MODEL: density_to_bytes(density, columns=names),
            pictures.REPORT: json.dumps(document, allow_nan=False, indent=1),
        }
        self.progress(0.8, "drawing")
        if space.dim in TABLE_ROWS and isinstance(space, Torus):
            files[pictures.TABLE] = tables.to_csv((*names, "density"), _table(density, space))
        if space.has_square and space.dim in TABLE_ROWS:
            self.progress(0.9, "drawing")
            files[PICTURE] = _picture(density, names)
        self.progress(1.0, "writing")
        write_files(self.folder, files, self.tell)
        if density.error > self.settings.accuracy:
            self.tell(
                runtime.Note(
                    "WARNING: the density cannot be approximated to within "
                    f"{self.settings.accuracy:g} nats"
                )
            )
        self.tell(runtime.Note(_words(density, names, self.folder.path)))
        summary = {"folder": str(self.folder.path), "files": list(files), "columns": names}
        return runtime.Outcome({**summary, **errors})


def evidence_of(density: Density, given: dict[int, float]) -> float:
    """Return the log density of known chart coordinates relative to the uniform one."""
    at = [[given.get(axis, math.nan) for axis in range(density.space.chart_dim)]]
    points = torch.tensor(at, dtype=torch.float64)
    return float(inference.log_prob_observed(density, points, measure="uniform"))


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
