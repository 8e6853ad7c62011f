"""Steps of EM for mixtures on quotients of spheres by large groups, such as orientations of crystals.

A point has as many images as the group has elements, and a component needs those near it alone. So
points stay where they are, in one piece of the sphere, components have images, and of these each block
of neighbouring points takes those that count there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import torch
from scipy.spatial import KDTree
from torch import Tensor

from orbiflow.density.models import FAINT_LOG, LOG2_E, kernel_rows, log_sum_exp
from orbiflow.density.spaces import UnitVectorSpace

BLOCK_POINTS, BLOCK_ENTRIES = 128, 2**18
"""The most points of a block, which are neighbours, and entries of a table of some of them: few enough
for the cache."""

LEFT_OUT_LOG = math.log(1e-6)
"""Logarithm of the share of a point's likelihood that images left out may have together."""

WIDE_LOG = 60.0
"""Logarithm of the largest ratio of likelihoods in a block that needs no scaling point by point."""

MOST_SINGLE = 1_000.0
"""Concentration below which single precision has shares within 1e-4 of themselves: half the time."""


class _Block(NamedTuple):
    """Neighbouring points (n, m), weights (n,), their middle (m,) and the largest angle from it."""

    points: Tensor
    weights: Tensor | None
    middle: Tensor
    radius: float

    def parts(self, size: int) -> Iterator[tuple[Tensor, Tensor | None]]:
        """Yield points and weights of at most `size` of them at a time."""
        points = torch.split(self.points, size)
        every = [None] * len(points) if self.weights is None else torch.split(self.weights, size)
        yield from zip(points, every, strict=True)


class Orbits:
    """Points (N, m) of a quotient of a sphere in blocks of neighbours, with weights (N,) or none."""

    def __init__(self, space: UnitVectorSpace, points: Tensor, weights: Tensor | None) -> None:
        self.space = space
        self.points = space.features(points, slice(1))[0]
        self.elements = space.elements.to(self.points)
        order = torch.as_tensor(KDTree(self.points.numpy(), leafsize=BLOCK_POINTS).indices)
        self._blocks: list[_Block] = []
        for rows in torch.split(order, BLOCK_POINTS):
            near = self.points[rows]
            middle = torch.nn.functional.normalize(near.mean(dim=0), dim=0)
            radius = float((near @ middle).clamp(-1, 1).min().acos())
            self._blocks.append(
                _Block(near, None if weights is None else weights[rows], middle, radius)
            )

    def away(self, row: int) -> Tensor:
        """Return squared distances (N,) from the nearest images of a point."""
        images = self.elements @ self.points[row]
        return (2 - 2 * (self.points @ images.mT).amax(dim=1)).clamp_min(0)

    def expectation(
        self, mean: Tensor, kappa: Tensor, weights: Tensor
    ) -> tuple[Tensor, Tensor, Tensor, float]:
        """Return what belongs to each of K components, and the log-likelihood.

        What belongs to a component are points (K,), again as (K, 1), and sums (K, m) of their images.
        """
        # x g . y = x . g^T y: what an image of the point is to the component
        images = (mean @ self.elements).flatten(0, 1)
        each = len(self.elements)
        rows, offsets = kernel_rows(self.space, images, kappa.repeat(each, 1))
        offsets = offsets + weights.log().repeat(each)
        sharp = kappa[:, 0].repeat(each)
        dtype = torch.float32 if float(kappa.max()) < MOST_SINGLE else torch.float64
        sums, score = images.new_zeros(images.shape[1] + 1, len(images)), 0.0
        for block in self._blocks:
            angle = (images @ block.middle).clamp_(-1, 1).acos_()
            least = offsets + sharp * (angle + block.radius).clamp_max_(math.pi).cos_()
            largest = offsets + sharp * (angle - block.radius).clamp_min_(0).cos_()
            bottom, top = float(log_sum_exp(least)), float(largest.max())
            at = (largest > bottom + LEFT_OUT_LOG - math.log(len(sharp))).nonzero()[:, 0]
            some = (rows[at] * LOG2_E).mT.to(dtype).contiguous()
            bias = ((offsets[at] - top) * LOG2_E).to(dtype)
            for points, counts in block.parts(max(1, BLOCK_ENTRIES // len(at))):
                share, high = torch.addmm(bias, points.to(dtype), some), 0.0
                if top - bottom > WIDE_LOG:
                    high = share.amax(dim=1)
                    share.sub_(high[:, None]).clamp_min_(FAINT_LOG)
                every = share.exp2_().sum(dim=1)
                likelihood, row = (every.log2() + high).double() / LOG2_E + top, every.reciprocal()
                if counts is not None:
                    likelihood, row = likelihood * counts, row * counts
                weighed = torch.cat([(points * row[:, None]).mT, row[None]]).to(dtype)
                sums.index_add_(1, at, (weighed @ share).double())
                score += float(likelihood.sum())
        total, count = sums[:-1].mT, sums[-1]
        # each sum is turned from where its image is to the component
        turned = total.reshape(each, -1, total.shape[1]) @ self.elements.mT
        counts = count.reshape(each, -1).sum(dim=0)
        return counts, counts[:, None], turned.sum(dim=0), score
