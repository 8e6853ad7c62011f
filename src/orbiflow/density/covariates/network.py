"""Neural mixtures: networks tell from covariates where kernels are, how sharp and how heavy."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self

import torch
from torch import Tensor
from torch.nn.functional import silu

from orbiflow.density.covariates.parts import Part, mean_cosines, on_chart
from orbiflow.density.fitting import Rows
from orbiflow.density.models import AdaptiveKernels, kernel_rows
from orbiflow.density.spaces import Space, by_sphere
from orbiflow.errors import OrbiflowError
from orbiflow.typed_torch import adam

HIDDEN = 64
"""Units of each of the two hidden layers."""

KERNELS = {1: 12}
"""Kernels on spaces of so many dimensions,"""
MOST_KERNELS = 24
"""and on larger ones."""

BATCH, RATE, STEPS = 256, 4e-3, 2_000
"""Rows of a step of Adam, its first rate, which falls to 0 as a cosine, and the most steps."""

EPOCHS = 120
"""The most times that each row is seen."""

DECAY = 1e-4
"""Decay of the weights in a step, in rates."""

LOOKS = 40
"""How often the rows that are kept apart are looked at."""

KAPPAS = (0.02, 1e5)
"""The least and the largest concentration."""

FIRST_KAPPA = 5.0

LEAST_SQUARE = 1e-20
"""What is added to squares of lengths."""

BLOCK_ROWS = 2**12
"""Rows worked on at a time."""

LAYERS = ("first", "first_bias", "second", "second_bias", "last", "last_bias")


class NeuralMixture(Part):
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
        found = (hidden @ last + last_bias).unflatten(-1, (-1, _per_kernel(self.space)))
        width = len(self.space.spheres)
        centers, kappa = found[..., : -width - 1], found[..., -width - 1 : -1]
        low, high = (math.log(kappa) for kappa in KAPPAS)
        kappa = (math.log(FIRST_KAPPA) + kappa).clamp(low, high).exp()
        return _on_spheres(self.space, centers), kappa, torch.log_softmax(found[..., -1], dim=-1)

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
        found: list[Tensor] = []
        for some, own in zip(points.split(BLOCK_ROWS), x.split(BLOCK_ROWS), strict=True):
            logs = self.logs(self.space.features(some)[:, None], own[None])
            found.append(logs.logsumexp(dim=0) - math.log(len(logs)))
        return on_chart(self.space, points, torch.cat(found))

    @torch.no_grad()
    def at(self, x: Tensor) -> AdaptiveKernels:
        centers, kappa, weights = (own[:, 0] for own in self.kernels(x[None, None]))
        points = self.space.lifted(centers.flatten(0, 1))
        shares = torch.softmax(weights.flatten(), dim=0)
        return AdaptiveKernels(self.space, points, kappa.flatten(0, 1), shares)

    @torch.no_grad()
    def mean_features(self, x: Tensor) -> Tensor:
        centers, kappa, weights = self.kernels(x[None])
        means = centers * mean_cosines(kappa).repeat(1, 1, 1, 2)
        return (means * weights.exp()[..., None]).sum(dim=2).mean(dim=0)

    def alone(self, first: int, count: int = 1) -> NeuralMixture:
        """Return some of the F mixtures."""
        return NeuralMixture(self.space, [own[first : first + count] for own in self.layers])

    def header(self) -> dict[str, Any]:
        return {}

    def tensors(self) -> dict[str, Tensor]:
        return dict(zip(LAYERS, self.layers, strict=True))

    @classmethod
    def from_header(
        cls, space: Space, number: Tensor, header: Mapping[str, Any], tensors: Mapping[str, Tensor]
    ) -> Self:
        del header
        layers = [tensors[name] for name in LAYERS]
        count, hidden, out = len(layers[0]), layers[0].shape[-1], layers[-1].shape[-1]
        shapes = [(len(number), hidden), (1, hidden), (hidden, hidden), (1, hidden)]
        shapes += [(hidden, out), (1, out)]
        if (
            [tuple(own.shape) for own in layers] != [(count, *shape) for shape in shapes]
            or not count
            or not out
            or out % _per_kernel(space)
            or not all(own.dtype == torch.float64 for own in layers)
            or not all(bool(own.isfinite().all()) for own in layers)
        ):
            raise OrbiflowError("a network of other shapes or values")
        return cls(space, layers)


def _per_kernel(space: Space) -> int:
    """Return the outputs for a kernel: its centre's features, its concentrations and its weight."""
    width = len(space.spheres)
    point = torch.zeros(1, space.chart_dim, dtype=torch.float64)
    return space.features(point, slice(1)).shape[-1] + width + 1


def _on_spheres(space: Space, vectors: Tensor) -> Tensor:
    """Return features (..., p) of the points in the directions of vectors, sphere by sphere."""
    table = by_sphere(vectors, len(space.spheres))
    own = torch.tensor(space.spheres)
    if len(own.unique()) > 1:  # smaller spheres have fewer coordinates
        table = table * (torch.arange(table.shape[-2])[:, None] <= own)
    squares = (table * table).sum(dim=-2, keepdim=True)  # torch's norms are ten times slower
    return (table * (squares + LEAST_SQUARE).rsqrt()).flatten(-2)


def fit_networks(
    space: Space,
    rows: Rows,
    x: Tensor,
    train: Sequence[Tensor],
    apart: Sequence[Tensor],
    seed: int,
    tell: Callable[[float], None],
) -> NeuralMixture:
    """Fit one mixture to each of F sets of rows, side by side.

    Args:
        space: Any space.
        rows: Points and their weights.
        x: Their features (N, m).
        train: The numbers of the rows of each set.
        apart: The numbers of rows by which the best step is chosen.
        seed: Seed of the starts and batches.
        tell: A function that hears the share of the work done.
    """
    generator = torch.Generator().manual_seed(seed)
    features, seen = space.features(rows.points).float(), x.float()
    weights = torch.ones(len(x)) if rows.weights is None else rows.weights.float()
    layers = _start(space, features[0], seen, train, generator)
    best = [own.detach().clone() for own in layers]
    least = [math.inf] * len(train)
    optimizer = adam(layers, RATE)
    size = min(BATCH, *(len(own) for own in train))
    steps = min(STEPS, EPOCHS * max(1, len(train[0]) // size))
    mixture = NeuralMixture(space, layers)
    batches = [_batches(own, size, generator) for own in train]
    for step in range(1, steps + 1):
        chosen = torch.stack([next(own) for own in batches])
        with torch.enable_grad():
            logs = mixture.logs(features[:, chosen], seen[chosen])
            loss = -(weights[chosen] * logs).sum() / size
        optimizer.zero_grad()
        loss.backward()
        rate = RATE * (1 + math.cos(math.pi * (step - 1) / steps)) / 2
        for group in optimizer.param_groups:
            group["lr"] = rate
        optimizer.step()
        with torch.no_grad():
            for own in layers[::2]:
                own.mul_(1 - rate * DECAY)
        if step % max(1, steps // LOOKS) == 0 or step == steps:
            tell(step / steps)
            _keep(mixture, features, seen, weights, apart, best, least)
    return NeuralMixture(space, [own.double() for own in best])


@torch.no_grad()
def _keep(
    mixture: NeuralMixture,
    features: Tensor,
    x: Tensor,
    weights: Tensor,
    apart: Sequence[Tensor],
    best: list[Tensor],
    least: list[float],
) -> None:
    """Keep the layers of each mixture that is better on rows apart than before."""
    for number, own in enumerate(apart):
        logs = mixture.alone(number).logs(features[:, own][:, None], x[own][None])[0]
        score = -float(weights[own] @ logs / weights[own].sum())
        if score < least[number]:
            least[number] = score
            for kept, layer in zip(best, mixture.layers, strict=True):
                kept[number] = layer[number]


def _batches(rows: Tensor, size: int, generator: torch.Generator) -> Any:
    """Yield numbers (size,) of rows without an end, all in turn."""
    while True:
        order = rows[torch.randperm(len(rows), generator=generator)]
        yield from order[: len(order) // size * size].split(size)


def _start(
    space: Space, features: Tensor, x: Tensor, train: Sequence[Tensor], generator: torch.Generator
) -> list[Tensor]:
    """Return layers whose kernels are about random rows at first."""
    count, width = len(train), x.shape[1]
    kernels = KERNELS.get(space.dim, MOST_KERNELS)
    per = _per_kernel(space)

    def random(*shape: int) -> Tensor:
        return torch.randn(*shape, generator=generator) / math.sqrt(shape[-2])

    bias = torch.zeros(count, kernels, per)
    for number, own in enumerate(train):
        chosen = own[torch.randint(len(own), (kernels,), generator=generator)]
        bias[number, :, : features.shape[1]] = features[chosen]
    layers = [
        random(count, width, HIDDEN),
        torch.zeros(count, 1, HIDDEN),
        random(count, HIDDEN, HIDDEN),
        torch.zeros(count, 1, HIDDEN),
        random(count, HIDDEN, kernels * per) / 4,
        bias.reshape(count, 1, -1),
    ]
    return [own.requires_grad_() for own in layers]
