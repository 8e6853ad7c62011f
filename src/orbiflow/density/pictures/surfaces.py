"""Surfaces in space for the four identification spaces, and a web page with one to turn.

A surface is a function that takes chart points (N, 2), anywhere in the plane, to points (N, 3) in
space, and identified points to the same point. Torus and sphere are embedded; the Klein bottle and
the projective plane cannot be, and cross themselves along curves. The page is one file, coloured by a
density, and needs no network.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import Density
from orbiflow.density.pictures import colours, frames
from orbiflow.density.pictures.grounds import SMALLER, thinned, uncrowded
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.spaces import RoundSpace, Space, to_vectors
from orbiflow.drawing import rendered
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_whole

RING_RADIUS, TUBE_RADIUS = 1.0, 0.45
"""Radii of the torus: of its centre line, and of its tube."""

KLEIN_RADIUS = 2.2
"""Radius of the circle that carries the figure eight; above 2, so that the middle stays open."""

MAX_RESOLUTION = 250
"""Cells along an edge at most: their corners are numbered in 16 bits."""


class SurfaceMesh(NamedTuple):
    """Chart points (N, 2) of the square, edges included, and triangles (M, 3), numbers of points."""

    points: Tensor
    triangles: Array


def _turns(points: Tensor) -> tuple[Array, Array]:
    x, y = 2 * math.pi * points.detach().double().cpu().numpy().T
    return x, y


def torus_ring(points: Tensor) -> Array:
    """Return ((R + r cos 2 pi y) cos 2 pi x, (R + r cos 2 pi y) sin 2 pi x, r sin 2 pi y)."""
    u, v = _turns(points)
    radius = RING_RADIUS + TUBE_RADIUS * np.cos(v)
    return np.stack([radius * np.cos(u), radius * np.sin(u), TUBE_RADIUS * np.sin(v)], axis=-1)


def klein_figure_eight(points: Tensor) -> Array:
    """Return points of a figure eight that makes half a turn on its way round a circle.

    With u = 2 pi y and v = 2 pi x, ((R + s) cos u, (R + s) sin u, t) where
    s = cos(u/2) sin v - sin(u/2) sin 2v and t = sin(u/2) sin v + cos(u/2) sin 2v (Banchoff; Wolfram
    MathWorld, "Klein Bottle"). u + 2 pi changes the sign of both, and so does -v.

    >>> x, y, height = klein_figure_eight(torch.tensor([[0.125, 0.0], [0.125, 0.3]])).T
    >>> ((np.hypot(x, y) - KLEIN_RADIUS) ** 2 + height**2).round(4)  # the eight is turned, not bent
    array([1.5, 1.5])
    """
    v, u = _turns(points)
    cos, sin = np.cos(u / 2), np.sin(u / 2)
    radius = KLEIN_RADIUS + cos * np.sin(v) - sin * np.sin(2 * v)
    height = sin * np.sin(v) + cos * np.sin(2 * v)
    return np.stack([radius * np.cos(u), radius * np.sin(u), height], axis=-1)


def boy_surface(vectors: Array) -> Array:
    """Return points of Boy's surface for axes given as unit vectors (N, 3).

    A vector and its opposite have the same point. In the parametrisation of R. Bryant and R. Kusner
    (Kusner, Conformal geometry and complete minimal surfaces, 1987), with w in the unit disc and
    D = w^6 + sqrt(5) w^3 - 1,
    g1 = -3/2 Im(w (1 - w^4) / D), g2 = -3/2 Re(w (1 + w^4) / D), g3 = Im((1 + w^6) / D) - 1/2, the
    point is g / |g|^2. It is the same at w and -1 / conj(w). The axis of the threefold symmetry is
    that of the third coordinate.
    """
    x, y, z = np.where(vectors[:, 2:] > 0, -vectors, vectors).T
    w = (x + 1j * y) / (1 - z)
    d = w**6 + math.sqrt(5) * w**3 - 1
    # g times |D|^2: finite where D = 0, at the triple point
    g = np.stack(
        [
            -1.5 * (w * (1 - w**4) * d.conj()).imag,
            -1.5 * (w * (1 + w**4) * d.conj()).real,
            ((1 + w**6) * d.conj()).imag - 0.5 * abs(d) ** 2,
        ],
        axis=-1,
    )
    size = np.maximum((g**2).sum(axis=-1), np.finfo(float).tiny)
    return g * (abs(d) ** 2 / size)[:, None]


def immersion(space: Space) -> Callable[[Tensor], Array]:
    """Return the surface of a two-dimensional space: chart points (N, 2) to points (N, 3).

    The torus is a ring, the sphere the unit sphere in the user's frame (`Sphere.vectors`), the Klein
    bottle a figure-8 immersion, the projective plane Boy's surface.
    """
    if not space.is_planar:
        raise OrbiflowError(f"only spaces of two dimensions have a surface, not {space!r}")
    if isinstance(space, RoundSpace):
        return lambda points: _of_vectors(space, space.vectors(points))
    return torus_ring if space.is_torus else klein_figure_eight


def _of_vectors(space: Space, vectors: Array) -> Array:
    return boy_surface(vectors) if space.name == "projective-plane" else vectors


def mesh(space: Space, resolution: int) -> SurfaceMesh:
    """Return an even grid on the canonical square, whose edges a group identifies, in triangles."""
    immersion(space)
    as_whole(resolution, "resolution", 2, MAX_RESOLUTION)
    t = torch.linspace(0.0, 1.0, resolution + 1, dtype=torch.float64)
    points = torch.stack(torch.meshgrid(t, t, indexing="ij"), dim=-1).reshape(-1, 2)
    number = np.arange((resolution + 1) ** 2).reshape(resolution + 1, -1)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    corners = np.stack([a, b, c, a, c, d], axis=-1)
    return SurfaceMesh(points, corners.reshape(-1, 3))


def normals(space: Space, points: Tensor) -> Array:
    """Return unit normals (N, 3) at points (N, 2) of the square, over its edges up to the sign."""
    surface, step = immersion(space), 1e-4
    if space.is_round:
        points = colours.off_cones(points, 4e-3)
    first, second = (
        surface(points + step * axis) - surface(points - step * axis)
        for axis in torch.eye(2, dtype=points.dtype)
    )
    across = np.cross(first, second)
    return across / np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-300)


EYE = 4.0
"""Distance of the eye from the surface's centre, in radii of the surface; also in the page."""

_RESOLUTION = 100
_HIDES, _CROWDS, _NEAR = 0.06, 0.18, 0.12
"""Distances in radii. What is within the first of a line of sight hides a place, unless it is within
the last of the place itself; what is within the second crowds the place."""


class Viewpoint(NamedTuple):
    """A place of the eye: `EYE` (cos p cos y, cos p sin y, sin p) radii from the surface's centre.

    - `yaw`, `pitch`: The angles y and p, in radians.
    - `cut`: How much of the surface is cut away in front, as the page's slider has it: what is above
      depth 1 - cut / 50, in radii towards the eye; nothing at 0.
    """

    yaw: float
    pitch: float
    cut: float = 0.0


def viewpoint(space: Space, place: Tensor) -> Viewpoint:
    """Return an eye that sees a chart point (2,) on the surface, as much from the front as it can.

    Rings are never seen from their edge, nor globes from their poles. Boy's surface encloses some
    places: for these the front is cut away.
    """
    surface = immersion(space)
    cloud = surface(mesh(space, _RESOLUTION).points)
    center, radius = _ball(cloud)
    spot = (surface(place[None])[0] - center) / radius
    normal = normals(space, place[None])[0]
    if space.name == "sphere":
        pitch = np.clip([np.arctan2(spot[2], np.hypot(spot[0], spot[1]))], -0.9, 0.9)
    elif space.is_round:
        pitch = np.linspace(-1.2, 1.2, 17)
    else:  # rings are recognised from above or below
        pitch = np.concatenate([s * np.linspace(0.4, 1.2, 9) for s in (1, -1)])
    yaw: Array = np.arctan2(spot[1], spot[0]) + np.linspace(0, 2 * np.pi, 36, endpoint=False)
    angles: Array = np.stack(np.meshgrid(yaw, pitch, indexing="ij"), axis=-1).reshape(-1, 2)
    yaws: Array
    pitches: Array
    yaws, pitches = angles.T
    toward = [np.cos(pitches) * np.cos(yaws), np.cos(pitches) * np.sin(yaws), np.sin(pitches)]
    toward = np.stack(toward, axis=-1)
    sight = EYE * toward - spot
    sight /= np.linalg.norm(sight, axis=1, keepdims=True)
    relative = (cloud - center) / radius - spot
    along = relative @ sight.T
    aside = (relative**2).sum(axis=1)[:, None] - along**2
    before = along > _NEAR
    hidden, crowded = ((before & (aside < w**2)).any(axis=0) for w in (_HIDES, _CROWDS))
    # rather from nearby than through a hole; of equals from above, as rings are usually drawn
    score = abs(sight @ normal) - 2.0 * hidden - 0.5 * crowded + 0.3 * toward @ spot
    score += 0.02 * np.sign(angles[:, 1])
    best = int(score.argmax())
    depth = min(1.0, float(toward[best] @ spot) + _NEAR / 2)
    return Viewpoint(*angles[best].tolist(), cut=50 * (1 - depth) if hidden[best] else 0.0)


MAX_BYTES = 3_000_000

_CELLS, _FINE_CELLS = 160, 240
"""Cells along an edge of the square: of a flow, and with kernels beside it."""

_SOFT = 1.6
"""Cells that the narrowest peak is averaged over: with fewer, a triangle's corners would be seen."""


def surface_data(
    density: Density,
    settings: PlotSettings | None = None,
    *,
    samples: Tensor | None = None,
    coastlines: Sequence[Array] = (),
    resolution: int | None = None,
    levels: bool = False,
) -> dict[str, Any]:
    """Return what `surface.js` draws, as JSON has it: see `density_page`.

    The value at a vertex is its place on the bar of colours; "caption" says what is seen. With `levels`
    there is the logarithm of the density at each vertex, too, as a share of its "span".
    """
    from matplotlib import colormaps

    settings, space = settings or PlotSettings(), density.space
    cells = resolution or (_FINE_CELLS if density.has_fine_detail else _CELLS)
    grid, view = mesh(space, cells), frames.view_of(space, settings.names)
    t = torch.linspace(0.0, 1.0, cells + 1, dtype=torch.float64)
    values = colours.density_on_grid(density, t, t, settings.measure, pixel=_SOFT / cells).ravel()
    # by area on the surface: vertices crowd at the cone points
    areas = space.log_area(grid.points).exp().numpy()
    log, _ = colours.chosen_scale(density, settings.measure, settings.scale)
    shade = colours.shading(values, areas, log=log)
    lines = (*_coordinate_lines(space), (1.6, _on_surface(space, coastlines)))
    notes: list[str] = []
    data = {
        **_surface(space, grid.points, int(values.argmax())),
        "round": space.name == "sphere",  # the near side hides the far one
        "triangles": packed(grid.triangles, "<u2"),
        "values": packed(65535 * np.clip(shade.places(values), 0, 1), "<u2"),
        "lines": [{"width": width, **_polylines(parts)} for width, parts in lines if parts],
        "samples": "",
        "widths": "",
        "dots": settings.dots,
        "labels": _labels(view),
        "colours": packed(255 * colormaps[colours.COLOURS](np.linspace(0, 1, 256)), "u1"),
        "ticks": [tick._asdict() for tick in colours.bar_ticks(shade, ends=True)],
        "measure": colours.bar_label(shade, space, settings.measure),
    }
    if levels:
        logs = np.log(np.maximum(values, values.max() * 1e-12))
        span = float(logs.min()), float(logs.max()) + 1e-6
        places = 65535 * (logs - span[0]) / (span[1] - span[0])
        data |= {"levels": packed(places, "<u2"), "span": span}
    if samples is not None:
        points = torch.tensor(thinned(frames.chart_points(space, samples).numpy()))
        places, widths = uncrowded(immersion(space)(space.project(points)))
        data |= {"samples": packed(places, "<f4"), "widths": packed(widths, "<f4")}
        notes.append(SMALLER)
    if colours.is_sharp(density, colours.square_pixel(density.space, _SOFT / cells)):
        notes.append(f"peaks narrower than 1/{round(cells / _SOFT)} of a side are averaged over it")
    words = CAPTIONS[space.name].format(*(frames.axis_label(view, k) for k in (0, 1)))
    return {**data, "caption": f"{words} {frames.sentences(notes)}".strip()}


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
    caption says so. The page opens with the peak in front. WebGL 2 draws it.

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
    data = surface_data(
        density, settings, samples=samples, coastlines=coastlines, resolution=resolution
    )
    title = title or f"Density on the {frames.space_title(density.space)}"
    page = rendered("orbiflow.density.pictures", "surface.html", title=title, data=data)
    size = len(page.encode())
    if size > MAX_BYTES:
        raise OrbiflowError(
            f"the page would have {size / 1e6:.1f} MB, more than {MAX_BYTES / 1e6:g}: lower the "
            "resolution or give coastlines of fewer points"
        )
    return page


def _ball(places: Array) -> tuple[Array, float]:
    """Return the middle and the radius of a surface of points (N, 3)."""
    center = (places.min(axis=0) + places.max(axis=0)) / 2
    return center, float(np.linalg.norm(places - center, axis=1).max())


def _surface(space: Space, points: Tensor, peak: int) -> dict[str, Any]:
    """Return the mesh in space, its size, and from where it is seen first."""
    places = immersion(space)(points)
    center, radius = _ball(places)
    return {
        "center": center.tolist(),
        "radius": radius,
        "start": viewpoint(space, points[peak])._asdict(),
        "eye": EYE,
        "points": packed(places, "<f4"),
        "normals": packed(127 * normals(space, points), "i1"),
    }


def packed(array: Array, kind: str) -> str:
    """Return the base64 text of an array, rounded if `kind` is an integer."""
    if np.dtype(kind).kind != "f":
        array = np.rint(array)
    return base64.b64encode(np.ascontiguousarray(array.astype(kind)).tobytes()).decode()


def _polylines(lines: list[Array]) -> dict[str, Any]:
    return {"points": packed(np.concatenate(lines), "<f4"), "counts": list(map(len, lines))}


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
    return [_of_vectors(space, to_vectors(line)) for line in lines if len(line) > 1]


def _eighths(space: Space, steps: int, zero: int) -> Lines:
    """Return lines every eighth of a turn, `steps` of them up the square; x = zero / 8 is angle 0."""
    surface, t = immersion(space), torch.linspace(0, 1, 161, dtype=torch.float64)
    across = [torch.stack([torch.full_like(t, k / 8), t], dim=-1) for k in range(8)]
    along = [torch.stack([t, torch.full_like(t, k / steps)], dim=-1) for k in range(steps)]
    zeros = [across[zero], along[0]]
    return (1.0, [surface(line) for line in across + along]), (2.0, [surface(z) for z in zeros])


def _labels(view: frames.View) -> list[dict[str, Any]]:
    """Return texts of directions, or of the first angle at four places of a ring, and their places."""
    space = view.space
    if space.name == "projective-plane":
        return []
    if space.is_round:
        texts = ("+x", "+y", "+z", "−x", "−y", "−z")
        if space.columns[0] == "lat":
            west = "270° E" if cast(RoundSpace, space).from_zero else "90° W"
            texts = ("0°", "90° E", "N", "180°", west, "S")
        places = 1.07 * np.concatenate([np.eye(3), -np.eye(3)])
    else:
        turns = (0, 0.125, 0.25, 0.375)
        if space.is_torus:
            turns = (0, 0.25, 0.5, 0.75 if space.axes[0].from_zero else -0.25)
        texts = [
            f"{frames.cut(view.names[0], frames.MAX_NAME)} {frames.angle_text(t, space.unit)}"
            for t in turns
        ]
        radius = RING_RADIUS + TUBE_RADIUS if space.is_torus else KLEIN_RADIUS + 1
        places = 1.1 * radius * np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    return [{"text": t, "at": place.tolist()} for t, place in zip(texts, places, strict=True)]


CAPTIONS = {
    "torus": "{} runs round the ring, {} round its tube. Lines every 45°, heavier where an "
    "angle is 0.",
    "klein-bottle": "The Klein bottle as a figure eight that makes half a turn on its way round: "
    "{} runs round the ring, {} along the figure eight. Lines every 45°, heavier where an "
    "angle is 0. The surface passes through itself along a circle; the sheets that cross there are far "
    "apart on the bottle.",
    "sphere": "The sphere in the data's frame. Lines every 30°, heavier the equator and longitude 0.",
    "projective-plane": "Boy's surface, where a direction and its opposite are one point. Lines every "
    "15° of latitude and longitude, heavier the equator and longitude 0. The surface passes through "
    "itself; sheets that cross are far apart on the projective plane.",
}
"""What is seen of each space, and which way its coordinates run."""
