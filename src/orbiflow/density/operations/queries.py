"""Questions to a saved density: the commands score, sample, marginal and conditional."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from orbiflow import runtime
from orbiflow.density import comparing, fitting, models, regions, spaces, tables
from orbiflow.density.run_folder import write_file
from orbiflow.density.tables import RowSettings, check_table_name
from orbiflow.errors import Advice, InputFileError, OrbiflowError, SettingError
from orbiflow.settings import DefaultText, Needs, Option, Range, Settings

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from torch import Tensor

    from orbiflow.arrays import Array
    from orbiflow.density.data import TableRows

Model = Annotated[Path, Option("--model", "-m")]
Out = Annotated[Path, Option("--out", "-o")]


class ScoreSettings(Settings, group="Scores"):
    """What is found of each row of a table."""

    measure: Literal["natural", "square", "uniform"] = "natural"
    """What the density is per. Natural: the data's own units, or steradians. Uniform: relative to
    chance."""

    given: Annotated[tuple[str, ...], DefaultText("none")] = ()
    """Columns that are known: the log density of the others where these are, p(others | given). Or the
    covariates that were given to the fit."""

    region: bool = False
    """Add a column hdr: the mass of the smallest region of highest density that holds the row."""

    samples: Annotated[
        int | None, Range(1000, 10_000_000), Needs("region"), DefaultText("20000")
    ] = None
    """Samples of the density from which hdr is known; 20000 tell masses up to 0.9995."""

    gradient: bool = False
    """Add the gradient of log_prob, a column for each of the data's: per unit of each angle, per degree
    of lat and lon, tangent vectors of x,y,z."""


@runtime.operation("density score")
def score(
    data: Path,
    settings: ScoreSettings = ScoreSettings(),
    reading: RowSettings = RowSettings(),
    *,
    model: Model,
    out: Out = Path("scores.csv"),
    on_event: runtime.Sink = runtime.ignore,
    cancel: runtime.Cancel = runtime.Cancel(),
) -> runtime.Outcome:
    """Add a column log_prob, in nats, to a table.

    Args:
        data: CSV, TSV, NPY or Parquet.
        model: Folder that `orbiflow density fit` wrote.
        out: The table with the new columns.
    """
    check_table_name(out)
    may_lack = reading.missing == "marginalise"
    for name in ("region", "gradient") if settings.given else ():
        if getattr(settings, name):
            raise SettingError(f"{{{name}}} requires complete rows; leave it out, or {{given}}")
    for name in ("region", "gradient") if may_lack else ():
        if getattr(settings, name):
            raise SettingError(
                f"{{{name}}} requires complete rows; leave it out, or {{missing}} marginalise"
            )

    from orbiflow.density.operations.saved import SavedDensity

    runtime.check_output_file(out, data, model)
    with runtime.one_thread():
        saved = SavedDensity.read(model)
        spaces.check_measure(settings.measure, saved.density.space)
        covariates = saved.covariates_named(settings.given)
        rows = saved.rows(data, reading, on_event, covariates)
        progress = runtime.progress_events(on_event, cancel)
        if covariates:
            scores = score_given(saved.density, rows, settings, progress, on_event)
        else:
            axes = saved.axes(settings.given, on_event) if settings.given else ()
            if len(axes) == len(saved.columns):
                raise SettingError("{given} names all columns: nothing is left to have a density")
            scores = score_rows(saved.density, rows, settings, progress, may_lack, axes)
        columns, mean, over, notes = scores
    weighted = "" if rows.weights is None else ", weighted"
    words = f"mean log density {mean:.4f} nats over {over}{weighted}; written to {out}"
    table = tables.append_columns(rows, columns)
    notes += [
        f"{data} has a column {name} already: the new one is {free}"
        for name, free in tables.renamed_columns(rows, columns).items()
    ]
    write_file(out, table, on_event, *notes, words)
    return runtime.Outcome({"file": str(out), "rows": len(rows.values), "mean": mean})


Scores: TypeAlias = "tuple[dict[str, Array], float, str, list[str]]"
"""Columns to add, a mean log density, the rows that it is over in words, and notes."""

BLOCK, BLOCK_GIVEN, BLOCK_GRADIENT = 2**18, 2**12, 2**16
"""Rows at a time: many cost less each, few leave room and tell how far it is."""

SCORED_SHARE = 0.3
"""Share of the work that is done when gradients are still to be found."""


def score_rows(
    density: models.Density,
    rows: TableRows,
    settings: ScoreSettings,
    progress: fitting.Progress,
    may_lack: bool,
    given: Sequence[int] = (),
) -> Scores:
    """Return columns (N,) to add to the table, log densities first, and what is known of them.

    Where columns are `given`, by their numbers from 0, they are log densities of the others.

    These are the weighted mean log density, in nats, of the rows that lack nothing, which rows they are
    in words, and notes.
    """
    from orbiflow.density import inference

    space, values = density.space, rows.values
    points = inference.chart_of_rows(space, values, may_lack=may_lack)
    present = ~points.isnan()
    whole = present.all(dim=1).numpy()
    name = "log_prob" if whole.all() else "log_prob_marginal"
    notes: list[str] = []
    columns = {name: _log_densities(density, points, settings, progress)}
    if given:
        given = inference.chosen_columns(space, given, len(rows.columns)).axes
        of_given = _log_densities(density, _only(points, given), settings, progress)
        columns, name = {"log_prob_given": columns[name] - of_given}, "log_prob_given"
    if settings.gradient:
        columns |= _gradients(density, rows, progress)
    if settings.region:
        count = regions.samples_for((), settings.samples)
        progress(1.0, f"drawing {count} samples")
        natural = settings.measure == "natural"
        scores = columns[name] if natural else comparing.scores_of(density, values)
        columns["hdr"] = regions.DensityLevels(density, samples=count).hdr_of(scores)
        notes.append(_region_note(count))
    if not whole.all():
        notes.append(_missing_note(present, name))
    over = f"{len(whole)} rows" if whole.all() else f"the {whole.sum()} whole rows"
    return columns, mean_of_whole(columns[name], rows.weights, whole), over, notes


def score_given(
    density: models.Density,
    rows: TableRows,
    settings: ScoreSettings,
    progress: fitting.Progress,
    tell: runtime.Sink,
) -> Scores:
    """Return log densities (N,) of rows, each where its covariates are, as `score_rows`."""
    from orbiflow.density import inference

    conditional_density = density.given
    assert conditional_density is not None
    cells = dict(zip(conditional_density.covariates.names, rows.given.values(), strict=True))
    try:
        x = conditional_density.covariates.features(cells)
        doubts = conditional_density.covariates.doubts(cells)
    except OrbiflowError as error:
        text = f"{rows.source.where}{error}; leave such rows out, or score without what is given"
        raise InputFileError(text) from error
    for doubt in doubts:
        tell(runtime.Note(f"WARNING: {doubt}"))
    points = inference.chart_of_rows(density.space, rows.values, may_lack=False)

    def score_block(some: slice) -> Tensor:
        return conditional_density.log_prob(points[some], x[some], measure=settings.measure)

    logs = _in_blocks(score_block, len(points), BLOCK_GIVEN, progress)
    mean = mean_of_whole(logs, rows.weights, rows.whole)
    return {"log_prob_given": logs}, mean, f"{rows.whole.sum()} rows", []


def _in_blocks(
    score: Callable[[slice], Tensor], count: int, size: int, progress: fitting.Progress
) -> Array:
    """Return scores (N,) of rows, so many at a time."""
    import numpy as np
    import torch

    blocks: list[Array] = []
    for start in range(0, count, size):
        with torch.no_grad():
            blocks.append(score(slice(start, start + size)).double().numpy())
        progress(min(1.0, (start + size) / count), "scoring")
    return np.concatenate(blocks)


def _only(points: Tensor, given: Sequence[int]) -> Tensor:
    """Return points (N, d) that lack all but some columns."""
    some = points.new_full(points.shape, math.nan)
    some[:, list(given)] = points[:, list(given)]
    return some


def _log_densities(
    density: models.Density, points: Tensor, settings: ScoreSettings, progress: fitting.Progress
) -> Array:
    from orbiflow.density import inference

    end = SCORED_SHARE if settings.gradient else 1.0
    return _in_blocks(
        lambda some: inference.at_observed(density, points[some], measure=settings.measure),
        len(points), BLOCK, lambda share, what: progress(end * share, what),
    )  # fmt: skip


def _gradients(
    density: models.Density, rows: TableRows, progress: fitting.Progress
) -> dict[str, Array]:
    """Return the gradient of the log density, a column (N,) for each of the data's coordinates."""
    import numpy as np

    values = rows.values
    blocks: list[Array] = []
    for start in range(0, len(values), BLOCK_GRADIENT):
        part = values[start : start + BLOCK_GRADIENT]
        blocks.append(models.log_density_gradient(density, part)[1])
        share = (start + len(part)) / len(values)
        progress(SCORED_SHARE + (1 - SCORED_SHARE) * share, "finding gradients")
    names = [f"log_prob_by_{name}" for name in rows.columns]
    return dict(zip(names, np.concatenate(blocks).T, strict=True))


def mean_of_whole(scores: Array, weights: Array | None, whole: NDArray[Any]) -> float:
    """Return the mean of the rows that lack nothing: densities of fewer angles are in another unit."""
    import numpy as np

    chosen = whole if whole.any() else np.ones_like(whole)
    counts = None if weights is None else weights[chosen]
    return fitting.weighted_mean(scores[chosen], counts)


def _region_note(samples: int) -> Advice:
    """Return how far `hdr` can be trusted, in words."""
    low, high = regions.resolvable_masses(samples)
    return Advice(
        "hdr: the mass of the smallest highest-density region that holds the row, by "
        f"{samples} samples ({{samples}}): ± {0.5 / math.sqrt(samples):.2g} at most; what is below "
        f"{low:g} or above {high:.10g} they do not tell apart"
    )


def _missing_note(present: Tensor, name: str) -> str:
    """Return in words how many rows lack angles, and what their log density is."""
    lacking, empty = int((~present.all(dim=1)).sum()), int((~present.any(dim=1)).sum())
    nothing = f"; {empty} of them have none, hence 0" if empty else ""
    return (
        f"{lacking} of {len(present)} rows lack some angles: {name} is the log density of those "
        f"that they have{nothing}"
    )


class SampleSettings(Settings, group="Samples"):
    """How samples are drawn."""

    at: Annotated[tuple[str, ...], DefaultText("none")] = ()
    """The covariates of the fit, such as temperature=295,residue=GLY: samples where they are."""

    count: Annotated[int, Range(1, 100_000_000), Option("-n")] = 1000
    """Number of samples."""

    seed: Annotated[int, Range(-(2**63), 2**64 - 1)] = 0
    """Seed of the random numbers: the same seed on the same machine gives the same samples."""


@runtime.operation("density sample")
def sample(
    settings: SampleSettings = SampleSettings(),
    *,
    model: Model,
    out: Out = Path("samples.csv"),
    on_event: runtime.Sink = runtime.ignore,
    cancel: runtime.Cancel = runtime.Cancel(),
) -> runtime.Outcome:
    """Draw samples in the units of the data.

    Args:
        model: Folder that `orbiflow density fit` wrote.
        out: CSV of the samples.
    """
    check_table_name(out)

    import torch

    from orbiflow.density.operations.saved import SavedDensity

    runtime.check_output_file(out, model)
    with runtime.one_thread():
        saved = SavedDensity.read_at(model, settings.at, on_event)
        generator = torch.Generator().manual_seed(settings.seed)
        data = saved.density.space.from_chart(saved.density.sample((settings.count,), generator))
    cancel.check()
    notes = _weighed_notes(saved.density)
    words = f"{settings.count} samples written to {out}"
    write_file(out, tables.to_csv(saved.columns, data), on_event, *notes, words)
    return runtime.Outcome({"file": str(out), "rows": settings.count})


def _weighed_notes(density: models.Density) -> list[str]:
    """Return of what is drawn with weights how many draws count, in words."""
    shares = [(weight, part.effective_share()) for weight, part in density.parts()]
    return [
        f"{100 * weight:.1f}% of the samples are chosen among weighed draws, of which "
        f"{100 * share:.2g}% count (effective sample size)"
        for weight, share in shares
        if share < 1
    ]


class PartialSettings(Settings, group="Densities of some angles"):
    """How well they are found."""

    accuracy: Annotated[float, Range(1e-6, 0.5)] = 0.01
    """Error of the log density that is asked for, in nats (root mean square). What has a closed form is
    exact; the rest takes some seconds at 0.01, and up to a minute at 0.001."""


@runtime.operation("density marginal")
def marginal(
    settings: PartialSettings = PartialSettings(),
    *,
    model: Model,
    columns: tuple[str, ...],
    out: Out = Path("marginal"),
    on_event: runtime.Sink = runtime.ignore,
    cancel: runtime.Cancel = runtime.Cancel(),
) -> runtime.Outcome:
    """Find the density of some of a torus' angles, whatever the others are.

    Writes a model that score, sample and plot read; of one or two angles density.csv and density.png,
    too.

    Args:
        model: Folder that `orbiflow density fit` wrote.
        columns: Angles to keep, by name or number, such as phi.
        out: Folder of the new model, made if need be.
    """
    if not columns:
        raise SettingError("{columns} names no column; give names or numbers, as in phi,psi")

    from orbiflow.density.operations.derived import Partial
    from orbiflow.density.operations.saved import SavedDensity

    runtime.check_output_folder(out, model, what="model")
    with runtime.one_thread():
        saved = SavedDensity.read(model)
        return Partial(saved, out, settings, on_event, cancel).marginal(columns)


@runtime.operation("density conditional")
def conditional(
    settings: PartialSettings = PartialSettings(),
    *,
    model: Model,
    at: tuple[str, ...],
    columns: Annotated[tuple[str, ...] | None, DefaultText("all")] = None,
    out: Out = Path("conditional"),
    on_event: runtime.Sink = runtime.ignore,
    cancel: runtime.Cancel = runtime.Cancel(),
) -> runtime.Outcome:
    """Find the density where covariates of the fit, or some of a torus' angles, are known.

    Writes a model that score, sample and plot read; of one or two angles density.csv and density.png,
    too.

    Args:
        model: Folder that `orbiflow density fit` wrote.
        at: What is known: covariates, such as temperature=295,residue=GLY, and angles in the
            model's unit, such as psi=-45,chi1=60.
        columns: Of the other angles, those to keep.
        out: Folder of the new model, made if need be.
    """
    if not at:
        raise SettingError("{at} says nothing; give what is known, as in psi=-45")

    from orbiflow.density.operations.derived import Partial
    from orbiflow.density.operations.saved import SavedDensity

    runtime.check_output_folder(out, model, what="model")
    with runtime.one_thread():
        saved, others = SavedDensity.read(model).split(at, on_event)
        return Partial(saved, out, settings, on_event, cancel).conditional(others, columns)
