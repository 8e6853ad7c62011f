"""All pictures of a density, in a folder or as the pages of one PDF."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arguments import path as as_path
from orbiflow.density.estimator import DensityEstimator
from orbiflow.density.models.symmetric import SymmetricDensity
from orbiflow.density.spaces.space import MEASURES, Space
from orbiflow.density.storage import read_density
from orbiflow.errors import OrbiflowError, OutputError
from orbiflow.figures.density_axes import space_title, view_of
from orbiflow.figures.density_corner import MOST_COLUMNS, corner_picture
from orbiflow.figures.density_flow import few_colours, flow_picture
from orbiflow.figures.density_page import density_page
from orbiflow.figures.density_scale import SCALES
from orbiflow.figures.density_square import density_picture, samples_picture
from orbiflow.figures.sheet import FORMATS, FigureFormat, Picture, Sheet, pdf_pages
from orbiflow.files import make_folder, write_atomic, write_set
from orbiflow.folders import LITTER
from orbiflow.threads import one_thread

MODEL = "density.safetensors"
REPORT = "report.json"
TABLE = "density.csv"
"""What the folder of a marginal or conditional density of one or two angles has beside its model."""

PAGE = "surface.html"
NAMES = ("density", "flow", "samples")
PICTURES = (*(f"{name}.{form}" for form in FORMATS for name in NAMES), PAGE)
"""What a plot may write into a folder, and what goes when another one is written there."""

SAMPLES = 3000


@dataclass(frozen=True)
class PlotSettings:
    """How a density is drawn.

    - `format`: "png" for a screen; "pdf" or "svg" for print.
    - `width`: of a printed figure, "single", "double" (a journal's columns) or mm; None is "single" for
      PDF and SVG. A PNG with a width is made for print, too.
    - `measure`: what the density is per: "natural", "square" or "uniform".
    - `scale`: of colours: "auto", "linear" or "log".
    - `names`: of the data's columns. `center`: angles in the middle of a torus' pictures.
    - `coastlines`: lines (N, 2) of latitude and longitude on the sphere's surface.
    - `dots`: draw data, or else samples, over the density.
    - `seed`: of the samples.

    Raises:
        OrbiflowError: for a setting that cannot be used, by its name.

    >>> PlotSettings(format="pdf", width="double").sheet.text
    8.0
    """

    format: FigureFormat = "png"
    width: str | float | None = None
    measure: str = "natural"
    scale: str = "auto"
    names: Sequence[str] | None = None
    center: Sequence[float] | None = None
    coastlines: Sequence[ArrayLike] | None = None
    dots: bool = False
    seed: int = 0

    def __post_init__(self) -> None:
        _ = self.sheet
        for name, known in (("measure", MEASURES), ("scale", SCALES)):
            if getattr(self, name) not in known:
                raise OrbiflowError(
                    f"{name} must be one of {', '.join(known)}, got {getattr(self, name)!r}"
                )

    @property
    def sheet(self) -> Sheet:
        """What the figures are made for."""
        if self.format == "png" and self.width is None:
            return Sheet.screen()
        return Sheet.column("single" if self.width is None else self.width, self.format)


class Plotted(NamedTuple):
    """The files that were written, and the figures' captions."""

    files: tuple[Path, ...]
    captions: tuple[str, ...]


@one_thread()
def plot_density(
    density: SymmetricDensity | DensityEstimator | str | Path,
    out: str | Path,
    settings: PlotSettings | None = None,
    *,
    data: ArrayLike | None = None,
    told: Callable[[float, str], None] = lambda *_: None,
) -> Plotted:
    """Draw the density on its square, the flow, samples beside the data, and the surface to turn.

    All is drawn before anything is written. Of a torus of more or fewer than two angles: samples alone,
    all pairs of angles.

    Args:
        density: or the folder of `orbiflow density fit`.
        out: a folder, made if need be, whose pictures of an earlier density go; or a .pdf, which gets a
            page a figure, without the surface.
        settings: see `PlotSettings`; an `out` that ends in .pdf is one whatever they say.
        data: (N, k) in the space's own units, to be drawn beside the samples.
        told: told the share of the work done and what is drawn; what it raises ends it.

    Raises:
        OrbiflowError: for settings or data that do not fit the density.
        InputFileError: if there is no density to read.
        OutputError: if a file cannot be written, or `out` ends like a file of one picture.
    """
    settings, out = settings or PlotSettings(), as_path(out, "the folder to draw into")
    single = is_one_file(out)
    if not single:
        refuse_others(out)
    plots = DensityPlots.of(density, settings, data)
    if single:
        pictures = plots.pictures(Sheet.column(settings.width or "single", "pdf"), told)
        made = list(pictures.values())
        return Plotted((write_atomic(out, pdf_pages(made)),), _words(made))
    make_folder(out)
    sheet = settings.sheet
    pictures = plots.pictures(sheet, told)
    contents: dict[str, str | bytes] = {
        f"{name}.{sheet.format}": _content(name, picture) for name, picture in pictures.items()
    }
    if plots.has_surface:
        told(0.75, f"drawing {PAGE}")
        contents[PAGE] = plots.page()
    paths = write_set(out, PICTURES, contents)
    return Plotted(tuple(paths), _words(pictures.values()))


def refuse_others(out: Path) -> None:
    """Pictures that would go, beside files that orbiflow did not write, may be somebody's own.

    Raises:
        OutputError: for such a folder.
    """
    if not out.is_dir():
        return
    inside = {path.name for path in out.iterdir()} - LITTER
    foreign, old = (
        sorted(inside - {MODEL, REPORT, TABLE, *PICTURES}),
        sorted(inside & set(PICTURES)),
    )
    if foreign and old:
        raise OutputError(
            f"{out} holds {old[0]}, which would go, beside {foreign[0]}, which is of no earlier run: "
            "choose another --out or move it"
        )


def is_one_file(out: Path) -> bool:
    """Whether the pictures are the pages of one PDF.

    Raises:
        OutputError: for a name like that of one picture, which is no folder.
    """
    ending = out.suffix.lower()
    if out.is_dir() or ending not in (".png", ".svg", ".pdf", ".html"):
        return False
    if ending != ".pdf":
        raise OutputError(
            f"cannot write {out}: there are several pictures; give a folder, or a .pdf, which gets "
            "a page each"
        )
    return True


@dataclass(frozen=True, eq=False)
class DensityPlots:
    """What the pictures of a density show: chart points beside it."""

    density: SymmetricDensity
    settings: PlotSettings
    samples: Tensor
    data: Tensor | None

    @classmethod
    def of(
        cls,
        density: SymmetricDensity | DensityEstimator | str | Path,
        settings: PlotSettings,
        data: ArrayLike | None = None,
    ) -> DensityPlots:
        """Mistakes before work.

        Raises:
            OrbiflowError: as `plot_density`.
        """
        own, columns = _density(density)
        space = own.space
        if settings.names is None:
            settings = replace(settings, names=known_names(space, columns))
        if settings.coastlines is not None and space.name != "sphere":
            raise OrbiflowError(f"coastlines belong to the sphere, not the {space.name}")
        if space.dim > MOST_COLUMNS:
            raise OrbiflowError(
                f"this {space.name} has {space.dim} angles, pictures are of {MOST_COLUMNS} at most: "
                "draw columns of `orbiflow density sample` beside those of the data"
            )
        view_of(space, settings.names, settings.center)
        points = None if data is None else space.to_chart(data)
        drawn = own.sample((SAMPLES,), torch.Generator().manual_seed(settings.seed))
        return cls(own, settings, drawn, points)

    @property
    def has_surface(self) -> bool:
        """Whether there is one to turn, and a square: of two dimensions alone."""
        return self.density.space.dim == 2

    def pictures(
        self, sheet: Sheet, told: Callable[[float, str], None] = lambda *_: None
    ) -> dict[str, Picture]:
        """By the names of their files, without the ending."""
        makers = self._makers(sheet)
        made: dict[str, Picture] = {}
        for k, (name, make) in enumerate(makers.items()):
            told(k / (len(makers) + 1), f"drawing {name}.{sheet.format}")
            made[name] = make()
        return made

    def page(self) -> str:
        """The surface, to turn in a browser."""
        settings, space = self.settings, self.density.space
        return density_page(
            self.density,
            measure=settings.measure,
            scale=settings.scale,
            names=settings.names,
            samples=self._shown,
            dots=settings.dots,
            coastlines=settings.coastlines,
            title=f"Density on the {space_title(space)}",
        )

    @property
    def _shown(self) -> Tensor:
        return self.samples if self.data is None else self.data

    def _makers(self, sheet: Sheet) -> Mapping[str, Callable[[], Picture]]:
        density, settings, data = self.density, self.settings, self.data
        axes: dict[str, Any] = {
            "names": settings.names,
            "center": settings.center,
            "sheet": sheet,
        }
        if not self.has_surface:
            return {"samples": lambda: corner_picture(density, data, self.samples, **axes)}
        dots = self._shown if settings.dots else None
        colours = {"measure": settings.measure, "scale": settings.scale}
        makers = {
            "density": lambda: density_picture(density, dots, **colours, **axes),
            "flow": lambda: flow_picture(density, center=settings.center, sheet=sheet),
        }
        if data is not None:
            makers["samples"] = lambda: samples_picture(density, data, self.samples, **axes)
        return makers


def known_names(space: Space, columns: Sequence[str] | None) -> Sequence[str] | None:
    """Columns of a table as names of the axes, if they are angles."""
    angles = space.unit is not None
    return columns if angles and columns and len(columns) == len(space.columns) else None


def _density(
    given: SymmetricDensity | DensityEstimator | str | Path,
) -> tuple[SymmetricDensity, Sequence[str] | None]:
    """It, and the columns that it was fitted to, where they are known."""
    if isinstance(given, SymmetricDensity):
        return given, None
    if isinstance(given, DensityEstimator):
        density = getattr(given, "density_", None)
        if density is None:
            raise OrbiflowError("this DensityEstimator is not fitted; call fit(data) first")
        return density, None
    path = as_path(given, "the density")
    density, extra = read_density(path / MODEL if path.is_dir() else path)
    return density, extra.get("columns")


def _content(name: str, picture: Picture) -> bytes:
    content = picture.file()
    # on a screen the flow's colours are few
    few = name == "flow" and picture.sheet.format == "png" and not picture.sheet.printed
    return few_colours(content) if few else content


def _words(pictures: Iterable[Picture]) -> tuple[str, ...]:
    return tuple(f"{picture.title}. {picture.caption}".strip() for picture in pictures)
