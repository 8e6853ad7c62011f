"""Tensors of points: in blocks, on a device, of a shape, from a source of random numbers."""

from __future__ import annotations

import copy
import numbers
from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor, nn

from orbiflow.errors import OrbiflowError


def in_blocks(function: Callable[[Tensor], Tensor], points: Tensor, size: int) -> Tensor:
    """Return a function of points (N, d) at points (..., d), evaluated at some of them at a time."""
    flat = points.reshape(-1, points.shape[-1])
    parts = [function(block) for block in torch.split(flat, size)]
    return torch.cat(parts).reshape(points.shape[:-1])


def destination(*wanted: Any) -> tuple[torch.device | None, torch.dtype | None]:
    """Return a device and a dtype from what `torch.Tensor.to` takes: either, both, or a tensor.

    >>> destination("cpu", torch.float32)
    (device(type='cpu'), torch.float32)
    """
    device: torch.device | None = None
    dtype: torch.dtype | None = None
    for place in wanted:
        if isinstance(place, torch.dtype):
            dtype = place
        elif isinstance(place, Tensor):
            device, dtype = place.device, place.dtype
        elif place is not None:
            try:
                device = torch.device(place)
            except (RuntimeError, TypeError) as error:
                raise OrbiflowError(
                    f"expected a device or a dtype, such as 'cuda' or torch.float32, got {place!r}"
                ) from error
    if dtype is not None and not dtype.is_floating_point:
        raise OrbiflowError(f"a density is evaluated in floating-point numbers, not in {dtype}")
    return device, dtype


def moved(value: Any, device: torch.device | None, dtype: torch.dtype | None = None) -> Any:
    """Return a copy on the device of whatever can be moved; only modules change their dtype."""
    if isinstance(value, nn.Module):  # which would move in place
        return copy.deepcopy(value).to(device=device, dtype=dtype)
    return value.to(device) if device is not None and hasattr(value, "to") else value


def source_of(generator: torch.Generator | None) -> torch.Generator:
    """Return the source of random numbers, by default torch's own."""
    if generator is None:
        return torch.default_generator
    if generator.device.type != "cpu":
        raise OrbiflowError(
            f"samples are drawn on the CPU, the generator is on {generator.device}: give a "
            "torch.Generator() without a device"
        )
    return generator


def shape_of(sample_shape: Any) -> torch.Size:
    """Return the shape of samples, which may be given as their number."""
    sizes = (int(sample_shape),) if isinstance(sample_shape, numbers.Integral) else sample_shape
    try:
        shape = torch.Size(sizes)
    except TypeError as error:
        raise OrbiflowError(f"expected a number or shape of samples: {error}") from error
    if any(size < 0 for size in shape):
        raise OrbiflowError(f"expected a number or shape of samples, got {tuple(shape)}")
    return shape
