"""The operation that summarises the columns of a table."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from orbiflow import runtime
from orbiflow.density import tables
from orbiflow.density.data import ROTATIONS
from orbiflow.density.tables import RowSettings, SpaceSettings
from orbiflow.errors import DataWarning, SettingError, literal
from orbiflow.settings import DefaultText, Ending, Option, Range, Settings, is_a

if TYPE_CHECKING:
    from orbiflow.density.data import TableRows
    from orbiflow.density.orientations import OrientationSummary
    from orbiflow.density.summaries import AngleSummary, AxisSummary, Correlation, DirectionSummary

File = Annotated[Path | None, DefaultText("none")]


WIDE_DEGREES = 15.0
"""Misorientation of half of the rows from which a mean says little."""


class SummarySettings(Settings, group="Summary"):
    """How sure a summary is."""

    level: Annotated[float, Range(0.5, 0.999)] = 0.95
    """Level of the intervals and cones."""


@runtime.operation("density summary")
def summary(
    data: Path,
    where: SpaceSettings,
    settings: SummarySettings = SummarySettings(),
    reading: RowSettings = RowSettings(),
    *,
    out: Annotated[File, Option("-o"), Ending(".json", ".csv")] = None,
    picture: Annotated[File, Ending(".png", ".pdf", ".svg")] = None,
    on_event: runtime.Sink = runtime.ignore,
    cancel: runtime.Cancel = runtime.Cancel(),
) -> runtime.Outcome:
    """Summarise angles, directions, axes or orientations: means with intervals, spread, tests.

    Nothing is fitted.

    Args:
        data: CSV, TSV, NPY or Parquet.
        out: A .json or .csv for the figures.
        picture: A .png, .pdf or .svg with a rose diagram of each column of angles.
    """
    _check(where, reading, picture)
    for file in filter(None, (out, picture)):
        runtime.check_output_file(file, data)
    rows = tables.read_rows(data, reading, on_event, where=where)
    if wrong := [str(role) for role in rows.roles if role is not None and role.kind != "angle"]:
        raise SettingError(
            literal(
                f"{data}: a summary is of angles in one unit, directions, axes and orientations, "
            )
            + f"and a column is {wrong[0]}: leave it out of {{columns}}"
        )
    answer = _summarised(rows, where, settings.level)
    runtime.emit(answer, on_event, cancel, out, picture)
    file = None if out is None else str(out)
    return runtime.Outcome({"file": file, **runtime.to_json(answer)})


def _check(where: SpaceSettings, reading: RowSettings, picture: Path | None) -> None:
    """Refuse what has no summary before the table is read."""
    if where.space not in ("torus", "sphere", "projective-plane", ROTATIONS):
        raise SettingError(
            f"{{space}} must be torus, sphere, projective-plane, {ROTATIONS}: summaries are "
            f"of angles, directions, axes and orientations; got {literal(repr(where.space))}"
        )
    if where.space != "torus":
        if reading.missing == "marginalise":
            raise SettingError("{missing} marginalise is for angles on a torus; use {missing} drop")
        if picture is not None:
            raise SettingError("{picture} is for angles on a torus: `density plot` draws maps")


def _summarised(rows: TableRows, where: SpaceSettings, level: float) -> Summary:
    from orbiflow.density import orientations, summaries
    from orbiflow.density.operations.fitting import space_of

    values, unit = rows.values, rows.unit or "degrees"
    how: dict[str, Any] = {"weights": rows.weights, "groups": rows.labels, "level": level}
    about: dict[str, Any] = {"space": where.space, "unit": unit, "level": level}
    about |= {"declaration": rows.declaration, "data": rows}
    if where.space == ROTATIONS:
        space: Any = space_of(where, rows.columns, unit)
        entry = orientations.summarize_orientations(space, values, **how)
        return Summary(**about, orientations=(entry,))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)  # told already
        if where.space == "sphere":
            entry = summaries.summarize_directions(values, unit="degrees", **how)
            return Summary(**about, directions=(entry,))
        if where.space == "projective-plane":
            return Summary(**about, axes=(summaries.summarize_axes(values, unit="degrees", **how),))
        columns, pairs = summaries.summarize_angles(values, columns=rows.columns, unit=unit, **how)
    return Summary(**about, columns=tuple(columns), correlations=tuple(pairs))


HEADINGS = {
    "half_width": "± ({sure})", "pairs": "Fisher-Lee", "sine": "Jammalamadaka-SenGupta",
    "sine_p": "p", "rayleigh_p": "Rayleigh p", "kuiper_p": "Kuiper p", "watson_p": "Watson p",
    "rao_p": "Rao p", "bingham_p": "Bingham p", "name": "column",
    "cone": "cone ({sure}), degrees", "fisher_cone": "Fisher's cone ({sure}), degrees",
    "k": "k = (n - 1)/(n - R)", "spread": "mean misorientation, degrees",
    "half": "half of the rows within, degrees",
}  # fmt: skip
"""What figures are called in tables, where that is not their name; `sure` is the level."""

TABLES = {
    "Angles": ("name", "rows", "mean", "half_width", "resultant", "concentration", "deviation"),
    "Tests of uniformity": ("name", "rayleigh_p", "kuiper_p", "watson_p", "rao_p"),
    "Circular correlations": ("first", "second", "sine", "sine_p", "pairs"),
}
"""The figures in each table of angles."""


@dataclass(frozen=True)
class Summary(runtime.Answer):
    """Figures of a table of angles, or of directions, axes or orientations.

    - `space`, `unit`, `declaration`: What the columns were taken for.
    - `level`: Level of the intervals and cones.
    - `data`: The rows.
    """

    kind = "summary"

    space: str
    unit: str
    level: float
    declaration: str
    data: TableRows = field(repr=False)
    columns: tuple[AngleSummary, ...] = ()
    correlations: tuple[Correlation, ...] = ()
    directions: tuple[DirectionSummary, ...] = ()
    axes: tuple[AxisSummary, ...] = ()
    orientations: tuple[OrientationSummary, ...] = ()

    def table(self) -> list[dict[str, Any]]:
        """Return the figures of columns, directions, axes or orientations, a row each."""
        rows: list[dict[str, Any]] = []
        for entry in self.columns or self.directions or self.axes or self.orientations:
            row: dict[str, Any] = {}
            for key, value in asdict(entry).items():
                several = is_a(value, tuple)
                row |= (
                    {f"{key}_{k}": v for k, v in enumerate(value, 1)} if several else {key: value}
                )
            rows.append(row)
        return rows

    def words(self) -> Iterator[str | runtime.Event]:
        """Yield the figures as tables, of directions and axes a line for each, and notes."""
        sure = f"{100 * self.level:g} %"

        def heading(key: str) -> str:
            return HEADINGS.get(key, key).format(sure=sure)

        for title, keys in TABLES.items() if self.columns else ():
            entries = self.correlations if title == "Circular correlations" else self.columns
            if entries:
                rows = tuple(tuple(_shown(k, getattr(e, k)) for k in keys) for e in entries)
                yield runtime.Table(title, tuple(map(heading, keys)), rows)
        for name in ("directions", "axes", "orientations"):
            for entry in getattr(self, name):
                lines = tuple((heading(k), _shown(k, v)) for k, v in asdict(entry).items())
                yield runtime.Table(name.capitalize(), ("figure", "value"), lines)
        yield from self._notes()

    def _notes(self) -> Iterator[str]:
        """Yield what to keep in mind."""
        from orbiflow.density.summaries import MIN_ROWS

        labels, weights = self.data.labels, self.data.weights
        entries = self.columns or self.directions or self.axes or self.orientations
        units, what = min(entry.rows for entry in entries), "rows"
        if labels is not None:
            units, what = len(set(labels.tolist())), "groups"
            yield f"intervals and tests count {units} groups, whose rows are not independent"
        if labels is not None or weights is not None:
            yield "tests that are known for independent rows of equal weight alone are left out"
        if units < MIN_ROWS:
            yield f"intervals are rough with fewer than {MIN_ROWS} {what}, there are {units}"
        peaks = [entry for entry in self.columns if entry.rows > 1]
        if constant := [entry.name for entry in peaks if entry.concentration is None]:
            yield f"all rows have the same value of {', '.join(constant)}"
        for entry in self.orientations:
            if entry.half > WIDE_DEGREES:
                yield (
                    f"half of the rows are {entry.half:.0f} degrees and more from the mean, which says "
                    "little: `density fit` finds several orientations"
                )
        if undetermined := [entry.name for entry in self.columns if entry.half_width is None]:
            yield (
                f"the mean direction of {', '.join(undetermined)} cannot be told; of the correlations, "
                "Fisher and Lee's needs none"
            )

    def picture(self, form: str) -> bytes:
        """Return a picture of a rose for each column."""
        import numpy as np

        from orbiflow.density import pictures
        from orbiflow.density.data import written_from_zero
        from orbiflow.density.spaces import whole_turn
        from orbiflow.drawing import Sheet

        turn, roses, weights = whole_turn(self.unit), list[pictures.Rose](), self.data.weights
        for values, entry in zip(self.data.values.T, self.columns, strict=True):
            kept = np.isfinite(values)
            shares = None if weights is None else weights[kept]
            mean, spread = (
                None if value is None else value / turn for value in (entry.mean, entry.half_width)
            )
            turns = values[kept] / turn
            first = 0.0 if written_from_zero(turns[:, None], 1.0) else -0.5
            place = (mean, entry.resultant, spread)
            roses.append(pictures.Rose(entry.name, turns, shares, None, place, first))
        sheet_form: Any = form
        sheet = Sheet.screen() if form == "png" else Sheet.column("double", sheet_form)
        words = "The line is the mean direction, as long as the resultant, and the arc its interval"
        return pictures.roses_picture(roses, self.unit, words, sheet).file()


def _shown(key: str, value: Any) -> str:
    """Return a figure in words.

    >>> _shown("rayleigh_p", 1e-320), _shown("mean", 51.05017), _shown("rows", 20_000)
    ('< 1e-300', '51.05', '20000')
    """
    if value is None:
        return "-"
    if isinstance(value, str):
        return value
    if is_a(value, Sequence):
        return ", ".join(_shown(key, part) for part in value)
    if key.endswith("_p"):
        return runtime.p_in_words(value)
    return str(value) if isinstance(value, int) else f"{value:.4g}"
