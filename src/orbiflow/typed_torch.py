"""Types of the torch functions that have none: the same functions under the same names.

torch's compiled functions have no signatures and some of its Python functions no annotations. Stubs
cannot replace this file: a partial stub package makes pyright lose the rest of torch's own types.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from typing import Any, Literal, Protocol, overload

import torch
from torch import Tensor
from torch.autograd import Function
from torch.optim import Optimizer

Normalisation = Literal["forward", "backward", "ortho"]


class _Special(Protocol):
    def i0e(self, input: Tensor) -> Tensor: ...
    def i1e(self, input: Tensor) -> Tensor: ...


class _Linalg(Protocol):
    def cross(self, input: Tensor, other: Tensor, *, dim: int = -1) -> Tensor: ...
    def det(self, A: Tensor) -> Tensor: ...
    def inv(self, A: Tensor) -> Tensor: ...
    def solve(self, A: Tensor, B: Tensor, *, left: bool = True) -> Tensor: ...
    def vector_norm(
        self,
        x: Tensor,
        ord: float = 2,
        dim: int | Sequence[int] | None = None,
        keepdim: bool = False,
    ) -> Tensor: ...


class _Transform(Protocol):
    def __call__(
        self,
        input: Tensor,
        s: Sequence[int] | None = None,
        dim: Sequence[int] | None = None,
        norm: Normalisation | None = None,
    ) -> Tensor: ...


class _Fft(Protocol):
    def fft(
        self, input: Tensor, n: int | None = None, dim: int = -1, norm: Normalisation | None = None
    ) -> Tensor: ...

    fft2: _Transform
    ifft2: _Transform
    fftn: _Transform
    ifftn: _Transform
    irfftn: _Transform


class _Random(Protocol):
    def fork_rng(
        self, devices: Sequence[torch.device | str | int]
    ) -> AbstractContextManager[None]: ...
    def manual_seed(self, seed: int) -> torch.Generator: ...


class _Unique(Protocol):
    @overload
    def __call__(self, input: Tensor, *, dim: int | None = None) -> Tensor: ...
    @overload
    def __call__(
        self, input: Tensor, *, return_inverse: Literal[True], dim: int | None = None
    ) -> tuple[Tensor, Tensor]: ...
    @overload
    def __call__(
        self,
        input: Tensor,
        *,
        return_inverse: Literal[True],
        return_counts: Literal[True],
        dim: int | None = None,
    ) -> tuple[Tensor, Tensor, Tensor]: ...


class _Broadcast(Protocol):
    def __call__(self, *tensors: Tensor) -> tuple[Tensor, ...]: ...


_torch: Any = torch
special: _Special = _torch.special
linalg: _Linalg = _torch.linalg
fft: _Fft = _torch.fft
random: _Random = _torch.random
unique: _Unique = _torch.unique
broadcast: _Broadcast = _torch.broadcast_tensors


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
