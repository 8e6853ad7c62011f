"""Symmetrization, which makes any vector field commute with a crystallographic group.

The mean over coset representatives (Reynolds operator, design point 2) and the paper's three
operators (equations for P_B, R_c^K and G_l^mu of section 3), which are unnormalised sums; and networks
that are periodic by themselves.
"""

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor, nn

from orbiflow.errors import OrbiflowError
from orbiflow.fields.protocol import VectorField, is_time_dependent, prepared_with_divergence
from orbiflow.symmetry import (
    CrystallographicGroup,
    Isometry,
    Line,
    checked_group,
    identity,
    rotation,
    transflection,
)
from orbiflow.typed_torch import linalg, random


class Symmetrized(nn.Module):
    """The field V(p) = 1/|G| sum_i R_i^-1 V0(R_i p + t_i), where V0 is made periodic first.

    See `symmetrize`. If `field` is a torch module it is kept as a submodule, so it can be trained.
    """

    def __init__(
        self, field: Callable[..., Tensor], group: CrystallographicGroup, *, periodic: bool = False
    ) -> None:
        super().__init__()
        self.field = field
        self.group = checked_group(group)
        self.periodic = periodic
        self.time_dependent = is_time_dependent(field)

    def forward(self, points: Tensor, *time: Tensor) -> Tensor:
        """Return V at points (..., d), and at a time () if the field is time-dependent."""
        images = self.group.images(points)
        field = _at_time(self.field, time)
        values = field(images) if self.periodic else blend(field, self.group.lattice, images)
        return self._mean(values, points)

    def with_divergence(self, points: Tensor, *time: Tensor) -> tuple[Tensor, Tensor]:
        """Return V (..., d) and its divergence (...,): the mean of the given field's own at the images.

        Only the given field is differentiated, not the symmetrization: R^-1 J R has the trace of J.
        """
        images = self.group.images(points)
        joint = _at_time(prepared_with_divergence(self.field), time)
        lattice = self.group.lattice
        both = joint(images) if self.periodic else blend_with_divergence(joint, lattice, images)
        values, divergence = both
        return self._mean(values, points), divergence.mean(dim=0)

    def divergence(self, points: Tensor, *time: Tensor) -> Tensor:
        """Return the trace of the Jacobian at points (..., d), as (...,)."""
        return self.with_divergence(points, *time)[1]

    def bound_with_divergence(self) -> Callable[[Tensor], tuple[Tensor, Tensor]]:
        """Return V and its divergence together, see `with_divergence`."""
        return self.with_divergence

    def _mean(self, values: Tensor, points: Tensor) -> Tensor:
        linear = torch.tensor(self.group.linear_parts, dtype=values.dtype, device=values.device)
        # the inverse of R acts on row vectors as multiplication by R
        flat = values.reshape(self.group.order, -1, self.group.dim) @ linear
        return flat.mean(dim=0).reshape(points.shape)

    def extra_repr(self) -> str:
        return f"{self.group!r}, periodic={self.periodic}"


def _at_time(field: Callable[..., Any], time: tuple[Tensor, ...]) -> Callable[[Tensor], Any]:
    return (lambda points: field(points, *time)) if time else field


def symmetrize(
    field: Callable[..., Tensor], group: CrystallographicGroup, *, periodic: bool = False
) -> Symmetrized:
    """Make any field commute with `group`: V(g p) = R_g V(p).

    Args:
        field: Any callable from points (..., d) to vectors of the same shape: a torch module, a
            function, a lambda, or a `TimeDependentField`. It need not be periodic: its translates
            are blended smoothly over neighbouring cells (2^d evaluations). A field that already
            commutes does not change.
        group: A group of R^d.
        periodic: Whether `field` is known to be periodic under the group's lattice (for instance a
            network behind `PeriodicFeatures`), so that it need not be blended.

    Raises:
        OrbiflowError: if `group` is not a group or, when called, for points of another dimension.

    >>> import torch
    >>> from orbiflow.symmetry import wallpaper_group
    >>> group = wallpaper_group("p3")
    >>> field = symmetrize(lambda p: torch.tanh(p), group)
    >>> p = torch.tensor([0.3, -0.2], dtype=torch.float64)
    >>> g = group.cosets[1]
    >>> bool(torch.allclose(field(g(p)), g.push(field(p))))
    True
    """
    return Symmetrized(field, group, periodic=periodic)


def blend(field: VectorField, lattice: ArrayLike, points: Tensor) -> Tensor:
    """Return a periodic field from any field: sum over n of w(u - n) field(B (u - n)), u = B^-1 p.

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
    for axis in range(points.shape[-1]):
        others = [i for i in range(points.shape[-1]) if i != axis]
        along = -torch.pi / 2 * torch.sin(torch.pi * shifted[..., axis])
        slopes.append(along * single[..., others].prod(dim=-1))
    gradient = torch.stack(slopes, dim=-1) @ _inverse(lattice, points)
    total = weight * divergence + (gradient * values).sum(dim=-1)
    return (weight[..., None] * values).sum(dim=0), total.sum(dim=0)


def _translates(lattice: ArrayLike, points: Tensor) -> tuple[Tensor, Tensor]:
    """Return u - n for the 2^d corners n of the cell, fractional (2^d, ..., d), and as points."""
    basis = torch.as_tensor(np.array(lattice), dtype=points.dtype, device=points.device)
    u = points @ _inverse(lattice, points).mT
    u = u - u.detach().floor()
    corners = itertools.product((0.0, 1.0), repeat=basis.shape[0])
    shifted = torch.stack([u - u.new_tensor(corner) for corner in corners])
    return shifted, shifted @ basis.mT


def _inverse(lattice: ArrayLike, like: Tensor) -> Tensor:
    return linalg.inv(torch.as_tensor(np.array(lattice), dtype=like.dtype, device=like.device))


def periodic_operator(field: VectorField, lattice: ArrayLike) -> VectorField:
    """Return P_B(V) = B o V o B^-1: a field with period 1 on each axis becomes B-periodic (eq. P_B)."""
    basis = torch.as_tensor(np.array(lattice), dtype=torch.float64)
    return lambda points: field(points @ _inverse(lattice, points).mT) @ basis.to(points).mT


def rotation_operator(field: VectorField, center: ArrayLike, order: int) -> VectorField:
    """Return R_c^K(V) = sum over k = 1..K of R_o^-k o V o R_c^k (eq. R_c^K): a sum, not a mean."""
    return summed_over_powers(field, rotation(center, order), order)


def transflection_operator(field: VectorField, line: Line, mu: float) -> VectorField:
    """Return G_l^mu(V) = V + M_l0 o V o T_l^mu o M_l (eq. G_l^mu): a sum, not a mean."""
    return summed_over_powers(field, transflection(line, mu), 2)


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
        if max_frequency < 1:
            raise OrbiflowError(f"max_frequency must be at least 1, got {max_frequency}")
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

    def forward(self, points: Tensor) -> Tensor:
        """Return features of shape (..., 2 M)."""
        phase = 2.0 * math.pi * points @ self.frequencies.to(points).mT
        return torch.cat([phase.cos(), phase.sin()], dim=-1)


@torch.inference_mode(False)  # its divergence is taken by autograd
def neural_field(
    group: CrystallographicGroup,
    *,
    hidden: tuple[int, ...] = (64, 64),
    max_frequency: int = 1,
    seed: int = 0,
    dtype: torch.dtype = torch.float64,
) -> Symmetrized:
    """Return a multilayer perceptron on periodic features, symmetrized over `group`.

    The last layer starts at zero, so the flow starts at the identity. The same seed gives the same
    weights; the global random state does not change.
    """
    features = PeriodicFeatures(group, max_frequency)
    sizes = (features.size, *hidden, group.dim)
    layers: list[nn.Module] = [features]
    with random.fork_rng(devices=[]):
        random.manual_seed(seed)
        for i, (a, b) in enumerate(itertools.pairwise(sizes)):
            layers.append(nn.Linear(a, b, dtype=dtype))
            if i < len(sizes) - 2:
                layers.append(nn.Tanh())
    last = layers[-1]
    assert isinstance(last, nn.Linear)  # by construction
    nn.init.zeros_(last.weight)
    nn.init.zeros_(last.bias)
    return Symmetrized(nn.Sequential(*layers), group, periodic=True)
