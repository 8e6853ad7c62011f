"""The paper's nested symmetrization sums, as printed, against the mean over the group."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from orbiflow.fields import FourierField, VectorField, periodic_operator, symmetrize
from orbiflow.symmetry import CrystallographicGroup, Isometry, identity

# A generator g and the number K of terms: V -> sum over k < K of g^-k o V o g^k
Operator = tuple[Isometry, int]

UNIT_CELL = CrystallographicGroup.generate(np.eye(2))


def unit_field(max_frequency: int = 3, seed: int = 0) -> FourierField:
    """Return the paper's F: periodic on the unit square, with random coefficients."""
    field = FourierField(UNIT_CELL, max_frequency, smoothness=1.0)
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        drawn = torch.randn(field.size, generator=generator, dtype=torch.float64)
        field.parameters_.copy_(drawn / math.sqrt(field.size))
    return field


def nested(field: VectorField, operators: Sequence[Operator]) -> VectorField:
    """Apply operators to a field, the first outermost: O_1(O_2(...(V)))."""
    result = field
    for g, count in reversed(operators):
        result = _summed(result, g, count)
    return result


def _summed(field: VectorField, g: Isometry, count: int) -> VectorField:
    powers = [identity(2)]
    for _ in range(count - 1):
        powers.append(g @ powers[-1])

    def operated(points: Tensor) -> Tensor:
        return torch.stack([p.inverse().push(field(p(points))) for p in powers]).sum(dim=0)

    return operated


def terms(operators: Sequence[Operator]) -> int:
    """Return the number of the field's evaluations in the nested sums."""
    return math.prod(count for _, count in operators)


@torch.no_grad()
def nested_error(group: CrystallographicGroup, operators: Sequence[Operator]) -> float:
    """Return the largest difference of the nested sums, over their terms, from the group's mean.

    It is taken at random points, relative to the field's root mean square.
    """
    periodic = periodic_operator(unit_field(), group.lattice)
    points = _points()
    paper = nested(periodic, operators)(points) / terms(operators)
    mean = symmetrize(periodic, group, periodic=True)(points)
    return float((paper - mean).norm(dim=-1).max() / mean.square().sum(dim=-1).mean().sqrt())


@torch.no_grad()
def equivariance_error(field: VectorField, group: CrystallographicGroup) -> float:
    """Return the largest |V(g p) - R_g V(p)| over cosets and points, over V's root mean square."""
    points = _points()
    values = field(points)
    worst = max(float((field(g(points)) - g.push(values)).norm(dim=-1).max()) for g in group.cosets)
    return worst / float(values.square().sum(dim=-1).mean().sqrt())


def _points() -> Tensor:
    generator = torch.Generator().manual_seed(1)
    return 4 * torch.rand(200, 2, generator=generator, dtype=torch.float64) - 2
