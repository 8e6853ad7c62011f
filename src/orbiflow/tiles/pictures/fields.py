"""The field of a tile's flow, where the tile lies."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from orbiflow.tiles.search import TileModel


def placed_field(model: TileModel) -> Callable[[Tensor], Tensor]:
    """Return a single candidate's vector field, pushed forward by A o L to the target's normal form.

    It is the mean over time if the flow has several segments.
    """
    linear = model.linear().detach()[0]
    # fields are linear in their parameters: one evaluation for any number of segments
    parameters = torch.stack([segment.parameters_.detach() for segment in model.fourier_fields()])
    mean = model.with_fields([parameters.mean(dim=0)])

    @torch.no_grad()
    def field(points: Tensor) -> Tensor:
        flat = points.to(linear).reshape(1, -1, 2)
        return (mean.flow.segments[0](model.unplace(flat)) @ linear.mT).reshape(points.shape)

    return field
