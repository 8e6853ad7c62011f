"""Parts of torch that have no types, under the same names.

torch's compiled functions have no signatures and some of its Python functions no annotations. Stubs
cannot replace this file: a partial stub package makes pyright lose the rest of torch's own types.
"""

from typing import Any

import torch
from torch import Tensor
from torch.autograd import Function, forward_ad

_torch: Any = torch
special, linalg, fft = _torch.special, _torch.linalg, _torch.fft
unique, broadcast = _torch.unique, _torch.broadcast_tensors


def applied(function: type[Function], *arguments: Any) -> Any:
    """Return `function.apply(*arguments)`."""
    untyped: Any = function
    return untyped.apply(*arguments)


def listed(tensor: Tensor) -> list[Any]:
    """Return the numbers of a tensor as nested lists, one level per dimension (at least one)."""
    values: Any = tensor
    return values.tolist()


# torch uses these itself, but has neither public names nor types for them
_core: Any = torch._C  # pyright: ignore[reportPrivateUsage]
_forward_mode: Any = forward_ad


def transformed() -> bool:
    """Return whether `torch.func` (vmap, grad, jvp and what builds on them) or forward mode is active.

    Tensors may then stand for batches, or carry tangents. torch has no public function for this; its
    own autograd functions ask the same.
    """
    return _core._are_functorch_transforms_active() or _forward_mode._current_level >= 0


def is_old_batch(tensor: Tensor) -> bool:
    """Return whether torch's older vectorization has batched a tensor."""
    return bool(_core._functorch.is_legacy_batchedtensor(tensor))
