"""Fourier fields: trigonometric vector fields that commute with a crystallographic group.

Their series on the unit torus are evaluated separably, with hand-written derivatives. A stack of C
scalar series in d variables is an array `weights` of shape (S, C, A_1, ..., A_d), A_i = 2 K_i + 1, in
the tensor basis 1, cos, ..., cos K, sin, ..., sin K (angles 2 pi k u_i) of each axis; S counts
independent stacks. Points lie last: `u` is (S, d, N), values are (S, C, N). One matrix product over the
last axis does nearly all the work (design point 4). The backward pass recomputes the tables block by
block: this is as fast as reading them back and needs no memory.
"""

import math
from collections.abc import Callable, Iterator
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.fields.invariants import InvariantBasis, InvariantField, coefficient_bound
from orbiflow.fields.protocol import plain_gradients, refuse_old_batches
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.typed_torch import applied, linalg, transformed

# the size of the working arrays for one block of points; 1 to 3 MiB measured fastest
BLOCK_BYTES = 2**21
# of the grid on which a Jacobian is bounded: the points of the shortest wave, and the most values
POINTS_PER_WAVE, MAX_GRID_VALUES = 8, 2**20


def trigonometric_table(u: Tensor, order: int, out: Tensor) -> Tensor:
    """Fill rows 1, cos 2 pi u, ..., cos 2 pi K u, sin 2 pi u, ..., sin 2 pi K u, K = `order`.

    For fractional coordinates (..., N) they are (..., 2 K + 1, N), and not tracked by autograd.
    """
    out[..., 0, :] = 1.0
    angle = out[..., order + 1 :, :]
    torch.mul((u - u.round())[..., None, :], _frequencies(order, u)[:, None], out=angle)
    # measured faster, and more accurate, than recurrences: sine and cosine are vectorised
    torch.cos(angle, out=out[..., 1 : order + 1, :])
    torch.sin(angle, out=angle)
    return out


@lru_cache(maxsize=256)
def _angular(order: int, dtype: torch.dtype, device: torch.device) -> Tensor:
    with torch.inference_mode(False):
        return 2.0 * math.pi * torch.arange(1, order + 1, dtype=dtype, device=device)


def _frequencies(order: int, like: Tensor) -> Tensor:
    return _angular(order, like.dtype, like.device)


def differentiate(weights: Tensor, axis: int, dim: int) -> Tensor:
    """Return the weights of the derivative in u_axis; the last `dim` axes are the variables."""
    moved = weights.movedim(axis - dim, -1)
    order = (moved.shape[-1] - 1) // 2
    factor = _frequencies(order, moved)
    cos, sin = moved[..., 1 : order + 1], moved[..., order + 1 :]
    result = torch.cat([torch.zeros_like(moved[..., :1]), factor * sin, -factor * cos], dim=-1)
    return result.movedim(-1, axis - dim)


def _derivative_dot(table: Tensor, dual: Tensor) -> Tensor:
    """Return the sum over rows of (d table / du) times `dual`: (S, A, N), (S, A, N) -> (S, N)."""
    order = (table.shape[-2] - 1) // 2
    if order == 0:
        return torch.zeros_like(table[:, 0])
    rows = table[:, 1 : order + 1] * dual[:, order + 1 :]
    rows -= table[:, order + 1 :] * dual[:, 1 : order + 1]
    return (_frequencies(order, table) @ rows.reshape(-1, order, table.shape[-1])).reshape(
        table.shape[0], -1
    )


def _align(table: Tensor, level: int) -> Tensor:
    """View a table (S, A, N) so that it multiplies partial sums (S, C, A_0, ..., A_level, N)."""
    return table.reshape(table.shape[0], *(1,) * (level + 1), *table.shape[1:])


def _partial_sums(weights: Tensor, table: Tensor, out: Tensor | None = None) -> Tensor:
    """Contract the last variable: one matrix product."""
    flat = weights.reshape(weights.shape[0], -1, weights.shape[-1])
    target = None if out is None else out.view(*flat.shape[:-1], -1)
    return torch.bmm(flat, table, out=target).reshape(*weights.shape[:-1], table.shape[-1])


class _Workspace:
    """Working arrays for blocks of `size` points, reused because allocating memory is slow."""

    def __init__(self, weights: Tensor, size: int) -> None:
        self.size = size
        self.orders = [(a - 1) // 2 for a in weights.shape[2:]]
        self.tables = [weights.new_empty(weights.shape[0], a, size) for a in weights.shape[2:]]
        self.sums = weights.new_empty(*weights.shape[:-1], size)

    def fill(self, u: Tensor) -> list[Tensor]:
        for i, (order, table) in enumerate(zip(self.orders, self.tables, strict=True)):
            trigonometric_table(u[:, i], order, table)
        return self.tables


def _blocks(weights: Tensor, points: int) -> Iterator[tuple[slice, _Workspace]]:
    """Yield ranges of points whose tables and partial sums fit into a processor's cache."""
    size = points
    if weights.device.type == "cpu":
        rows = math.prod(weights.shape[:-1]) + weights.shape[0] * sum(weights.shape[2:])
        fitting = max(1024, BLOCK_BYTES // (rows * weights.element_size()))
        size = -(-points // max(1, -(-points // fitting)))
    workspace = None
    for start in range(0, points, max(size, 1)):
        length = min(size, points - start)
        if workspace is None or workspace.size != length:
            workspace = _Workspace(weights, length)
        yield slice(start, start + length), workspace


def _forward(weights: Tensor, u: Tensor) -> Tensor:
    dim, points = u.shape[1], u.shape[2]
    values = u.new_empty(weights.shape[0], weights.shape[1], points)
    for block, workspace in _blocks(weights, points):
        tables = workspace.fill(u[..., block])
        sums = _partial_sums(weights, tables[-1], workspace.sums)
        for level in range(dim - 2, -1, -1):
            sums = sums.mul_(_align(tables[level], level)).sum(dim=-2)
        values[..., block] = sums
    return values


def _backward_block(
    weights: Tensor, u: Tensor, grad: Tensor, want_points: bool, workspace: _Workspace
) -> tuple[Tensor, Tensor | None]:
    """Return the cotangents of the flattened weights and of u, recomputing the partial sums."""
    dim = u.shape[1]
    tables = workspace.fill(u)
    flat = weights.reshape(weights.shape[0], -1, weights.shape[-1])
    before = [_partial_sums(weights, tables[-1], workspace.sums)] if want_points and dim > 1 else []
    for level in range(dim - 2, 0, -1) if want_points else ():
        before.append((before[-1] * _align(tables[level], level)).sum(dim=-2))
    point_grads: list[Tensor] = []
    dual = grad  # cotangent of the partial sums, level by level
    for level in range(dim - 1):
        if want_points:
            shared = before.pop().mul_(dual.unsqueeze(-2)).flatten(1, -3).sum(dim=1)
            point_grads.append(_derivative_dot(tables[level], shared))
        # at the last level the partial sums have been used up: their workspace is free
        free = workspace.sums if level == dim - 2 else None
        dual = torch.mul(dual.unsqueeze(-2), _align(tables[level], level), out=free)
    dual = dual.flatten(1, -2)
    if want_points:
        point_grads.append(_derivative_dot(tables[-1], flat.mT @ dual))
    return dual @ tables[-1].mT, torch.stack(point_grads, dim=1) if want_points else None


class _Series(torch.autograd.Function):
    """An autograd function that keeps only its arguments, so memory is independent of the modes."""

    @staticmethod
    def forward(ctx: Any, weights: Tensor, u: Tensor) -> Tensor:
        ctx.save_for_backward(weights, u)
        return _forward(weights, u)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, ...]:
        (grad,) = grads
        weights, u = ctx.saved_tensors
        if torch.is_grad_enabled() or transformed():  # to be differentiated again, or in batches
            return tuple(plain_gradients(evaluate_plainly, (weights, u), ctx, grad))
        refuse_old_batches(grad)
        want_weights, want_points = ctx.needs_input_grad
        grad_weights = torch.zeros_like(weights)
        grad_points = torch.empty_like(u) if want_points else None
        for block, workspace in _blocks(weights, u.shape[2]):
            part, moved = _backward_block(
                weights, u[..., block], grad[..., block], want_points, workspace
            )
            grad_weights += part.reshape(weights.shape)
            if grad_points is not None and moved is not None:
                grad_points[..., block] = moved
        return grad_weights if want_weights else None, grad_points


def evaluate_plainly(weights: Tensor, u: Tensor) -> Tensor:
    """Return the same values by ordinary differentiable operations, for derivatives of any order."""
    u = u - u.detach().round()
    *others, last = (_plain_table(weights, u, i) for i in range(u.shape[1]))
    flat = weights.flatten(1, -2)
    # a plain product for a single stack: `vmap` would copy the weights for a batched one
    sums: Tensor = (flat[0] @ last[0])[None] if len(flat) == 1 else flat @ last
    sums = torch.unflatten(sums, 1, weights.shape[1:-1])
    for i, table in reversed(list(enumerate(others))):
        sums = (sums * _align(table, i)).sum(dim=-2)
    return sums


def _plain_table(weights: Tensor, u: Tensor, i: int) -> Tensor:
    angle = u[:, i, None, :] * _frequencies((weights.shape[2 + i] - 1) // 2, u)[:, None]
    return torch.cat([torch.ones_like(u[:, i, None, :]), angle.cos(), angle.sin()], dim=1)


def evaluate(weights: Tensor, u: Tensor) -> Tensor:
    """Return values (S, C, N) of series (S, C, A_1, ..., A_d) at fractional points (S, d, N).

    First derivatives in both arguments are in closed form; higher ones, and those of `torch.func`,
    use ordinary operations.
    """
    if transformed():
        return evaluate_plainly(weights, u)
    if torch.is_grad_enabled() and (weights.requires_grad or u.requires_grad):
        return applied(_Series, weights, u)
    return _forward(weights, u)


@torch.no_grad()
def weight_cotangent(shape: tuple[int, ...], u: Tensor, grad: Tensor) -> Tensor:
    """Return the gradient of sum grad . values in the weights, of their shape."""
    weights = u.new_zeros(shape)
    if transformed():
        return torch.func.vjp(partial(evaluate_plainly, u=u), weights)[1](grad)[0]
    total = torch.zeros_like(weights)
    for block, workspace in _blocks(weights, u.shape[2]):
        part, _ = _backward_block(weights, u[..., block], grad[..., block], False, workspace)
        total += part.reshape(shape)
    return total


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
        divergence_free: Whether to take only fields without divergence, whose flows keep volumes up to
            the error of their steps (`Flow.forward_and_log_det` tells it).
        dtype, device: The dtype and the device of the parameters.

    Shapes:
        `parameters_`: (P,) or (S, P). Points (..., d), or (S, ..., d) for a stack.

    Raises `OrbiflowError` for a negative, fractional or too large `max_frequency`.

    >>> from orbiflow.symmetry import rotation, wallpaper_group
    >>> field = FourierField(wallpaper_group("p4"), 5)
    >>> field.size
    60
    >>> FourierField(wallpaper_group("p4"), 5, divergence_free=True).size
    30
    """

    stackable = True
    can_be_divergence_free = True

    @cached_property
    def _orders(self) -> tuple[int, ...]:
        return _orders(self.basis)

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
        values = self._values(self._jacobian_weights(self.weights()), points)
        return values.reshape(*values.shape[:-1], d, d)

    def bound_with_jacobian(self) -> Callable[[Tensor], tuple[Tensor, Tensor]]:
        """Return, as `bound` does, a function for V and its Jacobian from one matrix product."""
        d, weights = self.group.dim, self.weights()
        joint = torch.cat([weights, self._jacobian_weights(weights)], dim=1)

        def both(points: Tensor) -> tuple[Tensor, Tensor]:
            values = self._values(joint, points)
            return values[..., :d], values[..., d:].reshape(*values.shape[:-1], d, d)

        return both

    def _jacobian_weights(self, weights: Tensor) -> Tensor:
        d = self.group.dim
        by_axis = torch.stack([differentiate(weights, j, d) for j in range(d)], dim=2)
        return torch.einsum("sij...,jk->sik...", by_axis, self.frame).flatten(1, 2)

    @torch.no_grad()
    def lipschitz_bound(self) -> Tensor:
        """Return an upper bound of the Jacobian's spectral norm, () or (S,).

        It is rigorous: a Runge-Kutta step h with h * bound below the method's
        `RungeKutta.injective_below` is injective (design point 5). It is the smaller of
        `coefficient_bound` and, in few dimensions, of the largest value on an even grid with a factor
        (Ehlich and Zeller, Schwankung von Polynomen zwischen Gitterpunkten, 1964): where a
        trigonometric polynomial of degree n is largest it falls no faster than cos(n x), so that N
        points miss at most a factor cos(pi n / N), axis by axis.
        """
        parameters = self._stacked(self.parameters_)
        bound = coefficient_bound(self.group, self.basis, parameters * self.scale)
        d, sides = self.group.dim, [max(1, POINTS_PER_WAVE * k) for k in self._orders]
        if len(parameters) * d * d * math.prod(sides) <= MAX_GRID_VALUES:
            axes = [
                torch.arange(n, dtype=parameters.dtype, device=parameters.device) / n for n in sides
            ]
            u = torch.stack(torch.meshgrid(*axes, indexing="ij")).reshape(1, d, -1)
            slopes = evaluate(
                self._jacobian_weights(self.weights()), u.expand(len(parameters), -1, -1)
            )
            slopes = slopes.mT.reshape(len(parameters), -1, d, d)
            power = linalg.matrix_power(slopes.mT @ slopes, 4)
            # the norm of the power is hardly larger than its largest singular value, and quick
            largest = linalg.matrix_norm(power).amax(dim=-1).pow(1 / 8)
            missed = math.prod(math.cos(math.pi / POINTS_PER_WAVE) for k in self._orders if k)
            bound = torch.fmin(bound, largest / missed)
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
