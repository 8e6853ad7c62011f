"""Arguments of public functions: what can be used is, the rest is refused in our words."""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable
from typing import Any, TypeVar

import numpy as np
import torch
from torch import Tensor

from orbiflow.errors import OrbiflowError

T = TypeVar("T")


def check_kind(value: Any, kind: type[T], name: str, hint: str = "") -> T:
    """
    Raises:
        OrbiflowError: if `value` is not of the class `kind`.

    >>> check_kind("torus", int, "dim")
    Traceback (most recent call last):
    orbiflow.errors.OrbiflowError: dim must be of the class int, got 'torus'
    """
    if not isinstance(value, kind):
        shown = repr(value) if len(repr(value)) < 60 else f"a {type(value).__name__}"
        more = f": {hint}" if hint else ""
        raise OrbiflowError(f"{name} must be of the class {kind.__name__}, got {shown}{more}")
    return value


def silent(*_: object) -> None:
    """No progress wanted."""


def check_range(name: str, value: Any, low: float, high: float, *, integer: bool = False) -> None:
    """
    Raises:
        OrbiflowError: unless `value` is a number, or an integer, from `low` to `high`.
    """
    kind = numbers.Integral if integer else numbers.Real
    fits = not isinstance(value, bool) and isinstance(value, kind)
    if not fits or not low <= float(value) <= high:
        what = "an integer " if integer and not fits else ""
        least = f"{'of ' if what else ''}at least {low:g}"
        limits = f"from {low:g} to {high:g}" if high < math.inf else least
        raise OrbiflowError(f"{name} must be {what}{limits}, got {value!r}")


def check_ranges(
    settings: Any, ranges: Iterable[tuple[str, float, float]], *, integer: bool = False
) -> None:
    """`check_range` for attributes of `settings`."""
    for name, low, high in ranges:
        check_range(name, getattr(settings, name), low, high, integer=integer)


def check_share(value: Any, name: str = "validation") -> None:
    """
    Raises:
        OrbiflowError: unless `value` is a number between 0 and 1.
    """
    if not isinstance(value, numbers.Real) or not 0 < float(value) < 1:
        raise OrbiflowError(f"{name} must be between 0 and 1, got {value!r}")


def float_tensor(value: Any, name: str) -> Tensor:
    """A floating-point tensor as it is; integers and what NumPy takes in float64.

    Raises:
        OrbiflowError: for what is no array of real numbers.

    >>> float_tensor([[1, 2]], "points")
    tensor([[1., 2.]], dtype=torch.float64)
    """
    if not isinstance(value, Tensor):
        try:
            value = torch.as_tensor(np.array(value, dtype=np.float64))
        except (TypeError, ValueError) as error:
            raise OrbiflowError(f"{name}: expected real numbers, got {error}") from error
    if value.is_complex():
        raise OrbiflowError(f"{name}: expected real numbers, got {value.dtype}")
    return value if value.is_floating_point() else value.double()


def points_tensor(value: Any, dim: int, name: str = "points", *, flat: bool = False) -> Tensor:
    """Points (..., dim), or (N, dim) if `flat`, by `float_tensor`, all finite.

    Raises:
        OrbiflowError: for another shape, or values that are not finite.
    """
    points = float_tensor(value, name)
    if not points.dim() or points.shape[-1] != dim or (flat and points.dim() != 2):
        lead = "N" if flat else "..."
        raise OrbiflowError(f"expected {name} ({lead}, {dim}), got {tuple(points.shape)}")
    if not bool(torch.isfinite(points.detach()).all()):
        raise OrbiflowError(f"{name} must be finite; remove what is missing or infinite first")
    return points
