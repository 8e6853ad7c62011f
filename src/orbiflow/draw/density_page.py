"""A page with a surface to turn in space, coloured by a density: one file, no network."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Sequence
from importlib import resources
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.density.density import SymmetricDensity
from orbiflow.density.flat_spaces import Torus
from orbiflow.density.round_spaces import ProjectivePlane, Sphere, to_vectors
from orbiflow.density.space import Space, checked_table
from orbiflow.draw.density_square import (
    COLOURS,
    MAX_DOTS,
    Shade,
    density_at,
    measure_label,
    shading,
    space_title,
)
from orbiflow.draw.immersions import Mesh, boy_surface, immersion, mesh, normals
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry.isometry import Array

MAX_BYTES = 3_000_000

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def density_page(
    density: SymmetricDensity,
    *,
    measure: str = "natural",
    samples: Tensor | None = None,
    resolution: int = 160,
    coastlines: Sequence[ArrayLike] | None = None,
    title: str = "",
) -> str:
    """A self-contained HTML page: the surface of the space, coloured by the density, to be turned.

    Torus: a ring. Sphere: the unit sphere in the user's frame. Klein bottle: the figure-8 immersion.
    Projective plane: Boy's surface. The density is evaluated at every vertex, so the colours close
    over the seams. WebGL 2 draws it, or a plain canvas where there is none.

    Args:
        density: on a two-dimensional space.
        measure: with respect to which the density is drawn (`orbiflow.density.space.MEASURES`).
        samples: chart points (N, 2) to draw as dots; of more than `MAX_DOTS`, a random choice.
        resolution: cells along an edge of the square, 2 to 200.
        coastlines: for the sphere and the projective plane, lines (M, 2) of latitude and longitude
            in degrees in the data's frame.
        title: default "Density on the" and the space.

    Raises:
        OrbiflowError: for a space of another dimension, an unknown measure, coastlines on a space
            without latitudes, or a page above `MAX_BYTES`.
    """
    space = density.space
    grid = mesh(space, resolution)
    values = density_at(density, grid.points, measure)
    # by area on the surface: vertices crowd at the cone points
    shade = shading(values, space.log_area(grid.points).exp().numpy())
    data = {
        **_surface(space, grid, values),
        "values": _packed(65535 * np.clip(values / shade.high, 0, 1), "<u2"),
        "lines": [
            {"width": width, **_polylines(lines)}
            for width, lines in (*_grid(space), (1.6, _coast(space, coastlines)))
            if lines
        ],
        "samples": "",
        "labels": _labels(space),
        "colours": _packed(_colours(), "u1"),
        "ticks": _ticks(shade),
        "measure": measure_label(space, measure),
    }
    if samples is not None:
        data["samples"] = _packed(immersion(space)(_thinned(space, samples)), "<f4")
    return _filled(title or f"Density on the {space_title(space)}", _caption(space), data)


def _surface(space: Space, grid: Mesh, values: Array) -> dict[str, Any]:
    """The mesh in space, how large it is, and from where it is seen first."""
    points = immersion(space)(grid.points)
    center = (points.min(axis=0) + points.max(axis=0)) / 2
    return {
        "center": center.tolist(),
        "radius": float(np.linalg.norm(points - center, axis=1).max()),
        "start": _start(points[values.argmax()] - center, space),
        "round": isinstance(space, Sphere),
        "points": _packed(points, "<f4"),
        "normals": _packed(127 * normals(space, grid.points), "i1"),
        "triangles": _packed(grid.triangles, "<u2"),
    }


def _filled(heading: str, text: str, data: dict[str, Any]) -> str:
    template = resources.files("orbiflow.draw").joinpath("density_page.html").read_text("utf-8")
    parts = {
        "%TITLE%": html.escape(heading),
        "%CAPTION%": html.escape(text),
        "%DATA%": json.dumps(data).replace("<", "\\u003c"),
    }
    for name, part in parts.items():
        template = template.replace(name, part)
    size = len(template.encode())
    if size > MAX_BYTES:
        raise OrbiflowError(
            f"the page would have {size / 1e6:.1f} MB, more than {MAX_BYTES / 1e6:g}: lower the "
            "resolution or give coastlines of fewer points"
        )
    return template


def _packed(array: Array, kind: str) -> str:
    """Base64 of an array, rounded if `kind` is an integer."""
    if np.dtype(kind).kind != "f":
        array = np.rint(array)
    return base64.b64encode(np.ascontiguousarray(array.astype(kind)).tobytes()).decode()


def _polylines(lines: list[Array]) -> dict[str, Any]:
    return {
        "points": _packed(np.concatenate(lines), "<f4"),
        "counts": [len(line) for line in lines],
    }


def _grid(space: Space) -> tuple[tuple[float, list[Array]], tuple[float, list[Array]]]:
    """Lines (M, 3) of equal coordinates, with their widths; heavier those of coordinate zero."""
    if isinstance(space, Sphere | ProjectivePlane):
        t = np.linspace(-180.0, 180.0, 181)
        step = 30 if isinstance(space, Sphere) else 15
        across = [np.stack([np.full(181, lat), t], axis=-1) for lat in range(0, 90, step)]
        across += [line * (-1, 1) for line in across[1:]]
        along = [np.stack([t / 2, np.full(181, lon)], axis=-1) for lon in range(0, 360, step)]
        parallels, meridians = (
            [_of_vectors(space, to_vectors(line)) for line in lines] for lines in (across, along)
        )
        return (1.0, parallels + meridians), (2.0, [parallels[0], meridians[0]])
    surface, t = immersion(space), torch.linspace(0, 1, 161, dtype=torch.float64)
    # every eighth of a turn; on the Klein bottle the square is half a turn high, and phi 0 inside
    torus = isinstance(space, Torus)
    across = [torch.stack([torch.full_like(t, k / 8), t], dim=-1) for k in range(8)]
    steps = 8 if torus else 4
    along = [torch.stack([t, torch.full_like(t, k / steps)], dim=-1) for k in range(steps)]
    zeros = [across[0 if torus else 2], along[0]]
    return (1.0, [surface(line) for line in across + along]), (2.0, [surface(z) for z in zeros])


def _of_vectors(space: Space, vectors: Array) -> Array:
    return vectors if isinstance(space, Sphere) else boy_surface(vectors)


def _labels(space: Space) -> list[dict[str, Any]]:
    """Names of the six directions along the axes, on a sphere."""
    if not isinstance(space, Sphere):
        return []
    latlon = ("0°", "90° E", "N", "180°", "90° W", "S")
    names = latlon if space.form == "latlon" else ("+x", "+y", "+z", "−x", "−y", "−z")
    ends = 1.07 * np.concatenate([np.eye(3), -np.eye(3)])
    return [{"text": n, "at": e.tolist()} for n, e in zip(names, ends, strict=True)]


def _caption(space: Space) -> str:
    """What is seen, and which way the coordinates run."""
    if isinstance(space, Sphere):
        return (
            "The sphere in the data's frame. Lines every 30°, heavier the equator and longitude 0."
        )
    if isinstance(space, ProjectivePlane):
        return (
            "Boy's surface, where a direction and its opposite are one point. Lines every 15° of "
            "latitude and longitude, heavier the equator and longitude 0. The surface passes through "
            "itself; sheets that cross are far apart on the projective plane."
        )
    lines = "Lines every 45°, heavier where an angle is 0."
    if isinstance(space, Torus):
        return f"{space.columns[0]} runs round the ring, {space.columns[1]} round its tube. {lines}"
    return (
        "The Klein bottle as a figure eight that makes half a turn on its way round: theta runs round "
        f"the ring, phi along the figure eight. {lines} The surface passes through itself along a "
        "circle; the sheets that cross there are far apart on the bottle."
    )


def _coast(space: Space, coastlines: Sequence[ArrayLike] | None) -> list[Array]:
    if coastlines is None:
        return []
    if not isinstance(space, Sphere | ProjectivePlane):
        raise OrbiflowError(f"coastlines need latitudes and longitudes, the {space.name} has none")
    tables = [checked_table(line, (2,), "a coastline") for line in coastlines]
    return [_of_vectors(space, to_vectors(table)) for table in tables if len(table) > 1]


def _thinned(space: Space, samples: Tensor) -> Tensor:
    if samples.ndim != 2 or samples.shape[1] != space.dim:
        raise OrbiflowError(f"expected chart points (N, {space.dim}), got {tuple(samples.shape)}")
    points = space.project(samples.detach().double().cpu())
    if len(points) > MAX_DOTS:
        points = points[np.random.default_rng(0).choice(len(points), MAX_DOTS, replace=False)]
    return points


def _colours() -> Array:
    from matplotlib import colormaps

    return 255 * colormaps[COLOURS](np.linspace(0, 1, 256))


def _ticks(shade: Shade) -> list[dict[str, Any]]:
    """Places from 0 to 1 on the colour bar and their texts."""
    from matplotlib.ticker import MaxNLocator

    places = [t for t in MaxNLocator(5).tick_values(shade.low, shade.high) if t <= shade.high]
    found = [{"at": t / shade.high, "text": _number(t)} for t in places]
    if shade.cut:
        found = [tick for tick in found if tick["at"] < 0.93]
        found.append({"at": 1.0, "text": f"≥ {_number(shade.high)}"})
    return found


def _start(peak: Array, space: Space) -> dict[str, float]:
    """Yaw and pitch of an eye from which the place `peak`, relative to the centre, is in front."""
    yaw, pitch = np.arctan2(peak[1], peak[0]), np.arctan2(peak[2], np.hypot(peak[0], peak[1]))
    lowest = -0.9 if isinstance(space, Sphere | ProjectivePlane) else 0.4  # rings from above
    return {"yaw": float(yaw), "pitch": float(np.clip(pitch, lowest, 0.9))}


def _number(value: float) -> str:
    digits, _, power = f"{value:.3g}".partition("e")
    return f"{digits} × 10{str(int(power)).translate(_RAISED)}" if power else digits
