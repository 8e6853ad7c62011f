"""How a density is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from numpy.typing import ArrayLike

from orbiflow.arguments import number, whole
from orbiflow.density.regions import samples_for
from orbiflow.density.spaces.space import MEASURES
from orbiflow.errors import OrbiflowError
from orbiflow.figures.density_regions import STYLES
from orbiflow.figures.density_scale import SCALES
from orbiflow.figures.map_choice import PROJECTIONS
from orbiflow.figures.sheet import FigureFormat, Sheet

MOST_SAMPLES = 100_000


def check_masses(masses: Sequence[float]) -> None:
    """
    Raises:
        OrbiflowError: unless `masses` are different numbers between 0 and 1, four at most.
    """
    for mass in masses:
        if not number(mass, "a region's mass", 0.0, 1.0, above=True) < 1:
            raise OrbiflowError("a region's mass must be below 1: all of it is the whole space")
    if len(masses) > len(STYLES) or len(set(masses)) < len(masses):
        raise OrbiflowError(
            f"regions must be of at most {len(STYLES)} different masses, got {list(masses)}"
        )


@dataclass(frozen=True)
class PlotSettings:
    """How a density is drawn.

    - `format`: "png" for a screen; "pdf" or "svg" for print.
    - `width`: of a printed figure, "single", "double" (a journal's columns) or mm; None is "single" for
      PDF and SVG. A PNG with a width is made for print, too.
    - `measure`: what the density is per: "natural", "square" or "uniform".
    - `scale`: of colours: "auto", "linear" or "log".
    - `names`: of the data's columns.
    - `center`: of a torus' pictures, angles; of a map, latitude and longitude, or a longitude.
    - `projection`, `radius`: of maps; see `orbiflow.figures.map_choice.chosen_map`.
    - `coastlines`: of the sphere: lines (N, 2) of latitude and longitude, or a file of them; see
      `orbiflow.figures.coastlines.read_coastlines`.
    - `regions`: masses between 0 and 1: lines about the smallest regions that hold them, four at most.
    - `region_samples`: by which these are found; None for as many as the masses need, see
      `orbiflow.density.regions.samples_for`.
    - `dots`: draw data, or else samples, over the density.
    - `samples`: how many beside the data, or, if there are none, beside the density; None for 3,000
      beside data alone. More than 3,000 are pixels in a PDF or SVG.
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
    projection: str = "auto"
    radius: float | None = None
    coastlines: Sequence[ArrayLike] | str | Path | None = None
    regions: Sequence[float] = ()
    region_samples: int | None = None
    dots: bool = False
    samples: int | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        _ = self.sheet
        choices = (("measure", MEASURES), ("scale", SCALES), ("projection", PROJECTIONS))
        for name, known in choices:
            if getattr(self, name) not in known:
                raise OrbiflowError(
                    f"{name} must be one of {', '.join(known)}, got {getattr(self, name)!r}"
                )
        check_masses(self.regions)
        samples_for(self.regions, self.region_samples, name="region_samples")
        if self.samples is not None:
            whole(self.samples, "samples", 1, MOST_SAMPLES)

    @property
    def sheet(self) -> Sheet:
        """What the figures are made for."""
        if self.format == "png" and self.width is None:
            return Sheet.screen()
        return Sheet.column("single" if self.width is None else self.width, self.format)
