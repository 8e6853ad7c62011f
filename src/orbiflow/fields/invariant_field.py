"""What the fields with invariant Fourier coefficients as parameters have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Self

import numpy as np
import torch
from torch import Tensor, nn

from orbiflow.errors import OrbiflowError
from orbiflow.fields.invariants import InvariantBasis, invariant_basis
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.symmetry.group import checked_group


class InvariantField(nn.Module, ABC):
    """A vector field V with V(g p) = R_g V(p), linear in its parameters.

    The parameters are coordinates in an orthonormal basis of the invariant Fourier coefficients
    (paper, section 3; design points 2-4), each multiplied by `scale`.

    - `parameters_`: (P,), or (S, P) for a stack of S independent fields.
    - `basis`: the coefficients that the parameters stand for.
    - `size`: P.
    """

    rows: Tensor
    columns: Tensor
    values: Tensor
    scale: Tensor

    def __init__(
        self,
        group: CrystallographicGroup,
        max_frequency: int,
        *,
        batch: int | None = None,
        smoothness: float,
        dtype: torch.dtype,
        device: torch.device | str | None,
    ) -> None:
        super().__init__()
        self.group = checked_group(group)
        self.smoothness = smoothness
        self.basis: InvariantBasis = invariant_basis(group, max_frequency)
        self.max_frequency = int(max_frequency)
        self.size = self.basis.size
        shape = (self.size,) if batch is None else (batch, self.size)
        with torch.inference_mode(False):
            self.parameters_ = nn.Parameter(torch.zeros(shape, dtype=dtype, device=device))

    @abstractmethod
    def _constants(self, dtype: torch.dtype, device: torch.device) -> dict[str, Tensor]:
        """Buffers by name; segments of a flow should share them."""

    @abstractmethod
    def adjoint(self, points: Tensor, forces: Tensor) -> Tensor:
        """Gradient (P,) of sum forces . V(points) in the parameters; points, forces (N, d)."""

    def _check_points(self, points: Tensor) -> None:
        """Raise OrbiflowError for points that the field cannot be evaluated at."""
        d, own = self.group.dim, self.parameters_
        stack = len(own) if own.dim() == 2 else None
        if points.shape[-1:] != (d,) or (
            stack is not None and (points.dim() < 2 or len(points) != stack)
        ):
            expected = f"(..., {d})" if stack is None else f"({stack}, ..., {d})"
            raise OrbiflowError(f"expected points of shape {expected}, got {tuple(points.shape)}")
        if points.dtype != own.dtype:
            raise OrbiflowError(
                f"expected points of the field's dtype, {own.dtype}, got {points.dtype}: convert the "
                f"points with .to({own.dtype}) or the field with .to({points.dtype})"
            )

    def _fill_buffers(self) -> None:
        like = self.parameters_
        for name, tensor in self._constants(like.dtype, like.device).items():
            self.register_buffer(name, tensor, persistent=False)

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> Self:
        # a float32 field made float64 must be as symmetric as one born in float64
        super()._apply(fn, recurse)  # pyright: ignore[reportUnknownMemberType]
        self._fill_buffers()
        return self

    def extra_repr(self) -> str:
        return f"{self.group!r}, max_frequency={self.max_frequency}, parameters={self.size}"


def sobolev_weights(
    group: CrystallographicGroup, basis: InvariantBasis, smoothness: float
) -> np.ndarray:
    """(P,) factors (1 + |kappa|^2 vol^(2/d))^(-smoothness / 2), free of the unit of length."""
    size = group.cell_volume ** (1 / group.dim)
    return (1.0 + (basis.magnitude * size) ** 2) ** (-smoothness / 2)
