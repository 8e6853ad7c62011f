"""One density of what a fit by evidence has chosen."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from orbiflow.density.fitting.evidence import Candidates
from orbiflow.density.fitting.families import Family
from orbiflow.density.fitting.rows import Rows
from orbiflow.density.models import Density, Mixture, UniformDensity, mixture_of
from orbiflow.density.spaces import Space


def assembled(
    space: Space,
    families: list[Family[Any]],
    candidates: Candidates,
    weights: Tensor,
    rows: Rows,
    flow: Density | None,
    share: float,
) -> Mixture:
    """Return the candidates in proportions (P,), made final with all rows, beside a flow.

    Args:
        space: The space of all.
        families: The families that the candidates belong to.
        candidates: The candidates.
        weights: Their proportions.
        rows: All rows.
        flow: A flow's density; None for none.
        share: The weight of the flow.
    """
    found: list[tuple[float, Density]] = []
    for family in families:
        chosen = [
            (name, float(weight))
            for own, name, weight in zip(
                candidates.families, candidates.names, weights, strict=True
            )
            if own == family.name and weight > 0
        ]
        final = family.final(rows, candidates.fitted[family.name], [name for name, _ in chosen])
        found += [(weight, part) for (_, weight), part in zip(chosen, final, strict=True)]
    floor = float(weights[candidates.floor].sum())
    # the order of components is that in which samples are drawn: kernels before the floor
    found.sort(key=lambda part: part[1].kernel_part is None)
    kernels = sum(part.kernel_part is not None for _, part in found)
    found.insert(kernels, (floor, UniformDensity(space)))
    total = sum(weight for weight, _ in found)
    others = [((1 - share) * weight / total, part) for weight, part in found]
    return mixture_of(others if flow is None else [(share, flow), *others])
