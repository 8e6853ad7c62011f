"""Jacobi's theta functions of nome exp(-pi), the lattice of squares."""

from __future__ import annotations

import math

import torch
from torch import Tensor

K = 1.854074677301371918433850347195
"""Quarter period K(m) of the elliptic functions with parameter m = 1/2."""

NULL3 = 1.086434811213308014575316121510
"""theta_3(0) = pi^(1/4) / Gamma(3/4)."""

TERMS = 4
"""Of each series; the first left out is below 1e-16 for |Im z| <= 1."""


def thetas(z: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """theta_1, ..., theta_4 at v = pi z / 2.

    Args:
        z: complex, with |Im z| <= 1; there the terms that are summed give rounding accuracy.

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
