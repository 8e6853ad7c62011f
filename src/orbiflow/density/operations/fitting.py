"""Fitting a density to a table: the command fit."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Annotated

from orbiflow.density.fitting import DensitySettings
from orbiflow.density.tables import RowSettings, SpaceSettings
from orbiflow.runtime import Cancel, Note, Outcome, Sink, Written, ignore, operation
from orbiflow.settings import Group, Hidden, NotWith, Option, SettingError

COLUMNS = {"klein-bottle": 2}
"""How many columns a space takes, where that is known."""


@operation("density fit")
def fit(
    data: Path,
    where: SpaceSettings,
    settings: DensitySettings = DensitySettings(),
    reading: RowSettings = RowSettings(),
    *,
    out: Annotated[Path, Option("--out", "-o")] = Path("density"),
    group: Annotated[
        str | None,
        Group("Reading the table"),
        NotWith("kernels", because="a flow has no components to choose"),
    ] = None,
    picture: Annotated[bool, Hidden()] = False,
    on_event: Sink = ignore,
    cancel: Cancel = Cancel(),
) -> Outcome:
    """Fit a density: angles (torus), lat,lon or x,y,z (sphere), axes (projective plane) or theta,phi.

    Writes density.safetensors and report.json into the folder.

    Args:
        data: CSV, TSV, NPY or Parquet.
        out: Folder for the results, made if need be.
        group: Column that names what rows belong to (a protein, a station, an event): those of one are
            not independent.
        picture: Also draw a small picture, thumbnail.png.
    """
    begin = time.perf_counter()
    check_group(settings, group)
    if reading.missing == "marginalise":
        check_marginalised(where, settings)

    from orbiflow.density.comparing import RowSketch
    from orbiflow.density.estimator import DensityEstimator
    from orbiflow.density.models import density_to_bytes
    from orbiflow.density.operations.fitted import fit_document, fit_words, is_whole
    from orbiflow.density.pictures import MODEL, REPORT, THUMBNAIL
    from orbiflow.density.run_folder import written_files
    from orbiflow.density.tables import angle_unit, read_rows
    from orbiflow.runtime import (
        ResultFolder,
        check_output_folder,
        one_thread,
        progress_events,
        write_atomic,
    )

    with one_thread():
        rows = read_rows(data, reading, on_event, width=COLUMNS.get(where.space), group=group)
        labels, values = rows.labels(), rows.table.values
        unit = angle_unit(where.space, where.unit, rows.table, on_event)
        folder = ResultFolder(out, written_files)
        check_output_folder(out, data)
        estimator = DensityEstimator.with_settings(
            where.space,
            settings,
            unit=unit,
            missing="marginalise" if reading.missing == "marginalise" else "refuse",
        )
        progress = progress_events(on_event, cancel)
        estimator.fit(values, sample_weight=rows.weights, groups=labels, progress=progress)
        asked = {**settings.values(), **reading.values(), "group": group}
        document = fit_document(estimator, rows, asked, settings.seed)
        document["seconds"] = time.perf_counter() - begin
        whole = values[is_whole(rows)]
        known = RowSketch.of(estimator.space_, whole).to_json() if len(whole) else None
        model = density_to_bytes(
            estimator.density_, columns=list(rows.table.columns), fitted_rows=known
        )
        files: dict[str, str | bytes] = {
            MODEL: model,
            REPORT: json.dumps(document, allow_nan=False, indent=1),
        }
        if picture:
            from orbiflow.density.pictures import density_thumbnail

            files[THUMBNAIL] = density_thumbnail(estimator.density_, values)
    with folder.replaced() as staged:
        for name, content in files.items():
            write_atomic(staged / name, content)
    for name in files:
        on_event(Written(out / name))
    for note in (*estimator.report_.notes, *fit_words(document, len(values), out)):
        on_event(Note(note))
    summary = {name: document[name] for name in ("log_likelihood", "seconds")}
    summary |= {"folder": str(out), "rows": len(values)}
    return Outcome({**summary, "picture": THUMBNAIL if picture else None})


def check_group(settings: DensitySettings, group: str | None) -> None:
    """Refuse groups where no components are chosen."""
    if group is not None and settings.flow_alone:
        raise SettingError(
            "{group} serves to choose among {components}, and a flow alone has no choice; leave it out"
        )


def check_marginalised(where: SpaceSettings, settings: DensitySettings) -> None:
    """Refuse what cannot be fitted to rows that lack angles."""
    if where.space != "torus":
        raise SettingError(
            f"{{missing}} marginalise is for angles on a torus: on the {where.space} no coordinate is "
            "known without the other; use {missing} drop"
        )
    if settings.flow_alone:
        raise SettingError(
            "{missing} marginalise is for kernels and mixtures: a flow cannot be fitted to rows that "
            "lack angles; give other {components}"
        )
