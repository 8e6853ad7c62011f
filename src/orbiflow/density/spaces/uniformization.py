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

TERMS = 4
"""Terms of each series; the first one left out is below 1e-16 for |Im z| <= 1."""


def thetas(z: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Return theta_1, ..., theta_4 at v = pi z / 2.

    Reference: DLMF 20.2(i), https://dlmf.nist.gov/20.2.
    """
    v = z * (math.pi / 2)
    # powers by multiplication: complex sines are slow
    up, down = (torch.polar((-t * v.imag).exp(), t * v.real) for t in (1.0, -1.0))
    rise, fall = up * up, down * down
    odd, even = (up, down), (rise, fall)
    one, two = torch.zeros_like(v), torch.zeros_like(v)
    three, four = torch.ones_like(v), torch.ones_like(v)
    for n in range(TERMS):
        sign = -1.0 if n % 2 else 1.0
        half, whole = (math.exp(-math.pi * m**2) for m in (n + 0.5, n + 1))
        one = one - sign * half * 1j * (odd[0] - odd[1])
        two = two + half * (odd[0] + odd[1])
        three = three + whole * (even[0] + even[1])
        four = four - sign * whole * (even[0] + even[1])
        odd, even = (odd[0] * rise, odd[1] * fall), (even[0] * rise, even[1] * fall)
    return one, two, three, four


TINY = 1e-30
"""Least product of theta functions in a logarithm, since cone points have area factor 0."""


def to_sphere(points: Tensor, power: int) -> Tensor:
    """Return the unit vectors (..., 3) of points (..., 2) of the square [0, 1]^2."""
    one, _, three, _ = thetas(_complex(points))
    a, b = three**power, one**power
    size = a.abs() ** 2 + b.abs() ** 2
    product = 2 * a * b.conj() / size
    height = (a.abs() ** 2 - b.abs() ** 2) / size
    return torch.stack([product.real, product.imag, height], dim=-1)


def log_area(points: Tensor, power: int) -> Tensor:
    """Return the logarithm of the area factor J (...,) of `to_sphere` at points (..., 2) of the plane.

    J = (power/2)^2 4 pi^2 theta_3(0)^4 |theta_1 theta_3|^(2 power - 2) |theta_2 theta_4|^2 /
    (|theta_1|^(2 power) + |theta_3|^(2 power))^2: from the derivative
    (theta_3/theta_1)' = -theta_3(0)^2 theta_2 theta_4 / theta_1^2 (DLMF 20.7(ii), 22.13).
    """
    wrapped = points - 2 * (points.detach() / 2).round()  # J has the periods 2 and 2i
    one, two, three, four = (theta.abs().clamp_min(TINY) for theta in thetas(_complex(wrapped)))
    constant = 2 * math.log(power * math.pi * NULL3**2)
    product = (2 * power - 2) * (one.log() + three.log()) + 2 * (two.log() + four.log())
    return constant + product - 2 * (one ** (2 * power) + three ** (2 * power)).log()


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


def _complex(points: Tensor) -> Tensor:
    return torch.complex(points[..., 0], points[..., 1])
