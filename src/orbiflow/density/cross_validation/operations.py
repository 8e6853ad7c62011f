"""The operations of a cross-validation: all of it, and one of its fits, which workers do."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from orbiflow import batch, runtime
from orbiflow.arguments import as_whole
from orbiflow.density import operations, tables
from orbiflow.density.fitting import COMPONENTS, ComponentSettings, DensitySettings
from orbiflow.density.run_folder import write_files
from orbiflow.density.tables import GroupedRowSettings, SpaceSettings
from orbiflow.errors import OrbiflowError, SettingError, literal
from orbiflow.settings import DefaultText, Option, Range, Repeated, Settings

if TYPE_CHECKING:
    from numpy.typing import NDArray

SCORES, REPORT = "scores.csv", "report.json"
"""Files of one fit."""

DEFAULT, UNIFORM = "default", "uniform"
"""Names of what a fit chooses by itself, and of the density that is the same everywhere."""

Components = tuple[str, ...] | None
"""Those of a setting, None for what a fit chooses by itself."""


class CvSettings(Settings, group="Cross-validation"):
    """How rows are split, what is compared, and how sure the comparison is."""

    folds: Annotated[int, Range(2, 1000)] = 10
    """Number of parts of the rows; each is held out once."""

    times: Annotated[int, Range(1, 100)] = 1
    """Number of splits; more of them take away the chance of one."""

    against: Annotated[tuple[str, ...] | None, Repeated(), DefaultText("kernels")] = None
    """Other components, such as kernels,mixture, that are fitted to the same folds and compared row by
    row; also default, all components, and uniform. May be repeated."""

    level: Annotated[float, Range(0.5, 0.999)] = 0.95
    """Probability that all intervals hold at once."""

    bootstrap: Annotated[int, Range(100, 1_000_000)] = 2000
    """Number of resamples of rows or groups."""

    def check(self) -> None:
        for text in self.against or ():
            if text != UNIFORM:
                _setting_in(text)

    @property
    def others(self) -> dict[str, Components]:
        """The components of the other settings that are fitted, by name."""
        asked = ("kernels",) if self.against is None else self.against
        return dict(_setting_in(text) for text in asked if text != UNIFORM)


@dataclass(frozen=True)
class CrossValidation:
    """The table and the folder for the results, the fit in question, how rows are read and split."""

    data: Path
    out: Path
    where: SpaceSettings
    density: ComponentSettings
    rows: GroupedRowSettings
    cv: CvSettings

    def __post_init__(self) -> None:
        as_whole(self.density.seed, "seed", 0, 2**63 - 1)  # splits have fewer seeds than fits
        name, _ = setting_of(self.density.components, "components")
        if self.cv.against is not None and name in self.cv.others:
            raise SettingError(
                f"{{components}} and {{against}} are both {name}; compare it with others, or with "
                "uniform"
            )
        if self.rows.missing == "marginalise":
            for components in self.settings.values():
                operations.check_marginalised(
                    self.where, DensitySettings().replace(components=components)
                )

    @property
    def settings(self) -> dict[str, Components]:
        """The components by the name of each setting that is fitted, the one in question first."""
        found = dict([setting_of(self.density.components, "components")])
        for name, components in self.cv.others.items():
            found.setdefault(name, components)
        return found

    @property
    def names(self) -> list[str]:
        """The names of what is compared: the uniform density, too, if asked for or beside one alone."""
        fitted = list(self.settings)
        return (
            [*fitted, UNIFORM] if UNIFORM in (self.cv.against or ()) or len(fitted) == 1 else fitted
        )


@runtime.operation("density cv", keeps_partial=True, starts_processes=True)
def cross_validate(
    data: Path,
    where: SpaceSettings,
    density: ComponentSettings = ComponentSettings(),
    out: Annotated[Path, Option("-o")] = Path("cv"),
    cv: CvSettings = CvSettings(),
    rows: GroupedRowSettings = GroupedRowSettings(),
    work: batch.WorkSettings = batch.WorkSettings(),
    *,
    on_event: runtime.Sink = runtime.ignore,
    cancel: runtime.Cancel = runtime.Cancel(),
) -> runtime.Outcome:
    """Cross-validate: how well does a density foretell rows that its fit has not seen?

    Fits to all folds but one, for each in turn, here or on a Dask cluster, and scores the one held out,
    beside other settings at the same folds. Writes cv.csv, a line for each fold; rows.csv, the table
    with the log densities of each row; report.json, the comparison; and index.html, a page to look at.
    If it is interrupted, run the same command again to resume. The exit status is 1 if a fold has no
    result.

    Args:
        data: CSV, TSV, NPY or Parquet.
        out: Folder for the results; an earlier cross-validation there is resumed.
    """
    asked = CrossValidation(data, out, where, density, rows, cv)

    from orbiflow.density.cross_validation.overview import run

    return run(asked, work, on_event, cancel)


def setting_of(components: Sequence[str] | None, field: str) -> tuple[str, Components]:
    """Return the name of a setting, and its components in one order.

    >>> setting_of(["mixture", "kernels"], "components")
    ('kernels+mixture', ('kernels', 'mixture'))
    """
    if components is None:
        return DEFAULT, None
    unknown = [name for name in components if name not in COMPONENTS]
    if unknown or not components:
        others = ", default or uniform" if field == "against" else ""
        raise SettingError(
            f"{{{field}}} must be of {', '.join(COMPONENTS)} with commas between{others}, got "
            + literal(repr(", ".join(unknown)))
        )
    own = tuple(name for name in COMPONENTS if name in components)
    return (DEFAULT, None) if own == COMPONENTS else ("+".join(own), own)


def _setting_in(text: str) -> tuple[str, Components]:
    """Return the setting that a word of `against` names."""
    if text == DEFAULT:
        return DEFAULT, None
    pieces = [piece.strip() for piece in text.replace("+", ",").split(",")]
    return setting_of([piece for piece in pieces if piece], "against")


@runtime.operation("density fold")
@runtime.one_thread()
def fold(
    data: Path,
    where: SpaceSettings,
    density: ComponentSettings = ComponentSettings(),
    out: Annotated[Path, Option("-o")] = Path("fold"),
    rows: GroupedRowSettings = GroupedRowSettings(),
    *,
    fold: int,
    held: str = "fold",
    on_event: runtime.Sink = runtime.ignore,
    cancel: runtime.Cancel = runtime.Cancel(),
) -> runtime.Outcome:
    """Fit a density to all rows of a table but those of one fold, and score that fold.

    Writes scores.csv, a line for each row held out, and report.json. Rows of the fold take no part in
    the fit, nor in where the space is turned for it.

    Args:
        data: The table.
        out: Folder for the results, made if need be.
        fold: The fold that is held out.
        held: Column that numbers the fold of each row.
    """
    import numpy as np

    begin = time.perf_counter()
    width = len(rows.columns or ()) or None
    read = tables.read_rows(data, rows, on_event, width=width, group=rows.group)
    out_of_fit = _held(data, read.table, fold, held, rows.header)
    fitted, unseen = read.only(~out_of_fit), read.only(out_of_fit)
    folder = runtime.ResultFolder(out, written_files)
    estimator = operations.fit_rows(fitted, where, density, rows, on_event, cancel)
    scores = estimator.score_samples(unseen.table.values)
    if not np.isfinite(scores).all():
        raise SettingError(
            f"{(~np.isfinite(scores)).sum()} rows held out have no density: allow other "
            "{components}"
        )
    cancel.check()
    mean = operations.mean_of_whole(scores, unseen.weights, unseen.whole)
    document = {
        "space": {"name": estimator.space_.name, **estimator.space_.settings()},
        "fold": fold,
        "components": density.components,
        "rows": len(scores),
        "fitted": len(fitted.table.values),
        "log_likelihood": mean,
        "uniform": -math.log(estimator.space_.volume),
        "report": estimator.report_.to_json(),
        "seconds": time.perf_counter() - begin,
    }
    report = json.dumps(document, allow_nan=False, indent=1)
    pairs = zip(unseen.table.lines.tolist(), scores.tolist(), strict=True)
    write_files(
        folder, {SCORES: batch.csv_bytes(["row", "log_prob"], pairs), REPORT: report}, on_event
    )
    on_event(runtime.Note(f"mean log density {mean:.4f} nats at {len(scores)} rows held out"))
    names = ("rows", "fitted", "log_likelihood", "seconds")
    return runtime.Outcome({"folder": str(out), **{name: document[name] for name in names}})


def written_files(folder: Path) -> set[str]:
    """Return the names of what an earlier fold wrote into the folder."""
    return {SCORES, REPORT} if (folder / SCORES).is_file() else set()


def _held(
    data: Path, table: tables.Table, fold: int, name: str, header: bool | None
) -> NDArray[Any]:
    """Which rows (N,) are of the fold."""
    import numpy as np

    column = tables.read_table(data, columns=[name], width=1, has_header=header, drop_missing=True)
    if not np.isin(table.lines, column.lines).all():
        raise OrbiflowError(f"{data}: some rows lack their fold in {column.columns[0]!r}")
    folds = column.values[np.isin(column.lines, table.lines), 0]
    held = folds == fold
    if not held.any() or held.all():
        some = ", ".join(f"{one:g}" for one in np.unique(folds)[:20])
        raise SettingError(
            literal(f"{data}: {'all' if held.any() else 'none'} of its {len(held)} rows are of ")
            + f"{{fold}} {fold} by "
            + literal(f"{column.columns[0]!r}; give one of {some}")
        )
    return held
