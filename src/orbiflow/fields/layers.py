"""How steep a network can be anywhere: the product of what its layers can stretch."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, cast

from torch import nn

from orbiflow.typed_torch import linalg

SLOPES: dict[type[nn.Module], Callable[[Any], float]] = {
    nn.Identity: lambda _: 1.0,
    nn.Tanh: lambda _: 1.0,
    nn.ReLU: lambda _: 1.0,
    nn.Softsign: lambda _: 1.0,
    nn.Softplus: lambda _: 1.0,
    nn.Sigmoid: lambda _: 0.25,
    nn.LeakyReLU: lambda layer: max(1.0, abs(layer.negative_slope)),
    nn.ELU: lambda layer: max(1.0, abs(layer.alpha)),
    nn.SiLU: lambda _: 1.1,  # 1.09984 at 2.3994
    nn.GELU: lambda _: 1.13,  # 1.12890 at sqrt 2, or by its tanh 1.1290
    nn.Linear: lambda layer: float(linalg.matrix_norm(layer.weight.detach().double(), ord=2)),
}
"""The greatest slope of a layer that works on each number alone, or the norm of its matrix."""


def bound_of_layers(network: object, bound: Callable[[object], float | None]) -> float | None:
    """Return an upper bound of a network's Jacobian in spectral norm, or None for unknown layers.

    A `torch.nn.Sequential` has the product of its layers' bounds; `bound` says those of layers that
    have their own.

    >>> from orbiflow.fields.protocol import lipschitz_bound
    >>> layer = nn.Linear(2, 2)
    >>> _ = layer.weight.data.copy_(2 * layer.weight.new_tensor([[0.0, 1.0], [1.0, 0.0]]))
    >>> lipschitz_bound(nn.Sequential(layer, nn.Sigmoid(), layer))
    1.0
    """
    if not isinstance(network, nn.Module):
        return None
    does: Any = type(network).forward  # a subclass may do something else
    if does is cast(Any, nn.Sequential).forward and isinstance(network, nn.Sequential):
        bounds = [bound(layer) for layer in network]
        limits = [limit for limit in bounds if limit is not None]
        return math.prod(limits) if len(limits) == len(bounds) else None
    for kind, slope in SLOPES.items():
        if does is kind.forward:
            return slope(network)
    return None
