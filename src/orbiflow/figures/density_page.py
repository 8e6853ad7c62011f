"""A page with a surface to turn in space, coloured by a density: one file, no network."""

from __future__ import annotations

import base64
import html
import json
import re
from collections.abc import Sequence
from importlib import resources
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.density.models.blend import MixedDensity
from orbiflow.density.models.symmetric import SymmetricDensity
from orbiflow.density.spaces.flat import KleinBottle, Torus
from orbiflow.density.spaces.round import ProjectivePlane, Sphere, to_vectors
from orbiflow.density.spaces.space import Space, checked_table
from orbiflow.errors import OrbiflowError
from orbiflow.figures.density_axes import (
    View,
    angle_text,
    axis_label,
    chart_points,
    column_name,
    space_title,
    view_of,
)
from orbiflow.figures.density_scale import bar_label, bar_ticks, shading
from orbiflow.figures.density_square import COLOURS, average_note, thinned
from orbiflow.figures.density_values import density_on_grid, is_sharp, takes_logarithms
from orbiflow.figures.immersions import (
    KLEIN_RADIUS,
    RING_RADIUS,
    TUBE_RADIUS,
    Mesh,
    boy_surface,
    immersion,
    mesh,
    normals,
)
from orbiflow.figures.viewpoint import EYE, viewpoint
from orbiflow.symmetry.isometry import Array

MAX_BYTES = 3_000_000

_CELLS, _FINE_CELLS = 160, 240
_SOFT = 1.6
"""Cells that the narrowest peak is averaged over: of fewer, a triangle's corners would be seen."""


def density_page(
    density: SymmetricDensity,
    *,
    measure: str = "natural",
    scale: str = "linear",
    names: Sequence[str] | None = None,
    samples: Tensor | None = None,
    dots: bool = True,
    resolution: int | None = None,
    coastlines: Sequence[ArrayLike] | None = None,
    title: str = "",
) -> str:
    """A self-contained HTML page: the surface of the space, coloured by the density, to be turned.

    Torus: a ring. Sphere: the unit sphere in the user's frame. Klein bottle: the figure-8 immersion.
    Projective plane: Boy's surface. The density is evaluated at every vertex, so the colours close
    over the seams; peaks narrower than its triangles are averaged over them, and the caption says so.
    The page opens with the peak in front. WebGL 2 draws it, or a plain canvas where there is none.

    Args:
        density: on a two-dimensional space.
        measure: with respect to which the density is drawn (`orbiflow.density.spaces.space.MEASURES`).
        scale: of the colours, one of `orbiflow.figures.density_scale.SCALES`.
        names: of the data's columns on torus and Klein bottle, default `space.columns`.
        samples: chart points (N, 2) to draw as dots; of more than `MAX_DOTS`, a random choice.
        dots: whether the samples are seen at first; a box in the page shows and hides them.
        resolution: cells along an edge of the square, 2 to 250; default 160, or 240 for a density
            with kernels.
        coastlines: for the sphere and the projective plane, lines (M, 2) of latitude and longitude
            in degrees in the data's frame.
        title: default "Density on the" and the space.

    Raises:
        OrbiflowError: for a space of another dimension, an unknown measure or scale, names that do not
            fit, coastlines on a space without latitudes, or a page above `MAX_BYTES`.
    """
    space = density.space
    cells = resolution or (_FINE_CELLS if isinstance(density, MixedDensity) else _CELLS)
    grid, view = mesh(space, cells), view_of(space, names)
    t = torch.linspace(0.0, 1.0, cells + 1, dtype=torch.float64)
    values = density_on_grid(density, t, t, measure, pixel=_SOFT / cells).ravel()
    # by area on the surface: vertices crowd at the cone points
    areas = space.log_area(grid.points).exp().numpy()
    shade = shading(values, areas, log=takes_logarithms(density, measure, scale))
    data = {
        **_surface(space, grid, values),
        "values": _packed(65535 * np.clip(shade.places(values), 0, 1), "<u2"),
        "lines": [
            {"width": width, **_polylines(lines)}
            for width, lines in (*_grid(space), (1.6, _coast(space, coastlines)))
            if lines
        ],
        "samples": "",
        "dots": dots,
        "labels": _labels(view),
        "colours": _packed(_colours(), "u1"),
        "ticks": [tick._asdict() for tick in bar_ticks(shade, ends=True)],
        "measure": bar_label(shade, space, measure),
    }
    if samples is not None:
        points = torch.tensor(thinned(chart_points(space, samples).numpy()))
        data["samples"] = _packed(immersion(space)(space.project(points)), "<f4")
    caption = _caption(view)
    if is_sharp(density, _SOFT / cells):
        note = average_note(round(cells / _SOFT))
        caption += f" {note[0].upper()}{note[1:]}."
    return _filled(title or f"Density on the {space_title(space)}", caption, data)


def _surface(space: Space, grid: Mesh, values: Array) -> dict[str, Any]:
    """The mesh in space, how large it is, and from where it is seen first."""
    points = immersion(space)(grid.points)
    center = (points.min(axis=0) + points.max(axis=0)) / 2
    return {
        "center": center.tolist(),
        "radius": float(np.linalg.norm(points - center, axis=1).max()),
        "start": viewpoint(space, grid.points[int(values.argmax())])._asdict(),
        "eye": EYE,
        "round": isinstance(space, Sphere),
        "points": _packed(points, "<f4"),
        "normals": _packed(127 * normals(space, grid.points), "i1"),
        "triangles": _packed(grid.triangles, "<u2"),
    }


def _filled(heading: str, text: str, data: dict[str, Any]) -> str:
    template = resources.files("orbiflow.figures").joinpath("density_page.html").read_text("utf-8")
    parts = {
        "%TITLE%": html.escape(heading),
        "%CAPTION%": html.escape(text),
        "%DATA%": json.dumps(data).replace("<", "\\u003c"),
    }
    # in one pass: a title may hold the name of a part
    template = re.sub("|".join(parts), lambda found: parts[found[0]], template)
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


def _labels(view: View) -> list[dict[str, Any]]:
    """Names of directions: on a sphere the six along the axes, round a ring the first angle's."""
    space = view.space
    if isinstance(space, Sphere):
        latlon = ("0°", "90° E", "N", "180°", "90° W", "S")
        names = latlon if space.form == "latlon" else ("+x", "+y", "+z", "−x", "−y", "−z")
        ends = 1.07 * np.concatenate([np.eye(3), -np.eye(3)])
    elif isinstance(space, Torus | KleinBottle):
        turns = (0, 0.25, 0.5, -0.25) if isinstance(space, Torus) else (0, 0.125, 0.25, 0.375)
        name = column_name(view, 0)
        names = [f"{name} {angle_text(t, space.unit)}" for t in turns]
        outside = 1.1 * (
            RING_RADIUS + TUBE_RADIUS if isinstance(space, Torus) else KLEIN_RADIUS + 1
        )
        ends = outside * np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    else:
        return []
    return [{"text": n, "at": e.tolist()} for n, e in zip(names, ends, strict=True)]


def _caption(view: View) -> str:
    """What is seen, and which way the coordinates run."""
    space = view.space
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
    first, second = (axis_label(view, column) for column in (0, 1))
    if isinstance(space, Torus):
        return f"{first} runs round the ring, {second} round its tube. {lines}"
    return (
        f"The Klein bottle as a figure eight that makes half a turn on its way round: {first} runs "
        f"round the ring, {second} along the figure eight. {lines} The surface passes through itself "
        "along a circle; the sheets that cross there are far apart on the bottle."
    )


def _coast(space: Space, coastlines: Sequence[ArrayLike] | None) -> list[Array]:
    if coastlines is None:
        return []
    if not isinstance(space, Sphere | ProjectivePlane):
        raise OrbiflowError(f"coastlines need latitudes and longitudes, the {space.name} has none")
    tables = [checked_table(line, (2,), "a coastline") for line in coastlines]
    return [_of_vectors(space, to_vectors(table)) for table in tables if len(table) > 1]


def _colours() -> Array:
    from matplotlib import colormaps

    return 255 * colormaps[COLOURS](np.linspace(0, 1, 256))
