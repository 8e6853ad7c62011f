"""What a page in a browser draws flat: a density on a grid, with its colours, axes and points."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.inference import log_prob_observed
from orbiflow.density.models import Density
from orbiflow.density.pictures import colours, frames
from orbiflow.density.pictures.grounds import thinned
from orbiflow.density.pictures.surfaces import packed
from orbiflow.density.spaces import RoundSpace, Space, to_latlon, to_vectors
from orbiflow.errors import OrbiflowError

CELLS = {"line": 720, "square": 160, "pair": 64, "globe": 120}
"""Cells along a side; of a globe from pole to pole."""

NATURAL = "natural"


def flat_frame(density: Density, names: tuple[str, ...], samples: Tensor) -> dict[str, Any]:
    """Return what all flat pictures of a density share: names, axes, points, colours.

    Points are at most `MAX_DOTS`: places in the window, between 0 and 1, or degrees north and east.

    Args:
        density: A density on a torus, or on another space of two dimensions with a square.
        names: Names of the data's columns.
        samples: Chart points (N, d).
    """
    from matplotlib import colormaps

    space = density.space
    if not space.is_torus:
        frames.require_plane(space)
    view = frames.view_of(space, names)
    chosen = torch.tensor(thinned(frames.chart_points(space, samples).numpy()))
    axes: list[dict[str, Any]] = []
    if isinstance(space, RoundSpace):
        places = to_latlon(space.vectors(chosen))
    else:
        places = view.places(chosen)
        for axis in range(space.dim):
            label, at, texts = frames.angle_axis(view, axis)
            turn = {"low": view.low[axis], "period": space.periods[axis]}
            axes.append({"label": label, "at": at, "texts": texts} | turn)
    ramp = 255 * colormaps[colours.COLOURS](np.linspace(0, 1, 256))
    return {
        "names": list(view.names),
        "axes": axes,
        "points": packed(places, "<f4"),
        "shown": len(places),
        "colours": packed(ramp, "u1"),
    }


@torch.no_grad()
def flat_data(density: Density, axes: tuple[int, ...] | None = None) -> dict[str, Any]:
    """Return the density on a grid, the first axis first, and how it is coloured, as JSON has it.

    Log densities are in natural measure. A "line" is of one angle and a "square" of two, both of the
    window that `flat_frame` marks; a "globe" has rows from the south pole to the north pole and columns
    from 180 degrees west on. Peaks narrower than a cell are averaged over it, unless `axes` are given.

    Args:
        density: A density on a torus, or on another space of two dimensions with a square.
        axes: The two angles whose density is wanted, whatever the others are, on a torus of more.
    """
    space = density.space
    if axes is not None and space.dim > 2:
        kind, values, weights = "square", _pair(density, axes), None
    elif isinstance(space, RoundSpace):
        kind, (values, weights) = "globe", _globe(density, space)
    else:
        kind = "line" if space.dim == 1 else "square"
        values, weights = _window(density, kind), None
    shade = colours.shading(values, weights, log=None if kind != "line" else False)
    logs = np.log(np.maximum(values, shade.peak * 1e-12))
    return {
        "kind": kind,
        "cells": list(values.shape),
        "logs": packed(logs, "<f4"),
        "shade": {"low": shade.low, "high": shade.high, "log": shade.log},
        "ticks": [tick._asdict() for tick in colours.bar_ticks(shade, ends=True)],
        "measure": colours.bar_label(shade, _drawn(space, axes), NATURAL),
    }


def _drawn(space: Space, axes: tuple[int, ...] | None) -> Space:
    """Return the space of the angles that are drawn."""
    return space if axes is None or not space.is_torus else space.of_axes(axes)


def _middles(count: int) -> Tensor:
    return (torch.arange(count, dtype=torch.float64) + 0.5) / count


def _window(density: Density, kind: str) -> Array:
    view, t = frames.view_of(density.space), _middles(CELLS[kind])
    sides = [t + low for low in view.low]
    if len(sides) == 1:
        return density.log_prob(sides[0][:, None], measure=NATURAL).exp().numpy()
    return colours.density_on_grid(density, sides[0], sides[1], NATURAL)


def _pair(density: Density, axes: tuple[int, ...]) -> Array:
    """Return the density of two angles, at the middles of cells."""
    view, t = frames.view_of(density.space), _middles(CELLS["pair"])
    if len(set(axes)) != 2 or not all(0 <= axis < density.space.dim for axis in axes):
        raise OrbiflowError(f"a flat picture is of two different angles, got {list(axes)}")
    grid = torch.stack(
        torch.meshgrid(*(t + view.low[axis] for axis in axes), indexing="ij"), dim=-1
    )
    points = torch.full((len(t) ** 2, density.space.dim), math.nan, dtype=torch.float64)
    points[:, list(axes)] = grid.reshape(-1, 2)
    logs = log_prob_observed(density, points, measure=NATURAL)
    return logs.exp().reshape(len(t), len(t)).numpy()


def _globe(density: Density, space: RoundSpace) -> tuple[Array, Array]:
    """Return the density (n, 2 n) at latitudes and longitudes, and the areas of cells."""
    count = CELLS["globe"]
    lat = 180 * _middles(count).numpy() - 90
    lon = 360 * _middles(2 * count).numpy() - 180
    latlon = np.stack(np.meshgrid(lat, lon, indexing="ij"), axis=-1)
    points = space.vectors_to_chart(to_vectors(latlon.reshape(-1, 2)))
    values = colours.density_over(density, points, NATURAL, colours.round_pixel(math.pi / count))
    areas = np.repeat(np.cos(np.radians(lat))[:, None], 2 * count, axis=1)
    return values.reshape(areas.shape), areas
