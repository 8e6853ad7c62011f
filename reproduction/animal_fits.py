"""Tiles of one animal by the paper's own method: the work that three exhibits share."""

from __future__ import annotations

from orbiflow.tiles import (
    CLASSES,
    ClassFailure,
    EscherTile,
    OccupancySearch,
    escherize_class,
)
from reproduction.exhibit import Work
from reproduction.extent import Extent
from reproduction.published import animal

OMEGA = 5
"""The paper's maximum frequency for its figure of one animal."""


def animal_tile(name: str, omega: int, affine: int, iterations: int) -> EscherTile | ClassFailure:
    """The tile of one class: affine phase, then the flow of one stationary field, occupancy loss."""
    settings = OccupancySearch(max_frequency=omega, affine_iterations=affine, iterations=iterations)
    return escherize_class(animal(), name, settings)


def animal_work(extent: Extent, omega: int) -> list[Work]:
    """The tiles of all nine classes at one frequency."""
    cost = 1 + extent.iterations / 200 * (1.5 + omega / 2)
    return [
        Work(animal_tile, (name, omega, extent.affine, extent.iterations), cost) for name in CLASSES
    ]
