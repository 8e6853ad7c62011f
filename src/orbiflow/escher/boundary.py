"""From a candidate to a polygon: vertices where the boundary bends, the same on identified edges."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely
import torch

from orbiflow.errors import CertificationError
from orbiflow.escher.model import TileModel
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings import IsohedralClass, Tile

DENSE = 768
"""Samples along each edge of the template from which vertices are chosen: even, for midpoints."""

TOLERANCES = (5e-4, 1e-4, 2e-5, 0.0)
"""Largest deviation of the polygon from the sampled curve, in square roots of the tile's area."""


def converge(model: TileModel, points: torch.Tensor, *, tolerance: float = 1e-7) -> float:
    """Double the integration steps until the flow is accurate; returns the error estimate.

    Quality is judged at the steps set here, never at those of the optimisation (design point 5).

    Args:
        model: a single candidate; its number of steps is changed.
        points: (1, N, 2) in the group's frame.
        tolerance: on the flow's step-doubling estimate, in the group's units.

    Raises:
        CertificationError: if 1,024 steps are not enough: the field is too steep; or if the flow
            has no finite values.
    """
    while True:
        error = model.flow.error_estimate(points)
        if not math.isfinite(error):
            raise CertificationError("the flow has no finite values: lower the learning rate")
        if error <= tolerance:
            model.flow.steps *= 2
            return error
        if model.flow.steps >= 1024:
            raise CertificationError(
                f"the flow is not accurate after {model.flow.steps} steps (error {error:.1e}): "
                "the field is too steep; lower max-frequency or raise the penalty"
            )
        model.flow.steps *= 2


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
        CertificationError: if no sampling gives a simple polygon: the candidate has folded. With
            `force`, only if coordinates are not finite.
    """
    kind = model.isohedral_class
    model = model.take([0]).double()
    model.flow.method, model.flow.steps = "rk4", 8
    dense_template = model.template_boundary(DENSE)
    try:
        converge(model, dense_template[:, :: DENSE // 32])
    except CertificationError:
        if not force:
            raise
    dense = model(dense_template)[0].numpy()
    if not np.isfinite(dense).all():
        raise CertificationError(f"{kind.name}: the boundary has no finite coordinates")
    for polygon, corners in _polygons(kind, dense):
        tile = Tile(polygon, model.placed_group(), kind.name, corners)
        if shapely.Polygon(polygon).is_valid:
            return tile, model
    if force:
        return tile, model
    raise CertificationError(
        f"{kind.name}: the boundary crosses itself even with {DENSE} samples an edge"
    )


def _polygons(kind: IsohedralClass, dense: Array) -> Iterator[tuple[Array, tuple[int, ...]]]:
    edges = dense.reshape(-1, DENSE, 2)
    closed = np.concatenate([edges, np.roll(edges, -1, axis=0)[:, :1]], axis=1)
    for tolerance in TOLERANCES:
        chosen = _chosen_samples(kind, closed, tolerance)
        kept = [edge[mask[:-1]] for edge, mask in zip(edges, chosen, strict=True)]
        starts = np.cumsum([0] + [len(edge) for edge in kept[:-1]])
        yield np.concatenate(kept), tuple(int(start) for start in starts)


def _chosen_samples(kind: IsohedralClass, closed: Array, tolerance: float) -> list[Array]:
    """For each edge, which of its DENSE + 1 samples to keep: matching on identified edges."""
    masks: dict[int, Array] = {}
    for pair in kind.identified_edges:
        if pair.first == pair.second:  # a 2-fold centre at the midpoint
            half = _simplified(closed[pair.first][: DENSE // 2 + 1], tolerance)
            masks[pair.first] = np.concatenate([half, half[-2::-1]])
            continue
        mask = _simplified(closed[pair.first], tolerance)
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
