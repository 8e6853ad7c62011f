"""Fourier fields: trigonometric vector fields that commute with a crystallographic group."""

import math
from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.fields.invariants import InvariantBasis, InvariantField, coefficient_bound
from orbiflow.fields.series import differentiate, evaluate, weight_cotangent
from orbiflow.symmetry import CrystallographicGroup


class FourierField(InvariantField):
    """A vector field V with V(g p) = R_g V(p) for every g in the group.

    The parameters are coordinates in an orthonormal basis of the invariant Fourier coefficients, so
    an evaluation costs one Fourier sum for any group (paper, section 3; design points 2-4). Their
    Euclidean norm is the root mean square of the field.

    Args:
        group: The symmetry of the field.
        max_frequency: The paper's Omega: |k_i| <= Omega and the images of that box.
        batch: The size S of a stack of independent fields, or None for one field.
        smoothness: The power s >= 0; the parameter of frequency kappa is multiplied by
            (1 + |kappa|^2 vol^(2/d))^(-s / 2), which makes descent in the parameters Sobolev descent.
        dtype, device: The dtype and the device of the parameters.

    Shapes:
        `parameters_`: (P,) or (S, P). Points (..., d), or (S, ..., d) for a stack.

    Raises `OrbiflowError` for a negative, fractional or too large `max_frequency`.

    >>> from orbiflow.symmetry import rotation, wallpaper_group
    >>> field = FourierField(wallpaper_group("p4"), 5)
    >>> field.size
    60
    """

    def __init__(
        self,
        group: CrystallographicGroup,
        max_frequency: int,
        *,
        batch: int | None = None,
        smoothness: float = 0.0,
        dtype: torch.dtype = torch.float64,
        device: torch.device | str | None = None,
    ) -> None:
        super().__init__(
            group, max_frequency, batch=batch, smoothness=smoothness, dtype=dtype, device=device
        )
        self._orders = _orders(self.basis)

    @staticmethod
    def layout(group: CrystallographicGroup, basis: InvariantBasis) -> tuple[Array, Array, Array]:
        """Rewrite the invariant basis in the tensor basis of `series`, as sparse (row, column, value).

        exp(2 pi i k.u) is a product over the axes of cos(2 pi k u) + i sin(2 pi k u): each mode becomes
        2^d products of cosines and sines.
        """
        d, orders = group.dim, _orders(basis)
        mode, within = basis.rows // (2 * d), basis.rows % (2 * d)
        is_sine, component = within // d, within % d
        k = basis.frequencies[mode]
        size = np.abs(k)
        norm = np.where(k.any(axis=1), math.sqrt(2.0), 1.0)
        entries: list[tuple[Array, Array, Array]] = []
        for choice in np.ndindex(*(2,) * d):
            sines = np.array(choice)
            # i^(number of sines): real for cosines of the phase, imaginary for sines
            quarter = sines.sum()
            flips = ((sines == 1) & (k < 0)).sum(axis=1)
            sign = (-1.0) ** (quarter // 2 + flips)
            exists = ~((sines == 1) & (k == 0)).any(axis=1)
            keep = exists & (quarter % 2 == is_sine)
            position = size + sines * np.array(orders)
            flat = component.copy()
            for axis in range(d):
                flat = flat * (2 * orders[axis] + 1) + position[:, axis]
            weights = basis.values * norm * sign
            entries.append((flat[keep], basis.columns[keep], weights[keep]))
        rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
        return rows, columns, values

    @staticmethod
    def _stacked(parameters: Tensor) -> Tensor:
        # not reshape(-1, P): P is 0 for Omega = 0 and a group without invariant vectors
        return parameters if parameters.dim() == 2 else parameters.unsqueeze(0)

    def weights(self) -> Tensor:
        """Return the Fourier weights in the tensor basis of `series`.

        Shape (S, d, A_1, ..., A_d), with S = 1 for a single field.
        """
        flat = self._stacked(self.parameters_) * self.scale
        shape = (self.group.dim, *(2 * k + 1 for k in self._orders))
        weights = flat.new_zeros(flat.shape[0], math.prod(shape))
        weights = weights.index_add(1, self.rows, flat[:, self.columns] * self.values)
        return weights.reshape(flat.shape[0], *shape)

    def bound(self) -> Callable[[Tensor], Tensor]:
        """Return the field with its weights computed once, for many evaluations (an integrator's)."""
        weights = self.weights()
        return lambda points: self._values(weights, points)

    @torch.no_grad()
    def adjoint(self, points: Tensor, forces: Tensor) -> Tensor:
        """Return the gradient of sum forces . V(points) in the parameters, without autograd.

        This is the projection of a force on the invariant fields (design point 10). V is linear in
        the parameters, so their values do not matter.

        Args:
            points, forces: Arrays (N, d), or (S, N, d) for a stack.

        Returns:
            (P,) or (S, P).
        """
        flat, cotangents = (
            t.reshape(self._stacked(self.parameters_).shape[0], -1, self.group.dim)
            for t in (points, forces)
        )
        shape = (len(flat), self.group.dim, *(2 * k + 1 for k in self._orders))
        table = weight_cotangent(shape, self.frame @ flat.mT, cotangents.mT).flatten(1)
        gradient = flat.new_zeros(len(flat), self.size)
        gradient.index_add_(1, self.columns, table[:, self.rows] * self.values)
        return (gradient * self.scale).reshape(self.parameters_.shape)

    def forward(self, points: Tensor) -> Tensor:
        """Return V at points (..., d): vectors of the same shape."""
        return self._values(self.weights(), points)

    def divergence(self, points: Tensor) -> Tensor:
        """Return the trace of the Jacobian, (...,), in closed form: itself one Fourier sum."""
        return self._values(self._divergence_weights(self.weights()), points)[..., 0]

    def bound_with_divergence(self) -> Callable[[Tensor], tuple[Tensor, Tensor]]:
        """Return, as `bound` does, a function for V and its divergence from one matrix product."""
        weights = self.weights()
        joint = torch.cat([weights, self._divergence_weights(weights)], dim=1)

        def both(points: Tensor) -> tuple[Tensor, Tensor]:
            values = self._values(joint, points)
            return values[..., :-1], values[..., -1]

        return both

    def jacobian(self, points: Tensor) -> Tensor:
        """Return dV_i / dp_j as (..., d, d): d^2 Fourier sums from one matrix product."""
        d = self.group.dim
        weights = self.weights()
        by_axis = torch.stack([differentiate(weights, j, d) for j in range(d)], dim=2)
        flat = torch.einsum("sij...,jk->sik...", by_axis, self.frame).flatten(1, 2)
        values = self._values(flat, points)
        return values.reshape(*values.shape[:-1], d, d)

    def lipschitz_bound(self) -> Tensor:
        """Return `coefficient_bound`: an upper bound of the Jacobian's spectral norm, () or (S,).

        Rigorous but pessimistic; a Runge-Kutta step h with h * bound below the method's
        `RungeKutta.injective_below` is injective (design point 5).
        """
        flat = self._stacked(self.parameters_.detach()) * self.scale
        bound = coefficient_bound(self.group, self.basis, flat)
        return bound[0] if self.parameters_.dim() == 1 else bound

    def _divergence_weights(self, weights: Tensor) -> Tensor:
        d = self.group.dim
        along = torch.einsum("ji,si...->sj...", self.frame, weights)
        parts = [differentiate(along[:, j : j + 1], j, d) for j in range(d)]
        return torch.stack(parts).sum(dim=0)

    def _values(self, weights: Tensor, points: Tensor) -> Tensor:
        d = self.group.dim
        self._check_points(points)
        lead = points.shape[:-1]
        flat = points.reshape(weights.shape[0], -1, d)
        # for a single field a plain product: the batched one is slower
        u = (self.frame @ flat[0].mT)[None] if len(flat) == 1 else self.frame @ flat.mT
        values = evaluate(weights, u)
        return values.mT.reshape(*lead, weights.shape[1])


def _orders(basis: InvariantBasis) -> tuple[int, ...]:
    return tuple(np.abs(basis.frequencies).max(axis=0).tolist())
