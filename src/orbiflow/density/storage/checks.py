"""What is asked of a file's numbers and tensors before they are used."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from torch import Tensor

from orbiflow.errors import OrbiflowError


def checked_tensor(
    name: str, value: Tensor, shape: tuple[int, ...], *, least: float = -1e30
) -> Tensor:
    if tuple(value.shape) != tuple(shape):
        raise OrbiflowError(f"{name} has shape {tuple(value.shape)}, expected {tuple(shape)}")
    if not value.is_floating_point() or not bool(((value >= least) & (value < 1e30)).all()):
        raise OrbiflowError(f"{name} has values that are not finite numbers")
    return value


def checked_integer(header: Mapping[str, Any], name: str, most: int) -> int:
    value = header.get(name)
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= most:
        raise OrbiflowError(f"{name} must be an integer from 1 to {most}, got {value!r}")
    return value
