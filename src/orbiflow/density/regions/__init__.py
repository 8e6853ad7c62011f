"""Regions of highest density and level sets, with their mass and their outlines."""

from orbiflow.density.regions.enough import samples_for, told_masses
from orbiflow.density.regions.geojson import to_geojson
from orbiflow.density.regions.levels import (
    DensityLevels,
    DensityRegion,
    highest_density_region,
)
from orbiflow.density.regions.outlines import Outline, outlines

__all__ = [
    "DensityLevels",
    "DensityRegion",
    "Outline",
    "highest_density_region",
    "outlines",
    "samples_for",
    "to_geojson",
    "told_masses",
]
