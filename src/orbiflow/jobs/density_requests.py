"""What can be asked for of densities: one frozen dataclass a job, checked when made."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from orbiflow.jobs.request import (
    Request,
    ends_as_table,
    in_range,
)
from orbiflow.runtime import RecordError

MOST_SAMPLES = 100_000_000
MOST_DOTS = 100_000
MOST_REGION_SAMPLES = 10_000_000

SpaceName = Literal["torus", "sphere", "klein-bottle", "projective-plane"]
Unit = Literal["radians", "degrees", "turns"]
Measure = Literal["natural", "square", "uniform"]
Missing = Literal["refuse", "drop", "marginalise"]
Projection = Literal[
    "auto", "equal-earth", "mollweide", "latlon", "lambert", "stereographic", "schmidt", "wulff"
]
PARTS = (
    "flow",
    "kernels",
    "mixture",
    "chains",
    "network",
)  # as `orbiflow.density` has them, without its import


@dataclass(frozen=True)
class DensityFitRequest(Request):
    """Fit a density to a table; see `orbiflow density fit --help`.

    - `data`: the table. `out`: folder for the model and its report.
    - `columns`: names or numbers, None for what the space takes.
    - `header`: whether a text's first line names the columns, None to look.
    - `missing`: of rows that lack an angle of a torus: "refuse" them, "drop" them as `drop_missing`
      does, or "marginalise": they count by the angles that they have.
    - `weights`: the column that says how much each row counts.
    - `drop_missing`: leave out rows that lack a value.
    - `unit`: of angles; None for radians if no value is beyond 2 pi.
    - `parts`: of flow, kernels, mixture, chains and network those that may be used; None lets rows held
      out choose among all.
    - `repeats`: what rows that repeat another are taken for.
    - `detail`, `segments`: of the flow, None for what suits the number of rows.
    - `kernels`: a flow and adaptive kernels, nothing else.
    - `seconds`: of training at most, None for no limit.
    - `picture`: whether a small one is drawn as well, thumbnail.png.
    """

    KIND = "density-fit"

    data: Path
    space: SpaceName
    out: Path = Path("density")
    columns: tuple[str, ...] | None = None
    header: bool | None = None
    drop_missing: bool = False
    missing: Missing = "refuse"
    weights: str | None = None
    group: str | None = None
    unit: Unit | None = None
    parts: tuple[str, ...] | None = None
    repeats: Literal["places", "rounding"] = "places"
    detail: int | None = None
    segments: int | None = None
    kernels: bool = False
    seconds: float | None = None
    picture: bool = False
    seed: int = 0

    def check(self) -> None:
        columns_named(self.columns)
        _check_missing(self.drop_missing, self.missing)
        if self.missing == "marginalise":
            self._check_marginalised()
        unknown = [part for part in self.parts or () if part not in PARTS]
        if unknown or self.parts == ():
            raise RecordError(
                f"{{parts}} must be of {', '.join(PARTS)}, got {', '.join(unknown)!r}"
            )
        if self.kernels and self.parts is not None:
            raise RecordError("{kernels} means a flow with kernels: give it or {parts}, not both")
        if self.group is not None and (self.kernels or self.parts == ("flow",)):
            raise RecordError("{group} is for choosing among {parts}: a flow alone has no choice")

    def _check_marginalised(self) -> None:
        if self.space != "torus":
            raise RecordError(
                f"{{missing}} marginalise is of angles on a torus: on the {self.space} no coordinate "
                "is known without the other; leave out rows that lack one ({missing} drop)"
            )
        if self.kernels or self.parts == ("flow",):
            raise RecordError(
                "{missing} marginalise is of kernels and mixtures, as a flow cannot be fitted to rows "
                "that lack angles: give other {parts}"
            )


@dataclass(frozen=True)
class DensityPlotRequest(Request):
    """Draw a density; see `orbiflow density plot --help`.

    - `out`: a folder, or a .pdf that gets a page a figure.
    - `format`, `width`: of the figures; a width, "single", "double" or such as "85mm", is for print.
    - `center`: angles in the middle of a torus' pictures, such as "180,180"; latitude and longitude, or
      a longitude, in the middle of a map.
    - `projection`, `radius`: of a map; the radius in degrees.
    - `coastlines`: GeoJSON or a table of latitude and longitude, for the sphere.
    - `regions`: masses of the smallest regions that hold them, about which lines are drawn, by so many
      `region_samples`; None for 20,000, or more where a mass needs it.
    - `samples`: how many beside data or density, None for 3,000 beside data alone.
    - `columns`, `header`, `drop_missing`: of the data, as for a fit.
    """

    KIND = "density-plot"

    model: Path
    out: Path = Path("plots")
    data: Path | None = None
    columns: tuple[str, ...] | None = None
    header: bool | None = None
    drop_missing: bool = False
    coastlines: Path | None = None
    format: Literal["png", "pdf", "svg"] | None = None
    width: str | None = None
    measure: Measure = "natural"
    scale: Literal["auto", "linear", "log"] = "auto"
    center: str | None = None
    projection: Projection = "auto"
    radius: float | None = None
    regions: tuple[float, ...] | None = None
    region_samples: int | None = None
    dots: bool = False
    samples: int | None = None
    seed: int = 0

    def check(self) -> None:
        columns_named(self.columns)
        if self.samples is not None and not 1 <= self.samples <= MOST_DOTS:
            raise RecordError(f"{{samples}} must be from 1 to {MOST_DOTS}, got {self.samples}")
        if self.radius is not None and not 0 < self.radius <= 90:
            raise RecordError(f"{{radius}} must be above 0 and at most 90, got {self.radius:g}")
        if self.regions == () or any(not 0 < mass < 1 for mass in self.regions or ()):
            raise RecordError("{regions} must be masses between 0 and 1, such as 0.5,0.9")
        if len(set(self.regions or ())) < len(self.regions or ()) or len(self.regions or ()) > 4:
            raise RecordError("{regions} must be at most 4 different masses: as many lines differ")
        region_samples_in_range(self, "region_samples")
        if self.region_samples is not None and not self.regions:
            raise RecordError("{region_samples} are those of {regions}: give both, or neither")
        if self.data is None:
            for name, unset in (("columns", None), ("header", None), ("drop_missing", False)):
                if getattr(self, name) != unset:
                    raise RecordError(f"{{{name}}} is of {{data}}: give both, or neither")


@dataclass(frozen=True)
class PatchesRequest(Request):
    """Turn image patches into angles on the Klein bottle; see `orbiflow density patches --help`.

    - `columns`, `header`, `drop_missing`: as for a fit.
    """

    KIND = "density-patches"

    data: Path
    out: Path = Path("angles.csv")
    columns: tuple[str, ...] | None = None
    header: bool | None = None
    drop_missing: bool = False
    unit: Unit = "radians"
    farthest: float | None = None

    def check(self) -> None:
        ends_as_table(self.out)
        columns_named(self.columns)
        if self.farthest is not None and not self.farthest >= 0:
            raise RecordError(f"{{farthest}} must be at least 0, got {self.farthest:g}")


def _check_missing(drop: bool, missing: str) -> None:
    if drop and missing == "marginalise":
        raise RecordError(
            "{drop_missing} leaves out the rows that {missing} marginalise is for: give one"
        )


def region_samples_in_range(request: Request, name: str) -> None:
    """Raises a `RecordError` for a number that `orbiflow.density.regions` does not draw."""
    if getattr(request, name) is not None:
        in_range(request, name, 1000, MOST_REGION_SAMPLES)


def columns_named(columns: tuple[str, ...] | None) -> None:
    if columns == ():
        raise RecordError("{columns} names no column; give their names or numbers, as in lat,lon")
