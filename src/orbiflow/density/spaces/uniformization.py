"""The conformal bijections of the square under p4 with the sphere, under pgg with RP^2.

With nome exp(-pi) the function u = (theta_3 / theta_1)^2 at v = pi z / 2 has periods 2 and 2i,
u(iz) = -u(z), and the two glides of pgg act on it as the antipodal map -1 / conj(u). So w = u^2 takes
the square to the sphere and w = u to the projective plane (design point 13, where u is written
(1 + cn^2) / (1 - cn^2)). The theta quotient has no cancellation near its poles, its derivative is
another product of theta functions, and its inverse is Carlson's R_F: all exact.
"""

from __future__ import annotations

import math

import numpy as np
import torch
from scipy.special import elliprf
from torch import Tensor

from orbiflow.arrays import Array

K = 1.854074677301371918433850347195
"""Quarter period K(m) of the elliptic functions with parameter m = 1/2."""

NULL3 = 1.086434811213308014575316121510
"""theta_3(0) = pi^(1/4) / Gamma(3/4)."""

NOME = math.exp(-math.pi)


def thetas(z: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Return theta_1, ..., theta_4 at v = pi z / 2, for |Im z| <= 1.

    Of each series all terms above 1e-16, as polynomials in cos 2v.

    Reference: DLMF 20.2(i), https://dlmf.nist.gov/20.2.
    """
    across, along = z.real * (math.pi / 2), z.imag * (math.pi / 2)
    # complex sines are slow
    sin, cos, sinh, cosh = across.sin(), across.cos(), along.sinh(), along.cosh()
    sine, cosine = torch.complex(sin * cosh, cos * sinh), torch.complex(cos * cosh, -sin * sinh)
    double = 1 - 2 * sine * sine
    square, q = double * double, NOME
    small = q**6 - q**12
    even, odd = 1 - q**2 - small + 4 * small * square, 2 * (q**2 - q**6 - 2 * q**12)
    odd = (odd + 8 * q**12 * square) * double
    whole, part = 1 - 2 * q**4 + 4 * q**4 * square, 2 * q - 6 * q**9 + 8 * q**9 * square
    part = part * double
    first = 2 * q**0.25
    return first * sine * (even - odd), first * cosine * (even + odd), whole + part, whole - part


TINY = 1e-36
"""Least square of a theta function in a logarithm, since cone points have area factor 0."""


def to_sphere(points: Tensor, power: int) -> Tensor:
    """Return the unit vectors (..., 3) of points (..., 2) of the plane."""
    one, _, three, _ = thetas(_wrapped(points))
    below, above = (_square(own) ** power for own in (one, three))
    product = three * one.conj()
    for _ in range(power // 2):
        product = product * product
    size = below + above
    parts = [2 * product.real, 2 * product.imag, above - below]
    return torch.stack(parts, dim=-1) / size[..., None]


def log_area(points: Tensor, power: int) -> Tensor:
    """Return the logarithm of the area factor J (...,) of `to_sphere` at points (..., 2) of the plane.

    J = (power/2)^2 4 pi^2 theta_3(0)^4 |theta_1 theta_3|^(2 power - 2) |theta_2 theta_4|^2 /
    (|theta_1|^(2 power) + |theta_3|^(2 power))^2: from the derivative
    (theta_3/theta_1)' = -theta_3(0)^2 theta_2 theta_4 / theta_1^2 (DLMF 20.7(ii), 22.13).
    """
    one, two, three, four = (_square(own).clamp_min(TINY) for own in thetas(_wrapped(points)))
    constant = 2 * math.log(power * math.pi * NULL3**2)
    size = one**power + three**power
    return constant + (power - 1) * (one * three).log() + (two * four / (size * size)).log()


def from_sphere(vectors: Array, power: int) -> Array:
    """Return points (..., 2) of unit vectors (..., 3), somewhere in their orbit under p4 or pgg.

    u = a / b with b >= 0 and Re u >= 0, then K z = sqrt(2 b) R_F(a - b, a, a + b): the inverse of
    sn^2 = 2 / (u + 1) (DLMF 19.25(v)).
    """
    along: list[Array] = list(np.moveaxis(np.asarray(vectors, dtype=np.float64), -1, 0))
    x, y, z = along
    if power == 2:  # the one of the two opposite vectors with x >= 0
        sign = np.where(x < 0, -1.0, 1.0)
        x, y, z = sign * x, sign * y, sign * z
    radius = np.hypot(x, y)
    north = z > 0
    safe = np.where(radius == 0, 1.0, radius)
    a = np.where(north, np.where(radius == 0, 1.0, (x + 1j * y) / safe), x + 1j * y)
    b = np.where(north, radius / (1 + np.abs(z)), 1 - z)
    if power == 4:
        a, b = np.sqrt(a), np.sqrt(b)
    first = a - b + 0j
    # on the cut both sides are the same point of the space; SciPy needs to know which
    first = np.where((first.imag == 0) & (first.real < 0), first + 1e-300j, first)
    found = np.sqrt(2 * b) * elliprf(first, a + 0j, a + b + 0j) / K
    return np.stack([found.real, found.imag], axis=-1)


def _wrapped(points: Tensor) -> Tensor:
    """Return complex numbers for points of the plane, moved by periods to |Re z|, |Im z| <= 1."""
    near = points - 2 * (points.detach() / 2).round()
    return torch.complex(near[..., 0], near[..., 1])


def _square(z: Tensor) -> Tensor:
    return z.real.square() + z.imag.square()
