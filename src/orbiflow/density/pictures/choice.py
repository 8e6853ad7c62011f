"""What the pictures of a density show, and which there are for each space."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arguments import (
    number,
    whole,
)
from orbiflow.arguments import (
    path as as_path,
)
from orbiflow.density.estimator import DensityEstimator
from orbiflow.density.models import BlendedDensity, SymmetricDensity
from orbiflow.density.pictures.axes import space_title, view_of
from orbiflow.density.pictures.coastlines import read_coastlines, simplified
from orbiflow.density.pictures.corner import MOST_COLUMNS, corner_picture
from orbiflow.density.pictures.dots import MAX_DOTS
from orbiflow.density.pictures.flow import flow_picture
from orbiflow.density.pictures.map_choice import PROJECTIONS, chosen_map
from orbiflow.density.pictures.map_samples import map_samples_picture
from orbiflow.density.pictures.maps import map_picture
from orbiflow.density.pictures.page import density_page
from orbiflow.density.pictures.projections import PlateCarree, Projection
from orbiflow.density.pictures.regions import STYLES, RegionLine
from orbiflow.density.pictures.samples import samples_picture
from orbiflow.density.pictures.scale import SCALES
from orbiflow.density.pictures.square import density_picture
from orbiflow.density.regions import DensityLevels, samples_for
from orbiflow.density.spaces import MEASURES, Space
from orbiflow.density.storage import read_density
from orbiflow.drawing import (
    FigureFormat,
    Picture,
    Sheet,
)
from orbiflow.errors import OrbiflowError

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


MODEL = "density.safetensors"
SAMPLES = 3000
PAGE_POINTS = 40_000
"""Of coastlines on the surface that turns."""


@dataclass(frozen=True, eq=False)
class DensityPlots:
    """What the pictures of a density show: chart points beside it."""

    density: SymmetricDensity
    settings: PlotSettings
    samples: Tensor
    data: Tensor | None
    map: Projection | None = None
    regions: tuple[RegionLine, ...] = ()

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
        settings = replace(settings, coastlines=_coastlines(space, settings.coastlines))
        if space.dim > MOST_COLUMNS:
            raise OrbiflowError(
                f"this {space.name} has {space.dim} angles, pictures are of {MOST_COLUMNS} at most: "
                "draw columns of `orbiflow density sample` beside those of the data"
            )
        _check_window(space, settings)
        points = None if data is None else space.to_chart(data)
        source = torch.Generator().manual_seed(settings.seed)
        drawn = own.sample((settings.samples or SAMPLES,), source)
        chosen = None
        if space.is_round:
            chosen = chosen_map(
                space, drawn if points is None else points, projection=settings.projection,
                center=settings.center, radius=settings.radius, names=columns,
            )  # fmt: skip
        return cls(own, settings, drawn, points, chosen, _regions(own, settings))

    @property
    def notes(self) -> tuple[str, ...]:
        """What is not drawn, and why."""
        if not self.has_surface or self._flows:
            return ()
        return ("the flow has no part in this density, so that there is no picture of it",)

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
            coastlines=simplified(list(map(np.asarray, self._coasts)), PAGE_POINTS) or None,
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
        most = settings.samples or MAX_DOTS
        if not self.has_surface:
            return {
                "samples": lambda: corner_picture(density, data, self.samples, most=most, **axes)
            }
        makers: dict[str, Callable[[], Picture]] = {}
        dots = self._shown if settings.dots else None
        colours: dict[str, Any] = {"measure": settings.measure, "scale": settings.scale}
        lines = {"regions": self.regions}
        flat: dict[str, Any] = {**colours, **axes, "center": None if self.map else settings.center}
        if self.map is None:
            makers["density"] = lambda: density_picture(density, dots, most=most, **lines, **flat)
        else:
            maps: dict[str, Any] = {**colours, "sheet": sheet, "coastlines": self._coasts}
            makers |= self._maps(dots, {**maps, **lines, "most": most})
            makers["square"] = lambda: density_picture(density, dots, most=most, **lines, **flat)
        if self._flows:
            makers["flow"] = lambda: flow_picture(density, center=flat["center"], sheet=sheet)
        if data is None and settings.samples is None:
            return makers
        if self.map is None:
            makers["samples"] = lambda: samples_picture(
                density, data, self.samples, most=most, **flat
            )
        else:
            chosen = self.map
            makers["samples"] = lambda: map_samples_picture(
                density, data, self.samples, projection=chosen, most=most, **maps
            )
        return makers

    def _maps(
        self, dots: Tensor | None, options: dict[str, Any]
    ) -> dict[str, Callable[[], Picture]]:
        density, chosen = self.density, self.map
        assert chosen is not None
        makers = {"density": lambda: map_picture(density, dots, projection=chosen, **options)}
        if density.space.name == "sphere" and not isinstance(chosen, PlateCarree):
            plain = PlateCarree((0.0, chosen.center[1]))
            makers["latlon"] = lambda: map_picture(density, dots, projection=plain, **options)
        return makers

    @property
    def _flows(self) -> bool:
        """Whether a flow has a part in the density."""
        density = self.density
        return not (isinstance(density, BlendedDensity) and float(density.shares[0]) == 0)

    @property
    def _coasts(self) -> Sequence[Any]:
        lines = self.settings.coastlines
        assert not isinstance(lines, str | Path)  # they were read
        return lines or ()


def known_names(space: Space, columns: Sequence[str] | None) -> Sequence[str] | None:
    """Columns of a table as names of the axes, if they are angles."""
    angles = space.unit is not None
    return columns if angles and columns and len(columns) == len(space.columns) else None


def _regions(density: SymmetricDensity, settings: PlotSettings) -> tuple[RegionLine, ...]:
    """
    Raises:
        OrbiflowError: for regions of what is not drawn in two dimensions.
    """
    if not settings.regions:
        return ()
    if density.space.dim != 2:
        raise OrbiflowError(
            f"regions are drawn in two dimensions, this {density.space.name} has {density.space.dim}"
        )
    count = samples_for(settings.regions, settings.region_samples)
    levels = DensityLevels(density, samples=count, seed=settings.seed % 2**63)
    return tuple(
        RegionLine(mass, levels.highest(mass).log_prob) for mass in map(float, settings.regions)
    )


def _check_window(space: Space, settings: PlotSettings) -> None:
    """
    Raises:
        OrbiflowError: for options of maps on other spaces, and for names or a centre that do not fit.
    """
    view_of(space, settings.names, None if space.is_round else settings.center)
    if not space.is_round and (settings.projection != "auto" or settings.radius is not None):
        name = "radius" if settings.projection == "auto" else "projection"
        raise OrbiflowError(
            f"{name} belongs to maps of the sphere and the projective plane, not to the {space.name}"
        )


def _coastlines(
    space: Space, lines: Sequence[ArrayLike] | str | Path | None
) -> Sequence[ArrayLike] | None:
    if lines is None:
        return None
    if space.name != "sphere":
        raise OrbiflowError(f"coastlines belong to the sphere, not the {space.name}")
    if isinstance(lines, str | Path):
        return read_coastlines(as_path(lines, "coastlines"))
    return lines


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
