"""The Fourier coefficients that are invariant under a crystallographic group (design point 3).

Bounds of their fields' Jacobians follow from the waves. A wave of unit root mean square is
sqrt 2 (a cos(phase) + b sin(phase)) at each frequency kappa of an orbit, with |a|^2 + |b|^2 summed over
the orbit equal to 1. Its Jacobian is the sum over the orbit of

    2 pi sqrt 2 (b cos(phase) - a sin(phase)) (x) kappa.

A single frequency is therefore at most 2 pi sqrt 2 |kappa| steep; `steepness` adds that up. An orbit
of M pairs +-kappa can be `group_factor` times steeper: sqrt M by the triangle inequality and the even
share 1 / sqrt M of each, but less where the matrices at its frequencies point differently.

Proof of the smaller bound. Decompose the (d, 2) matrix [b, -a] at each frequency as the sum of its
singular values times u (x) v: as (cos, sin) runs over the unit circle, v . (cos, sin) stays in
[-1, 1]. So the Jacobian is 2 pi sqrt 2 times a sum of s_i A_i with A_i = sigma_i u_i (x) kappa_i and
s_i in [-1, 1]. The spectral norm is convex in s, hence largest at a corner of the cube: the largest
over all choices of signs is a bound, and there are few signs (design point 17).
"""

import copy
import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
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

    The box |k_i| <= max_frequency and its images under the dual point group, rows k @ B^-1 R B: a set
    that is not a union of orbits would lose symmetry (hexagonal groups).
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
    images = np.concatenate([box @ m for m in np.unique(group.integral_parts, axis=0)])
    return np.unique(_half(images)[0], axis=0)


def _half(k: Array) -> tuple[Array, Array]:
    """Return the lexicographically non-negative one of k and -k, and whether it was -k."""
    first = np.zeros(len(k), dtype=np.int64)
    for column in range(k.shape[1] - 1, -1, -1):
        first = np.where(k[:, column] != 0, k[:, column], first)
    flipped = first < 0
    return np.where(flipped[:, None], -k, k), flipped


def _action(group: CrystallographicGroup, frequencies: Array) -> tuple[Array, Array]:
    """Return where each element sends each frequency, and the (2d, 2d) block it applies.

    (g V)(p) = R^-1 V(R p + t) sends the coefficient at k to k M times R^-1 exp(2 pi i k . B^-1 t).
    """
    d = group.dim
    integral = group.integral_parts
    targets = np.empty((group.order, len(frequencies)), dtype=np.int64)
    blocks = np.zeros((group.order, len(frequencies), 2, d, 2, d))
    base = int(np.abs(frequencies).max(initial=0)) * 2 + 3
    radix = base ** np.arange(d - 1, -1, -1, dtype=np.int64)  # frequencies are sorted by digits
    for g, element in enumerate(group.cosets):
        image, flipped = _half(frequencies @ integral[g])
        targets[g] = np.searchsorted(frequencies @ radix, image @ radix)
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
def invariant_basis(
    group: CrystallographicGroup, max_frequency: int, divergence_free: bool = False
) -> InvariantBasis:
    """Build the basis orbit by orbit: the range of the mean over coset representatives.

    A field has no divergence if each coefficient is at a right angle to its frequency (design point
    24). The projection onto these commutes with the group, which turns both alike.
    """
    d = group.dim
    frequencies = frequency_set(group, max_frequency)
    targets, blocks = _action(group, frequencies)
    entries: list[tuple[Array, Array, Array]] = []
    magnitude: list[Array] = []
    orbit_of = targets.min(axis=0)
    size = 0
    order = np.argsort(orbit_of, kind="stable")
    cuts = np.flatnonzero(np.diff(orbit_of[order])) + 1
    for orbit in np.split(order, cuts):  # positions that share an orbit, each ascending
        m = len(orbit)
        local = np.searchsorted(orbit, targets[:, orbit])
        projector = np.zeros((m, 2 * d, m, 2 * d))
        for g, source in itertools.product(range(group.order), range(m)):
            projector[local[g, source], :, source, :] += blocks[g, orbit[source]]
        projector /= group.order
        if not frequencies[orbit[0]].any():
            projector[:, d:] = projector[:, :, :, d:] = 0.0
        waves = frequencies[orbit] @ group.inverse_lattice
        if divergence_free and waves.any():
            across = (
                np.eye(d) - waves[:, :, None] * waves[:, None] / (waves**2).sum(1)[:, None, None]
            )
            both = np.einsum("mij,mkjnl->mkinl", across, projector.reshape(m, 2, d, m, 2 * d))
            projector = both.reshape(projector.shape)
        basis = _orthonormal_columns(projector.reshape(2 * d * m, 2 * d * m))
        row, column = np.nonzero(np.abs(basis) > 1e-14)
        place: Array = orbit[row // (2 * d)] * 2 * d + row % (2 * d)
        entries.append((place, column + size, basis[row, column]))
        kappa = np.linalg.norm(group.inverse_lattice.T @ frequencies[orbit[0]])
        count: int = basis.shape[1]
        magnitude.append(np.full(count, kappa))
        size += count
    rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
    return InvariantBasis(frequencies, rows, columns, values, size, np.concatenate(magnitude))


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
    frame: Tensor
    stackable = False  # whether the parameters may be those of a stack
    can_be_divergence_free = False  # whether its coefficients are those of waves

    def __init__(
        self,
        group: CrystallographicGroup,
        max_frequency: int,
        *,
        batch: int | None = None,
        smoothness: float = 0.0,
        divergence_free: bool = False,
        dtype: torch.dtype = torch.float64,
        device: torch.device | str | None = None,
    ) -> None:
        super().__init__()
        if divergence_free and not self.can_be_divergence_free:
            raise OrbiflowError(
                f"a {type(self).__name__} cannot be without divergence; take a FourierField"
            )
        if batch is not None and not self.stackable:
            raise OrbiflowError(f"a {type(self).__name__} cannot be a stack; leave batch out")
        self.group = checked_group(group)
        self.smoothness = smoothness
        self.divergence_free = bool(divergence_free)
        self.basis: InvariantBasis = invariant_basis(group, max_frequency, self.divergence_free)
        self.max_frequency = int(max_frequency)
        self.size = self.basis.size
        shape = (self.size,) if batch is None else (batch, self.size)
        with torch.inference_mode(False):
            self.parameters_ = nn.Parameter(torch.zeros(shape, dtype=dtype, device=device))
        self._fill_buffers()

    @staticmethod
    @abstractmethod
    def layout(group: CrystallographicGroup, basis: InvariantBasis) -> tuple[Array, Array, Array]:
        """Return the basis in the coefficients that the field evaluates, as (row, column, value)."""

    @abstractmethod
    def bound(self) -> Callable[[Tensor], Tensor]:
        """Return the field as a function for many evaluations at its present parameters."""

    def forward(self, points: Tensor) -> Tensor:
        """Return V at points (..., d): vectors of the same shape."""
        return self.bound()(points)

    @abstractmethod
    def adjoint(self, points: Tensor, forces: Tensor) -> Tensor:
        """Return the gradient (P,) of sum forces . V(points) in the parameters; inputs (N, d)."""

    def with_parameters(self, parameters: Tensor) -> Self:
        """Return the field with other parameters, such as the output of a network, which get gradients.

        Args:
            parameters: (P,) for one field, or (S, P) for a stack of S: of S contexts, say. Only a
                `FourierField` can be a stack.

        Raises `OrbiflowError` for another shape or dtype.

        >>> from orbiflow.fields import FourierField
        >>> from orbiflow.symmetry import wallpaper_group
        >>> field = FourierField(wallpaper_group("p4"), 1)
        >>> context, network = torch.rand(5, 3), torch.nn.Linear(3, field.size)
        >>> each = field.float().with_parameters(network(context))
        >>> each(torch.rand(5, 7, 2)).shape  # seven points of each context
        torch.Size([5, 7, 2])
        """
        current = self.parameters_
        if parameters.shape[-1:] != (self.size,) or parameters.dim() > 1 + self.stackable:
            wanted = f"({self.size},)" + f" or (S, {self.size})" * self.stackable
            raise OrbiflowError(
                f"expected parameters of shape {wanted}, got {tuple(parameters.shape)}"
            )
        if parameters.dtype != current.dtype:
            raise OrbiflowError(
                f"expected parameters of the field's dtype, {current.dtype}, got {parameters.dtype}: "
                f"convert them, or the field with .to({parameters.dtype})"
            )
        view = copy.copy(self)  # shallow: it shares the basis
        view._parameters = {}
        view.parameters_ = parameters  # pyright: ignore[reportAttributeAccessIssue]
        return view

    def _check_points(self, points: Tensor) -> None:
        """Raise OrbiflowError for points that the field cannot be evaluated at."""
        d, parameters = self.group.dim, self.parameters_
        stack = len(parameters) if parameters.dim() == 2 else None
        if points.shape[-1:] != (d,) or (
            stack is not None and (points.dim() < 2 or len(points) != stack)
        ):
            expected = f"(..., {d})" if stack is None else f"({stack}, ..., {d})"
            raise OrbiflowError(f"expected points of shape {expected}, got {tuple(points.shape)}")
        if points.dtype != parameters.dtype:
            raise OrbiflowError(
                f"expected points of the field's dtype, {parameters.dtype}, got {points.dtype}: "
                f"convert the points with .to({parameters.dtype}) or the field with .to({points.dtype})"
            )

    def _fill_buffers(self) -> None:
        parameters = self.parameters_
        which = self.max_frequency, self.divergence_free
        key = *which, self.smoothness, parameters.dtype, parameters.device, self.layout
        for name, tensor in _constants(self.group, *key).items():
            self.register_buffer(name, tensor, persistent=False)

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> Self:
        # a float32 field converted to float64 must be as symmetric as one created in float64
        super()._apply(fn, recurse)  # pyright: ignore[reportUnknownMemberType]
        self._fill_buffers()
        return self

    def extra_repr(self) -> str:
        return f"{self.group!r}, max_frequency={self.max_frequency}, parameters={self.size}"


@cached_by_basis(maxsize=64)  # the segments of a flow share them
@torch.inference_mode(False)  # cached in inference mode, they could never be trained
def _constants(
    group: CrystallographicGroup,
    max_frequency: int,
    divergence_free: bool,
    smoothness: float,
    dtype: torch.dtype,
    device: torch.device,
    layout: Callable[..., tuple[Array, Array, Array]],
) -> dict[str, Tensor]:
    basis = invariant_basis(group, max_frequency, divergence_free)
    rows, columns, values = layout(group, basis)
    size = group.cell_volume ** (1 / group.dim)  # makes the factors free of the unit of length
    scale = (1.0 + (basis.magnitude * size) ** 2) ** (-smoothness / 2)
    reals = {"values": values, "scale": scale, "frame": group.inverse_lattice}
    return {
        "rows": torch.tensor(rows, device=device),
        "columns": torch.tensor(columns, device=device),
        **{name: torch.tensor(x, dtype=dtype, device=device) for name, x in reals.items()},
    }


# the largest number of terms whose signs are all tried; orbits of plane groups have no more
MAX_SIGNED_TERMS = 6


def steepness(parameters: Tensor, magnitude: Tensor) -> Tensor:
    """Return sum_j |c_j| 2 pi sqrt 2 |kappa_j|: times `group_factor`, a bound of |DV| anywhere.

    Coordinates c are (..., P) in the orthonormal basis, |kappa| (P,) is `InvariantBasis.magnitude`.
    """
    return math.sqrt(2.0) * (parameters.abs() * (2.0 * math.pi * magnitude)).sum(dim=-1)


@lru_cache(maxsize=64)  # bases hash by identity
def group_factor(group: CrystallographicGroup, basis: InvariantBasis) -> float:
    """Return the smallest known f with |DV| <= f `steepness` for all parameters and points.

    It depends on the group, its lattice and the frequencies: 1 for p1 and p2, up to sqrt 2 for pg and
    pgg, sqrt 1/2 for p4, sqrt 3/4 for p3 and p6, sqrt 3/2 for p6m.

    >>> from orbiflow.fields import FourierField
    >>> from orbiflow.symmetry import wallpaper_group
    >>> p4 = FourierField(wallpaper_group("p4"), 3)
    >>> round(group_factor(p4.group, p4.basis), 6)
    0.707107
    """
    owner, terms = _terms(group, basis)
    counts = np.bincount(owner, minlength=basis.size)
    steepest = 0.0
    for count in np.unique(counts[counts > 0]):
        mine = terms[np.isin(owner, np.flatnonzero(counts == count))]
        mine = mine.reshape(-1, count, group.dim, group.dim)
        steepest = max(steepest, float(_largest_sum(mine).max()))
    return steepest


def _terms(group: CrystallographicGroup, basis: InvariantBasis) -> tuple[Array, Array]:
    """Return ascending parameter indices (T,) and their matrices A_i (T, d, d) for |kappa| = 1."""
    d, modes = group.dim, len(basis.frequencies)
    pair = basis.columns * modes + basis.rows // (2 * d)
    pairs, place = np.unique(pair, return_inverse=True)
    blocks = np.zeros((len(pairs), 2 * d))
    np.add.at(blocks, (place, basis.rows % (2 * d)), basis.values)
    owner, mode = np.divmod(pairs, modes)
    waves = basis.magnitude[owner] > 0.0
    owner, mode, blocks = owner[waves], mode[waves], blocks[waves].reshape(-1, 2, d)
    u, sigma, _ = np.linalg.svd(blocks.swapaxes(1, 2), full_matrices=False)
    kappa = basis.frequencies[mode] @ group.inverse_lattice
    kappa = kappa / np.linalg.norm(kappa, axis=1, keepdims=True)
    every = np.einsum("tk,tik,tj->tkij", sigma, u, kappa)
    real = sigma > 1e-12
    return np.repeat(owner, real.sum(axis=1)), every[real]


def _largest_sum(terms: Array) -> Array:
    """Return a bound (P,) of the spectral norm of sum_i s_i A_i over all signs, A (P, n, d, d)."""
    count = terms.shape[1]
    if count > MAX_SIGNED_TERMS:
        return np.linalg.norm(terms, axis=(2, 3)).sum(axis=1)
    signs = np.array([(1.0, *s) for s in itertools.product((1.0, -1.0), repeat=count - 1)])
    sums = np.einsum("sn,pnij->psij", signs, terms)
    return np.linalg.norm(sums, ord=2, axis=(2, 3)).max(axis=1)


def coefficient_bound(
    group: CrystallographicGroup, basis: InvariantBasis, coefficients: Tensor
) -> Tensor:
    """Return sum over kappa of 2 pi sqrt 2 |kappa| |[a, b]|, a bound (S,) of the Jacobian's norm.

    Sharper than `group_factor` for given coefficients (S, P), since parameters at one frequency are
    added before their size is taken.
    """
    d, modes = group.dim, len(basis.frequencies)
    rows, columns = (
        torch.as_tensor(index, device=coefficients.device) for index in (basis.rows, basis.columns)
    )
    lengths = np.linalg.norm(basis.frequencies @ group.inverse_lattice, axis=1)
    values, kappa = (torch.as_tensor(x).to(coefficients) for x in (basis.values, lengths))
    z = coefficients.new_zeros(len(coefficients), 2 * d * modes)
    z.index_add_(1, rows, coefficients[:, columns] * values)
    a, b = z.reshape(-1, modes, 2, d).unbind(dim=2)
    # largest singular value of the (d, 2) matrix [a, b]
    half = (a.square().sum(-1) + b.square().sum(-1)) / 2
    skew = (a.square().sum(-1) - b.square().sum(-1)) / 2
    largest = (half + torch.hypot(skew, (a * b).sum(-1))).sqrt()
    return 2.0 * math.pi * math.sqrt(2.0) * largest @ kappa
