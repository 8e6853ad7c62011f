"""All pictures of a density, in a folder or as the pages of one PDF."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple

import torch
from numpy.typing import ArrayLike

from orbiflow.arguments import as_path
from orbiflow.density.comparing import density_of
from orbiflow.density.estimator import DensityEstimator
from orbiflow.density.models import Density
from orbiflow.density.pictures import figures
from orbiflow.density.pictures.coastlines import coastlines_for, simplified
from orbiflow.density.pictures.corner import MAX_COLUMNS, corner_picture
from orbiflow.density.pictures.frames import view_of
from orbiflow.density.pictures.maps import Map
from orbiflow.density.pictures.overlays import region_lines
from orbiflow.density.pictures.projections import PlateCarree, chosen_map
from orbiflow.density.pictures.roses import rose_picture
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.pictures.surfaces import density_page
from orbiflow.density.spaces import Space, check_measure
from orbiflow.drawing import FORMATS, Picture, pdf_pages
from orbiflow.errors import OrbiflowError, OutputError, SettingError
from orbiflow.runtime import LITTER, make_folder, one_thread, write_atomic, write_set

MODEL = "density.safetensors"
REPORT = "report.json"
TABLE = "density.csv"
"""The table beside the model in the folder of a marginal or conditional density."""

THUMBNAIL = "thumbnail.png"
"""The small picture beside the model of a fit in a batch."""

PAGE = "surface.html"
NAMES = ("density", "latlon", "square", "flow", "samples", "rose")
PICTURES = (*(f"{name}.{form}" for form in FORMATS for name in NAMES), PAGE)
"""The files that a plot may write into a folder, and that go when another one is written there."""

SAMPLES = 3000
PAGE_POINTS = 40_000
"""Points of coastlines on the surface that turns, at most."""


class Plotted(NamedTuple):
    """The files that were written, the figures' captions, and what was not drawn, and why."""

    files: tuple[Path, ...]
    captions: tuple[str, ...]
    notes: tuple[str, ...] = ()


@one_thread()
def plot_density(
    density: Density | DensityEstimator,
    out: str | Path,
    settings: PlotSettings | None = None,
    *,
    data: ArrayLike | None = None,
    told: Callable[[float, str], None] = lambda _share, _what: None,
) -> Plotted:
    """Draw a density, its flow, samples beside the data, and the surface to turn.

    The density of angles is drawn on its square; that of directions or axes on a map ("density"), on
    the sphere also in plain latitude and longitude ("latlon"), and on its square ("square"). A flow
    that is not in the density is left out. On a torus of more or fewer than two angles there are
    samples alone, all pairs of angles, and of one angle a rose. All is drawn before any is written.

    Args:
        density: A density or a fitted estimator.
        out: A folder, made if need be, from which the pictures of an earlier density are removed; or a
            .pdf, which gets a page for each figure, without the surface.
        settings: How it is drawn. An `out` that ends in .pdf is a PDF whatever they say.
        data: Data (N, k) in the space's own units, to be drawn beside the samples.
        told: A function that is called with the share of the work done and what is drawn. What it
            raises ends the work.

    Raises:
        OrbiflowError: If settings or data do not fit the density.
        OutputError: If a file cannot be written, or `out` ends like a file of one picture.
    """
    settings, out = settings or PlotSettings(), as_path(out, "the folder to draw into")
    single = is_one_file(out)
    if single:
        settings = settings.replace(format="pdf")
    else:
        refuse_foreign_files(out)
    shown = _Shown(density_of(density, "this DensityEstimator"), settings, data)
    if not single:
        make_folder(out)
    form, makers, pictures = settings.sheet.format, shown.makers(), dict[str, Picture]()
    for k, (name, make) in enumerate(makers.items()):
        told(k / (len(makers) + 1), f"drawing {name}.{form}")
        pictures[name] = make()
    captions = tuple(f"{own.title}. {own.caption}".strip() for own in pictures.values())
    flowless = shown.space.is_planar and not shown.flows
    notes = ("there is no flow in this density, and so no picture of one",) * flowless
    if single:
        path = write_atomic(out, pdf_pages(list(pictures.values())))
        return Plotted((path,), captions, notes)
    files = {f"{name}.{form}": picture.file() for name, picture in pictures.items()}
    if "flow.png" in files and not settings.sheet.printed:
        files["flow.png"] = figures.few_colours(files["flow.png"])
    contents: dict[str, str | bytes] = {**files}
    if shown.space.is_planar:
        told(0.75, f"drawing {PAGE}")
        lines = simplified(shown.coastlines, PAGE_POINTS)
        contents[PAGE] = density_page(
            shown.density, settings, samples=shown.points, coastlines=lines
        )
    return Plotted(tuple(write_set(out, PICTURES, contents)), captions, notes)


def refuse_foreign_files(out: Path) -> None:
    """Refuse a folder with pictures beside files of others: the pictures may be somebody's own."""
    if not out.is_dir():
        return
    inside = {path.name for path in out.iterdir()} - LITTER
    foreign = sorted(inside - {MODEL, REPORT, TABLE, THUMBNAIL, *PICTURES})
    old = sorted(inside & set(PICTURES))
    if foreign and old:
        raise OutputError(
            f"{out} holds {old[0]}, which would be removed, beside {foreign[0]}, which orbiflow did "
            "not write: choose another --out or move it"
        )


def is_one_file(out: Path) -> bool:
    """Return whether the pictures will be the pages of one PDF; refuse a name of one picture."""
    ending = out.suffix.lower()
    if out.is_dir() or ending not in (".png", ".svg", ".pdf", ".html"):
        return False
    if ending != ".pdf":
        raise OutputError(
            f"cannot write {out}: there are several pictures; give a folder, or a .pdf, which gets "
            "a page each"
        )
    return True


class _Shown:
    """A density and what is drawn with it; all that can be wrong is checked before the work."""

    def __init__(self, density: Density, settings: PlotSettings, data: ArrayLike | None) -> None:
        self.density, self.settings = density, settings
        self.space = space = density.space
        self.coastlines = coastlines_for(space, settings)
        _check_space(space, settings)
        self.data = None if data is None else space.to_chart(data)
        generator = torch.Generator().manual_seed(settings.seed)
        self.samples = self.density.sample((settings.samples or SAMPLES,), generator)
        self.points = self.samples if self.data is None else self.data
        self.map = chosen_map(space, self.points, settings) if space.is_round else None
        self.regions = region_lines(self.density, settings)
        self.flows = figures.carried_part(density)[1].is_carried

    def makers(self) -> Mapping[str, Callable[[], Picture]]:
        """Return functions that draw the figures, by the names of their files without the ending."""
        density, settings, data, samples = self.density, self.settings, self.data, self.samples
        if self.space.dim != 2:
            made = {"samples": partial(corner_picture, density, data, samples, settings)}
            if self.space.dim == 1:
                what = "samples" if data is None else "data"
                made["rose"] = partial(rose_picture, density, self.points, settings, what=what)
            return made
        grounds = self._grounds()
        dots = self.points if settings.dots else None
        draw = partial(figures.density_picture, density, dots, settings, regions=self.regions)
        makers = {name: partial(draw, ground=ground) for name, ground in grounds.items()}
        if self.flows and self.space.has_square:
            makers["flow"] = partial(figures.flow_picture, density, settings)
        if data is not None or settings.samples is not None:
            draw = partial(figures.samples_picture, density, data, samples, settings)
            makers["samples"] = partial(draw, ground=grounds["density"])
        return makers

    def _grounds(self) -> dict[str, figures.Ground]:
        """Return what the density is drawn on, by the names of the figures."""
        space, square = self.space, figures.plane_ground(self.space, self.settings)
        if self.map is None:
            return {"density": square}
        grounds: dict[str, figures.Ground] = {"density": Map(space, self.map, self.coastlines)}
        if space.name == "sphere" and not isinstance(self.map, PlateCarree):
            plain = PlateCarree((0.0, self.map.center[1]))
            grounds["latlon"] = Map(space, plain, self.coastlines)
        return {**grounds, "square": square}


def _check_space(space: Space, settings: PlotSettings) -> None:
    """Check that a space can be drawn, and that settings fit it."""
    if space.dim > MAX_COLUMNS:
        raise OrbiflowError(
            f"this {space.name} has {space.dim} angles, pictures have {MAX_COLUMNS} at most: draw "
            "columns of `orbiflow density sample` beside those of the data"
        )
    view_of(space, settings.names, settings.center)
    check_measure(settings.measure, space)
    if not space.is_round and (settings.projection != "auto" or settings.radius is not None):
        name = "radius" if settings.projection == "auto" else "projection"
        raise SettingError(
            f"{{{name}}} applies to maps of the sphere and the projective plane, not to the "
            f"{space.name}"
        )
