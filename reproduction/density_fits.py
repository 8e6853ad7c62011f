"""The paper's target densities on the unit square, and the fits to them that four exhibits share.

They are four and six Gaussians of variance 0.005, and the 5 x 5 checkerboard (paper, section 5.3). On
round spaces they are also taken per round area: the same function times the area factor.
"""

import math
import tempfile
from pathlib import Path
from typing import Literal, NamedTuple

import torch
from torch import Tensor

from orbiflow.density import (
    Density,
    FlowSettings,
    Space,
    density_to_bytes,
    fit_density,
    kl_by_quadrature,
    make_space,
    midpoints,
    read_density,
)
from reproduction.exhibit import Extent, Work

TARGETS = ("4-gaussian", "6-gaussian", "checkerboard")

TargetMeasure = Literal["flat", "round"]

_SMOOTH = {"max_frequency": 6, "segments": 8, "roughness": (1e-3, 1e-3)}
_SHARP = {"max_frequency": 8, "segments": 6, "roughness": (1e-4, 1e-4)}
# the `FlowSettings` that suit each target
FIT_SETTINGS = {"4-gaussian": _SMOOTH, "6-gaussian": _SMOOTH, "checkerboard": _SHARP}


def target(name: str, points: Tensor) -> Tensor:
    """Return a target's density (N,) at points (N, 2), per area of the square, nearly normalised.

    >>> target("checkerboard", torch.tensor([[0.1, 0.1], [0.3, 0.1]])).round(decimals=2).tolist()
    [1.9199999570846558, 0.0]
    """
    if name == "checkerboard":
        cells = (points * 5).floor().clamp(0, 4).sum(dim=-1)
        return (cells % 2 == 0).to(points) * 25 / 13
    if name == "4-gaussian":
        means = torch.tensor([[x, y] for x in (0.25, 0.75) for y in (0.25, 0.75)])
    else:
        angle = torch.arange(6) * math.pi / 3
        means = 0.5 + 0.3 * torch.stack([angle.cos(), angle.sin()], dim=-1)
    squared = ((points[..., None, :] - means.to(points)) ** 2).sum(dim=-1)
    return (-squared / 0.01).exp().mean(dim=-1) / (2 * math.pi * 0.005)


def weighted(name: str, space: Space, points: Tensor, measure: TargetMeasure) -> Tensor:
    """Return the target (N,) per area of the square, if it is given in `measure`."""
    factor = space.log_area(points).exp() if measure == "round" else 1.0
    return target(name, points) * factor


def drawn(name: str, space: Space, measure: TargetMeasure, count: int, seed: int) -> Tensor:
    """Draw samples (count, 2) of a target, by rejection."""
    generator = torch.Generator().manual_seed(seed)
    most = 1.1 * float(weighted(name, space, midpoints(space, 400), measure).max())
    found: list[Tensor] = []
    while sum(len(part) for part in found) < count:
        points = torch.rand(4 * count, 2, dtype=torch.float64, generator=generator)
        chance = torch.rand(4 * count, dtype=torch.float64, generator=generator)
        found.append(points[chance * most < weighted(name, space, points, measure)])
    return torch.cat(found)[:count]


def kl_of_uniform(name: str, space: Space, grid: int = 400) -> float:
    """Return the KL divergence of the square's uniform density from a target: that of no fit at all.

    >>> from orbiflow.density import make_space
    >>> round(kl_of_uniform("checkerboard", make_space("torus")), 3)  # log(25 / 13)
    0.654
    """
    points = midpoints(space, grid)
    return kl_by_quadrature(target(name, points), torch.zeros(len(points), dtype=torch.float64))


class Fitted(NamedTuple):
    """A density fitted to samples of a target.

    - `space`, `target`, `measure`: What was fitted.
    - `saved`: The density, as `density_to_bytes` returns it.
    - `kl`: The divergence from the target in nats, by quadrature with doubled steps of the flow.
    - `mass`: The density's integral over the square.
    """

    space: str
    target: str
    measure: TargetMeasure
    saved: bytes
    kl: float
    mass: float

    def density(self) -> Density:
        """Return the density."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "density.safetensors"
            path.write_bytes(self.saved)
            return read_density(path)[0]


def fitted(
    space: str, target: str, measure: TargetMeasure, points: int, evaluations: int, grid: int
) -> Fitted:
    """Draw samples of a target, fit a density to them, and measure its divergence."""
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
    """Return a fit as work."""
    arguments = (space, target, measure, extent.points, extent.evaluations, extent.grid)
    return Work(fitted, arguments, 2 + extent.evaluations / 12)
