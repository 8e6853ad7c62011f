"""From a candidate to a polygon: vertices where the boundary bends, the same on identified edges."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
import shapely
import torch

from orbiflow.arguments import instance
from orbiflow.arrays import Array
from orbiflow.errors import CertificationError
from orbiflow.tiles.search.model import TileModel
from orbiflow.tiles.tilings import (
    EdgeIdentification,
    IsohedralClass,
    Tile,
)
from orbiflow.typed_torch import listed

DENSE = (960, 4320)
"""Least number of samples around the tile from which vertices are chosen; the second if need be."""

MAX_STEPS = 1024
"""Integration steps of a segment beyond which a field counts as too steep."""

TOLERANCES = (5e-4, 1e-4, 2e-5, 0.0)
"""Largest deviation of the polygon from the sampled curve, in square roots of the tile's area."""


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

    The coarsest polygon that is simple is taken: 5e-4 of the tile's size from the sampled curve,
    finer where parts of the boundary come close to each other.

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
    kind = model.isohedral_class
    model = model.take([0]).double()
    model.flow = model.flow.with_steps(max(1, 8 // model.segments), method="rk4")
    sides = model.prototile()[0].shape[1]
    tile = None
    for count in DENSE:
        pieces = 2 * -(-count // (2 * sides))  # even: centres are sampled
        edges = _flowed_edges(model, pieces, force)
        for polygon, starts in _polygons(kind, edges):
            tile = Tile(polygon, model.placed_group(), kind.name, starts)
            if shapely.Polygon(polygon).is_valid:
                return tile, model
    if force and tile is not None:
        return tile, model
    raise CertificationError(
        f"{kind.name}: the boundary crosses itself even with {DENSE[-1]} samples"
    )


def _flowed_edges(model: TileModel, pieces: int, force: bool) -> list[Array]:
    """Samples along each edge of the tile, both ends included, at converged steps.

    Half of them are carried by the flow, the others are their images: the flow commutes with the
    group, step for step.
    """
    kind, placed = model.isohedral_class, _placement(model)
    before = model.boundary(pieces)[0]
    closed = torch.cat([before, before[:1]])
    first: list[int] = [*listed(model.prototile()[1][0] * pieces), len(before)]
    spans: dict[EdgeIdentification, slice[int, int, None]] = {}
    for pair in kind.identified_edges:
        start, end = first[pair.first], first[pair.first + 1]
        spans[pair] = slice(start, (start + end) // 2 + 1 if pair.folded else end + 1)
    points = torch.cat([closed[span] for span in spans.values()])[None]
    flowed = converge(model, points, force=force)[0][0].numpy()
    ends = np.cumsum([span.stop - span.start for span in spans.values()])
    edges: dict[int, Array] = {}
    for pair, own in zip(spans, np.split(flowed, ends[:-1]), strict=True):
        image = pair.isometry(own)
        if pair.folded:
            edges[pair.first] = np.concatenate([own, image[-2::-1]])
        else:
            edges[pair.first] = own
            edges[pair.second] = image[::-1] if pair.reversed else image
    return [placed(edges[i]) for i in range(len(edges))]


def _placement(model: TileModel) -> Callable[[Array], Array]:
    linear, offset = (t.detach().numpy()[0] for t in (model.linear(), model.offset))
    return lambda points: points @ linear.T + offset


def _polygons(kind: IsohedralClass, edges: list[Array]) -> Iterator[tuple[Array, tuple[int, ...]]]:
    for tolerance in TOLERANCES:
        chosen = _chosen_samples(kind, edges, tolerance)
        kept = [edge[:-1][mask[:-1]] for edge, mask in zip(edges, chosen, strict=True)]
        starts = np.cumsum([0] + [len(edge) for edge in kept[:-1]])
        yield np.concatenate(kept), tuple(int(start) for start in starts)


def _chosen_samples(kind: IsohedralClass, closed: list[Array], tolerance: float) -> list[Array]:
    """For each edge, which of its samples to keep, both ends included: matching on identified edges."""
    masks: dict[int, Array] = {}
    for pair in kind.identified_edges:
        curve = closed[pair.first]
        if pair.folded:
            half = _simplified(curve[: len(curve) // 2 + 1], tolerance)
            masks[pair.first] = np.concatenate([half, half[-2::-1]])
            continue
        mask = _simplified(curve, tolerance)
        masks[pair.first] = mask
        masks[pair.second] = mask[::-1] if pair.reversed else mask
    return [masks[i] for i in range(len(closed))]


def _simplified(curve: Array, tolerance: float) -> Array:
    """Douglas-Peucker: which points of the curve (M, 2) to keep, the ends always."""
    if tolerance == 0.0:
        return np.ones(len(curve), dtype=bool)
    kept = shapely.get_coordinates(
        shapely.simplify(shapely.LineString(curve), tolerance, preserve_topology=False)
    )
    mask = np.zeros(len(curve), dtype=bool)
    position = 0
    for point in kept:  # vertices are kept bit for bit and in order
        position += int(np.flatnonzero((curve[position:] == point).all(axis=1))[0])
        mask[position] = True
    return mask
