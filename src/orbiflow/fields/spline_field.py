"""Symmetric fields evaluated by cubic splines, at a cost that does not grow with the frequency.

A value depends on 4^d coefficients for any size of the even periodic grid. Points are on the last axis:
`u` is (d, N), in cells of the grid. The derivatives are hand-written; the backward pass needs second
ones, because the divergence is a result too. Autograd differentiates the backward pass itself.
"""

import math
from collections.abc import Callable
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.fields.invariants import InvariantBasis, InvariantField
from orbiflow.fields.protocol import plain_gradients, refuse_old_batches
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.typed_torch import applied, fft, linalg, transformed

TAPS = 4  # the number of coefficients along an axis that a cubic spline's value depends on


@lru_cache(maxsize=16)
def _polynomials(orders: int, dtype: torch.dtype, device: torch.device) -> Tensor:
    """Return the B-splines' pieces and derivatives as polynomials of the fraction, (4 orders, 4)."""
    pieces = np.array([[1, -3, 3, -1], [4, 0, -6, 3], [1, 3, 3, -3], [0, 0, 0, 1]]) / 6
    rows = [pieces]
    for _ in range(orders - 1):
        lower = rows[-1][:, 1:] * np.arange(1, 4)
        rows.append(np.pad(lower, ((0, 0), (0, 1))))
    with torch.inference_mode(False):
        return torch.tensor(np.concatenate(rows), dtype=dtype, device=device)


def cubic_weights(fraction: Tensor, orders: int = 1) -> Tensor:
    """Return weights (d, orders, 4, N) of the four nearest B-splines, and of their derivatives.

    >>> float(cubic_weights(torch.tensor([[0.25]])).sum())
    1.0
    """
    square = fraction * fraction
    powers = torch.stack([torch.ones_like(fraction), fraction, square, square * fraction])
    table = _polynomials(orders, fraction.dtype, fraction.device) @ powers.reshape(TAPS, -1)
    return table.reshape(orders, TAPS, *fraction.shape).permute(2, 0, 1, 3)


def symbol(size: int) -> Tensor:
    """Return the Fourier transform (size,) of the B-spline on its grid: what interpolation divides by.

    >>> float(symbol(8)[0])
    1.0
    """
    k = torch.arange(size, dtype=torch.float64)
    return 2 / 3 + torch.cos(2 * math.pi * k / size) / 3


def padded(table: Tensor) -> Tensor:
    """Return a periodic table (C, M_1, ..., M_d) with the three more cells that splines reach."""
    for axis in range(1, table.dim()):
        side = table.shape[axis]
        table = torch.cat(
            [table.narrow(axis, side - 1, 1), table, table.narrow(axis, 0, TAPS - 2)], dim=axis
        )
    return table


@lru_cache(maxsize=64)
def _layout(
    sides: tuple[int, ...], dtype: torch.dtype, device: torch.device
) -> tuple[Tensor, Tensor]:
    """Return the periods (d, 1) of a padded table, and positions (4^d, 1) of the taps of a cell."""
    with torch.inference_mode(False):
        offsets = torch.arange(TAPS, device=device)
        taps = offsets
        for side in sides[1:]:
            taps = (taps[:, None] * side + offsets).reshape(-1)
        return torch.tensor(sides, dtype=dtype, device=device)[:, None] - (TAPS - 1), taps[:, None]


def _cells(sides: tuple[int, ...], u: Tensor) -> tuple[Tensor, Tensor]:
    """Return flat positions (4^d, N) in a padded table that points meet, and fractions (d, N)."""
    period, taps = _layout(sides, u.dtype, u.device)
    u = u - period * (u / period).floor()
    # rounding can put a point just below 0 at the period itself
    first = torch.minimum(u.floor(), period - 1)
    cell = first.long()
    flat = cell[0]
    for axis in range(1, len(sides)):
        flat = flat * sides[axis] + cell[axis]
    return taps + flat, u - first


class _Near:
    """Sums of one channel's coefficients (4, ..., 4, N) times weights; partial sums are kept."""

    def __init__(self, values: Tensor, weights: Tensor) -> None:
        self.weights = weights
        self.kept: dict[tuple[int, ...], Tensor] = {(): values}

    def sum(self, *orders: int) -> Tensor:
        """Return the derivative (N,) of these orders along the axes; the last axis is summed first."""
        if orders not in self.kept:
            # of few points, four views would cost what the sum does: unbind makes them at once
            rest = self.sum(*orders[1:]).unbind(-2)
            w = self.weights[-len(orders), orders[0]].unbind()
            # tap by tap: a table of products would go through the memory twice
            total = rest[0] * w[0]
            for values, weight in zip(rest[1:], w[1:], strict=True):
                total = torch.addcmul(total, values, weight)
            self.kept[orders] = total
        return self.kept[orders]


def _near(table: Tensor, flat: Tensor) -> list[Tensor]:
    """Return the coefficients (4, ..., 4, N) of each channel that the points meet."""
    shape = (*(TAPS,) * (table.dim() - 1), -1)
    return [c.reshape(-1).index_select(0, flat.reshape(-1)).reshape(shape) for c in table]


def _sums(
    near: list[Tensor], fraction: Tensor, rates: tuple[float, ...] | None
) -> tuple[Tensor, Tensor]:
    """Return values (C, N) and divergence (N,), zero without rates; autograd can differentiate it."""
    d = len(fraction)
    weights = cubic_weights(fraction, 1 if rates is None else 2)
    sums = [_Near(c, weights) for c in near]
    values = torch.stack([part.sum(*_unit(d)) for part in sums])
    divergence = fraction.new_zeros(fraction.shape[1])
    for axis, rate in enumerate(rates or ()):
        divergence = divergence.add(sums[axis].sum(*_unit(d, axis)), alpha=rate)
    return values, divergence


class _SplineSum(torch.autograd.Function):
    """Values (C, N) at grid coordinates and, if asked, sum_c rate_c d value_c / du_c (N,)."""

    @staticmethod
    def forward(ctx: Any, table: Tensor, u: Tensor, rates: tuple[float, ...] | None) -> Any:
        flat, fraction = _cells(tuple(table.shape[1:]), u)
        near = _near(table, flat)
        ctx.save_for_backward(table, u, flat, fraction, *near)
        ctx.rates = rates
        return _sums(near, fraction, rates)

    @staticmethod
    def backward(ctx: Any, *gradients: Any) -> Any:
        table, u, flat, fraction, *near = ctx.saved_tensors
        if torch.is_grad_enabled() or transformed():  # to be differentiated again, or in batches
            # the divergence is a constant where no rates are given
            count = 1 if ctx.rates is None else 2
            plain = partial(_plain_sum, rates=ctx.rates, count=count)
            return *plain_gradients(plain, (table, u), ctx, gradients[:count]), None
        refuse_old_batches(*gradients)
        weights = cubic_weights(fraction, 3)
        on_table = on_u = None
        if ctx.needs_input_grad[1]:
            on_u = _on_points(near, weights, gradients, ctx.rates)
        if ctx.needs_input_grad[0]:
            on_table = _on_table(table.shape, flat, weights, gradients, ctx.rates)
        return on_table, on_u, None


def _on_points(
    near: list[Tensor],
    weights: Tensor,
    gradients: tuple[Tensor, Tensor],
    rates: tuple[float, ...] | None,
) -> Tensor:
    by_value, by_divergence = gradients
    d = len(weights)
    on_u = by_divergence.new_zeros(d, len(by_divergence))
    for c, values in enumerate(near):
        part = _Near(values, weights)
        for j in range(d):
            on_u[j].addcmul_(by_value[c], part.sum(*_unit(d, j)))
            if rates is not None:
                on_u[j].addcmul_(by_divergence, part.sum(*_unit(d, c, j)), value=rates[c])
    return on_u


def _on_table(
    shape: torch.Size,
    flat: Tensor,
    weights: Tensor,
    gradients: tuple[Tensor, Tensor],
    rates: tuple[float, ...] | None,
) -> Tensor:
    by_value, by_divergence = gradients
    plain = [w[0] for w in weights]
    channels: list[Tensor] = []
    for c in range(shape[0]):
        factors = list(plain)
        if rates is None:
            factors[0] = factors[0] * by_value[c]
        else:
            slope = weights[c][1] * (rates[c] * by_divergence)
            factors[c] = (plain[c] * by_value[c]).add_(slope)
        spread = _outer(factors).reshape(-1)
        zeros = spread.new_zeros(math.prod(shape[1:]))
        channels.append(zeros.scatter_add_(0, flat.reshape(-1), spread))
    return torch.stack(channels).reshape(shape)


def _unit(d: int, *axes: int) -> tuple[int, ...]:
    """Return how often each of d axes is among `axes`."""
    return tuple(axes.count(i) for i in range(d))


def _outer(factors: list[Tensor]) -> Tensor:
    """Return the product (4, ..., 4, N) of one (4, N) an axis."""
    d = len(factors)
    shaped = [w.reshape(*(1,) * i, TAPS, *(1,) * (d - 1 - i), -1) for i, w in enumerate(factors)]
    product = shaped[-1]
    for factor in reversed(shaped[:-1]):
        product = factor * product
    return product


def spline_sum(
    table: Tensor, u: Tensor, rates: tuple[float, ...] | None = None
) -> tuple[Tensor, Tensor]:
    """Return values (C, N) of splines at `u` (d, N), in cells of a `padded` grid of coefficients.

    Beside them sum_i rates_i d value_i / du_i (N,) of a vector field (C = d), zero without rates. First
    derivatives in both arguments are in closed form; higher ones, and those of `torch.func`, use
    ordinary operations. A cubic spline's third derivatives are constant in each cell.
    """
    if transformed():
        return _plain_sum(table, u, rates)  # pyright: ignore[reportReturnType]
    return applied(_SplineSum, table, u, rates)


def _plain_sum(
    table: Tensor, u: Tensor, rates: tuple[float, ...] | None, count: int = 2
) -> tuple[Tensor, ...]:
    """Return the first `count` of values and divergence, by ordinary differentiable operations."""
    flat, fraction = _cells(tuple(table.shape[1:]), u)
    return _sums(_near(table, flat), fraction, rates)[:count]


# the least number of grid points on the shortest wave, for an error of about 2 per cent
POINTS_PER_WAVE = 3


class SplineField(InvariantField):
    """The cubic spline through a `FourierField`'s values on an even grid.

    It has the same parameters and exactly the same symmetry, as the group maps the grid to itself. It
    is twice continuously differentiable, and its divergence is exact. An evaluation reads 4^d
    coefficients for any `max_frequency`; one fast Fourier transform fills the grid.

    Args:
        group: A group with a rectangular lattice in one to three dimensions, whose linear parts
            permute and flip the axes.
        max_frequency, smoothness, dtype, device: See `FourierField`. Without divergence there is none.

    Shapes:
        `parameters_`: (P,). Points (..., d).

    Raises `OrbiflowError` for another group, or a `max_frequency` out of range.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> SplineField(wallpaper_group("p4"), 5).sides
    (16, 16)
    """

    @cached_property
    def sides(self) -> tuple[int, ...]:
        """The numbers of the grid's points along the axes."""
        return grid_sides(self.group, self.basis)

    @cached_property
    def _per_length(self) -> tuple[float, ...]:
        lengths = np.diag(self.group.lattice)
        return tuple(float(m / a) for m, a in zip(self.sides, lengths, strict=True))

    @staticmethod
    def layout(group: CrystallographicGroup, basis: InvariantBasis) -> tuple[Array, Array, Array]:
        """Return the basis as sparse (row, column, value) of the half spectrum's real numbers.

        sqrt 2 (a cos + b sin) is (a - i b) / sqrt 2 at k and its conjugate at -k; divided by the
        B-splines' own transform, so that the spline goes through the field's values.
        """
        d, sides = group.dim, grid_sides(group, basis)
        mode, within = basis.rows // (2 * d), basis.rows % (2 * d)
        is_sine, component = within // d, within % d
        k = basis.frequencies[mode]
        constant = ~k.any(axis=1)
        strength = np.where(constant, 1.0, math.sqrt(0.5))
        for axis, side in enumerate(sides):
            strength = strength / symbol(side).numpy()[k[:, axis] % side]
        entries: list[tuple[Array, Array, Array]] = []
        for sign in (1, -1):
            image = sign * k
            keep = (image[:, -1] >= 0) & (~constant if sign < 0 else True)
            flat = component.copy()
            for axis, side in enumerate((*sides[:-1], sides[-1] // 2 + 1)):
                flat = flat * side + (image[:, axis] % side if axis < d - 1 else image[:, axis])
            weights = basis.values * strength * np.where(is_sine, -sign, 1)
            entries.append(((2 * flat + is_sine)[keep], basis.columns[keep], weights[keep]))
        rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
        return rows, columns, values

    def table(self) -> Tensor:
        """Return the spline's coefficients (d, M_1, ..., M_d)."""
        d, half = self.group.dim, self.sides[-1] // 2 + 1
        shape = (d, *self.sides[:-1], half, 2)
        spectrum = self.parameters_.new_zeros(math.prod(shape))
        entries = (self.parameters_ * self.scale)[self.columns] * self.values
        spectrum = torch.view_as_complex(spectrum.index_add(0, self.rows, entries).reshape(shape))
        return fft.irfftn(spectrum, s=self.sides, dim=tuple(range(1, d + 1)), norm="forward")

    def bound(self) -> Callable[[Tensor], Tensor]:
        """Return the field with its grid filled once, for many evaluations (an integrator's)."""
        both = self._evaluated(None)
        return lambda points: both(points)[0]

    def bound_with_divergence(self) -> Callable[[Tensor], tuple[Tensor, Tensor]]:
        """Return, as `bound` does, a function for V and its divergence from the same coefficients."""
        return self._evaluated(self._per_length)

    def _evaluated(
        self, rates: tuple[float, ...] | None
    ) -> Callable[[Tensor], tuple[Tensor, Tensor]]:
        table = padded(self.table())

        def both(points: Tensor) -> tuple[Tensor, Tensor]:
            values, divergence = spline_sum(table, self._cells(points), rates)
            return values.mT.reshape(points.shape), divergence.reshape(points.shape[:-1])

        return both

    def divergence(self, points: Tensor) -> Tensor:
        """Return the trace of the Jacobian, (...,), exact."""
        return self.bound_with_divergence()(points)[1]

    @torch.no_grad()
    def lipschitz_bound(self) -> Tensor:
        """Return an upper bound of the Jacobian's spectral norm anywhere, ().

        The derivative of a spline along an axis is a convex combination of the differences of
        neighbouring coefficients, per cell; the norm of the Jacobian is at most that of its columns'
        lengths.
        """
        table = self.table()
        steepest = [
            rate * linalg.vector_norm(table.roll(-1, axis) - table, dim=0).max()
            for axis, rate in enumerate(self._per_length, start=1)
        ]
        return linalg.vector_norm(torch.stack(steepest))

    def adjoint(self, points: Tensor, forces: Tensor) -> Tensor:
        """Return the gradient (P,) of sum forces . V(points) in the parameters; inputs (N, d)."""
        with torch.enable_grad():
            work = (self.forward(points.detach()) * forces.detach()).sum()
            return torch.autograd.grad(work, self.parameters_)[0]

    def _cells(self, points: Tensor) -> Tensor:
        self._check_points(points)
        rates = torch.tensor(self._per_length, dtype=points.dtype, device=points.device)
        return points.reshape(-1, self.group.dim).mT * rates[:, None]


def has_even_grid(group: CrystallographicGroup) -> bool:
    """Return whether a group can have a `SplineField`.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> has_even_grid(wallpaper_group("p4m")), has_even_grid(wallpaper_group("p6m"))
    (True, False)
    """
    # one wave along the longest side has some grid, if any number of waves has
    lengths = np.abs(np.diag(group.lattice))
    return _keeps_axes(group) and _even_grid(group, 1 / lengths.min()) is not None


def grid_sides(group: CrystallographicGroup, basis: InvariantBasis) -> tuple[int, ...]:
    """Return the number of points along each lattice vector of a grid that the group preserves.

    The points are equally spaced along each vector.
    """
    if not _keeps_axes(group):
        raise OrbiflowError(
            "a spline field needs a rectangular lattice in one to three dimensions and linear parts "
            f"that permute and flip the axes; {group!r} has not: use FourierField"
        )
    waves = np.abs(basis.frequencies).max(axis=0) / np.diag(group.lattice)  # per unit of length
    sides = _even_grid(group, float(waves.max()))
    if sides is None:
        raise OrbiflowError(f"no even grid is mapped to itself by {group!r}: use FourierField")
    return sides


def _keeps_axes(group: CrystallographicGroup) -> bool:
    """Return whether the lattice is rectangular and the group permutes and flips the axes."""
    permute = np.abs(group.linear_parts)
    return bool(
        1 <= group.dim <= 3
        and np.allclose(group.lattice, np.diag(np.diag(group.lattice)))
        and np.allclose(permute, np.round(permute))
    )


def _even_grid(group: CrystallographicGroup, waves: float) -> tuple[int, ...] | None:
    """Return the sides of a grid for so many waves per unit of length, None if the group has none.

    Equally dense along all axes, if it can be; else each side has as many points as it needs.
    """
    lengths = np.diag(group.lattice)
    shifts = group.translations / lengths
    # multiples of four: half and quarter translations stay on the grid
    density = 4 * math.ceil(POINTS_PER_WAVE * waves * lengths.min() / 4 + 1e-9) / lengths.min()
    choices: list[Array] = [density * lengths]
    # of twelve: thirds and sixths, too; equal lengths come out equal
    needed = np.round(POINTS_PER_WAVE * waves * lengths, 6)
    choices += [multiple * np.ceil(needed / multiple + 1e-9) for multiple in (4, 12)]
    for sides in choices:
        places = np.vstack([sides, shifts * sides])
        if np.allclose(places, np.round(places)):
            return tuple(round(m) for m in sides)
    return None
