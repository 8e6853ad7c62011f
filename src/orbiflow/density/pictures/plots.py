"""All pictures of a density, in a folder or as pages of one PDF, and a small one for many together."""

# matplotlib types no keyword arguments
# pyright: reportUnknownMemberType=false

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike

from orbiflow.arrays import Array
from orbiflow.density.comparing import density_of
from orbiflow.density.estimator import DensityEstimator
from orbiflow.density.inference import marginal
from orbiflow.density.models import Density
from orbiflow.density.pictures import figures
from orbiflow.density.pictures.coastlines import coastlines_for, simplified
from orbiflow.density.pictures.colours import COLOURS
from orbiflow.density.pictures.corner import MAX_COLUMNS, corner_picture
from orbiflow.density.pictures.figures import plane_ground
from orbiflow.density.pictures.frames import real_spans, view_of
from orbiflow.density.pictures.grounds import region_lines
from orbiflow.density.pictures.maps import Map
from orbiflow.density.pictures.projections import PlateCarree, chosen_map
from orbiflow.density.pictures.roses import rose_picture
from orbiflow.density.pictures.series import along_of, series_picture
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.pictures.surfaces import density_page
from orbiflow.density.spaces import ProductSpace, Space, check_measure
from orbiflow.drawing import FORMATS, Picture, Sheet, pdf_pages
from orbiflow.errors import OrbiflowError, OutputError, SettingError
from orbiflow.runtime import LITTER, make_folder, one_thread, write_atomic, write_set
from orbiflow.settings import as_path

if TYPE_CHECKING:
    from matplotlib.figure import Figure


MODEL = "density.safetensors"
REPORT = "report.json"
TABLE = "density.csv"
"""The table beside the model in the folder of a marginal or conditional density."""

THUMBNAIL = "thumbnail.png"
"""The small picture beside the model of a fit in a batch."""

PAGE = "surface.html"
NAMES = ("density", "latlon", "square", "flow", "samples", "rose", "series", "beside")
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
    shown = _shown(density_of(density, "this DensityEstimator"), settings, data)
    if not single:
        make_folder(out)
    form, makers, pictures = settings.sheet.format, shown.makers(), dict[str, Picture]()
    for k, (name, make) in enumerate(makers.items()):
        told(k / (len(makers) + 1), f"drawing {name}.{form}")
        pictures[name] = make()
    captions = tuple(f"{picture.title}. {picture.caption}".strip() for picture in pictures.values())
    flowless = shown.space.is_surface and not shown.flows
    notes = ("there is no flow in this density, and so no picture of one",) * flowless
    if single:
        path = write_atomic(out, pdf_pages(list(pictures.values())))
        return Plotted((path,), captions, notes)
    files = {f"{name}.{form}": picture.file() for name, picture in pictures.items()}
    if "flow.png" in files and not settings.sheet.printed:
        files["flow.png"] = figures.few_colours(files["flow.png"])
    contents: dict[str, str | bytes] = {**files}
    if shown.space.is_surface:
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
            "not write: choose another folder or move it"
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


class _ShownBeside:
    """A density on a space beside other columns: what is drawn of both, and of one along the other."""

    flows, coastlines = False, list[Array]()

    def __init__(
        self, density: Density, space: ProductSpace, settings: PlotSettings, data: ArrayLike | None
    ) -> None:
        self.density, self.space, self.settings = density, space, settings
        names = settings.names or space.columns
        self.first = len(names) - space.beside.dim
        self.along = along_of(density, names, settings)
        table = None if data is None else np.asarray(data, dtype=np.float64)
        every = range(space.chart_dim)
        base = marginal(density, every[: space.together])
        of_base = settings.replace(names=names[: self.first], along=None, slices=None)
        self.base = _Shown(base, of_base, None if table is None else table[:, : self.first])
        beside = marginal(density, every[space.together :])
        other = PlotSettings(**{name: getattr(settings, name) for name in FOR_COLUMNS})
        other = other.replace(names=names[self.first :])
        self.beside = _Shown(beside, other, None if table is None else table[:, self.first :])
        self.points = self.base.points

    def makers(self) -> Mapping[str, Callable[[], Picture]]:
        """Return functions that draw the figures, by the names of their files without the ending."""
        makers = dict(self.base.makers())
        if self.space.base.dim == 2:
            ground = self.base.grounds()["density"]
            makers["series"] = partial(
                series_picture, self.density, self.along, self.settings, ground
            )
        others = self.beside.makers()
        return {**makers, "beside": others.get("samples") or others["density"]}


FOR_COLUMNS = ("format", "width", "samples", "seed")
"""Settings that hold for pictures of columns beside a space, too."""


def _shown(
    density: Density, settings: PlotSettings, data: ArrayLike | None
) -> _Shown | _ShownBeside:
    if isinstance(density.space, ProductSpace):
        return _ShownBeside(density, density.space, settings, data)
    for name in ("along", "slices"):
        if getattr(settings, name) is not None:
            raise SettingError(f"{{{name}}} is of columns beside another space: leave it out")
    return _Shown(density, settings, data)


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
            if self.space.dim == 1 and not real_spans(self.space):
                what = "samples" if data is None else "data"
                made["rose"] = partial(rose_picture, density, self.points, settings, what=what)
            return made
        grounds = self.grounds()
        dots = self.points if settings.dots else None
        draw = partial(figures.density_picture, density, dots, settings, regions=self.regions)
        makers = {name: partial(draw, ground=ground) for name, ground in grounds.items()}
        if self.flows and self.space.is_surface:
            makers["flow"] = partial(figures.flow_picture, density, settings)
        if data is not None or settings.samples is not None:
            draw = partial(figures.samples_picture, density, data, samples, settings)
            makers["samples"] = partial(draw, ground=grounds["density"])
        return makers

    def grounds(self) -> dict[str, figures.Ground]:
        """Return what the density is drawn on, by the names of the figures."""
        space, square = self.space, figures.plane_ground(self.space, self.settings)
        if self.map is None:
            return {"density": square}
        grounds: dict[str, figures.Ground] = {"density": Map(space, self.map, self.coastlines)}
        if space.name == "sphere" and self.map.name != PlateCarree.name:
            plain = PlateCarree((0.0, self.map.center[1]))
            grounds["latlon"] = Map(space, plain, self.coastlines)
        return {**grounds, "square": square}


def _check_space(space: Space, settings: PlotSettings) -> None:
    """Check that a space can be drawn, and that settings fit it."""
    if not space.has_chart:
        raise OrbiflowError(
            f"pictures are of angles, directions and axes, not of the {space.name}: draw columns of "
            "`orbiflow density sample`; MTEX and orix draw pole figures of sampled orientations"
        )
    if space.dim > MAX_COLUMNS:
        raise OrbiflowError(
            f"this {space.name} has {space.dim} angles, pictures have {MAX_COLUMNS} at most: draw "
            "columns of `orbiflow density sample` beside those of the data"
        )
    check_measure(settings.measure, space)
    view_of(space, settings.names, settings.center)
    if not space.is_round and (settings.projection != "auto" or settings.radius is not None):
        name = "radius" if settings.projection == "auto" else "projection"
        raise SettingError(
            f"{{{name}}} applies to maps of the sphere and the projective plane, not to the "
            f"{space.name}"
        )


SIZE = (360, 240)
"""Width and height in pixels, half as many again as a page shows."""

SHEET = Sheet(SIZE[0] / 100, 8.0, dpi=100)
PIXELS, MAP_PIXELS = 120, 14_000
"""Points along a side at which a density is evaluated, and of a map in all."""

SMALL_SAMPLES, SMALL_SEED = 4_000, 0
"""Samples of a density of other than two dimensions, a stripe for each column, and their seed."""


@torch.no_grad()
def density_thumbnail(density: Density, data: ArrayLike) -> bytes:
    """Return a PNG of 360 x 240 pixels, the same every time.

    Colours are by logarithms where most of the picture would be dark otherwise. `data` (N, k) are those
    that the density was fitted to; rows that lack angles are left out.
    """
    space, table = density.space, np.asarray(data, dtype=np.float64)
    if isinstance(space, ProductSpace):
        base = marginal(density, range(space.together))
        return density_thumbnail(base, table[:, : table.shape[1] - space.beside.dim])
    whole = table[~np.isnan(table).any(axis=1)]
    figure = SHEET.figure(SIZE[1] / 100)
    if space.has_chart and space.dim == 2:
        _draw_plane(figure, density, whole)
    else:
        drawn = density.sample((SMALL_SAMPLES,), torch.Generator().manual_seed(SMALL_SEED))
        places = view_of(space).places(drawn) if space.has_chart else (drawn.numpy() + 1) / 2
        if space.has_chart and not space.has_square:
            places = (places - places.min(axis=0)) / np.ptp(places, axis=0)
        _draw_stripes(figure, places)
    return SHEET.file(figure)


def _draw_plane(figure: Figure, density: Density, data: Array) -> None:
    """Draw the canonical square, a lattice's cell, or a map that suits data (N, k)."""
    space, settings = density.space, PlotSettings()
    if space.is_round:
        ground = Map(space, chosen_map(space, space.to_chart(data)))
    else:
        ground = plane_ground(space, settings)
    axes = figure.add_axes((0.01, 0.01, 0.98, 0.98))
    count = MAP_PIXELS if space.is_round else PIXELS
    ground.colouring(density, settings, count).draw(axes)
    axes.set_aspect("equal")
    axes.set_axis_off()


def _draw_stripes(figure: Figure, places: Array) -> None:
    """Draw a stripe for each column, from the top, each as bright as its largest bin."""
    edges = {"left": 0, "right": 1, "bottom": 0, "top": 1, "hspace": 0.05}
    panels = figure.subplots(places.shape[1], 1, squeeze=False, gridspec_kw=edges)
    for axes, column in zip(panels.flat, places.T, strict=True):
        axes.imshow(np.histogram(column, 90, (0, 1))[0][None], COLOURS, vmin=0, aspect="auto")
        axes.set_axis_off()
