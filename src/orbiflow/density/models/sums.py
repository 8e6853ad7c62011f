"""Sums of exponentials: of tables, and of kernels as terms that fall off with the distance.

Features (m, N) are points on F factors: circles in the plane, one for each angle, or one sphere in
space. Component i belongs to factor i modulo F. Terms and points lie last, so that sums over components
run along the memory.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from orbiflow.typed_torch import applied, transformed

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
        logs = torch.cat(values).div_(LOG2_E).add_(top)
        if not slope:
            return logs, None
        linear, square = torch.split(torch.cat(slopes, dim=1), [len(middle), self.factors])
        repeated = square.repeat(len(middle) // self.factors, 1)
        return logs, linear + 2 * repeated * offset

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
        parts = torch.split(features, max(1, PLAIN_ENTRIES // self.size), dim=1)
        return torch.cat([self.each(part).logsumexp(dim=1) for part in parts])

    def each(self, features: Tensor) -> Tensor:
        """Return the logarithms (N, K) of the terms at features (m, N); differentiable."""
        table = self.peaks
        for k, (x, center) in enumerate(zip(features, self.centers, strict=True)):
            table = table - self.kappa[k % self.factors] / 2 * (x[:, None] - center) ** 2
        return table

    def _about(
        self, features: Tensor, middle: Tensor
    ) -> tuple[Tensor, Tensor, Tensor, Sequence[Tensor]]:
        """Return rows (m + F, K), bias (K,), offsets (m, N), and blocks of them with their squares.

        Exponents are linear in offsets and their squares.
        """
        offsets_of_centers, half = self.centers - middle[:, None], self.kappa / 2
        bias = self.peaks - (half * lengths2(offsets_of_centers, self.factors)).sum(dim=0)
        repeated = self.kappa.repeat(len(middle) // self.factors, 1)
        offset = features - middle[:, None]
        seen = torch.cat([offset, lengths2(offset, self.factors)])
        parts = torch.split(seen, max(1, BLOCK_ENTRIES // self.size), dim=1)
        return torch.cat([repeated * offsets_of_centers, -half]), bias, offset, parts


def lengths2(offset: Tensor, factors: int) -> Tensor:
    """Return squares (F, N) of the lengths of vectors (m, N) in each factor."""
    return (offset**2).reshape(-1, factors, offset.shape[1]).sum(dim=0)


LOG_TOLERANCE = math.log(1e-13)
"""Logarithm of the share of a sum that may be left out in each of some ten halvings of a tile."""

ROUNDING = 1e-15
"""Rounding error of squared distances between unit vectors, which bounds allow for."""

FEW_POINTS, FEW_PAIRS = 256, 5_000_000
"""Tiles with fewer points, or fewer points times terms, are not divided further."""

FEWEST_PAIRS = 20_000
"""Fewer points times terms are summed one by one at once: looking for tiles would take longer."""

LESS_SHARE, MAX_IDLE_HALVINGS = 0.9, 3
"""A tile is divided at most `MAX_IDLE_HALVINGS` times in a row while more than the share `LESS_SHARE`
of the terms stays."""


def near_log_sum(terms: Terms, features: Tensor, floor: float = -math.inf) -> Tensor:
    """Return the logarithm (N,) of a sum of terms at features (m, N).

    It is exact within `LOG_TOLERANCE` and rounding.

    Points are divided into tiles. Terms whose largest values in a tile are negligible beside the least
    sum there are left out; the rest is summed point by point, once tiles are small. `floor` is the
    logarithm of what the caller adds to the sum, to which errors are relative as well; it is not in the
    result.

    Differentiable in the features: the gradient in closed form, as fast as the sum; higher
    derivatives by autograd through all terms.
    """
    if features.shape[1] * terms.size < FEWEST_PAIRS or transformed():
        return terms.plain_log_sum(features)
    if not (features.requires_grad and torch.is_grad_enabled()):
        return _Walk(features, terms, floor).log_sum
    return applied(_NearLogSum, features, terms, floor)


class _NearLogSum(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, features: Tensor, terms: Terms, floor: float) -> Tensor:
        walk = _Walk(features, terms, floor, slope=True)
        ctx.save_for_backward(features, walk.slope)
        ctx.terms = terms
        return walk.log_sum

    @staticmethod
    def backward(ctx: Any, *gradients: Any) -> Any:
        features, slope = ctx.saved_tensors
        if not torch.is_grad_enabled():
            return gradients[0] * slope, None, None
        # second derivatives were asked for: let autograd have them
        view: Tensor = features.view_as(features)
        plain = ctx.terms.plain_log_sum(view)
        (second,) = torch.autograd.grad(plain, view, gradients[0], create_graph=True)
        return second, None, None


class FeatureBox:
    """A box around features (m, N), N > 0."""

    def __init__(self, features: Tensor, factors: int) -> None:
        low, high = torch.aminmax(features, dim=1)
        self.factors = factors
        self.middle, self.sides = (low + high) / 2, high - low
        self.radius = lengths2(features - self.middle[:, None], factors).amax(dim=1).sqrt()

    def bounds(self, terms: Terms) -> tuple[Tensor, Tensor]:
        """Return the least and largest logarithms (K,) of the terms in the tile.

        They are bounds by the triangle inequality.
        """
        square, radius = self._away2(terms), self.radius[:, None]
        nearest = (square - ROUNDING).clamp_min_(0).sqrt_().sub_(radius).clamp_min_(0).square_()
        farthest = square.clamp_min_(0).add_(ROUNDING).sqrt_().add_(radius).square_()
        least = largest = terms.peaks
        for kappa, near, far in zip(terms.kappa, nearest, farthest, strict=True):
            least = torch.addcmul(least, kappa, far, value=-0.5)
            largest = torch.addcmul(largest, kappa, near, value=-0.5)
        return least, largest

    def _away2(self, terms: Terms) -> Tensor:
        """Return squared distances (F, K) of centers from the middle, within `ROUNDING`."""
        rows = torch.zeros(self.factors, len(self.middle), dtype=self.middle.dtype)
        rows[torch.arange(len(self.middle)) % self.factors, torch.arange(len(self.middle))] = (
            -2 * self.middle
        )
        # centers are unit vectors
        square = 1 + lengths2(self.middle[:, None], self.factors)
        return torch.addmm(square, rows, terms.centers)


class _Walk:
    """Logarithms (N,) of sums, and their gradients (m, N) in the features if they are wanted."""

    def __init__(
        self, features: Tensor, terms: Terms, floor: float, *, slope: bool = False
    ) -> None:
        features, self.floor = features.detach(), floor
        self.log_sum = torch.full_like(features[0], -math.inf)
        self.slope = torch.zeros_like(features) if slope else None
        if len(self.log_sum):
            self._add(torch.arange(len(self.log_sum)), features, terms)

    def _add(self, at: Tensor, features: Tensor, terms: Terms, idle: int = 0) -> None:
        """Sum terms at points, by their numbers (N,) and features (m, N), or in both halves of them.

        `idle` is how many times in a row hardly any term has been left out.
        """
        tile, count, before = FeatureBox(features, terms.factors), len(at), terms.size
        least, largest = tile.bounds(terms)
        bottom = float(np.logaddexp(self.floor, float(log_sum_exp(least))))
        far = largest < bottom + LOG_TOLERANCE - math.log(before)
        if bool(far.any()):
            terms = terms.only(~far)
        idle = 0 if terms.size < LESS_SHARE * before else idle + 1
        if count > FEW_POINTS and count * terms.size > FEW_PAIRS and idle <= MAX_IDLE_HALVINGS:
            # halves across the longest side; a gather is four times as fast as an index
            along = features[int(tile.sides.argmax())].numpy()
            order = torch.as_tensor(np.argpartition(along, count // 2))
            for half in (order[: count // 2], order[count // 2 :]):
                inside = features.gather(1, half.expand(len(features), -1))
                self._add(at[half], inside, terms, idle)
            return
        slope, parts = self.slope is not None, list[tuple[Tensor, Tensor | None]]()
        sharp = terms.sharp(tile.radius)
        if bool(sharp.any()):
            parts.append(terms.only(sharp).sharp_log_sum(features, slope=slope))
            terms = terms.only(~sharp)
        if terms.size:
            spread = float(terms.peaks.max()) - bottom
            parts.append(terms.log_sum(features, tile.middle, spread, slope=slope))
        self._put(at, parts)

    def _put(self, at: Tensor, parts: list[tuple[Tensor, Tensor | None]]) -> None:
        """Set the sums at points (N,), whose parts have logarithms (N,) and gradients (m, N)."""
        if not parts:
            return
        logs = [log for log, _ in parts]
        total = reduce(torch.logaddexp, logs)
        self.log_sum[at] = total
        if self.slope is not None:
            for log, slope in parts:
                assert slope is not None
                self.slope[:, at] += slope * (log - total).exp().nan_to_num_(0.0)
