"""A time-dependent neural field on tori of many angles, with an exact divergence."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn import functional

from orbiflow.arguments import is_a
from orbiflow.errors import OrbiflowError
from orbiflow.typed_torch import random

MAX_WIDTH, MAX_DEPTH, MAX_WAVES = 1024, 8, 16
"""Bounds of `NeuralTorusField`, for settings and for files."""

MAX_DIM = 64
"""Angles at most, as of the density's torus."""

CLOCK = 4
"""Cosines of the time that the network sees."""

REMAINING = 0.02
"""Share of the way left when matching's clock stops; see `way`."""


def way(time: Tensor) -> Tensor:
    """Share of the way gone at times in [0, 1]: 0 to 1, slower and slower.

    A point on its way to data of width w is drawn together at the rate 1 / (1 - way + w), which no
    fixed step of an even clock could follow; 1 - way + 0.02 falls exponentially instead, so that
    every step contracts alike.
    """
    return (1 - ((1 + REMAINING) / REMAINING) ** -time) * (1 + REMAINING)


def speed(time: Tensor) -> Tensor:
    """Derivative of `way`."""
    rate = math.log((1 + REMAINING) / REMAINING)
    return rate * (1 + REMAINING) * (-rate * time).exp()


class NeuralTorusField(nn.Module):
    """A time-dependent vector field V(x, t) on T^d, of period 1 in each coordinate.

    A residual multilayer perceptron (SiLU) of cos and sin(2 pi k x_i), k = 1..waves, and of
    cos(pi j t), times `speed`(t). Its divergence is exact: the d tangents of the input are carried
    through the layers beside the values, in one matrix product a layer, and the trace is taken in
    the last. The last layer starts at zero, so that the flow starts at the identity.

    Args:
        dim: number of angles d, 1 to 64.
        width: of the hidden layers, 1 to 1024.
        depth: hidden layers, 1 to 8.
        waves: largest multiple of each angle, 1 to 16.
        seed: of the weights; the global random state is left alone.
        dtype: of the weights.

    Raises:
        OrbiflowError: for a size out of range.
    """

    time_dependent = True

    def __init__(
        self,
        dim: int,
        *,
        width: int = 128,
        depth: int = 3,
        waves: int = 2,
        seed: int = 0,
        dtype: torch.dtype = torch.float64,
    ) -> None:
        super().__init__()
        for name, value, most in (
            ("dim", dim, MAX_DIM),
            ("width", width, MAX_WIDTH),
            ("depth", depth, MAX_DEPTH),
            ("waves", waves, MAX_WAVES),
        ):
            if isinstance(value, bool) or not is_a(value, int) or not 1 <= value <= most:
                raise OrbiflowError(f"{name} must be an integer from 1 to {most}, got {value!r}")
        self.dim, self.width, self.depth, self.waves = dim, width, depth, waves
        with random.fork_rng(devices=[]):
            random.manual_seed(seed)
            self.first = nn.Linear(2 * waves * dim + CLOCK, width, dtype=dtype)
            self.hidden = nn.ModuleList(
                nn.Linear(width, width, dtype=dtype) for _ in range(depth - 1)
            )
            self.last = nn.Linear(width, dim, dtype=dtype)
        nn.init.zeros_(self.last.weight)
        nn.init.zeros_(self.last.bias)

    def forward(self, points: Tensor, time: Tensor) -> Tensor:
        """V at points (..., d) and times (..., 1) or (): (..., d)."""
        cos, sin = self._waves(points)
        value = functional.silu(self._enter(points, cos, sin, time))
        for layer in self.hidden:
            value = value + functional.silu(layer(value))
        return self.last(value) * speed(time)

    def with_divergence(self, points: Tensor, time: Tensor) -> tuple[Tensor, Tensor]:
        """V (..., d) and its divergence in the points (...,), exact."""
        cos, sin = self._waves(points)
        value, slope = _silu(self._enter(points, cos, sin, time))
        tangent = slope[..., None, :] * self._tangents(cos, sin)
        for layer in self.hidden:
            assert isinstance(layer, nn.Linear)  # by construction
            more, slope = _silu(layer(value))
            value = value + more
            tangent = tangent + slope[..., None, :] * functional.linear(tangent, layer.weight)
        trace = (tangent * self.last.weight).sum(dim=(-2, -1))
        pace = speed(time)
        return self.last(value) * pace, trace * pace.expand(*points.shape[:-1], 1)[..., 0]

    def _waves(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """cos and sin (..., d, K)."""
        number = torch.arange(1, self.waves + 1, dtype=points.dtype, device=points.device)
        phase = 2 * math.pi * points[..., None] * number
        return phase.cos(), phase.sin()

    def _enter(self, points: Tensor, cos: Tensor, sin: Tensor, time: Tensor) -> Tensor:
        number = torch.arange(1, CLOCK + 1, dtype=points.dtype, device=points.device)
        clock = (math.pi * number * time).cos().expand(*points.shape[:-1], CLOCK)
        return self.first(torch.cat([cos.flatten(-2), sin.flatten(-2), clock], dim=-1))

    def _tangents(self, cos: Tensor, sin: Tensor) -> Tensor:
        """Derivatives (..., d, width) of the first layer by each coordinate."""
        size = self.waves * self.dim
        number = torch.arange(1, self.waves + 1, dtype=cos.dtype, device=cos.device)
        weight = self.first.weight[:, : 2 * size].reshape(-1, 2, self.dim, self.waves)
        by_cos, by_sin = (2 * math.pi * number * weight).unbind(dim=1)
        return torch.einsum("...jk,hjk->...jh", cos, by_sin) - torch.einsum(
            "...jk,hjk->...jh", sin, by_cos
        )

    def extra_repr(self) -> str:
        return f"dim={self.dim}, width={self.width}, depth={self.depth}, waves={self.waves}"


def _silu(x: Tensor) -> tuple[Tensor, Tensor]:
    """x sigmoid(x) and its derivative."""
    gate = x.sigmoid()
    value = x * gate
    return value, gate + value * (1 - gate)
