"""Symmetrization, which makes any vector field commute with a crystallographic group.

The mean over coset representatives (Reynolds operator, design point 2) and the paper's three
operators (equations for P_B, R_c^K and G_l^mu of section 3), which are unnormalised sums; and networks
that are periodic by themselves.
"""

import contextlib
import itertools
import math
from collections.abc import Callable, Generator
from functools import partial
from typing import Any, cast

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor, nn

from orbiflow.errors import OrbiflowError
from orbiflow.fields.protocol import VectorField, lipschitz_bound, prepared_with_divergence
from orbiflow.settings import as_tensor, as_whole, described, is_tensor, refusal
from orbiflow.symmetry import (
    CrystallographicGroup,
    Isometry,
    checked_group,
    identity,
    lattice_along,
)
from orbiflow.typed_torch import linalg


class Symmetrized(nn.Module):
    """The field V(p) = 1/|G| sum_i R_i^-1 V0(R_i p + t_i), where V0 is made periodic first.

    See `symmetrize`. If `field` is a torch module it is kept as a submodule, so it can be trained.
    """

    def __init__(
        self,
        field: VectorField,
        group: CrystallographicGroup,
        *,
        periodic: bool = False,
        along: str | None = None,
    ) -> None:
        super().__init__()
        if not callable(field):
            raise refusal(
                "the field", "a function of points (..., d), such as a torch module", field
            )
        self.field = field
        self.group = checked_group(group)
        self.periodic, self.along = periodic, along
        self._lattice = self.group.lattice if along is None else lattice_along(self.group, along)
        self._blended = not periodic and self._lattice.size > 0
        _try_out(field, self.group.dim)

    def forward(self, points: Tensor) -> Tensor:
        """Return V at points (..., d)."""
        points = as_tensor(points, "points")
        images = self.group.images(points)

        def field(points: Tensor) -> Tensor:
            with self._explaining(points):
                return _checked(self.field(points), points)

        values = blend(field, self._lattice, images) if self._blended else field(images)
        return self._mean(values, points)

    def divergence(self, points: Tensor) -> Tensor:
        """Return the trace of the Jacobian at points (..., d), as (...,)."""
        return self.bound_with_divergence()(points)[1]

    def bound_with_divergence(self) -> Callable[[Tensor], tuple[Tensor, Tensor]]:
        """Return V and its divergence together: the mean of the given field's own at the images.

        Only the given field is differentiated, not the symmetrization: R^-1 J R has the trace of J.
        """
        evaluate = prepared_with_divergence(self.field)

        def joint(points: Tensor) -> tuple[Tensor, Tensor]:
            with self._explaining(points):
                values, divergence = evaluate(points)
                return _checked(values, points), divergence.to(points.dtype)

        if self._blended:
            joint = partial(blend_with_divergence, joint, self._lattice)

        def both(points: Tensor) -> tuple[Tensor, Tensor]:
            points = as_tensor(points, "points")
            values, divergence = joint(self.group.images(points))
            return self._mean(values, points), divergence.mean(dim=0)

        return both

    def lipschitz_bound(self) -> Tensor | None:
        """Return an upper bound () of the Jacobian's spectral norm, or None if it is not known.

        A mean over isometries is no steeper than the given field: that of a `torch.nn.Sequential` is
        known by its layers. A field that is blended has no bound, as values may grow without limit.
        """
        bound = None if self._blended else lipschitz_bound(self.field)
        return None if bound is None else torch.tensor(bound, dtype=torch.float64)

    @contextlib.contextmanager
    def _explaining(self, points: Tensor) -> Generator[None]:
        """Raise what goes wrong in the field as an `OrbiflowError` that says where."""
        try:
            yield
        except OrbiflowError:
            raise
        except (RuntimeError, TypeError, ValueError, IndexError) as error:
            hint = "its parameters have {}: convert the points or the field"
            hints = {hint.format(p.dtype) for p in self.parameters() if p.dtype != points.dtype}
            raise OrbiflowError(
                f"the field cannot be evaluated at {points.dtype} points of shape "
                f"(..., {points.shape[-1]}): {'; '.join([str(error), *sorted(hints)])}"
            ) from error

    def _mean(self, values: Tensor, points: Tensor) -> Tensor:
        linear = torch.tensor(self.group.linear_parts, dtype=values.dtype, device=values.device)
        # the inverse of R acts on row vectors as multiplication by R
        flat = values.reshape(self.group.order, -1, self.group.dim) @ linear
        return flat.mean(dim=0).reshape(points.shape)

    def extra_repr(self) -> str:
        return f"{self.group!r}, periodic={self.periodic}, along={self.along!r}"


def _checked(values: object, points: Tensor) -> Tensor:
    """Return a field's values at points in their dtype; raise `OrbiflowError` for another shape."""
    if not is_tensor(values) or values.shape != points.shape:
        wanted = f"a tensor of its points' shape {tuple(points.shape)}, one vector for each"
        raise OrbiflowError(f"the field must give {wanted}; got {described(values)}")
    return values.to(points.dtype)


def _try_out(field: VectorField, dim: int) -> None:
    """Raise `OrbiflowError` at once for a field whose values have another shape than its points."""
    module = isinstance(field, nn.Module)
    if module and any(True for _ in field.buffers()):
        return  # an evaluation may change them
    first = next(field.parameters(), None) if module else None
    points = torch.zeros(3, dim, dtype=torch.float64) if first is None else first.new_zeros(3, dim)
    with torch.no_grad(), cast(Any, torch.random).fork_rng(devices=[]):
        try:
            values: object = field(points)
        except Exception:  # it may need other points, which a call will tell
            return
    _checked(values, points)


def symmetrize(
    field: VectorField,
    group: CrystallographicGroup,
    *,
    periodic: bool = False,
    along: str | None = None,
) -> Symmetrized:
    """Make any field commute with `group`: V(g p) = R_g V(p).

    Args:
        field: Any callable from points (..., d) to vectors of the same shape: a torch module, a
            function or a lambda, evaluated in the dtype of the points. It need not be periodic: its
            translates are blended smoothly over neighbouring cells (2^d evaluations). A field that
            already commutes does not change.
        group: A group of R^d.
        periodic: Whether `field` is known to be periodic under the group's lattice (for instance a
            network behind `PeriodicFeatures`), so that it need not be blended.
        along: The axes that the field is to be periodic along, for groups with fewer translations: "x"
            for a frieze, "z" for a rod, "xy" for a layer, "" for a point group. Default: all.

    Raises:
        OrbiflowError: if `field` is no function or `group` no group, or none that is periodic along
            these axes alone (`lattice_along`); for a field that gives anything but one vector for each
            point, or cannot take the points, which it is tried on at once and checked for at each
            call; when called, for points of another dimension.

    >>> import torch
    >>> from orbiflow.symmetry import wallpaper_group
    >>> group = wallpaper_group("p3")
    >>> field = symmetrize(lambda p: torch.tanh(p), group)
    >>> p = torch.tensor([0.3, -0.2], dtype=torch.float64)
    >>> g = group.cosets[1]
    >>> bool(torch.allclose(field(g(p)), g.push(field(p))))
    True
    """
    return Symmetrized(field, group, periodic=periodic, along=along)


def blend(field: VectorField, lattice: ArrayLike, points: Tensor) -> Tensor:
    """Return a periodic field from any field: sum over n of w(u - n) field(p - B n), u = B^-1 p.

    B may have fewer columns than rows: then the field becomes periodic along these alone.
    w(u) = prod cos^2(pi u_i / 2) on [-1, 1]^d sums to one over the translates, so a periodic field is
    unchanged and a smooth field stays continuously differentiable.
    """
    shifted, at = _translates(lattice, points)
    weight = torch.cos(shifted * (torch.pi / 2)).square().prod(dim=-1, keepdim=True)
    return (weight * field(at)).sum(dim=0)


def blend_with_divergence(
    joint: Callable[[Tensor], tuple[Tensor, Tensor]], lattice: ArrayLike, points: Tensor
) -> tuple[Tensor, Tensor]:
    """Blend V and its divergence: div(w V) = w div V + grad w . V."""
    shifted, at = _translates(lattice, points)
    values, divergence = joint(at)
    single = torch.cos(shifted * (torch.pi / 2)).square()
    weight = single.prod(dim=-1)
    slopes: list[Tensor] = []
    for axis in range(shifted.shape[-1]):
        others = [i for i in range(shifted.shape[-1]) if i != axis]
        along = -torch.pi / 2 * torch.sin(torch.pi * shifted[..., axis])
        slopes.append(along * single[..., others].prod(dim=-1))
    gradient = torch.stack(slopes, dim=-1) @ _inverse(lattice, points)
    total = weight * divergence + (gradient * values).sum(dim=-1)
    return (weight[..., None] * values).sum(dim=0), total.sum(dim=0)


def _translates(lattice: ArrayLike, points: Tensor) -> tuple[Tensor, Tensor]:
    """Return u - n for the 2^r corners n of the cell, fractional (2^r, ..., r), and as points."""
    basis = torch.as_tensor(np.array(lattice), dtype=points.dtype, device=points.device)
    u = points @ _inverse(lattice, points).mT
    across = points - u @ basis.mT
    u = u - u.detach().floor()
    corners = itertools.product((0.0, 1.0), repeat=basis.shape[1])
    shifted = torch.stack([u - u.new_tensor(corner) for corner in corners])
    at = shifted @ basis.mT
    return shifted, at + across if basis.shape[0] > basis.shape[1] else at


def _inverse(lattice: ArrayLike, like: Tensor) -> Tensor:
    """Return B^-1, or B's pseudoinverse if it has fewer columns than rows."""
    basis = torch.as_tensor(np.array(lattice), dtype=like.dtype, device=like.device)
    return linalg.inv(basis) if basis.shape[0] == basis.shape[1] else linalg.pinv(basis)


def periodic_operator(field: VectorField, lattice: ArrayLike) -> VectorField:
    """Return P_B(V) = B o V o B^-1: a field with period 1 on each axis becomes B-periodic (eq. P_B)."""
    basis = torch.as_tensor(np.array(lattice), dtype=torch.float64)
    return lambda points: field(points @ _inverse(lattice, points).mT) @ basis.to(points).mT


def summed_over_powers(field: VectorField, isometry: Isometry, terms: int) -> VectorField:
    """Return the sum over k < terms of g^-k o V o g^k for an isometry g: an operator of the paper."""
    powers = [identity(isometry.dim)]
    for _ in range(terms - 1):
        powers.append(isometry @ powers[-1])
    return lambda points: torch.stack([g.inverse().push(field(g(points))) for g in powers]).sum(
        dim=0
    )


class PeriodicFeatures(nn.Module):
    """Periodic features of points (..., d): cosines and sines of low frequencies, (..., 2 M).

    Args:
        group: The group whose lattice is the period.
        max_frequency: The largest frequency. If d <= 3, all k in [-max, max]^d are taken up to sign,
            without 0; in higher dimensions only the multiples 1..max of each axis.

    Raises `OrbiflowError` if `max_frequency` < 1 or `group` is no group.
    """

    frequencies: Tensor

    def __init__(self, group: CrystallographicGroup, max_frequency: int = 1) -> None:
        super().__init__()
        as_whole(max_frequency, "max_frequency", 1)
        d = checked_group(group).dim
        if d <= 3:
            box = itertools.product(range(-max_frequency, max_frequency + 1), repeat=d)
            k = np.array([v for v in box if v > (0,) * d], dtype=np.float64)
        else:
            k = np.concatenate([m * np.eye(d) for m in range(1, max_frequency + 1)])
        with torch.inference_mode(False):  # otherwise it could never be differentiated
            waves = torch.tensor(k @ group.inverse_lattice)
        self.group, self.max_frequency = group, max_frequency
        self.register_buffer("frequencies", waves, persistent=False)

    @property
    def size(self) -> int:
        """Number of features 2 M."""
        return 2 * self.frequencies.shape[0]

    def lipschitz_bound(self) -> Tensor:
        """Return the spectral norm () of the Jacobian, which is the same at all points."""
        return 2.0 * math.pi * linalg.matrix_norm(self.frequencies.double(), ord=2)

    def forward(self, points: Tensor) -> Tensor:
        """Return features of shape (..., 2 M)."""
        phase = 2.0 * math.pi * points @ self.frequencies.to(points).mT
        return torch.cat([phase.cos(), phase.sin()], dim=-1)
