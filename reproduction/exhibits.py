"""All exhibits, in the order of the paper."""

from __future__ import annotations

from reproduction import (
    animal,
    classes,
    comparison,
    densities,
    density_surfaces,
    frequencies,
    method,
    spaces,
    square,
    symmetries,
    symmetrization,
    tilings,
)
from reproduction.exhibit import Exhibit

EXHIBITS: tuple[Exhibit, ...] = (
    square.EXHIBIT,
    classes.TEMPLATES,
    classes.GROUPS_TABLE,
    spaces.SPACES_FIGURE,
    symmetries.EXHIBIT,
    method.EXHIBIT,
    tilings.EXHIBIT,
    symmetrization.EXHIBIT,
    animal.EXHIBIT,
    frequencies.EXHIBIT,
    comparison.TILES,
    comparison.TABLE,
    spaces.SYMMETRIZATION,
    densities.TABLE,
    densities.SIX_GAUSSIANS,
    density_surfaces.EXHIBIT,
    densities.CHECKERBOARD,
)
