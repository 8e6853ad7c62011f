"""Bounds of the Jacobian of a field of invariant waves.

A wave of unit root mean square is sqrt 2 (a cos(phase) + b sin(phase)) at each frequency kappa of an
orbit, with |a|^2 + |b|^2 summed over the orbit equal to 1. Its Jacobian is the sum over the orbit of

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

from __future__ import annotations

import itertools
import math
from functools import lru_cache

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.fields.invariants import InvariantBasis
from orbiflow.symmetry import CrystallographicGroup

# the largest number of terms whose signs are all tried; orbits of plane groups have no more
MAX_SIGNED_TERMS = 6


def steepness(parameters: Tensor, magnitude: Tensor) -> Tensor:
    """Return sum_j |c_j| 2 pi sqrt 2 |kappa_j|: times `group_factor`, a bound of |DV| anywhere.

    Args:
        parameters: Coordinates c (..., P) in the orthonormal basis.
        magnitude: |kappa| (P,) of each, `InvariantBasis.magnitude`.

    Returns:
        The bounds (...,), per unit of time.
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
    """Return an upper bound of the Jacobian's spectral norm for given coefficients.

    The bound is the sum over kappa of 2 pi sqrt 2 |kappa| |[a, b]|.

    Sharper than `group_factor` for given coefficients, since parameters at one frequency are added
    before their size is taken.

    Args:
        coefficients: Coordinates (S, P) in the orthonormal basis.

    Returns:
        The bounds (S,).
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
