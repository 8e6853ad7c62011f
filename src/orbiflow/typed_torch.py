"""Parts of torch that have no types, under the same names.

torch's compiled functions have no signatures and some of its Python functions no annotations. Stubs
cannot replace this file: a partial stub package makes pyright lose the rest of torch's own types.
"""

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.autograd import Function
from torch.optim import Optimizer

_torch: Any = torch
special, linalg, fft = _torch.special, _torch.linalg, _torch.fft
unique, broadcast = _torch.unique, _torch.broadcast_tensors


adam: Callable[..., Optimizer] = torch.optim.Adam
"""The optimizer, whose own `step` has no types."""


def applied(function: type[Function], *arguments: Any) -> Any:
    """Return `function.apply(*arguments)`."""
    untyped: Any = function
    return untyped.apply(*arguments)


def listed(tensor: Tensor) -> list[Any]:
    """Return the numbers of a tensor as nested lists, one level per dimension (at least one)."""
    values: Any = tensor
    return values.tolist()
