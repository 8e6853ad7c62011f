"""Settings of a density's pictures."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

from orbiflow.density.regions import Mass, SampleCount, samples_for
from orbiflow.drawing import NARROWEST, WIDEST, FigureFormat, Sheet, column_width
from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.settings import (
    DefaultText,
    HelpHeading,
    Hidden,
    Needs,
    Option,
    Parsed,
    Range,
    Settings,
    Unit,
)

MAX_REGIONS = 4
"""Number of styles of lines that can be told apart."""

MAPS, POINTS = HelpHeading("Maps"), HelpHeading("Points and regions")


def read_center(text: str) -> tuple[float, ...]:
    """Return angles with commas between them, where "pi" is half a turn in radians.

    >>> read_center("0, pi")
    (0.0, 3.141592653589793)
    """
    signs = {"pi": math.pi, "-pi": -math.pi}
    try:
        return tuple(signs.get(part.strip()) or float(part) for part in text.split(","))
    except ValueError as error:
        raise OrbiflowError(
            f"{text!r} is not a list of angles; write numbers, such as 0,180 on a torus or 40,140 "
            "(latitude, longitude) on a map"
        ) from error


class PlotSettings(Settings, group="Figures"):
    """How a density is drawn.

    >>> PlotSettings(format="pdf", width="double").sheet.text
    8.0
    """

    format: Annotated[FigureFormat | None, DefaultText("png, or pdf with a width")] = None
    """Format of the figures: png for a screen, pdf or svg for print."""

    width: Annotated[
        float | None,
        Parsed(column_width, "single (85mm), double (180mm) or a length such as 85mm", "LENGTH"),
        Range(NARROWEST, WIDEST),
        Unit("mm"),
        DefaultText("single for pdf and svg"),
    ] = None
    """Width of figures for print, with texts of 7 to 8 points: a journal's single (85mm) or double
    (180mm) column, or a length. A PNG with a width is made for print, too."""

    measure: Literal["natural", "square", "uniform"] = "natural"
    """What the density is per: natural is the data's own units, or steradians; uniform compares it
    with the uniform distribution."""

    scale: Literal["auto", "linear", "log"] = "auto"
    """Scale of the colours. Auto is log if the density is below a tenth of its peak on 80 % of the
    area."""

    names: Annotated[tuple[str, ...] | None, Hidden()] = None
    """Names of the data's columns. Default: those that the density was fitted to."""

    center: Annotated[
        tuple[float, ...] | None,
        Parsed(read_center, "angles such as 0,180", "ANGLES"),
        DefaultText("0 each on a torus"),
    ] = None
    """Middle of the pictures: on a torus an angle for each column, in the space's unit; on a map
    lat,lon, or the lon of the middle meridian."""

    projection: Annotated[
        Literal[
            "auto", "equal-earth", "mollweide", "latlon", "lambert", "stereographic", "schmidt",
            "wulff",
        ],
        MAPS,
    ] = "auto"  # fmt: skip
    """Projection of maps. Auto is, on the sphere, lambert if nearly all points are in one hemisphere,
    else equal-earth. Schmidt and wulff are nets of plunge, trend."""

    radius: Annotated[float | None, Range(above=0, most=90), Unit("degrees"), MAPS] = None
    """Radius of what lambert, stereographic and nets show around the centre."""

    coastlines: Annotated[Path | None, MAPS] = None
    """Other lines to draw over maps of the sphere: GeoJSON, or a table of lat,lon where a lat beyond 90
    ends a line."""

    earth: Annotated[bool, Option("--earth", off="--no-coastlines"), MAPS] = True
    """Draw the Earth's coastlines where the data are lat,lon, unless there are others."""

    along: Annotated[str | None, DefaultText("the first")] = None
    """Of a space beside other columns, the one along which a series of pictures is drawn."""

    slices: Annotated[
        tuple[float, ...] | None, DefaultText("six: even ones of a period, else by equal masses")
    ] = None
    """Values of that column, of which each has a picture."""

    regions: Annotated[tuple[Mass, ...] | None, POINTS] = None
    """Masses such as 0.5,0.9: lines are drawn around the smallest regions that hold them."""

    region_samples: Annotated[SampleCount, Needs("regions"), POINTS] = None
    """Number of samples from which the regions are found."""

    samples: Annotated[
        int | None, Range(1, 100_000), DefaultText("3000 beside data, else none"), POINTS
    ] = None
    """Number of samples drawn beside the data, or beside the density if there are none. More than 3000
    are pixels in a PDF or SVG."""

    dots: Annotated[bool, POINTS] = False
    """Draw data, or else samples, over density and surface, smaller where they crowd."""

    seed: Annotated[int, Range(-(2**63), 2**64 - 1), POINTS] = 0
    """Seed of the samples."""

    def check(self) -> None:
        regions = self.regions or ()
        if len(regions) > MAX_REGIONS or len(set(regions)) < len(regions):
            raise SettingError(
                f"{{regions}} must be at most {MAX_REGIONS} different masses, got "
                f"{', '.join(f'{mass:g}' for mass in regions)}"
            )
        samples_for(regions, self.region_samples, name="region_samples")

    @property
    def sheet(self) -> Sheet:
        """The sheet that the figures are made for."""
        if self.width is None and self.format in (None, "png"):
            return Sheet.screen()
        return Sheet.column(self.width or "single", self.format or "pdf")
