"""Conditional densities of a joint density, on a torus, of the data and the covariates."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Self

import torch
from torch import Tensor

from orbiflow.density.models.conditional_parts import ConditionalPart
from orbiflow.density.models.density import Density, Split
from orbiflow.density.models.headers import density_from, density_parts
from orbiflow.density.models.mixture import PartialDensity, mixture_of
from orbiflow.density.spaces import SPREAD, Space, Torus, turns_at
from orbiflow.errors import OrbiflowError
from orbiflow.typed_torch import listed

MOST_DIM = 6
"""The most angles and covariates together."""

BLOCK_ROWS = 2**12
"""Rows worked on at a time."""


class JointDensity(ConditionalPart):
    """p(y, x) / p(x) of a density of data on a torus and of covariates, each of them a circle, too.

    A real covariate is a circle that closes at infinity, as one of the torus.

    Args:
        space: The torus of the data.
        density: A density on `joint_torus` of it.
        number: The number (m,) of the covariate of each feature.
    """

    kind = "joint"

    def __init__(self, space: Torus, density: Density, number: Tensor) -> None:
        self.space, self.density, self.number = space, density, number

    @torch.no_grad()
    def log_prob(self, points: Tensor, x: Tensor) -> Tensor:
        d, logs = self.space.dim, list[Tensor]()
        both = torch.cat([points, covariate_turns(x, self.number)], dim=1)
        for some in torch.split(both, BLOCK_ROWS):
            logs.append(self.density.log_prob(some) - log_of_covariates(self.density, some, d))
        return torch.cat(logs)

    @torch.no_grad()
    def at(self, x: Tensor) -> Density:
        values: list[float] = listed(covariate_turns(x[None], self.number)[0])
        d = self.space.dim
        split = Split(
            d + len(values), tuple(range(d)), tuple(range(d, d + len(values))), (*values,)
        )
        closed, left = self.density.restricted(split, self.space)
        others = [(log, PartialDensity(part, how)) for log, part, how in left]
        parts = [*closed, *((log + part.log_given, part) for log, part in others)]
        top = max(log for log, _ in parts)
        weighted = [(math.exp(log - top), part) for log, part in parts]
        return mixture_of([(weight, part) for weight, part in weighted if weight > 0])

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
    columns: list[Tensor] = []
    for covariate in range(int(number.max()) + 1):
        some = x[:, number == covariate]
        if some.shape[1] == 2:
            columns.append(torch.atan2(some[:, 1], some[:, 0]) / (2 * math.pi) % 1)
        else:
            columns.append(turns_at(some[:, 0] / SPREAD))
    return torch.stack(columns, dim=1)


def log_of_covariates(density: Density, points: Tensor, dim: int) -> Tensor:
    """Return log densities (N,) of the columns after the first `dim` alone."""
    return density.log_marginal(points[:, dim:], list(range(dim, points.shape[1])))
