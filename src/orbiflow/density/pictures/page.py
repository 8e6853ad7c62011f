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

from orbiflow.arrays import Array
from orbiflow.density.models import BlendedDensity, SymmetricDensity
from orbiflow.density.pictures.axes import (
    chart_points,
    space_title,
    view_of,
)
from orbiflow.density.pictures.dots import roomy, thinned
from orbiflow.density.pictures.drawings import DRAWINGS
from orbiflow.density.pictures.legend import SMALLER
from orbiflow.density.pictures.scale import (
    bar_label,
    bar_ticks,
    shading,
)
from orbiflow.density.pictures.square import COLOURS, average_note
from orbiflow.density.pictures.surfaces import (
    EYE,
    Mesh,
    immersion,
    mesh,
    normals,
    of_vectors,
    viewpoint,
)
from orbiflow.density.pictures.values import (
    density_on_grid,
    is_sharp,
    takes_logarithms,
)
from orbiflow.density.spaces import (
    Space,
    checked_table,
    to_vectors,
)
from orbiflow.errors import OrbiflowError

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
    cells = resolution or (_FINE_CELLS if isinstance(density, BlendedDensity) else _CELLS)
    grid, view = mesh(space, cells), view_of(space, names)
    drawing = DRAWINGS[space.name]
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
            for width, lines in (*drawing.grid(space), (1.6, _coast(space, coastlines)))
            if lines
        ],
        "samples": "",
        "widths": "",
        "dots": dots,
        "labels": drawing.labels(view),
        "colours": _packed(_colours(), "u1"),
        "ticks": [tick._asdict() for tick in bar_ticks(shade, ends=True)],
        "measure": bar_label(shade, space, measure),
    }
    if samples is not None:
        points = torch.tensor(thinned(chart_points(space, samples).numpy()))
        places, widths = roomy(immersion(space)(space.project(points)))
        data["samples"], data["widths"] = _packed(places, "<f4"), _packed(widths, "<f4")
    caption = drawing.caption(view)
    if samples is not None:
        caption += f" {SMALLER[0].upper()}{SMALLER[1:]}."
    if is_sharp(density, _SOFT / cells):
        note = average_note(round(cells / _SOFT))
        caption += f" {note[0].upper()}{note[1:]}."
    return _filled(title or f"Density on the {space_title(space)}", caption, data)


def _surface(space: Space, grid: Mesh, values: Array) -> dict[str, Any]:
    """The mesh in space, how large it is, and from where it is seen first."""
    drawing = DRAWINGS[space.name]
    points = immersion(space)(grid.points)
    center = (points.min(axis=0) + points.max(axis=0)) / 2
    return {
        "center": center.tolist(),
        "radius": float(np.linalg.norm(points - center, axis=1).max()),
        "start": viewpoint(space, grid.points[int(values.argmax())])._asdict(),
        "eye": EYE,
        "round": drawing.is_ball,
        "points": _packed(points, "<f4"),
        "normals": _packed(127 * normals(space, grid.points), "i1"),
        "triangles": _packed(grid.triangles, "<u2"),
    }


def _filled(heading: str, text: str, data: dict[str, Any]) -> str:
    template = (
        resources.files("orbiflow.density.pictures")
        .joinpath("density_page.html")
        .read_text("utf-8")
    )
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


def _coast(space: Space, coastlines: Sequence[ArrayLike] | None) -> list[Array]:
    if coastlines is None:
        return []
    if not space.is_round:
        raise OrbiflowError(f"coastlines need latitudes and longitudes, the {space.name} has none")
    tables = [checked_table(line, (2,), "a coastline") for line in coastlines]
    return [of_vectors(space)(to_vectors(table)) for table in tables if len(table) > 1]


def _colours() -> Array:
    from matplotlib import colormaps

    return 255 * colormaps[COLOURS](np.linspace(0, 1, 256))
