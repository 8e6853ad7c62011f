"""Operations on a fitted density: pictures and regions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from orbiflow import runtime
from orbiflow.density import pictures, regions, spaces
from orbiflow.density.pictures import PlotSettings
from orbiflow.density.regions import RegionSettings
from orbiflow.density.tables import TableSettings
from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.settings import DefaultText, Ending, Option

if TYPE_CHECKING:
    from orbiflow.density.regions import DensityRegion
    from orbiflow.density.spaces import Space

Model = Annotated[Path, Option("-m")]
"""The parameter of a fitted density."""


@runtime.operation("density plot")
def plot(
    settings: PlotSettings = PlotSettings(),
    table: TableSettings = TableSettings(),
    *,
    model: Model,
    out: Annotated[Path, Option("-o")] = Path("plots"),
    data: Path | None = None,
    at: Annotated[tuple[str, ...], DefaultText("none")] = (),
    on_event: runtime.Sink = runtime.ignore,
    cancel: runtime.Cancel = runtime.Cancel(),
) -> runtime.Outcome:
    """Draw a density: density, flow, samples as PNG, PDF or SVG, and surface.html, to turn in 3-D.

    Directions and axes are drawn on maps (density, latlon) and on the square.

    On a torus of more angles there are samples alone, all pairs of angles; of one, a rose, too.

    Args:
        model: Folder that `fit` wrote.
        out: Folder for the pictures, made if need be; or a .pdf, which gets a page for each figure.
        data: Table to draw beside samples in samples.png, and as the dots of --dots.
        at: The covariates of the fit, such as temperature=295,residue=GLY: the density where they
            are.
    """
    if data is None and table.fields_given:
        name = min(table.fields_given)
        raise SettingError(f"{{{name}}} applies only to {{data}}; give both or neither")

    from orbiflow.density.operations.saved import SavedDensity

    single = pictures.is_one_file(out)
    if single and settings.format not in (None, "pdf"):
        raise SettingError(f"{{out}} ends in .pdf but {{format}} is {settings.format}")
    # pictures may stand beside their model
    check = runtime.check_output_file if single else runtime.check_outside_runs
    check(out, model, data, settings.coastlines)
    saved = SavedDensity.read_at(model, at, on_event)
    space = saved.density.space
    if settings.names is None:
        settings = settings.replace(names=tuple(saved.columns))
    points = None
    if data is not None:
        points = saved.rows(data, table, on_event).values

    progress = runtime.progress_events(on_event, cancel)
    plotted = pictures.plot_density(saved.density, out, settings, data=points, told=progress)
    captions = plotted.captions if single or settings.sheet.printed else ()
    for path in plotted.files:
        on_event(runtime.Written(path))
    for note in (*(f"caption: {caption}" for caption in captions), *plotted.notes):
        on_event(runtime.Note(note))
    on_event(runtime.Note(_where_pictures_are(out, single, space)))
    folder = out.parent if single else out
    return runtime.Outcome({"folder": str(folder), "files": [path.name for path in plotted.files]})


def _where_pictures_are(out: Path, single: bool, space: Space) -> str:
    if isinstance(space, spaces.ProductSpace):
        return (
            f"pictures of the {space.base.name}, of the columns beside it, and of one along the other "
            f"are written to {out}"
        )
    if space.dim == 1:
        return f"written {out}" if single else f"written to {out}"
    if space.dim != 2:
        where = out if single else f"the picture in {out}"
        return (
            f"density, flow and surface are drawn in two dimensions, here are {space.dim}: {where} "
            "shows samples, column by column"
        )
    if not space.is_surface:
        return f"written to {out}"
    if single:
        return f"written {out}, a page for each figure; a folder gets the surface to turn, too"
    return f"written to {out}; open {out / 'surface.html'} in a browser"


@runtime.operation("density region")
def region(
    settings: RegionSettings = RegionSettings(),
    *,
    model: Model,
    out: Annotated[Path, Option("-o"), Ending(".geojson", ".json", ".csv")] = Path("regions.json"),
    on_event: runtime.Sink = runtime.ignore,
    cancel: runtime.Cancel = runtime.Cancel(),
) -> runtime.Outcome:
    """Find the smallest regions that hold a mass: threshold, size, and boundary as closed polygons.

    On a torus of more or fewer than two angles, and where columns are real, there are threshold and
    size alone.

    Args:
        model: Folder that `fit` wrote.
        out: File for the regions: .geojson (of directions and axes), .json or .csv.
    """
    from orbiflow.density.operations.saved import SavedDensity

    runtime.check_output_file(out, model)
    density = SavedDensity.read(model).density
    kind, space = out.suffix.lower(), density.space
    _require_format(out, kind, space)
    if settings.min_mass is not None and not space.is_surface:
        raise SettingError("{min_mass} is of islands, which are outlined in two dimensions alone")
    samples = regions.samples_for(settings.masses, settings.samples)
    progress = runtime.progress_events(on_event, cancel)
    progress(0.0, f"drawing {samples} samples")
    with runtime.one_thread():
        levels = regions.DensityLevels(
            density, samples=samples, seed=settings.seed, smooth=settings.smooth
        )
        thresholds = [levels.highest(mass) for mass in settings.masses]
        thresholds += [levels.above(level) for level in settings.level or ()]
        shown: Sequence[DensityRegion] = thresholds
        if space.is_surface:
            shown = regions.outlines(
                levels, thresholds, budget=settings.budget, seed=settings.seed,
                min_mass=settings.min_mass, told=lambda share, what: progress(0.1 + 0.9 * share, what),
            )  # fmt: skip
    answer = regions.DensityRegions.of(shown, samples, settings.seed)
    runtime.emit(answer, on_event, cancel, out)
    return runtime.Outcome({"file": str(out), "regions": runtime.to_json(thresholds)})


def _require_format(out: Path, kind: str, space: Space) -> None:
    """Check that regions of a space can be written in a format."""
    if kind == ".geojson" and not (space.is_round and space.is_surface):
        raise OrbiflowError(
            f"{out}: GeoJSON is for places on a globe, not for points of the {space.name}: write .json"
            + " or .csv" * space.is_surface
        )
    if kind == ".csv" and not space.is_surface:
        raise OrbiflowError(
            f"{out}: a table holds outlines, which are drawn in two dimensions; this {space.name} has "
            f"{space.dimensions}: write .json, and use `orbiflow density score --region` for the rows "
            "inside"
        )
