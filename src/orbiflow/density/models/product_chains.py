"""Mixtures of chains on products: other columns first, then a point of the base that goes with them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from orbiflow.density.models.chains import waves
from orbiflow.density.models.density import Density, Restriction, Split
from orbiflow.density.models.kernels import AdaptiveKernels, drawn_about, kernel_peaks
from orbiflow.density.models.sums import log_sum_exp, shares_of
from orbiflow.density.models.tensors import in_blocks
from orbiflow.density.spaces import CHART, ProductSpace, Space, by_sphere
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_tensor
from orbiflow.typed_torch import linalg, listed, special

MOST_BESIDE = 3
"""The most other columns: more could not be integrated out at so few nodes."""

WINDOW, STEP = 6.0, 0.8
"""Deviations on each side at which nodes end, and of what is integrated between two nodes."""

MOST_NODES = 2_000
"""The most nodes of a component, over all hidden columns."""

PROBES = 32
"""Places of a column at which the speed of a component's mean is looked at."""

BLOCK_ENTRIES = 1_000_000
"""Entries of the table of images of points against components and features at a time."""

DRAWS = 2**10
"""Points at a time."""


class ProductChains(Density, kind="product-chains"):
    """A mixture of chains, exact and normalised on a product.

    In a component the other columns are von Mises and independent, as turns u of their circles. Then
    comes the point of the base: a kernel about the direction of M w(u) on each sphere of the base's
    features, with the waves w = (1, sin u, cos u), summed over the images of the point. That is a
    regression of directions on columns, normalised whatever M is.

    Args:
        space: A `ProductSpace` of at most `MOST_BESIDE` other columns, k of them.
        weights: Weights (K,) of sum 1.
        centers, sharpness: Means (K, k) of the other columns in turns, and concentrations (K, k).
        slopes: The matrices M (K, 1 + 2 k, m), transposed; m is the number of the base's features.
        concentrations: Those of the kernels on the base's F spheres, (K, F).
    """

    stored = ("weights", "centers", "sharpness", "slopes", "concentrations")

    def __init__(
        self,
        space: Space,
        weights: Tensor,
        centers: Tensor,
        sharpness: Tensor,
        slopes: Tensor,
        concentrations: Tensor,
    ) -> None:
        super().__init__(space)
        if not isinstance(space, ProductSpace) or space.beside.dim > MOST_BESIDE:
            raise OrbiflowError(
                f"such chains are for spaces beside at most {MOST_BESIDE} columns, not the {space.name}"
            )
        self.base, self.beside = space.base, space.beside
        tensors_given = (weights, centers, sharpness, slopes, concentrations)
        tensors = [
            as_tensor(t, n).double() for n, t in zip(self.stored, tensors_given, strict=True)
        ]
        count, k = len(tensors[0]) if tensors[0].dim() else 0, space.beside.dim
        width = (1 + self.base.spheres[0]) * len(self.base.spheres)
        shapes = ((count,), (count, k), (count, k), (count, 1 + 2 * k, width))
        shapes = (*shapes, (count, len(self.base.spheres)))
        if not count or [tuple(t.shape) for t in tensors] != list(shapes):
            raise OrbiflowError(f"chains of shapes {[tuple(t.shape) for t in tensors]} do not fit")
        if not (
            all(bool(t.isfinite().all()) for t in tensors)
            and bool((tensors[0] >= 0).all())
            and abs(float(tensors[0].sum()) - 1) < 1e-6
            and bool((tensors[2] > 0).all() and (tensors[4] > 0).all())
        ):
            raise OrbiflowError("chains need finite tensors, positive widths, weights of sum 1")
        self.weights, self.centers, self.sharpness, self.slopes, self.concentrations = tensors

    def log_density(self, points: Tensor, beside: float = -math.inf) -> Tensor:
        del beside
        flat = points.reshape(-1, self.space.chart_dim).double()
        entries = len(self.weights) * self.slopes.shape[-1]
        size = max(1, min(DRAWS, BLOCK_ENTRIES // entries))
        values = in_blocks(lambda x: log_sum_exp(self.log_each(x)), flat, size)
        return values.reshape(points.shape[:-1]).to(points.dtype)

    def log_each(self, points: Tensor) -> Tensor:
        """Return the log density (N, K) of each component with its weight, as `log_density` has it."""
        chart = self.base.chart_dim
        images = self.base.features(points[:, :chart])
        return self.image_logs(images, points[:, chart:])[0].logsumexp(dim=0)

    def _log_beside(self, turns: Tensor, axes: Sequence[int] | None = None) -> Tensor:
        """Return log densities (N, K) of some of the other columns at turns (N, len(axes))."""
        center, kappa = self.centers, self.sharpness
        if axes is not None:
            center, kappa = center[:, list(axes)], kappa[:, list(axes)]
        sine = (math.pi * (turns[:, None] - center)).sin()
        return -(2 * kappa * sine**2).sum(dim=-1) - special.i0e(kappa).log().sum(dim=-1)

    def means(self, turns: Tensor) -> Tensor:
        """Return the features (N, K, p, F) of the middles on the base at other columns (N, k)."""
        sums = torch.einsum("nl,klm->nkm", waves(2 * math.pi * turns), self.slopes)
        return _directions(sums, len(self.base.spheres))

    def image_logs(self, images: Tensor, turns: Tensor) -> tuple[Tensor, Tensor]:
        """Return log densities (E, N, K) of components at images (E, N, m) of points, and cosines.

        The cosines (E, N, K, F) are those from the components' middles, on each sphere.
        """
        middle = self.means(turns)
        # the square of the chord keeps the digits of narrow kernels
        below = [
            ((by_sphere(image, len(self.base.spheres))[:, None] - middle) ** 2).sum(dim=2) / 2
            for image in images
        ]
        off = torch.stack(below)
        logs = kernel_peaks(self.base, self.concentrations) - (off * self.concentrations).sum(
            dim=-1
        )
        return logs + self._log_beside(turns) + self.weights.log(), 1 - off

    def draw(self, count: int, generator: torch.Generator) -> Tensor:
        return self.to("cpu")._walk(count, {}, generator)

    def _walk(self, count: int, given: Mapping[int, float], generator: torch.Generator) -> Tensor:
        """Return draws (count, d), of which some other columns are given, by number among them."""
        seed = int(torch.randint(2**31, (), generator=generator))
        rng, weights = np.random.default_rng(seed), self.weights.numpy()
        chosen = torch.as_tensor(rng.choice(len(weights), count, p=weights / weights.sum()))
        noise = torch.tensor(rng.vonmises(0.0, self.sharpness[chosen].numpy()))
        turns = self.centers[chosen] + noise / (2 * math.pi)
        for axis, value in given.items():
            turns[:, axis] = value
        sums = torch.einsum("nl,nlm->nm", waves(2 * math.pi * turns), self.slopes[chosen])
        middle = _directions(sums, len(self.base.spheres))
        places = self.base.lifted(middle.flatten(1))
        drawn = drawn_about(self.base, places, self.concentrations[chosen], rng)
        return torch.cat([drawn, self.beside.project(turns)], dim=1)

    def draw_given(
        self, count: int, given: Mapping[int, float], generator: torch.Generator
    ) -> tuple[Tensor, Tensor]:
        if self.weights.device.type != "cpu":
            return self.to("cpu").draw_given(count, given, generator)
        chart = self.base.chart_dim
        lines = {axis - chart: value for axis, value in given.items() if axis >= chart}
        points = self._walk(count, lines, generator)
        logs = points.new_zeros(count)
        if len(lines) < len(given):  # the point of the base: weighed by how likely it is there
            points[:, :chart] = points.new_tensor([given[axis] for axis in range(chart)])
            beside = self._log_beside(points[:, chart:]) + self.weights.log()
            logs = log_sum_exp(self.log_each(points)) - log_sum_exp(beside)
            logs += self.base.log_kernel_factor(points[:, :chart], CHART)
        if lines:
            at = points[:1, [chart + axis for axis in lines]]
            logs += log_sum_exp(self._log_beside(at, [*lines]) + self.weights.log())
        return points, logs

    @classmethod
    def joined(cls, components: Sequence[Any], weights: Tensor) -> Self:
        """Return all chains of several densities on one space, in proportions (P,)."""
        shares = weights.double() / weights.sum()
        tensors = [
            torch.cat([getattr(part, name) for part in components]) for name in cls.stored[1:]
        ]
        of_each = [share * part.weights for share, part in zip(shares, components, strict=True)]
        return cls(components[0].space, torch.cat(of_each), *tensors)

    def restricted(self, split: Split, space: Space) -> Restriction:
        """Keep components, hidden columns at nodes; none if a point of the base is given."""
        chart = self.base.chart_dim
        if any(axis < chart for axis in split.given):
            return Restriction([], [(0.0, self, split)])
        kept = [axis - chart for axis in split.kept if axis >= chart]
        fixed = [axis - chart for axis in split.given]
        weights, log = self.weights, 0.0
        turns = torch.tensor([split.values], dtype=torch.float64)
        if fixed:
            logs = (self._log_beside(turns, fixed) + weights.log())[0]
            log, weights = float(log_sum_exp(logs)), shares_of(logs)
        if min(split.kept) >= chart:  # the other columns alone
            kernels = (self.centers[:, kept], self.sharpness[:, kept], weights)
            return Restriction([(log, AdaptiveKernels(space, *kernels))], [])
        constant = self.slopes[:, :1] + self._part_of(fixed, turns.expand(len(weights), 1, -1))
        hidden = [k for k in range(self.beside.dim) if k not in kept and k not in fixed]
        every = torch.arange(len(weights))
        if hidden:
            places, shares = self._nodes(hidden)
            every = every.repeat_interleave(torch.tensor([len(kernels) for kernels in shares]))
            weights = weights[every] * torch.cat(shares)
            at = torch.cat(places)[:, None]
            constant = constant[every] + self._part_of(hidden, at, every)
        kappa = self.concentrations[every]
        if not kept:
            middle = _directions(constant, len(self.base.spheres))[:, 0]
            middles = self.base.lifted(middle.flatten(1))
            return Restriction([(log, AdaptiveKernels(space, middles, kappa, weights))], [])
        rows = [*(1 + k for k in kept), *(1 + self.beside.dim + k for k in kept)]
        slopes = torch.cat([constant, self.slopes[every][:, rows]], dim=1)
        lines = (self.centers[every][:, kept], self.sharpness[every][:, kept])
        return Restriction([(log, ProductChains(space, weights, *lines, slopes, kappa))], [])

    def _part_of(self, axes: list[int], turns: Tensor, every: Tensor | None = None) -> Tensor:
        """Return what some other columns at turns (K, 1, a) add to constants (K, 1, m)."""
        rows = [*(1 + k for k in axes), *(1 + self.beside.dim + k for k in axes)]
        some = self.slopes[:, rows] if every is None else self.slopes[every][:, rows]
        return waves(2 * math.pi * turns)[..., 1:] @ some

    def _nodes(self, hidden: list[int]) -> tuple[list[Tensor], list[Tensor]]:
        """Return nodes (n, h) in turns of each component's hidden columns, and their masses (n,).

        A trapezoidal rule, whose error falls faster than any power of the step.
        """
        nodes: list[Tensor] = []
        masses: list[Tensor] = []
        reach = (WINDOW / self.sharpness.sqrt() / (2 * math.pi)).clamp_max(0.5)
        counts = torch.stack([self._count(k, reach[:, k]) for k in hidden], dim=1)
        for number, count_of_columns in enumerate(counts):
            size = (MOST_NODES / float(count_of_columns.prod())) ** (1 / len(hidden))
            lines: list[Tensor] = []
            for k, count in zip(hidden, listed(count_of_columns), strict=True):
                n = max(2, math.ceil(min(1.0, size) * count))
                even = (torch.arange(n, dtype=torch.float64) + 0.5) / n - 0.5
                lines.append(self.centers[number, k] + 2 * reach[number, k] * even)
            grid = torch.cartesian_prod(*lines).reshape(-1, len(hidden))
            logs = self._log_beside(grid, hidden)[:, number]
            nodes.append(grid)
            masses.append(torch.softmax(logs, dim=0))
        return nodes, masses

    def _count(self, axis: int, reach: Tensor) -> Tensor:
        """Return how many nodes (K,) of a column resolve its density times that of the base."""
        even = torch.linspace(-1, 1, PROBES, dtype=torch.float64)
        at = self.centers.repeat(PROBES, 1, 1)
        at[:, :, axis] += even[:, None] * reach
        middle = torch.einsum("pkl,klm->pkm", waves(2 * math.pi * at), self.slopes)
        middle = _directions(middle, len(self.base.spheres))
        move = (middle[1:] - middle[:-1]).square().sum(dim=2).amax(dim=0)  # (K, F)
        speed = move.sqrt() * (PROBES - 1) / (4 * math.pi * reach[:, None])
        sharp = self.sharpness[:, axis] + (self.concentrations * speed**2).sum(dim=1)
        return (4 * math.pi * reach * sharp.sqrt() / STEP).ceil() + 1


def _directions(sums: Tensor, spheres: int) -> Tensor:
    """Return unit vectors (..., p, F) of sums (..., m) on each sphere."""
    vectors = by_sphere(sums, spheres)
    return vectors / linalg.vector_norm(vectors, dim=-2, keepdim=True).clamp_min(1e-300)
