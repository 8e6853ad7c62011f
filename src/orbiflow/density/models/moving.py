"""Densities and their parts on another device, or with a flow of another precision."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import torch
from torch import Tensor, nn

from orbiflow.errors import OrbiflowError


@runtime_checkable
class _Movable(Protocol):
    def to(self, device: torch.device, /) -> Any: ...


def destination(*wanted: Any) -> tuple[torch.device | None, torch.dtype | None]:
    """A device and a dtype, from what `torch.Tensor.to` takes: either, both, or a tensor.

    Raises:
        OrbiflowError: for another thing, a device that torch does not know, a dtype that is not
            floating.

    >>> destination("cpu", torch.float32)
    (device(type='cpu'), torch.float32)
    """
    device: torch.device | None = None
    dtype: torch.dtype | None = None
    for one in wanted:
        if isinstance(one, torch.dtype):
            dtype = one
        elif isinstance(one, Tensor):
            device, dtype = one.device, one.dtype
        elif one is not None:
            device = _device(one)
    if dtype is not None and not dtype.is_floating_point:
        raise OrbiflowError(f"a density is evaluated in floating-point numbers, not in {dtype}")
    return device, dtype


def moved(part: Any, device: torch.device | None, dtype: torch.dtype | None = None) -> Any:
    """A copy on the device: tensors, modules and whatever has `to`; the rest as it is."""
    if device is None and dtype is None:
        return part
    if isinstance(part, Tensor | nn.Module):
        return part.to(device=device, dtype=dtype)
    return part.to(device) if device is not None and isinstance(part, _Movable) else part


def _device(wanted: Any) -> torch.device:
    try:
        return torch.device(wanted)
    except (RuntimeError, TypeError) as error:
        raise OrbiflowError(
            f"expected a device or a dtype, such as 'cuda' or torch.float32, got {wanted!r}"
        ) from error
