"""Neural mixtures: networks tell from covariates where kernels are, how sharp and how heavy."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Self

import torch
from torch import Tensor
from torch.nn.functional import silu

from orbiflow.density.models.conditional_parts import ConditionalPart, checked
from orbiflow.density.models.kernels import AdaptiveKernels, kernel_rows
from orbiflow.density.spaces import CHART, Space, by_sphere
from orbiflow.errors import OrbiflowError

KAPPAS = (0.02, 1e5)
"""The least and the largest concentration."""

FIRST_KAPPA = 5.0

LEAST_SQUARE = 1e-20
"""What is added to squares of lengths."""

BLOCK_ROWS = 2**12
"""Rows worked on at a time."""

LAYERS = ("first", "first_bias", "second", "second_bias", "last", "last_bias")


class NeuralMixture(ConditionalPart):
    """The mean of F mixtures of the space's kernels, whose parameters are networks of the features.

    A mixture density network (Bishop, 1994): two hidden layers; of each kernel a direction for the
    features of its centre, logarithms of concentrations, and of its weight.

    Args:
        space: Any space.
        layers: Weights (F, m, h), (F, h, h), (F, h, o), each followed by its biases (F, 1, h or o).
    """

    kind = "network"

    def __init__(self, space: Space, layers: Sequence[Tensor]) -> None:
        self.space, self.layers = space, tuple(layers)

    def kernels(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return features of centres (F, N, K, p), concentrations (.., w), log weights (F, N, K).

        `x` are features (F or 1, N, m).
        """
        first, first_bias, second, second_bias, last, last_bias = self.layers
        hidden = silu(x @ first + first_bias)
        hidden = silu(hidden @ second + second_bias)
        outputs = torch.unflatten(
            hidden @ last + last_bias, -1, (-1, outputs_per_kernel(self.space))
        )
        width = len(self.space.spheres)
        centers, kappa = outputs[..., : -width - 1], outputs[..., -width - 1 : -1]
        low, high = (math.log(kappa) for kappa in KAPPAS)
        kappa = (math.log(FIRST_KAPPA) + kappa).clamp(low, high).exp()
        return _on_spheres(self.space, centers), kappa, torch.log_softmax(outputs[..., -1], dim=-1)

    def logs(self, features: Tensor, x: Tensor) -> Tensor:
        """Return log densities (F, N) as kernels have them.

        `features` (E, F or 1, N, p) are those of points' images, `x` (F or 1, N, m) of covariates.
        """
        centers, kappa, weights = self.kernels(x)
        shape = weights.shape
        rows, offsets = kernel_rows(self.space, centers.flatten(0, -2), kappa.flatten(0, -2))
        fits = torch.einsum("efnp,fnkp->efnk", features, rows.reshape(*shape, -1))
        fits = fits + offsets.reshape(shape) + weights
        return fits.logsumexp(dim=-1).logsumexp(dim=0)

    @torch.no_grad()
    def log_prob(self, points: Tensor, x: Tensor) -> Tensor:
        logs_of_blocks: list[Tensor] = []
        for some, features in zip(
            torch.split(points, BLOCK_ROWS), torch.split(x, BLOCK_ROWS), strict=True
        ):
            logs = self.logs(self.space.features(some)[:, None], features[None])
            logs_of_blocks.append(logs.logsumexp(dim=0) - math.log(len(logs)))
        return torch.cat(logs_of_blocks) + self.space.log_kernel_factor(points, CHART)

    @torch.no_grad()
    def at(self, x: Tensor) -> AdaptiveKernels:
        centers, kappa, weights = (tensor[:, 0] for tensor in self.kernels(x[None, None]))
        points = self.space.lifted(centers.flatten(0, 1))
        shares = torch.softmax(weights.flatten(), dim=0)
        return AdaptiveKernels(self.space, points, kappa.flatten(0, 1), shares)

    def alone(self, first: int, count: int = 1) -> NeuralMixture:
        """Return some of the F mixtures."""
        return NeuralMixture(self.space, [layer[first : first + count] for layer in self.layers])

    def tensors(self) -> dict[str, Tensor]:
        return dict(zip(LAYERS, self.layers, strict=True))

    @classmethod
    def from_header(
        cls, space: Space, number: Tensor, header: Mapping[str, Any], tensors: Mapping[str, Tensor]
    ) -> Self:
        del header
        count, _, hidden = tensors["first"].shape
        out = tensors["last"].shape[-1]
        if not count or not out or out % outputs_per_kernel(space):
            raise OrbiflowError("a network of no kernels")
        shapes = [(len(number), hidden), (1, hidden), (hidden, hidden), (1, hidden)]
        shapes += [(hidden, out), (1, out)]
        whole = {name: (count, *shape) for name, shape in zip(LAYERS, shapes, strict=True)}
        return cls(space, checked(tensors, whole, "a network"))


def outputs_per_kernel(space: Space) -> int:
    """Return the outputs for a kernel: its centre's features, its concentrations and its weight."""
    width = len(space.spheres)
    point = torch.zeros(1, space.chart_dim, dtype=torch.float64)
    return space.features(point, slice(1)).shape[-1] + width + 1


def _on_spheres(space: Space, vectors: Tensor) -> Tensor:
    """Return features (..., p) of the points in the directions of vectors, sphere by sphere."""
    table = by_sphere(vectors, len(space.spheres))
    dims = torch.tensor(space.spheres)
    if len(set(space.spheres)) > 1:  # smaller spheres have fewer coordinates
        table = table * (torch.arange(table.shape[-2])[:, None] <= dims)
    squares = (table * table).sum(dim=-2, keepdim=True)  # torch's norms are ten times slower
    return (table * (squares + LEAST_SQUARE).rsqrt()).flatten(-2)
