"""Mixtures of kernels: the component for what is sharp, and, on a grid, for what is smooth."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models.concentrations import moments
from orbiflow.density.models.density import Density, Pixel, Restriction, Split, Weighted
from orbiflow.density.models.sums import Terms, log_sum_exp, near_log_sum, shares_of
from orbiflow.density.spaces import CHART, Space, by_sphere
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_tensor
from orbiflow.typed_torch import fft, special

MOST_KERNELS = 1_000_000
"""The most kernels that a file may hold."""

MAX_CONCENTRATION = 1e16
"""The largest concentration whose kernels keep seven digits: a deviation of 1e-8 radians, 6 cm on the
earth."""


class AdaptiveKernels(Density, kind="kernels"):
    """A mixture of kernels made invariant under the space's group.

    Products of von Mises kernels in the coordinates of the space's frame on flat spaces, summed over
    images under the group; von Mises-Fisher kernels on spheres of any dimension and their quotients,
    summed over the images of a unit vector, such as both ends of an axis; products of both on products.

    Args:
        space: Any space.
        centers: The chart points (N, d) that the kernels are about.
        concentrations: Concentrations kappa > 0, one for each of the space's `spheres`: (N, d) on flat
            spaces and (N, 1) on round ones.
        weights: Weights (N,) of sum 1.
    """

    stored = ("centers", "concentrations", "weights")

    def __init__(
        self, space: Space, centers: Tensor, concentrations: Tensor, weights: Tensor
    ) -> None:
        super().__init__(space)
        named = zip(self.stored, (centers, concentrations, weights), strict=True)
        centers, concentrations, weights = (as_tensor(value, name) for name, value in named)
        width = len(space.spheres)
        shapes = [tuple(t.shape) for t in (centers, concentrations, weights)]
        count = len(centers) if centers.dim() else 0
        if shapes != [(count, space.chart_dim), (count, width), (count,)] or not count:
            raise OrbiflowError(f"kernels of shapes {shapes} do not fit a {space.name}")
        if not (
            bool(torch.isfinite(centers).all())
            and bool((concentrations > 0).all())
            and bool(torch.isfinite(concentrations).all())
            and bool((weights >= 0).all())
            and abs(float(weights.sum()) - 1) < 1e-6
        ):
            raise OrbiflowError("kernels need finite centers, positive widths, weights of sum 1")
        self.centers, self.concentrations, self.weights = (
            t.double() for t in (centers, concentrations, weights)
        )
        images = space.features(self.centers, slice(space.kernel_images))
        features = images.flatten(0, 1).mT.contiguous()
        self._terms = _terms(space, features, self.concentrations, self.weights)

    def with_concentrations(self, concentrations: Tensor) -> Self:
        """Return kernels of other concentrations > 0, (N, d) or (N, 1), about the same centers."""
        new = copy.copy(self)
        new.concentrations = concentrations.double()
        new._terms = _terms(self.space, self._terms.centers, new.concentrations, self.weights)
        return new

    def bumps(self) -> Tensor:
        return self.centers

    def is_narrower_than(self, pixel: Pixel) -> bool:
        side = pixel(self.centers).to(self.concentrations)
        return bool((self.concentrations**-0.5 < side).any())

    def averaged_over(self, pixel: Pixel) -> AdaptiveKernels:
        half = pixel(self.centers).to(self.concentrations) / 2
        return self.with_concentrations(1 / (1 / self.concentrations + half**2))

    def log_density(self, points: Tensor, beside: float = -math.inf) -> Tensor:
        flat = points.reshape(-1, self.space.chart_dim).double()
        # images that turn the axes are of points, all others of kernels
        images = self.space.features(flat, slice(None, None, self.space.kernel_images))
        features = images.flatten(0, 1).mT
        if features.device.type == "cpu":
            values = near_log_sum(self._terms, features.contiguous(), beside)
        else:
            values = self._terms.plain_log_sum(features)
        if len(images) > 1:
            values = values.reshape(len(images), -1).logsumexp(dim=0)
        return values.reshape(points.shape[:-1]).to(points.dtype)

    def draw(self, count: int, generator: torch.Generator) -> Tensor:
        seed = int(torch.randint(2**31, (), generator=generator))
        rng = np.random.default_rng(seed)
        weights = self.weights.cpu().numpy()
        chosen = rng.choice(len(weights), count, p=weights / weights.sum())
        kappa = self.concentrations.cpu()[chosen]
        return drawn_about(self.space, self.centers.cpu()[chosen], kappa, rng)

    @classmethod
    def joined(cls, components: Sequence[Any], weights: Tensor) -> Self:
        """Return all kernels of several densities on one space, in proportions (P,)."""
        proportions = weights.double() / weights.sum()
        return cls(
            components[0].space,
            torch.cat([part.centers for part in components]),
            torch.cat([part.concentrations for part in components]),
            torch.cat(
                [share * part.weights for share, part in zip(proportions, components, strict=True)]
            ),
        )

    def restricted(self, split: Split, space: Space) -> Restriction:
        """Keep the kernels' own marginals.

        A kernel weighs as much more as it has the given values more likely.
        """
        kept, fixed, some = list(split.kept), list(split.given), self.space.factors_of(split.kept)
        weights, evidence = self.weights, 0.0
        if fixed:
            at = torch.tensor([split.values], dtype=torch.float64)
            logs = self.log_each(at, fixed)[0] + weights.log()
            evidence, weights = float(log_sum_exp(logs)), shares_of(logs)
        kernels = AdaptiveKernels(
            space, self.centers[:, kept], self.concentrations[:, some], weights
        )
        return Restriction([(evidence, kernels)], [])

    def log_each(self, points: Tensor, axes: list[int]) -> Tensor:
        """Return log densities (N, K) of kernels of some coordinates, at points (N, a) of these."""
        space, kappa = self.space.of_axes(axes), self.concentrations[:, self.space.factors_of(axes)]
        centers = space.features(self.centers[:, axes], slice(space.kernel_images))
        features = centers.flatten(0, 1).mT.contiguous()
        terms = _terms(space, features, kappa, torch.ones_like(self.weights))
        images = space.features(points.double(), slice(None, None, space.kernel_images))
        logs = torch.stack([terms.each(image.mT) for image in images])
        logs = by_sphere(logs, len(kappa)).logsumexp(dim=(0, 2))
        return logs + space.log_kernel_factor(points, CHART)[:, None]

    def header(self) -> dict[str, Any]:
        if len(self.centers) > MOST_KERNELS:
            raise OrbiflowError(
                f"there are {len(self.centers)} kernels: {MOST_KERNELS} at most are saved"
            )
        return {"kernels": len(self.centers)}


def _terms(space: Space, features: Tensor, kappa: Tensor, weights: Tensor) -> Terms:
    """Return kernels about all E images (m, E * N) of their centers: then points need no images."""
    moves = torch.as_tensor(space.moves).to(kappa)
    every = torch.cat([move @ kappa.mT for move in moves], dim=1)
    return Terms(features, every, (kernel_peaks(space, kappa) + weights.log()).repeat(len(moves)))


def kernel_peaks(space: Space, kappa: Tensor) -> Tensor:
    """Return logarithms (N,) of the largest values of kernels of concentrations (N, F)."""
    if space.parts:
        widths = [len(part.spheres) for part in space.parts]
        factors = zip(space.parts, torch.split(kappa, widths, dim=1), strict=True)
        return torch.stack([kernel_peaks(part, some) for part, some in factors]).sum(dim=0)
    if space.is_round:
        return -moments(kappa[:, 0], space.dim + 1).log_mass
    return -(special.i0e(kappa) * space.sides.to(kappa)).log().sum(dim=1)


def drawn_about(space: Space, centers: Tensor, kappa: Tensor, rng: np.random.Generator) -> Tensor:
    """Return a draw (N, d) of each of N kernels."""
    if space.parts:
        widths = [len(part.spheres) for part in space.parts]
        places = torch.split(centers, [part.chart_dim for part in space.parts], dim=1)
        every = zip(space.parts, places, torch.split(kappa, widths, dim=1), strict=True)
        return torch.cat([drawn_about(*factor, rng) for factor in every], dim=1)
    if space.is_round:
        vectors = _von_mises_fisher(space.features(centers)[0].numpy(), kappa[:, 0].numpy(), rng)
        return space.from_features(torch.tensor(vectors))
    angle = torch.tensor(rng.vonmises(0.0, kappa.numpy()))
    return space.project(centers + space.from_turns(angle / (2 * math.pi)))


def kernel_rows(space: Space, centers: Tensor, kappa: Tensor) -> tuple[Tensor, Tensor]:
    """Return log kernels as linear functions of the space's `features`: rows (N, m), offsets (N,).

    They are with respect to the chart's area on flat spaces and to the round area on round ones.
    """
    rows = kappa.repeat(1, centers.shape[1] // kappa.shape[1]) * centers
    return rows, kernel_peaks(space, kappa) - kappa.sum(dim=1)


def _von_mises_fisher(centers: Array, kappa: Array, rng: np.random.Generator) -> Array:
    """Return one draw (N, m) about each of `centers` (Wood, Simulation of the von Mises Fisher
    distribution, 1994; closed form on the sphere)."""
    if centers.shape[1] == 3:
        below = -np.log1p(rng.uniform(size=len(centers)) * np.expm1(-2 * kappa)) / kappa
    else:
        below = _wood(kappa, centers.shape[1] - 1, rng)
    across = rng.normal(size=centers.shape)
    across -= (across * centers).sum(axis=1, keepdims=True) * centers
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    aside = np.sqrt(np.clip(below * (2 - below), 0, 1))
    vectors = (1 - below)[:, None] * centers + aside[:, None] * across
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _wood(kappa: Array, dim: int, rng: np.random.Generator) -> Array:
    """Return 1 - cos (N,) of the angle between draws on S^dim and their centers, by rejection."""
    slope = dim / (2 * kappa + np.sqrt(4 * kappa**2 + dim**2))
    # how far the best cosine is below 1, without which all digits would be lost
    gap = 2 * slope / (1 + slope)
    best, most = 1 - gap, dim * np.log(gap * (2 - gap))
    below_cosines, left = np.zeros_like(kappa), np.arange(len(kappa))
    while len(left):
        z, b = rng.beta(dim / 2, dim / 2, size=len(left)), slope[left]
        below = 2 * b * z / (1 - (1 - b) * z)
        odds = kappa[left] * (gap[left] - below)
        odds += dim * np.log(gap[left] + best[left] * below) - most[left]
        below_cosines[left] = below
        left = left[odds < np.log(rng.uniform(size=len(left)))]
    return below_cosines


KERNEL_STEP = 0.65
"""Deviations of the sharpest bumps of a function between two points of a grid that resolves it."""

DROPPED_WEIGHT = 1e-7
"""The weight that the lightest kernels may have together, to be left out."""

FIRST_GRID, GRID_BLOCK = {1: 256, 2: 48}, 2**12
"""Points along an angle at first, by the number of angles, and points evaluated at a time."""


def kernels_for(
    density: Density, split: Split, space: Space, level: int, tick: Callable[[], None]
) -> list[Weighted]:
    """Return kernels as `Density.approximated` does, if need be through marginals on a grid."""
    kernels_of_density = density.approximated(split, space, level, tick)
    if kernels_of_density is not None:
        return kernels_of_density
    count = FIRST_GRID[space.dim] * 2**level
    line = torch.arange(count, dtype=torch.float64) / count
    grid = torch.cartesian_prod(*[line] * space.dim).reshape(-1, space.dim)
    values = grid.new_tensor(split.values)
    parts: list[Tensor] = []
    for block in torch.split(grid, GRID_BLOCK):
        tick()
        whole = torch.cat([block, values.expand(len(block), -1)], dim=1)
        parts.append(density.log_marginal(whole, list(split.observed), level))
    logs = torch.cat(parts)
    log, kernels = lattice_kernels((logs - logs.max()).exp().reshape([count] * space.dim), space)
    return [(float(logs.max()) + log, kernels)]


def sharpest_on(count: int, step: float = KERNEL_STEP) -> float:
    """Return the largest concentration that `count` points on a circle resolve."""
    return (count * step / (2 * math.pi)) ** 2


def lattice_kernels(
    values: Tensor, space: Space, start: float = 0.0
) -> tuple[float, AdaptiveKernels]:
    """Return kernels through values (n,) or (n, m) on an even grid that begins at `start`, in turns.

    The logarithm of the values' mean comes first. Kernels whose deviation is one step interpolate what
    is smooth over a few steps nearly to rounding: their weights are one deconvolution by Fourier
    transform.
    """
    spectrum = fft.fftn(values)
    lines: list[Tensor] = []
    kappas: list[float] = []
    for axis, count in enumerate(values.shape):
        line = torch.arange(count, dtype=torch.float64) / count
        kappa = sharpest_on(count, 1.0)
        scaled = special.i0e(torch.tensor(kappa, dtype=torch.float64))
        kernel = (kappa * ((2 * math.pi * line).cos() - 1)).exp() / scaled
        shape = [-1 if i == axis else 1 for i in range(space.dim)]
        spectrum = spectrum / fft.fft(kernel).real.reshape(shape)
        lines.append(line)
        kappas.append(kappa)
    weights = fft.ifftn(spectrum).real.flatten().clamp_min(0)
    weights = weights / weights.sum()
    ordered, order = weights.sort()
    kept = order[ordered.cumsum(0) >= DROPPED_WEIGHT].sort().values
    grid = torch.cartesian_prod(*lines).reshape(-1, space.dim)[kept]
    concentrations = torch.tensor(kappas, dtype=torch.float64).expand(len(kept), -1)
    kernels = AdaptiveKernels(
        space, (grid + start) % 1, concentrations, weights[kept] / weights[kept].sum()
    )
    return math.log(float(values.mean())), kernels
