"""What a part of a conditional density can do."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import torch
from torch import Tensor

from orbiflow.density.models.density import Density
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError


class ConditionalPart(ABC):
    """A density of points of a space where features of covariates are known.

    - `kind`: Its name in files and reports.
    - `stored`: The names of the tensors that make it again.
    """

    kind: ClassVar[str]
    stored: ClassVar[tuple[str, ...]] = ()
    space: Space

    @abstractmethod
    def log_prob(self, points: Tensor, x: Tensor) -> Tensor:
        """Return log densities (N,) per area of the chart at points (N, d) and features (N, m)."""

    @abstractmethod
    def at(self, x: Tensor) -> Density:
        """Return the density where the features are x (m,)."""

    def header(self) -> dict[str, Any]:
        """Return what makes it again, together with `tensors`; ready for JSON."""
        return {}

    def tensors(self) -> dict[str, Tensor]:
        """Return its tensors by name."""
        pairs = ((name, getattr(self, name)) for name in self.stored)
        return {name: tensor for name, tensor in pairs if tensor is not None}

    @classmethod
    @abstractmethod
    def from_header(
        cls, space: Space, number: Tensor, header: Mapping[str, Any], tensors: Mapping[str, Tensor]
    ) -> ConditionalPart:
        """Make it again; `number` (m,) says of which covariate each feature is.

        Raises `OrbiflowError` for what cannot be.
        """


LEAST_LOG_KAPPA, MOST_LOG_KAPPA = math.log(0.02), math.log(1e6)
"""Logarithms of the least and largest concentration of kernels that are fitted."""


def checked(
    tensors: Mapping[str, Tensor], shapes: Mapping[str, Sequence[int]], what: str
) -> list[Tensor]:
    """Return tensors by name, in the order of their shapes; raise `OrbiflowError` for others."""
    ordered = [tensors[name] for name in shapes]
    if not all(
        tensor.shape == tuple(shape)
        and tensor.dtype == torch.float64
        and bool(tensor.isfinite().all())
        for tensor, shape in zip(ordered, shapes.values(), strict=True)
    ):
        raise OrbiflowError(f"{what} of other shapes or values")
    return ordered
