"""A web page with a surface to turn in space, coloured by a density: one file, no network."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import Density
from orbiflow.density.pictures import axes, colours, surfaces
from orbiflow.density.pictures.colours import COLOURS
from orbiflow.density.pictures.overlays import SMALLER, thinned, uncrowded
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.pictures.square import average_note
from orbiflow.density.spaces import Space, to_vectors
from orbiflow.drawing import rendered
from orbiflow.errors import OrbiflowError

MAX_BYTES = 3_000_000

_CELLS, _FINE_CELLS = 160, 240
"""Cells along an edge of the square: of a flow, and with kernels beside it."""

_SOFT = 1.6
"""Cells that the narrowest peak is averaged over: with fewer, a triangle's corners would be seen."""


def density_page(
    density: Density,
    settings: PlotSettings | None = None,
    *,
    samples: Tensor | None = None,
    coastlines: Sequence[Array] = (),
    resolution: int | None = None,
    title: str = "",
) -> str:
    """Return a self-contained HTML page with the surface of the space, to be turned.

    The torus is a ring, the sphere the unit sphere in the user's frame, the Klein bottle the figure-8
    immersion, the projective plane Boy's surface. The density is evaluated at every vertex, so the
    colours close over the seams; peaks narrower than its triangles are averaged over them, and the
    caption says so. The page opens with the peak in front. WebGL 2 draws it, or a plain canvas if
    there is none.

    Args:
        density: A density on a two-dimensional space.
        settings: How it is drawn; `dots` says whether the samples are seen at first.
        samples: Chart points (N, 2) to draw as dots, which a box in the page shows and hides. Of more
            than `MAX_DOTS` a random choice is drawn.
        coastlines: For the sphere and the projective plane, lines (M, 2) from `read_coastlines`.
        resolution: Cells along an edge of the square, 2 to 250. Default: 160, or 240 for a density
            with kernels.
        title: The title. Default: "Density on the" and the space.
    """
    from matplotlib import colormaps

    settings, space = settings or PlotSettings(), density.space
    cells = resolution or (_FINE_CELLS if density.has_fine_detail else _CELLS)
    grid, view = surfaces.mesh(space, cells), axes.view_of(space, settings.names)
    t = torch.linspace(0.0, 1.0, cells + 1, dtype=torch.float64)
    values = colours.density_on_grid(density, t, t, settings.measure, pixel=_SOFT / cells).ravel()
    # by area on the surface: vertices crowd at the cone points
    areas = space.log_area(grid.points).exp().numpy()
    log, _ = colours.chosen_scale(density, settings.measure, settings.scale)
    shade = colours.shading(values, areas, log=log)
    lines = (*_coordinate_lines(space), (1.6, _on_surface(space, coastlines)))
    notes = []
    data = {
        **_surface(space, grid.points, int(values.argmax())),
        "round": space.name == "sphere",  # the near side hides the far one
        "triangles": _packed(grid.triangles, "<u2"),
        "values": _packed(65535 * np.clip(shade.places(values), 0, 1), "<u2"),
        "lines": [{"width": width, **_polylines(parts)} for width, parts in lines if parts],
        "samples": "",
        "widths": "",
        "dots": settings.dots,
        "labels": _labels(view),
        "colours": _packed(255 * colormaps[COLOURS](np.linspace(0, 1, 256)), "u1"),
        "ticks": [tick._asdict() for tick in colours.bar_ticks(shade, ends=True)],
        "measure": colours.bar_label(shade, space, settings.measure),
    }
    if samples is not None:
        points = torch.tensor(thinned(axes.chart_points(space, samples).numpy()))
        places, widths = uncrowded(surfaces.immersion(space)(space.project(points)))
        data |= {"samples": _packed(places, "<f4"), "widths": _packed(widths, "<f4")}
        notes.append(SMALLER)
    if colours.is_sharp(density, pixel=_SOFT / cells):
        notes.append(average_note(round(cells / _SOFT)))
    caption = " ".join([_caption(view), *(f"{n[0].upper()}{n[1:]}." for n in notes)])
    title = title or f"Density on the {axes.space_title(space)}"
    page = rendered(
        "orbiflow.density.pictures", "surface.html", title=title, caption=caption, data=data
    )
    size = len(page.encode())
    if size > MAX_BYTES:
        raise OrbiflowError(
            f"the page would have {size / 1e6:.1f} MB, more than {MAX_BYTES / 1e6:g}: lower the "
            "resolution or give coastlines of fewer points"
        )
    return page


def _surface(space: Space, points: Tensor, peak: int) -> dict[str, Any]:
    """Return the mesh in space, its size, and from where it is seen first."""
    places = surfaces.immersion(space)(points)
    center = (places.min(axis=0) + places.max(axis=0)) / 2
    return {
        "center": center.tolist(),
        "radius": float(np.linalg.norm(places - center, axis=1).max()),
        "start": surfaces.viewpoint(space, points[peak])._asdict(),
        "eye": surfaces.EYE,
        "points": _packed(places, "<f4"),
        "normals": _packed(127 * surfaces.normals(space, points), "i1"),
    }


def _packed(array: Array, kind: str) -> str:
    """Return the base64 text of an array, rounded if `kind` is an integer."""
    if np.dtype(kind).kind != "f":
        array = np.rint(array)
    return base64.b64encode(np.ascontiguousarray(array.astype(kind)).tobytes()).decode()


def _polylines(lines: list[Array]) -> dict[str, Any]:
    return {
        "points": _packed(np.concatenate(lines), "<f4"),
        "counts": [len(line) for line in lines],
    }


Lines = tuple[tuple[float, list[Array]], tuple[float, list[Array]]]
"""Lines (M, 3) of equal coordinates with their widths, then those of coordinate 0, which are wider."""


def _coordinate_lines(space: Space) -> Lines:
    """Return parallels and meridians of a round space, lines every eighth of a turn of angles."""
    if not space.is_round:
        # the Klein bottle's square is half a turn high, and phi is 0 inside
        return _eighths(space, 8, 0) if space.is_torus else _eighths(space, 4, 2)
    step = 30 if space.name == "sphere" else 15
    t = np.linspace(-180.0, 180.0, 181)
    across = [np.stack([np.full(181, lat), t], axis=-1) for lat in range(0, 90, step)]
    across += [line * (-1, 1) for line in across[1:]]
    along = [np.stack([t / 2, np.full(181, lon)], axis=-1) for lon in range(0, 360, step)]
    parallels, meridians = _on_surface(space, across), _on_surface(space, along)
    return (1.0, parallels + meridians), (2.0, [parallels[0], meridians[0]])


def _on_surface(space: Space, lines: Sequence[Array]) -> list[Array]:
    """Return lines of directions (M, 2), of more than a point, on the surface of a round space."""
    surface = surfaces.vector_immersion(space)
    return [surface(to_vectors(line)) for line in lines if len(line) > 1]


def _eighths(space: Space, steps: int, zero: int) -> Lines:
    """Return lines every eighth of a turn, `steps` of them up the square; x = zero / 8 is angle 0."""
    surface, t = surfaces.immersion(space), torch.linspace(0, 1, 161, dtype=torch.float64)
    across = [torch.stack([torch.full_like(t, k / 8), t], dim=-1) for k in range(8)]
    along = [torch.stack([t, torch.full_like(t, k / steps)], dim=-1) for k in range(steps)]
    zeros = [across[zero], along[0]]
    return (1.0, [surface(line) for line in across + along]), (2.0, [surface(z) for z in zeros])


def _labels(view: axes.View) -> list[dict[str, Any]]:
    """Return texts of directions, or of the first angle at four places of a ring, and their places."""
    space = view.space
    if space.name == "projective-plane":
        return []
    if space.is_round:
        texts = ("+x", "+y", "+z", "−x", "−y", "−z")
        if space.columns[0] == "lat":
            texts = ("0°", "90° E", "N", "180°", "90° W", "S")
        places = 1.07 * np.concatenate([np.eye(3), -np.eye(3)])
    else:
        turns = (0, 0.25, 0.5, -0.25) if space.is_torus else (0, 0.125, 0.25, 0.375)
        texts = [f"{axes.column_name(view, 0)} {axes.angle_text(t, space.unit)}" for t in turns]
        radius = (
            surfaces.RING_RADIUS + surfaces.TUBE_RADIUS
            if space.is_torus
            else surfaces.KLEIN_RADIUS + 1
        )
        places = 1.1 * radius * np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    return [{"text": t, "at": place.tolist()} for t, place in zip(texts, places, strict=True)]


def _caption(view: axes.View) -> str:
    """Return what is seen, and which way the coordinates run."""
    if view.space.is_round:
        return CAPTIONS[view.space.name]
    names = {"first": axes.axis_label(view, 0), "second": axes.axis_label(view, 1)}
    return CAPTIONS[view.space.name].format(**names)


CAPTIONS = {
    "torus": "{first} runs round the ring, {second} round its tube. Lines every 45°, heavier where an "
    "angle is 0.",
    "klein-bottle": "The Klein bottle as a figure eight that makes half a turn on its way round: "
    "{first} runs round the ring, {second} along the figure eight. Lines every 45°, heavier where an "
    "angle is 0. The surface passes through itself along a circle; the sheets that cross there are far "
    "apart on the bottle.",
    "sphere": "The sphere in the data's frame. Lines every 30°, heavier the equator and longitude 0.",
    "projective-plane": "Boy's surface, where a direction and its opposite are one point. Lines every "
    "15° of latitude and longitude, heavier the equator and longitude 0. The surface passes through "
    "itself; sheets that cross are far apart on the projective plane.",
}
"""What is said of each surface, by the name of the space."""
