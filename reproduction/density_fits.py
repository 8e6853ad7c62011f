"""Fits of the paper's target densities: the work that four exhibits share."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import NamedTuple

import torch

from orbiflow.density import (
    Density,
    FlowSettings,
    density_to_bytes,
    fit_density,
    kl_by_quadrature,
    make_space,
    midpoints,
    read_density,
)
from reproduction.density_targets import (
    FIT_SETTINGS,
    TargetMeasure,
    drawn,
    weighted,
)
from reproduction.exhibit import Work
from reproduction.extent import Extent


class Fitted(NamedTuple):
    """A density fitted to samples of a target.

    - `space`, `target`, `measure`: as asked for.
    - `saved`: the density, as `density_to_bytes` has it.
    - `kl`: divergence from the target in nats, by quadrature at doubled steps.
    - `mass`: its integral over the square.
    """

    space: str
    target: str
    measure: TargetMeasure
    saved: bytes
    kl: float
    mass: float

    def density(self) -> Density:
        """The density again."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "density.safetensors"
            path.write_bytes(self.saved)
            return read_density(path)[0]


def fitted(
    space: str, target: str, measure: TargetMeasure, points: int, evaluations: int, grid: int
) -> Fitted:
    """Draw samples of a target, fit a density to them, and measure how near it comes."""
    there = make_space(space)
    samples = drawn(target, there, measure, points, seed=0)
    settings = FlowSettings(evaluations=evaluations, **FIT_SETTINGS[target])  # type: ignore[arg-type]
    density, report = fit_density(there, samples, settings)
    places = midpoints(there, grid)
    with torch.no_grad():
        part = density.flow_part
        assert part is not None
        values = part[1].with_steps(2 * part[1].flow.steps).log_prob(places)
    kl = kl_by_quadrature(weighted(target, there, places, measure), values)
    return Fitted(space, target, measure, density_to_bytes(density), kl, float(report.mass or 0.0))


def fit_work(space: str, target: str, extent: Extent, measure: TargetMeasure = "flat") -> Work:
    """The fit, as work."""
    arguments = (space, target, measure, extent.points, extent.evaluations, extent.grid)
    return Work(fitted, arguments, 2 + extent.evaluations / 12)
