"""The bivariate von Mises density with sines: two angles that depend on each other."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models.density import Density, Restriction, Split
from orbiflow.density.models.kernels import AdaptiveKernels
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_tensor
from orbiflow.typed_torch import special

FEWEST_NODES, NODES_PER_DEVIATION = 64, 24
"""Nodes of the integral over one angle: at least so many, and so many for a deviation."""

MOST_NODES = 2**20
"""Nodes at most, which is enough for concentrations up to 1e9."""

CELLS = 512
"""Cells of a circle on which a marginal density is bounded by constants."""


def log_sine(shape: Tensor) -> Tensor:
    """Return the logarithm of the integral of exp(k cos a + l cos b + d sin a sin b) over two angles.

    One of them is integrated in closed form, the other by the trapezoidal rule, whose error is that of
    rounding. It is differentiable.

    >>> even = log_sine(torch.tensor([2.0, 3.0, 0.0]).double()).exp()
    >>> bessel = special.i0(torch.tensor([2.0, 3.0]).double()).prod()
    >>> round(float(even / bessel) / math.pi**2, 12)
    4.0
    """
    first, other, depends = shape
    size = float(shape.detach().abs().max())
    count = min(MOST_NODES, FEWEST_NODES + int(NODES_PER_DEVIATION * math.sqrt(size)))
    angles = 2 * math.pi * torch.arange(count, dtype=torch.float64) / count
    logs = _log_over_first(first, depends, angles.sin()) + other * angles.cos()
    return logs.logsumexp(0) + math.log(2 * math.pi / count)


def _log_over_first(first: Tensor, depends: Tensor, sine: Tensor) -> Tensor:
    """Return the logarithm of the integral over the first angle where the other has these sines."""
    length = (first**2 + (depends * sine) ** 2).clamp_min(1e-300).sqrt()
    return special.i0e(length).log() + length + math.log(2 * math.pi)


class VonMisesSine(Density, kind="von-mises-sine"):
    """The density exp(k cos a + l cos b + d sin a sin b) / c of two angles, a and b from their means.

    Singh, Hnizdo and Demchuk, Probabilistic model for two dependent circular variables (2002). The
    constant and samples are exact.

    Args:
        space: A torus of two angles.
        means: The means (2,), in turns.
        shape: The concentrations k and l, and the dependence d, (3,).
    """

    article = "a bivariate von Mises density"
    stored = ("means", "shape")

    def __init__(self, space: Space, means: Tensor, shape: Tensor) -> None:
        super().__init__(space)
        parameters = [as_tensor(means, "means").detach(), as_tensor(shape, "shape").detach()]
        self.means, self.shape = (parameter.double() for parameter in parameters)
        if not space.is_of_angles or space.dim != 2:
            raise OrbiflowError("a density with sines is for a torus of two angles")
        finite = all(bool(parameter.isfinite().all()) for parameter in (self.means, self.shape))
        if self.means.shape != (2,) or self.shape.shape != (3,) or not finite:
            raise OrbiflowError(
                "a density with sines has two finite means and three shape parameters"
            )
        # per area of the square, whose sides are a turn
        self._log_top = 2 * math.log(2 * math.pi) - float(log_sine(self.shape.cpu()))

    def log_chart(self, points: Tensor) -> Tensor:
        a, b = (2 * math.pi * (points.double() - self.means)).unbind(dim=-1)
        first, other, depends = self.shape
        return (first * a.cos() + other * b.cos() + depends * a.sin() * b.sin() + self._log_top).to(
            points
        )

    def bumps(self) -> Tensor:
        return self.means[None]

    def log_marginal(self, points: Tensor, axes: list[int], seed: int = 0) -> Tensor:
        del seed
        if len(axes) == 2:
            return self.log_chart(points[:, [axes.index(0), axes.index(1)]])
        (axis,) = axes
        angle = 2 * math.pi * (points[:, 0].double() - self.means[axis])
        over = _log_over_first(self.shape[1 - axis], self.shape[2], angle.sin())
        return over + self.shape[axis] * angle.cos() + self._log_top - math.log(2 * math.pi)

    def restricted(self, split: Split, space: Space) -> Restriction:
        """Keep an angle's von Mises density where the other is given."""
        if not split.given or len(split.kept) != 1:
            return Restriction([], [(0.0, self, split)])
        (kept,), (fixed,) = split.kept, split.given
        at = torch.tensor([split.values], dtype=torch.float64)
        center, kappa = self._given(kept, 2 * math.pi * (at[:, 0] - self.means[fixed]))
        kernel = AdaptiveKernels(space, space.project(center), kappa, torch.ones(1))
        return Restriction([(float(self.log_marginal(at, [fixed])), kernel)], [])

    def _given(self, kept: int, angle: Tensor) -> tuple[Tensor, Tensor]:
        """Return the mean (N, 1) in turns and concentration (N, 1) of one angle, given the other."""
        across = self.shape[2] * angle.sin()
        turn = torch.atan2(across, self.shape[kept].expand_as(across)) / (2 * math.pi)
        kappa = (self.shape[kept] ** 2 + across**2).sqrt().clamp_min(1e-12)
        return (self.means[kept] + turn)[:, None], kappa[:, None]

    def draw(self, count: int, generator: torch.Generator) -> Tensor:
        rng = np.random.default_rng(int(torch.randint(2**31, (), generator=generator)))
        angle = torch.tensor(self._second(count, rng))
        center, kappa = self._given(0, angle)
        first = center[:, 0].numpy() + rng.vonmises(0.0, kappa[:, 0].numpy()) / (2 * np.pi)
        second = float(self.means[1]) + angle.numpy() / (2 * np.pi)
        return self.space.project(torch.tensor(np.stack([first, second], axis=1)))

    def _second(self, count: int, rng: np.random.Generator) -> Array:
        """Return draws (count,) of the second angle from its mean, by rejection from cells.

        In a cell the sine's square and the cosine are between their values at its ends.
        """
        ends = torch.linspace(0, 2 * math.pi, CELLS + 1, dtype=torch.float64)
        first, other, depends = self.shape.cpu()
        sines, cosines = ends.sin().abs(), other * ends.cos()
        highest = _log_over_first(first, depends, torch.maximum(sines[1:], sines[:-1]))
        tops = (highest + torch.maximum(cosines[1:], cosines[:-1])).numpy()
        shares = np.exp(tops - tops.max())
        accepted: list[Array] = []
        while (left := count - sum(map(len, accepted))) > 0:
            cells = rng.choice(CELLS, 2 * left + 16, p=shares / shares.sum())
            tried = 2 * np.pi * (cells + rng.uniform(size=len(cells))) / CELLS
            at = torch.tensor(tried)
            logs = (_log_over_first(first, depends, at.sin()) + other * at.cos()).numpy()
            accepted.append(tried[np.log(rng.uniform(size=len(tried))) < logs - tops[cells]])
        return np.concatenate(accepted)[:count]
