"""Symmetric fields evaluated by splines, at a cost that does not grow with the frequency."""

import math
from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.fields.invariants import InvariantBasis, InvariantField
from orbiflow.fields.splines import padded, spline_sum, spline_sum_with_divergence, symbol
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.typed_torch import fft, linalg

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
        max_frequency, smoothness, dtype, device: See `FourierField`.

    Shapes:
        `parameters_`: (P,). Points (..., d).

    Raises `OrbiflowError` for another group, or a `max_frequency` out of range.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> SplineField(wallpaper_group("p4"), 5).sides
    (16, 16)
    """

    def __init__(
        self,
        group: CrystallographicGroup,
        max_frequency: int,
        *,
        smoothness: float = 0.0,
        dtype: torch.dtype = torch.float64,
        device: torch.device | str | None = None,
    ) -> None:
        super().__init__(group, max_frequency, smoothness=smoothness, dtype=dtype, device=device)
        self.sides = grid_sides(group, self.basis)
        lengths = np.diag(group.lattice)
        self._per_length = tuple(float(m / a) for m, a in zip(self.sides, lengths, strict=True))

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
        table = padded(self.table())

        def values(points: Tensor) -> Tensor:
            return spline_sum(table, self._cells(points)).mT.reshape(points.shape)

        return values

    def bound_with_divergence(self) -> Callable[[Tensor], tuple[Tensor, Tensor]]:
        """Return, as `bound` does, a function for V and its divergence from the same coefficients."""
        table = padded(self.table())

        def both(points: Tensor) -> tuple[Tensor, Tensor]:
            u = self._cells(points)
            values, divergence = spline_sum_with_divergence(table, u, self._per_length)
            return values.mT.reshape(points.shape), divergence.reshape(points.shape[:-1])

        return both

    def forward(self, points: Tensor) -> Tensor:
        """Return V at points (..., d): vectors of the same shape."""
        return self.bound()(points)

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
        d = self.group.dim
        self._check_points(points)
        rates = torch.tensor(self._per_length, dtype=points.dtype, device=points.device)
        return points.reshape(-1, d).mT * rates[:, None]


def grid_sides(group: CrystallographicGroup, basis: InvariantBasis) -> tuple[int, ...]:
    """Return the number of points along each lattice vector of a grid that the group preserves.

    The points are equally spaced.
    """
    lengths = np.diag(group.lattice)
    permute = np.abs(group.linear_parts)
    if (
        not 1 <= group.dim <= 3
        or not np.allclose(group.lattice, np.diag(lengths))
        or not np.allclose(permute, np.round(permute))
    ):
        raise OrbiflowError(
            "a spline field needs a rectangular lattice in one to three dimensions and linear parts "
            f"that permute and flip the axes; {group!r} has not: use FourierField"
        )
    waves = np.abs(basis.frequencies).max(axis=0) / lengths  # per unit of length
    # multiples of four: half and quarter translations stay on the grid
    density = (
        4 * math.ceil(POINTS_PER_WAVE * waves.max() * lengths.min() / 4 + 1e-9) / lengths.min()
    )
    sides: Array = density * lengths
    shifts: Array = np.array([g.translation for g in group.cosets]) * density
    if not np.allclose(sides, np.round(sides)) or not np.allclose(shifts, np.round(shifts)):
        raise OrbiflowError(f"no even grid is mapped to itself by {group!r}: use FourierField")
    return tuple(round(m) for m in sides)
