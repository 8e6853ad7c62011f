"""Sums of kernels as tables: terms that fall off with the distance on products of unit spheres.

Features (m, N) are points on F factors: circles in the plane, one for each angle, or one sphere in
space. Component i belongs to factor i modulo F. Terms and points lie last, so that sums over components
run along the memory.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

FAINT_LOG = -80.0
"""Logarithm, relative to the largest, of terms that no sum in double precision can feel."""


LOG2_E = math.log2(math.e)
"""Powers of 2 are twice as fast as exponentials, and no slower where they underflow."""

MIN_SUM = 1e-300
"""The least sum of terms that is not taken for 0."""


def log_sum_exp(table: Tensor) -> Tensor:
    """Return `torch.logsumexp` over the last dimension, ten times as fast if most terms are faint.

    Exponentials that underflow take a slow path of the processor. Each is raised to `FAINT_LOG`, which
    changes nothing: the largest term counts 1. Of logarithms (..., n), n > 0, return (...); where
    all terms are 0, the lowest number of the dtype rather than -inf.

    >>> log_sum_exp(torch.tensor([[0.0, 0.0], [-1e9, 3.0]]))
    tensor([0.6931, 3.0000])
    """
    terms, top = _terms(table)
    return terms.sum(dim=-1).log_() + top.squeeze(-1)


def shares_of(table: Tensor) -> Tensor:
    """Return `torch.softmax` of logarithms (..., n) over the last dimension, none below e^-80 / n."""
    terms, _ = _terms(table)
    return terms / terms.sum(dim=-1, keepdim=True)


def _terms(table: Tensor) -> tuple[Tensor, Tensor]:
    """Return exponentials (..., n) relative to the largest, and its logarithm (..., 1)."""
    top = table.amax(dim=-1, keepdim=True).clamp_min(torch.finfo(table.dtype).min)
    # in place: at this size, fresh memory costs more than the arithmetic
    return (table - top).clamp_min_(FAINT_LOG).mul_(LOG2_E).exp2_(), top


WIDE_LOG_RATIO = 600.0
"""Logarithm of the largest ratio that exponentials can hold without rescaling."""

PLAIN_ENTRIES = 2**24
"""The same where arithmetic is cheap and memory is not."""

BLOCK_ENTRIES = 250_000
"""Entries of the table of points against terms worked on at a time: few enough for the cache."""

SHARP_EXPONENT = 1e8
"""Concentration times squared distance from the middle above which exponents are taken term by term: a
sum about the middle would lose more than 8 digits of 16."""


class Terms(NamedTuple):
    """Terms exp(peak - sum_f kappa_f / 2 |x_f - center_f|^2) of a sum over K of them.

    - `centers`: (m, K) features. `kappa`: (F, K). `peaks`: (K,), their largest logarithms.
    """

    centers: Tensor
    kappa: Tensor
    peaks: Tensor

    @property
    def size(self) -> int:
        """K."""
        return len(self.peaks)

    @property
    def factors(self) -> int:
        """F."""
        return len(self.kappa)

    def to(self, device: torch.device) -> Terms:
        """Return the same terms on a device."""
        return Terms(*(t.to(device) for t in self))

    def only(self, which: Tensor) -> Terms:
        """Return the terms of a mask (K,)."""
        at = which.nonzero()[:, 0]
        return Terms(*(t.index_select(-1, at) for t in self))

    def log_sum(
        self, features: Tensor, middle: Tensor, spread: float, *, slope: bool
    ) -> tuple[Tensor, Tensor | None]:
        """Return the logarithm (N,) of the sum at features (m, N), and its gradient (m, N) if wanted.

        Exponents are taken about features `middle` (m,) near them, where little cancels: at a
        concentration of 1e7 the cosine of the whole angle would lose half of all digits. For terms as
        in `sharp`, even that loses too much: see `sharp_log_sum`. `spread` is the logarithm of the
        ratio of the largest peak to the least sum.
        """
        rows, bias, offset, parts = self._about(features, middle)
        top = self.peaks.max()
        bias, binary = (bias - top).mul_(LOG2_E), rows * LOG2_E
        values: list[Tensor] = []
        slopes: list[Tensor] = []
        space = features.new_empty(parts[0].shape[1], self.size)  # once: fresh memory is slow
        for part in parts:
            table = space[: part.shape[1]]
            torch.addmm(bias, part.mT, binary, out=table)
            high: Tensor | float = 0.0
            if spread > WIDE_LOG_RATIO:
                high = table.amax(dim=1)
                table.sub_(high[:, None])
            total = table.exp2_().sum(dim=1).clamp_min_(MIN_SUM)
            values.append(total.log2() + high)
            if slope:
                slopes.append(rows @ table.mT / total)
        found = torch.cat(values).div_(LOG2_E).add_(top)
        if not slope:
            return found, None
        linear, square = torch.split(torch.cat(slopes, dim=1), [len(middle), self.factors])
        repeated = square.repeat(len(middle) // self.factors, 1)
        return found, linear + 2 * repeated * offset

    def sharp(self, radius: Tensor) -> Tensor:
        """Return which terms (K,) are too sharp for `log_sum` at this distance (F,) from its middle."""
        return (self.kappa * radius[:, None].square()).amax(dim=0) > SHARP_EXPONENT

    def sharp_log_sum(self, features: Tensor, *, slope: bool) -> tuple[Tensor, Tensor | None]:
        """Return what `log_sum` does, from the differences of features: nothing cancels."""
        values: list[Tensor] = []
        slopes: list[Tensor] = []
        half = self.kappa / 2
        pulls = self.kappa.repeat(len(features) // self.factors, 1)
        for part in torch.split(features, max(1, BLOCK_ENTRIES // self.size), dim=1):
            table = self.peaks.expand(part.shape[1], -1).clone()
            for k, (x, center) in enumerate(zip(part, self.centers, strict=True)):
                off = x[:, None] - center
                table.addcmul_(off * half[k % self.factors], off, value=-1)
            high = table.amax(dim=1, keepdim=True)
            table.sub_(high).clamp_min_(FAINT_LOG).mul_(LOG2_E).exp2_()
            total = table.sum(dim=1)
            values.append(total.log() + high[:, 0])
            if slope:
                shares = table / total[:, None]
                slopes.append((pulls * self.centers) @ shares.mT - part * (pulls @ shares.mT))
        return torch.cat(values), torch.cat(slopes, dim=1) if slope else None

    def plain_log_sum(self, features: Tensor) -> Tensor:
        """Return the logarithm (N,) of the sum at features (m, N), term by term; differentiable.

        Nothing cancels and no result is needed in between: for devices where arithmetic is cheap.
        """
        found: list[Tensor] = []
        for part in torch.split(features, max(1, PLAIN_ENTRIES // self.size), dim=1):
            table = self.peaks
            for k, (x, center) in enumerate(zip(part, self.centers, strict=True)):
                table = table - self.kappa[k % self.factors] / 2 * (x[:, None] - center) ** 2
            found.append(table.logsumexp(dim=1))
        return torch.cat(found)

    def _about(
        self, features: Tensor, middle: Tensor
    ) -> tuple[Tensor, Tensor, Tensor, Sequence[Tensor]]:
        """Return rows (m + F, K), bias (K,), offsets (m, N), and blocks of them with their squares.

        Exponents are linear in offsets and their squares.
        """
        own, half = self.centers - middle[:, None], self.kappa / 2
        bias = self.peaks - (half * lengths2(own, self.factors)).sum(dim=0)
        repeated = self.kappa.repeat(len(middle) // self.factors, 1)
        offset = features - middle[:, None]
        seen = torch.cat([offset, lengths2(offset, self.factors)])
        parts = torch.split(seen, max(1, BLOCK_ENTRIES // self.size), dim=1)
        return torch.cat([repeated * own, -half]), bias, offset, parts


def lengths2(offset: Tensor, factors: int) -> Tensor:
    """Return squares (F, N) of the lengths of vectors (m, N) in each factor."""
    return (offset**2).reshape(-1, factors, offset.shape[1]).sum(dim=0)
