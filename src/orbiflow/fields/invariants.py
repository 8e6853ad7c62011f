"""The Fourier coefficients that are invariant under a crystallographic group (design point 3)."""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
import torch
from torch import Tensor, nn

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup, cached_by_basis, checked_group

# the largest number of real coefficients before symmetrization, for about a gigabyte of memory
MAX_COEFFICIENTS = 2_000_000


@dataclass(frozen=True, eq=False)
class InvariantBasis:
    """An orthonormal basis of the invariant real trigonometric vector fields of bounded frequency.

    A field is V(p) = z_0 + sum over `frequencies` of sqrt(2) (a cos(phase) + b sin(phase)), where
    phase = 2 pi k . B^-1 p and one of k, -k is listed. The flat coefficient vector holds, for each k,
    a then b (d numbers each; for k = 0 the b are void). Entry (row, column, value) of the sparse
    basis takes parameter `column` to coefficient `row`; columns are orthonormal, so the Euclidean norm
    of the parameters is the root mean square of the field.

    Args:
        frequencies: Integers (M, d), k = 0 first.
        rows, columns, values: The entries of the sparse basis, (nnz,) each.
        size: The number of parameters P.
        magnitude: |kappa| (P,) of each parameter, kappa = B^-T k, per unit of length.
    """

    frequencies: Array
    rows: Array
    columns: Array
    values: Array
    size: int
    magnitude: Array


def frequency_set(group: CrystallographicGroup, max_frequency: int) -> Array:
    """Return (M, d) integer frequencies, one of each pair +-k, k = 0 first.

    The box |k_i| <= max_frequency and its images under the dual point group: a set that is not a
    union of orbits would lose symmetry (hexagonal groups).

    Raises:
        OrbiflowError: if `max_frequency` is negative or too large to handle.
    """
    if isinstance(max_frequency, bool) or int(max_frequency) != max_frequency or max_frequency < 0:
        raise OrbiflowError(f"max_frequency must be an integer >= 0, got {max_frequency!r}")
    max_frequency = int(max_frequency)
    side = 2 * max_frequency + 1
    if side**group.dim * group.dim > MAX_COEFFICIENTS:
        raise OrbiflowError(
            f"max_frequency {max_frequency} in {group.dim} dimensions needs "
            f"{side**group.dim * group.dim:,} coefficients, over the limit of "
            f"{MAX_COEFFICIENTS:,}; choose a smaller one"
        )
    axis = np.arange(-max_frequency, max_frequency + 1)
    box = np.stack(np.meshgrid(*[axis] * group.dim, indexing="ij"), axis=-1).reshape(-1, group.dim)
    images = np.concatenate([box @ m for m in np.unique(_integral_parts(group), axis=0)])
    return np.unique(_half(images)[0], axis=0)


def _integral_parts(group: CrystallographicGroup) -> Array:
    """Return (|G|, d, d) integer matrices B^-1 R B; a frequency k (a row) goes to k @ M."""
    m = group.inverse_lattice @ group.linear_parts @ group.lattice
    return np.round(m).astype(np.int64)


def _half(k: Array) -> tuple[Array, Array]:
    """Return the lexicographically non-negative one of k and -k, and whether it was -k."""
    first = np.zeros(len(k), dtype=np.int64)
    for column in range(k.shape[1] - 1, -1, -1):
        first = np.where(k[:, column] != 0, k[:, column], first)
    flipped = first < 0
    return np.where(flipped[:, None], -k, k), flipped


def _index(frequencies: Array, k: Array) -> Array:
    """Return rows of `frequencies` (sorted lexicographically) at which the rows of `k` stand."""
    base = int(np.abs(frequencies).max(initial=0)) * 2 + 3
    radix = base ** np.arange(frequencies.shape[1] - 1, -1, -1, dtype=np.int64)
    return np.searchsorted(frequencies @ radix, k @ radix)


def _action(group: CrystallographicGroup, frequencies: Array) -> tuple[Array, Array]:
    """Return where each element sends each frequency, and the (2d, 2d) block it applies.

    (g V)(p) = R^-1 V(R p + t) sends the coefficient at k to k M times R^-1 exp(2 pi i k . B^-1 t).
    """
    d = group.dim
    integral = _integral_parts(group)
    targets = np.empty((group.order, len(frequencies)), dtype=np.int64)
    blocks = np.zeros((group.order, len(frequencies), 2, d, 2, d))
    for g, element in enumerate(group.cosets):
        image, flipped = _half(frequencies @ integral[g])
        targets[g] = _index(frequencies, image)
        turns = frequencies @ (group.inverse_lattice @ element.translation)
        phase = 2 * np.pi * (turns - np.round(turns))
        c, s = np.cos(phase)[:, None, None], np.sin(phase)[:, None, None]
        sign = np.where(flipped, -1.0, 1.0)[:, None, None]
        inverse = element.linear.T
        # z = a - i b times exp(i phase); the complex conjugate where -k is the listed one
        blocks[g, :, 0, :, 0, :] = c * inverse
        blocks[g, :, 0, :, 1, :] = s * inverse
        blocks[g, :, 1, :, 0, :] = -s * sign * inverse
        blocks[g, :, 1, :, 1, :] = c * sign * inverse
    return targets, blocks.reshape(group.order, len(frequencies), 2 * d, 2 * d)


def _orthonormal_columns(projector: Array) -> Array:
    """Return the basis of the range of an orthogonal projector, by Gram-Schmidt in a fixed order.

    Deterministic, unlike eigenvectors of a repeated eigenvalue: saved parameters depend on it.
    """
    basis = np.empty((len(projector), 0))
    for column in projector.T:
        for _ in range(2):  # twice is enough (Kahan)
            column = column - basis @ (basis.T @ column)
        norm = np.linalg.norm(column)
        if norm > 1e-3:
            basis = np.column_stack([basis, column / norm])
    return basis


@cached_by_basis(maxsize=64)  # a flow of many segments shares one basis
def invariant_basis(group: CrystallographicGroup, max_frequency: int) -> InvariantBasis:
    """Build the basis orbit by orbit: the range of the mean over coset representatives.

    Raises:
        OrbiflowError: if `max_frequency` is negative or too large to handle.
    """
    d = group.dim
    frequencies = frequency_set(group, max_frequency)
    targets, blocks = _action(group, frequencies)
    rows: list[Array] = []
    columns: list[Array] = []
    values: list[Array] = []
    magnitude: list[Array] = []
    orbit_of = targets.min(axis=0)
    size = 0
    for orbit in _members(orbit_of):
        m = len(orbit)
        local = np.searchsorted(orbit, targets[:, orbit])
        projector = np.zeros((m, 2 * d, m, 2 * d))
        for g, source in itertools.product(range(group.order), range(m)):
            projector[local[g, source], :, source, :] += blocks[g, orbit[source]]
        projector /= group.order
        if not frequencies[orbit[0]].any():
            projector[:, d:] = projector[:, :, :, d:] = 0.0
        basis = _orthonormal_columns(projector.reshape(2 * d * m, 2 * d * m))
        row, column = np.nonzero(np.abs(basis) > 1e-14)
        values.append(basis[row, column])
        rows.append(orbit[row // (2 * d)] * 2 * d + row % (2 * d))
        columns.append(column + size)
        count: int = basis.shape[1]
        kappa = np.linalg.norm(group.inverse_lattice.T @ frequencies[orbit[0]])
        magnitude.append(np.full(count, kappa))
        size += count
    return InvariantBasis(
        frequencies,
        np.concatenate(rows),
        np.concatenate(columns),
        np.concatenate(values),
        size,
        np.concatenate(magnitude),
    )


def _members(labels: Array) -> list[Array]:
    """Return positions that share a label, each list ascending, in the order of the labels."""
    order = np.argsort(labels, kind="stable")
    cuts = np.flatnonzero(np.diff(labels[order])) + 1
    return np.split(order, cuts)


class InvariantField(nn.Module, ABC):
    """A vector field V with V(g p) = R_g V(p), linear in its parameters.

    The parameters are coordinates in an orthonormal basis of the invariant Fourier coefficients
    (paper, section 3; design points 2-4), each multiplied by `scale`.

    - `parameters_`: The coordinates (P,), or (S, P) for a stack of S independent fields.
    - `basis`: The coefficients that the parameters stand for.
    - `size`: The number of parameters P.
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
        """Return buffers by name; segments of a flow should share them."""

    @abstractmethod
    def adjoint(self, points: Tensor, forces: Tensor) -> Tensor:
        """Return the gradient (P,) of sum forces . V(points) in the parameters; inputs (N, d)."""

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
        # a float32 field converted to float64 must be as symmetric as one created in float64
        super()._apply(fn, recurse)  # pyright: ignore[reportUnknownMemberType]
        self._fill_buffers()
        return self

    def extra_repr(self) -> str:
        return f"{self.group!r}, max_frequency={self.max_frequency}, parameters={self.size}"


def sobolev_weights(
    group: CrystallographicGroup, basis: InvariantBasis, smoothness: float
) -> Array:
    """Return (P,) factors (1 + |kappa|^2 vol^(2/d))^(-smoothness / 2), free of the unit of length."""
    size = group.cell_volume ** (1 / group.dim)
    return (1.0 + (basis.magnitude * size) ** 2) ** (-smoothness / 2)


def constant_tensors(
    layout: tuple[Array, Array, Array], dtype: torch.dtype, device: torch.device, **others: Array
) -> dict[str, Tensor]:
    """Return a sparse basis (rows, columns, values) and other real arrays as tensors by name."""
    rows, columns, values = layout
    reals = {"values": values, **others}
    return {
        "rows": torch.tensor(rows, device=device),
        "columns": torch.tensor(columns, device=device),
        **{name: torch.tensor(x, dtype=dtype, device=device) for name, x in reals.items()},
    }
