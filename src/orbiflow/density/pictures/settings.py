"""Settings of a density's pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from orbiflow.arguments import number, whole
from orbiflow.density.regions import samples_for
from orbiflow.density.spaces import MEASURES
from orbiflow.drawing import FigureFormat, Sheet
from orbiflow.errors import OrbiflowError

ScaleName = Literal["auto", "linear", "log"]
ProjectionName = Literal[
    "auto", "equal-earth", "mollweide", "latlon", "lambert", "stereographic", "schmidt", "wulff"
]
PROJECTIONS: tuple[ProjectionName, ...] = get_args(ProjectionName)

MAX_SAMPLES = 100_000
MAX_REGIONS = 4
"""As many styles of lines can be told apart."""


@dataclass(frozen=True)
class PlotSettings:
    """How a density is drawn.

    Raises:
        OrbiflowError: If a setting cannot be used.

    >>> PlotSettings(format="pdf", width="double").sheet.text
    8.0
    """

    format: FigureFormat = "png"
    """Format of the figures: "png" for a screen, "pdf" or "svg" for print."""

    width: str | float | None = None
    """Width of a printed figure: "single" or "double" (a journal's columns), or mm. A PNG with a
    width is made for print, too. Default: "single" for PDF and SVG."""

    measure: str = "natural"
    """What the density is per: "natural", "square" or "uniform"."""

    scale: ScaleName = "auto"
    """Scale of the colours. "auto" is "log" if the density is below a tenth of its peak on 80 % of
    the area."""

    names: Sequence[str] | None = None
    """Names of the data's columns. Default: those that the density was fitted to."""

    center: Sequence[float] | None = None
    """Middle of the pictures: on a torus an angle for each column, in the space's unit; on a map
    latitude and longitude, or the longitude of the middle meridian."""

    projection: ProjectionName = "auto"
    """Projection of maps. "auto" is, on the sphere, "lambert" if nearly all points are in one
    hemisphere, else "equal-earth"; for axes it is "lambert", or "schmidt" if the columns are named
    after inclinations, plunges or dips."""

    radius: float | None = None
    """Degrees around the centre that "lambert", "stereographic" and nets show, at most 90."""

    coastlines: str | Path | None = None
    """File of lines to draw over maps of the sphere: GeoJSON, or a table of lat,lon where a latitude
    beyond 90 ends a line."""

    regions: Sequence[float] = ()
    """Masses between 0 and 1: lines are drawn around the smallest regions that hold them."""

    region_samples: int | None = None
    """Number of samples from which the regions are found. Default: as many as the masses need."""

    dots: bool = False
    """Whether data, or else samples, are drawn over the density."""

    samples: int | None = None
    """Number of samples beside the data, or else beside the density. Default: 3000 beside data, and
    none otherwise. More than 3000 are pixels in a PDF or SVG."""

    seed: int = 0
    """Seed of the samples."""

    def __post_init__(self) -> None:
        _ = self.sheet
        choices = {"measure": MEASURES, "scale": get_args(ScaleName), "projection": PROJECTIONS}
        for name, known in choices.items():
            if getattr(self, name) not in known:
                raise OrbiflowError(
                    f"{name} must be one of {', '.join(known)}, got {getattr(self, name)!r}"
                )
        self._check_regions()
        if self.samples is not None:
            whole(self.samples, "samples", 1, MAX_SAMPLES)

    def _check_regions(self) -> None:
        for mass in self.regions:
            if not number(mass, "a region's mass", 0.0, 1.0, above=True) < 1:
                raise OrbiflowError(
                    "a region's mass must be below 1: the whole space holds all of the mass"
                )
        if len(self.regions) > MAX_REGIONS or len(set(self.regions)) < len(self.regions):
            raise OrbiflowError(
                f"regions must be at most {MAX_REGIONS} different masses, got {list(self.regions)}"
            )
        samples_for(self.regions, self.region_samples, name="region_samples")

    @property
    def sheet(self) -> Sheet:
        """The sheet that the figures are made for."""
        if self.format == "png" and self.width is None:
            return Sheet.screen()
        return Sheet.column("single" if self.width is None else self.width, self.format)
