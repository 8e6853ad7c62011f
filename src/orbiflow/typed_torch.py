"""Parts of torch that have no types, under the same names.

torch's compiled functions have no signatures and some of its Python functions no annotations. Stubs
cannot replace this file: a partial stub package makes pyright lose the rest of torch's own types.
"""

from collections.abc import Iterable
from typing import Any

import torch
from torch import Tensor
from torch.autograd import Function
from torch.optim import Optimizer

_torch: Any = torch
special, linalg, fft = _torch.special, _torch.linalg, _torch.fft
unique, broadcast = _torch.unique, _torch.broadcast_tensors


def adam(
    parameters: Iterable[Tensor] | Iterable[dict[str, Any]],
    lr: float = 1e-3,
    betas: tuple[float, float] = (0.9, 0.999),
) -> Optimizer:
    """Return `torch.optim.Adam`, whose own `step` has no types."""
    return torch.optim.Adam(parameters, lr=lr, betas=betas)


def applied(function: type[Function], *arguments: Any) -> Any:
    """Return `function.apply(*arguments)`."""
    untyped: Any = function
    return untyped.apply(*arguments)


def listed(tensor: Tensor) -> list[Any]:
    """Return the numbers of a tensor as nested lists, one level per dimension (at least one)."""
    values: Any = tensor
    return values.tolist()
