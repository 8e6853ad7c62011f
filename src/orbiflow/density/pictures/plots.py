"""All pictures of a density, in a folder or as the pages of one PDF."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

from numpy.typing import ArrayLike

from orbiflow.arguments import path as as_path
from orbiflow.density.estimator import DensityEstimator
from orbiflow.density.models import SymmetricDensity
from orbiflow.density.pictures.choice import (
    MODEL,
    DensityPlots,
    PlotSettings,
)
from orbiflow.density.pictures.flow import few_colours
from orbiflow.drawing import (
    FORMATS,
    Picture,
    Sheet,
    pdf_pages,
)
from orbiflow.errors import OutputError
from orbiflow.runtime import (
    LITTER,
    make_folder,
    one_thread,
    write_atomic,
    write_set,
)

REPORT = "report.json"
TABLE = "density.csv"
"""What the folder of a marginal or conditional density of one or two angles has beside its model."""

THUMBNAIL = "thumbnail.png"
"""What a fit of a batch has beside its model."""

PAGE = "surface.html"
NAMES = ("density", "latlon", "square", "flow", "samples")
PICTURES = (*(f"{name}.{form}" for form in FORMATS for name in NAMES), PAGE)
"""What a plot may write into a folder, and what goes when another one is written there."""


class Plotted(NamedTuple):
    """The files that were written, the figures' captions, and what was not drawn, and why."""

    files: tuple[Path, ...]
    captions: tuple[str, ...]
    notes: tuple[str, ...] = ()


@one_thread()
def plot_density(
    density: SymmetricDensity | DensityEstimator | str | Path,
    out: str | Path,
    settings: PlotSettings | None = None,
    *,
    data: ArrayLike | None = None,
    told: Callable[[float, str], None] = lambda *_: None,
) -> Plotted:
    """Draw the density, the flow, samples beside the data, and the surface to turn.

    The density of angles is drawn on its square; that of directions or axes on a map ("density"), on
    the sphere also in plain latitude and longitude ("latlon"), and on its square ("square"). A flow
    that has no part in the density is left out. All is drawn before anything is written. Of a torus of
    more or fewer than two angles: samples alone, all pairs of angles.

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
        return Plotted((write_atomic(out, pdf_pages(made)),), _words(made), plots.notes)
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
    return Plotted(tuple(paths), _words(pictures.values()), plots.notes)


def refuse_others(out: Path) -> None:
    """Pictures that would go, beside files that orbiflow did not write, may be somebody's own.

    Raises:
        OutputError: for such a folder.
    """
    if not out.is_dir():
        return
    inside = {path.name for path in out.iterdir()} - LITTER
    foreign, old = (
        sorted(inside - {MODEL, REPORT, TABLE, THUMBNAIL, *PICTURES}),
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


def _content(name: str, picture: Picture) -> bytes:
    content = picture.file()
    # on a screen the flow's colours are few
    few = name == "flow" and picture.sheet.format == "png" and not picture.sheet.printed
    return few_colours(content) if few else content


def _words(pictures: Iterable[Picture]) -> tuple[str, ...]:
    return tuple(f"{picture.title}. {picture.caption}".strip() for picture in pictures)
