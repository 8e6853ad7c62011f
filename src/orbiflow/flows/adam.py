"""Adam, whose steps are those of `torch.optim.Adam` bit for bit, without its import of a compiler."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor

MEAN_DECAY, SQUARE_DECAY, LEAST_DEVIATION = 0.9, 0.999, 1e-8


class Adam:
    """Moments of the gradients of some tensors (Kingma and Ba, 2015, algorithm 1).

    The first optimizer of torch in a process imports `torch._dynamo`, which takes as long as torch.

    Args:
        tensors: What is optimised, in place: tensors of any shapes, of which gradients can be taken.

    >>> place = torch.tensor([3.0], requires_grad=True)
    >>> adam = Adam([place])
    >>> adam.step(place.square().sum(), rate=0.5)
    >>> place.detach()
    tensor([2.5000])
    """

    def __init__(self, tensors: Sequence[Tensor]) -> None:
        self.tensors = list(tensors)
        self.means = [torch.zeros_like(tensor) for tensor in self.tensors]
        self.squares = [torch.zeros_like(tensor) for tensor in self.tensors]
        self.steps = 0

    def step(self, loss: Tensor, rate: float | Sequence[float]) -> None:
        """Move down the gradient of a loss, at one rate or at one for each tensor.

        Tensors on which the loss does not depend stay where they are.
        """
        slopes: Any = torch.autograd.grad(loss, self.tensors, allow_unused=True)
        rates = rate if isinstance(rate, Sequence) else [rate] * len(slopes)
        self.steps += 1
        mean_bias = 1 - MEAN_DECAY**self.steps
        root_bias = math.sqrt(1 - SQUARE_DECAY**self.steps)
        with torch.no_grad():
            for k, slope in enumerate(slopes):
                if slope is None:
                    continue
                mean = self.means[k].lerp_(slope, 1 - MEAN_DECAY)
                square = self.squares[k].mul_(SQUARE_DECAY)
                square.addcmul_(slope, slope, value=1 - SQUARE_DECAY)
                deviation = (square.sqrt() / root_bias).add_(LEAST_DEVIATION)
                self.tensors[k].addcdiv_(mean, deviation, value=-rates[k] / mean_bias)
