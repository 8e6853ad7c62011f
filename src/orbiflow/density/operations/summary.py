"""The operation that summarises the columns of a table."""

from __future__ import annotations

import json
import warnings
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from orbiflow import runtime
from orbiflow.batch import csv_bytes
from orbiflow.density import tables
from orbiflow.density.data import ROTATIONS
from orbiflow.density.run_folder import write_file
from orbiflow.density.tables import RowSettings, SpaceSettings
from orbiflow.errors import DataWarning, SettingError, literal
from orbiflow.settings import DefaultText, Ending, Option, Range, Settings, is_a

if TYPE_CHECKING:
    from orbiflow.density.data import TableRows

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
    unit = rows.unit or "degrees"
    found = _summarised(rows, where, unit, settings)
    cancel.check()
    for event in _tables(found, settings.level):
        on_event(event)
    for note in _notes(found, rows):
        on_event(runtime.Note(note))
    document = {"kind": "summary", "space": where.space, "unit": unit, "level": settings.level}
    document |= {"declaration": rows.declaration}
    document |= found
    if out is not None:
        as_csv = out.suffix.lower() == ".csv"
        text = _csv(found) if as_csv else json.dumps(document, allow_nan=False, indent=1)
        write_file(out, text, on_event, f"written to {out}")
    if picture is not None:
        write_file(picture, _roses(rows, found["columns"], unit, picture), on_event)
    return runtime.Outcome({"file": None if out is None else str(out), **document})


def _csv(found: dict[str, Any]) -> bytes:
    """Return the figures of columns, directions or axes, a row each; correlations are in the JSON."""
    rows: list[dict[str, Any]] = []
    for entry in next(iter(found.values())):
        flat: dict[str, Any] = {}
        for key, value in entry.items():
            several = is_a(value, tuple)
            flat |= {f"{key}_{k}": v for k, v in enumerate(value, 1)} if several else {key: value}
        rows.append(flat)
    return csv_bytes(list(rows[0]), [list(row.values()) for row in rows])


def _check(where: SpaceSettings, reading: RowSettings, picture: Path | None) -> None:
    """Refuse what has no summary before the table is read."""
    if where.space not in ("torus", "sphere", "projective-plane", *ROTATIONS):
        raise SettingError(
            f"{{space}} must be torus, sphere, projective-plane, {', '.join(ROTATIONS)}: summaries are "
            f"of angles, directions, axes and orientations; got {literal(repr(where.space))}"
        )
    if where.space != "torus":
        if reading.missing == "marginalise":
            raise SettingError("{missing} marginalise is for angles on a torus; use {missing} drop")
        if picture is not None:
            raise SettingError("{picture} is for angles on a torus: `density plot` draws maps")


def _summarised(
    rows: TableRows, where: SpaceSettings, unit: str, settings: SummarySettings
) -> dict[str, Any]:
    """Return the summaries of rows as JSON has them."""
    from orbiflow.density import orientations, summaries
    from orbiflow.density.operations.fitting import space_of

    values, space = rows.values, where.space
    how: dict[str, Any] = {
        "weights": rows.weights, "groups": rows.labels, "level": settings.level,
    }  # fmt: skip
    if space in ROTATIONS:
        own: Any = space_of(where, rows.columns, unit)
        return {"orientations": [asdict(orientations.summarize_orientations(own, values, **how))]}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)  # told already
        if space == "torus":
            made = summaries.summarize_angles(values, columns=rows.columns, unit=unit, **how)
            names = ("columns", "correlations")
            return {n: [asdict(one) for one in part] for n, part in zip(names, made, strict=True)}
        name, summarise = {
            "sphere": ("directions", summaries.summarize_directions),
            "projective-plane": ("axes", summaries.summarize_axes),
        }[space]
        return {name: [asdict(summarise(values, unit="degrees", **how))]}


TABLES = {
    "Angles": ("name", "rows", "mean", "half_width", "resultant", "concentration", "deviation"),
    "Tests of uniformity": ("name", "rayleigh_p", "kuiper_p", "watson_p", "rao_p"),
    "Circular correlations": ("first", "second", "sine", "sine_p", "pairs"),
}
"""The figures in each table of angles."""


def _tables(found: dict[str, Any], level: float) -> list[runtime.Table]:
    """Return the figures as tables, of directions and axes a line for each."""
    sure = f"{100 * level:g} %"
    words: dict[str, str] = {
        "half_width": f"± ({sure})", "deviation": "deviation", "pairs": "Fisher-Lee",
        "sine": "Jammalamadaka-SenGupta", "sine_p": "p", "rayleigh_p": "Rayleigh p",
        "kuiper_p": "Kuiper p", "watson_p": "Watson p", "rao_p": "Rao p",
        "bingham_p": "Bingham p", "name": "column",
        "cone": f"cone ({sure}), degrees", "fisher_cone": f"Fisher's cone ({sure}), degrees",
        "k": "k = (n - 1)/(n - R)", "spread": "mean misorientation, degrees",
        "half": "half of the rows within, degrees",
    }  # fmt: skip
    if "columns" not in found:
        (name, (entry,)), *_ = found.items()
        lines = tuple(
            (str(words.get(key, key)), _shown(key, value)) for key, value in entry.items()
        )
        return [runtime.Table(name.capitalize(), ("figure", "value"), lines)]
    of = dict(zip(TABLES, (found["columns"], found["columns"], found["correlations"]), strict=True))
    return [
        runtime.Table(
            title,
            tuple(str(words.get(key, key)) for key in keys),
            tuple(tuple(_shown(key, entry[key]) for key in keys) for entry in of[title]),
        )
        for title, keys in TABLES.items()
        if of[title]
    ]


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
        return f"{value:.2g}" if value > 1e-300 else "< 1e-300"
    return str(value) if isinstance(value, int) else f"{value:.4g}"


def _notes(found: dict[str, Any], rows: TableRows) -> list[str]:
    """Return what to keep in mind."""
    from orbiflow.density.summaries import MIN_ROWS

    entries, notes = next(iter(found.values())), list[str]()
    units, what = min(entry["rows"] for entry in entries), "rows"
    if rows.labels is not None:
        units, what = len(set(rows.labels.tolist())), "groups"
        notes.append(f"intervals and tests count {units} groups, whose rows are not independent")
    if rows.labels is not None or rows.weights is not None:
        notes.append("tests that are known for independent rows of equal weight alone are left out")
    if units < MIN_ROWS:
        notes.append(f"intervals are rough with fewer than {MIN_ROWS} {what}, there are {units}")
    peaks = [one for one in entries if "name" in one and one["rows"] > 1]
    if constant := [one["name"] for one in peaks if one["concentration"] is None]:
        notes.append(f"all rows have the same value of {', '.join(constant)}")
    if (half := entries[0].get("half", 0.0)) > WIDE_DEGREES:
        notes.append(
            f"half of the rows are {half:.0f} degrees and more from the mean, which says little: "
            "`density fit` finds several orientations"
        )
    undetermined = [entry["name"] for entry in entries if entry.get("half_width", 0) is None]
    if undetermined:
        notes.append(
            f"the mean direction of {', '.join(undetermined)} cannot be told; of the correlations, "
            "Fisher and Lee's needs none"
        )
    return notes


def _roses(rows: TableRows, columns: list[dict[str, Any]], unit: str, file: Path) -> bytes:
    """Return a picture of a rose for each column."""
    import numpy as np

    from orbiflow.density import pictures
    from orbiflow.density.data import written_from_zero
    from orbiflow.density.spaces import whole_turn
    from orbiflow.drawing import Sheet

    turn, roses = whole_turn(unit), list[pictures.Rose]()
    for column, entry in zip(rows.values.T, columns, strict=True):
        kept = np.isfinite(column)
        weights = None if rows.weights is None else rows.weights[kept]
        mean, spread = (
            None if entry[key] is None else entry[key] / turn for key in ("mean", "half_width")
        )
        place = (mean, entry["resultant"], spread)
        turns = column[kept] / turn
        first = 0.0 if written_from_zero(turns[:, None], 1.0) else -0.5
        roses.append(pictures.Rose(entry["name"], turns, weights, None, place, first))
    form: Any = file.suffix.lower()[1:]
    sheet = Sheet.screen() if form == "png" else Sheet.column("double", form)
    words = "The line is the mean direction, as long as the resultant, and the arc its interval"
    return pictures.roses_picture(roses, unit, words, sheet).file()
