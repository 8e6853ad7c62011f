"""From a candidate's flow to the polygon of its tile."""

from __future__ import annotations

import math

import torch

from orbiflow.arguments import instance
from orbiflow.arrays import Array
from orbiflow.errors import CertificationError
from orbiflow.tiles.search.model import TileModel
from orbiflow.tiles.search.polygons import simplest_tile
from orbiflow.tiles.tilings import Tile
from orbiflow.typed_torch import listed

MAX_STEPS = 1024
"""Integration steps of a segment beyond which a field counts as too steep."""


@torch.no_grad()
def converge(
    model: TileModel, points: torch.Tensor, *, tolerance: float = 1e-7, force: bool = False
) -> tuple[torch.Tensor, float]:
    """Double the integration steps until the flow is accurate.

    Quality is judged at the steps set here, never at those of the optimisation (design point 5).

    Args:
        model: a single candidate; its number of steps is changed.
        points: (1, N, 2) in the group's frame.
        tolerance: on the change of the flow when its steps are doubled, in the group's units.
        force: give what there is after `MAX_STEPS` steps, accurate or not.

    Returns:
        The points carried at the doubled steps, and the error estimate.

    Raises:
        CertificationError: if `MAX_STEPS` are not enough: the field is too steep; or if the flow
            has no finite values.
    """
    coarse = model.flow(points)
    while True:
        finer = model.flow.with_steps(2 * model.flow.steps)
        fine = finer(points)
        error = float((fine - coarse).abs().max())
        if not math.isfinite(error):
            raise CertificationError("the flow has no finite values: lower the learning rate")
        model.flow = finer
        if error <= tolerance or (force and model.flow.steps >= MAX_STEPS):
            return fine, error
        if model.flow.steps >= MAX_STEPS:
            raise CertificationError(
                f"the flow is not accurate after {model.flow.steps} steps (error {error:.1e}): "
                "the field is too steep; lower max-frequency or raise the penalty"
            )
        coarse = fine


@torch.no_grad()
def extract_tile(model: TileModel, *, force: bool = False) -> tuple[Tile, TileModel]:
    """The polygon and group of a single candidate, in the target's normal form, float64.

    The polygon is the coarsest that is simple, see `simplest_tile`.

    Args:
        model: a single candidate; left as it is.
        force: return the finest polygon even if it crosses itself or the flow is inaccurate.

    Returns:
        The tile, and the float64 model with the integration steps that made it.

    Raises:
        OrbiflowError: if the model holds more than one candidate.
        CertificationError: if no sampling gives a simple polygon: the candidate has folded. With
            `force`, only if coordinates are not finite.
    """
    instance(model, TileModel, "the model", "load_model and the fits give one")
    model.require_single()
    model = model.take([0]).double()
    model.flow = model.flow.with_steps(max(1, 8 // model.segments), method="rk4")
    vertices, corners = model.prototile()

    def moved(points: Array) -> Array:
        return converge(model, torch.as_tensor(points)[None], force=force)[0][0].numpy()

    tile = simplest_tile(
        model.isohedral_class,
        vertices[0].numpy(),
        listed(corners[0]),
        model.linear()[0].numpy(),
        model.offset.detach()[0].numpy(),
        moved=moved,
        force=force,
    )
    return tile, model
