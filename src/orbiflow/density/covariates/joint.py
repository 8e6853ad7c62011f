"""Conditional densities of a joint density, on a torus, of the data and the covariates."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Self

import torch
from scipy import optimize
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.covariates.columns import SPREAD
from orbiflow.density.covariates.parts import Part
from orbiflow.density.fitting import Evidence, Folds
from orbiflow.density.inference import at_observed
from orbiflow.density.models import (
    Density,
    PartialDensity,
    Split,
    density_from,
    density_parts,
    mixture_of,
)
from orbiflow.density.spaces import Space, Torus, turns_at
from orbiflow.errors import OrbiflowError
from orbiflow.typed_torch import listed

SHARE_RIDGE = 1e-3
"""Weight of the mean square of the logarithms by which shares are changed for what is asked."""

MOST_DIM = 6
"""The most angles and covariates together."""

BLOCK_ROWS = 2**12
"""Rows worked on at a time."""


class JointDensity(Part):
    """p(y, x) / p(x) of a density of data on a torus and of covariates, each of them a circle, too.

    A real covariate is a circle that closes at infinity, as one of the torus.

    Args:
        space: The torus of the data.
        density: A density on `joint_torus` of it.
        number: The number (m,) of the covariate of each feature.
    """

    kind = "joint"
    space: Torus

    def __init__(self, space: Torus, density: Density, number: Tensor) -> None:
        self.space, self.density, self.number = space, density, number

    @torch.no_grad()
    def log_prob(self, points: Tensor, x: Tensor) -> Tensor:
        known = covariate_turns(x, self.number)
        none = points.new_full(points.shape, math.nan)
        found = [
            at_observed(self.density, torch.cat([own, at], dim=1))
            - at_observed(self.density, torch.cat([lack, at], dim=1))
            for own, lack, at in zip(
                *(part.split(BLOCK_ROWS) for part in (points, none, known)), strict=True
            )
        ]
        return torch.cat(found)

    @torch.no_grad()
    def at(self, x: Tensor) -> Density:
        values: list[float] = listed(covariate_turns(x[None], self.number)[0])
        d = self.space.dim
        split = Split(
            d + len(values), tuple(range(d)), tuple(range(d, d + len(values))), (*values,)
        )
        closed, left = self.density.restricted(split, self.space)
        others = [(log, PartialDensity(own, how)) for log, own, how in left]
        parts = [*closed, *((log + own.log_given, own) for log, own in others)]
        top = max(log for log, _ in parts)
        weighted = [(math.exp(log - top), own) for log, own in parts]
        return mixture_of([(weight, own) for weight, own in weighted if weight > 0])

    def header(self) -> dict[str, Any]:
        return {"density": density_parts(self.density, "joint density")[0]}

    def tensors(self) -> dict[str, Tensor]:
        return density_parts(self.density, "joint density")[1]

    @classmethod
    def from_header(
        cls, space: Space, number: Tensor, header: Mapping[str, Any], tensors: Mapping[str, Tensor]
    ) -> Self:
        if not isinstance(space, Torus) or not is_joint_possible(space, number):
            raise OrbiflowError("a joint density that cannot be")
        joint = joint_torus(space, int(number.max()) + 1)
        return cls(space, density_from(joint, header["density"], tensors), number)


def for_conditionals(evidence: Evidence, folds: Folds, dim: int) -> Evidence:
    """Return evidence with shares that suit the first `dim` columns best where the others are known.

    Those of a joint density make all columns likeliest, and how covariates are spread does not count.
    """
    tables: list[Tensor] = []
    for fold in range(folds.used):
        whole = folds.held(fold).points
        known = torch.cat([whole.new_full((len(whole), dim), math.nan), whole[:, dim:]], dim=1)
        parts = evidence.parts(fold)
        tables.append(
            torch.stack(
                [torch.stack([at_observed(own, at) for own in parts]) for at in (whole, known)]
            )
        )
    table, candidates = torch.cat(tables, dim=2), evidence.candidates
    counts = candidates.row_weights
    counts = torch.ones_like(table[0, 0]) if counts is None else counts
    folds_of_rows = candidates.fold

    def shares(some: Tensor) -> Tensor:
        every = torch.zeros_like(evidence.shares)
        chosen = evidence.chosen
        every[chosen] = _conditional_shares(
            table[:, :, some], counts[some], evidence.shares[chosen], candidates.floor[chosen]
        )
        return every

    apart = [shares(folds_of_rows != fold) for fold in range(folds.used)]
    return replace(evidence, shares=shares(folds_of_rows >= 0), apart=apart)


def _conditional_shares(table: Tensor, counts: Tensor, start: Tensor, floor: Tensor) -> Tensor:
    """Return shares (P,) by log densities (2, P, n) of whole rows and of covariates alone.

    The search begins at a start, and a ridge holds what few rows decide. Those of the `floor` (P,) do
    not fall: nothing is impossible.
    """
    both, alone = table
    row_shares = counts / counts.sum()

    def loss(values: Array) -> tuple[float, Array]:
        logits = torch.tensor(values, requires_grad=True)
        weights = torch.log_softmax(logits, dim=0)[:, None]
        gains = (both + weights).logsumexp(dim=0) - (alone + weights).logsumexp(dim=0)
        value = SHARE_RIDGE * (logits - start.log()).square().mean() - row_shares @ gains
        (gradient,) = torch.autograd.grad(value, logits)
        return float(value.detach()), gradient.numpy()

    found = optimize.minimize(loss, start.log().numpy(), jac=True, method="L-BFGS-B").x
    best = torch.softmax(torch.tensor(found), dim=0)
    best[floor] = best[floor].maximum(start[floor])
    return best / best.sum()


def is_joint_possible(space: Space, number: Tensor) -> bool:
    """Return whether there are so few columns on a torus; `number` is that of `JointDensity`.

    Words, which have more features, are taken for none.
    """
    few = isinstance(space, Torus) and space.dim + int(number.max()) + 1 <= MOST_DIM
    return few and int(number.bincount().max()) <= 2


def joint_torus(space: Torus, covariates: int) -> Torus:
    """Return the torus of a torus' columns and as many circles more."""
    return Torus([*space.axes, *[None] * covariates], unit=str(space.unit))


def covariate_turns(x: Tensor, number: Tensor) -> Tensor:
    """Return where real and cyclic covariates are on circles, in turns (N, c), by features (N, m)."""
    found: list[Tensor] = []
    for own in range(int(number.max()) + 1):
        some = x[:, number == own]
        if some.shape[1] == 2:
            found.append(torch.atan2(some[:, 1], some[:, 0]) / (2 * math.pi) % 1)
        else:
            found.append(turns_at(some[:, 0] / SPREAD))
    return torch.stack(found, dim=1)
