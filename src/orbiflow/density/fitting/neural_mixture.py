"""Fitting neural mixtures: many side by side, each to rows of its own."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import Tensor

from orbiflow.density.fitting.rows import Rows
from orbiflow.density.models import NeuralMixture, outputs_per_kernel
from orbiflow.density.spaces import Space
from orbiflow.flows import Adam

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
    best = [tensor.detach().clone() for tensor in layers]
    least = [math.inf] * len(train)
    adam = Adam(layers)
    size = min(BATCH, *(len(tensor) for tensor in train))
    steps = min(STEPS, EPOCHS * max(1, len(train[0]) // size))
    mixture = NeuralMixture(space, layers)
    batches = [_batches(tensor, size, generator) for tensor in train]
    for step in range(1, steps + 1):
        chosen = torch.stack([next(tensor) for tensor in batches])
        with torch.enable_grad():
            logs = mixture.logs(features[:, chosen], seen[chosen])
            loss = -(weights[chosen] * logs).sum() / size
        rate = RATE * (1 + math.cos(math.pi * (step - 1) / steps)) / 2
        adam.step(loss, rate)
        with torch.no_grad():
            for tensor in layers[::2]:
                tensor.mul_(1 - rate * DECAY)
        if step % max(1, steps // LOOKS) == 0 or step == steps:
            tell(step / steps)
            _keep(mixture, features, seen, weights, apart, best, least)
    return NeuralMixture(space, [tensor.double() for tensor in best])


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
    for number, rows in enumerate(apart):
        logs = mixture.alone(number).logs(features[:, rows][:, None], x[rows][None])[0]
        score = -float(weights[rows] @ logs / weights[rows].sum())
        if score < least[number]:
            least[number] = score
            for kept, layer in zip(best, mixture.layers, strict=True):
                kept[number] = layer[number]


def _batches(rows: Tensor, size: int, generator: torch.Generator) -> Any:
    """Yield numbers (size,) of rows without an end, all in turn."""
    while True:
        order = rows[torch.randperm(len(rows), generator=generator)]
        yield from torch.split(order[: len(order) // size * size], size)


def _start(
    space: Space, features: Tensor, x: Tensor, train: Sequence[Tensor], generator: torch.Generator
) -> list[Tensor]:
    """Return layers whose kernels are about random rows at first."""
    count, width = len(train), x.shape[1]
    kernels = KERNELS.get(space.dim, MOST_KERNELS)
    per = outputs_per_kernel(space)

    def random(*shape: int) -> Tensor:
        return torch.randn(*shape, generator=generator) / math.sqrt(shape[-2])

    bias = torch.zeros(count, kernels, per)
    for number, rows in enumerate(train):
        chosen = rows[torch.randint(len(rows), (kernels,), generator=generator)]
        bias[number, :, : features.shape[1]] = features[chosen]
    layers = [
        random(count, width, HIDDEN),
        torch.zeros(count, 1, HIDDEN),
        random(count, HIDDEN, HIDDEN),
        torch.zeros(count, 1, HIDDEN),
        random(count, HIDDEN, kernels * per) / 4,
        bias.reshape(count, 1, -1),
    ]
    return [rows.requires_grad_() for rows in layers]
