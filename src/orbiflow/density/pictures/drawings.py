"""What is drawn on the four surfaces beside the density: lines, names of directions, a caption."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import torch

from orbiflow.arrays import Array
from orbiflow.density.pictures.axes import (
    View,
    angle_text,
    axis_label,
    column_name,
    unit_of,
)
from orbiflow.density.pictures.surfaces import (
    KLEIN_RADIUS,
    RING_RADIUS,
    TUBE_RADIUS,
    immersion,
    of_vectors,
)
from orbiflow.density.spaces import (
    RoundSpace,
    Space,
    to_vectors,
)

Lines = tuple[tuple[float, list[Array]], tuple[float, list[Array]]]
"""Lines (M, 3) of equal coordinates, with their widths; heavier those of coordinate zero."""


@dataclass(frozen=True)
class Drawing:
    """Of one space.

    - `grid`: lines of equal coordinates.
    - `labels`: texts and where they stand, of directions.
    - `caption`: what is seen, and which way the coordinates run.
    - `is_ball`: whether the far side is hidden by the near one.
    """

    grid: Callable[[Space], Lines]
    labels: Callable[[View], list[dict[str, Any]]]
    caption: Callable[[View], str]
    is_ball: bool = False


def _graticule(space: Space, step: int) -> Lines:
    """Parallels and meridians, every `step` degrees."""
    t = np.linspace(-180.0, 180.0, 181)
    across = [np.stack([np.full(181, lat), t], axis=-1) for lat in range(0, 90, step)]
    across += [line * (-1, 1) for line in across[1:]]
    along = [np.stack([t / 2, np.full(181, lon)], axis=-1) for lon in range(0, 360, step)]
    surface = of_vectors(space)
    parallels, meridians = (
        [surface(to_vectors(line)) for line in lines] for lines in (across, along)
    )
    return (1.0, parallels + meridians), (2.0, [parallels[0], meridians[0]])


def _eighths(space: Space, steps: int, zero: int) -> Lines:
    """Every eighth of a turn: `steps` of them up the square, x = zero / 8 where an angle is 0."""
    surface, t = immersion(space), torch.linspace(0, 1, 161, dtype=torch.float64)
    across = [torch.stack([torch.full_like(t, k / 8), t], dim=-1) for k in range(8)]
    along = [torch.stack([t, torch.full_like(t, k / steps)], dim=-1) for k in range(steps)]
    zeros = [across[zero], along[0]]
    return (1.0, [surface(line) for line in across + along]), (2.0, [surface(z) for z in zeros])


def _placed(texts: Sequence[str], ends: Array) -> list[dict[str, Any]]:
    return [{"text": t, "at": end.tolist()} for t, end in zip(texts, ends, strict=True)]


def _round_the_ring(view: View, turns: Sequence[float], radius: float) -> list[dict[str, Any]]:
    """The first angle at four places round a ring."""
    name, unit = column_name(view, 0), unit_of(view.space)
    ends = 1.1 * radius * np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    return _placed([f"{name} {angle_text(t, unit)}" for t in turns], ends)


def _along_the_axes(view: View) -> list[dict[str, Any]]:
    latlon = ("0°", "90° E", "N", "180°", "90° W", "S")
    form = cast(RoundSpace, view.space).form
    names = latlon if form == "latlon" else ("+x", "+y", "+z", "−x", "−y", "−z")
    return _placed(names, 1.07 * np.concatenate([np.eye(3), -np.eye(3)]))


def _angles(view: View) -> tuple[str, str]:
    return axis_label(view, 0), axis_label(view, 1)


_EVERY_45 = "Lines every 45°, heavier where an angle is 0."


def _ring_caption(view: View) -> str:
    return "{} runs round the ring, {} round its tube. ".format(*_angles(view)) + _EVERY_45


def _bottle_caption(view: View) -> str:
    first, second = _angles(view)
    return (
        f"The Klein bottle as a figure eight that makes half a turn on its way round: {first} runs "
        f"round the ring, {second} along the figure eight. {_EVERY_45} The surface passes through "
        "itself along a circle; the sheets that cross there are far apart on the bottle."
    )


def _globe_caption(view: View) -> str:
    del view
    return "The sphere in the data's frame. Lines every 30°, heavier the equator and longitude 0."


def _boy_caption(view: View) -> str:
    del view
    return (
        "Boy's surface, where a direction and its opposite are one point. Lines every 15° of "
        "latitude and longitude, heavier the equator and longitude 0. The surface passes through "
        "itself; sheets that cross are far apart on the projective plane."
    )


DRAWINGS: dict[str, Drawing] = {
    "torus": Drawing(
        lambda space: _eighths(space, 8, 0),
        lambda view: _round_the_ring(view, (0, 0.25, 0.5, -0.25), RING_RADIUS + TUBE_RADIUS),
        _ring_caption,
    ),
    # the square is half a turn high, and phi 0 inside
    "klein-bottle": Drawing(
        lambda space: _eighths(space, 4, 2),
        lambda view: _round_the_ring(view, (0, 0.125, 0.25, 0.375), KLEIN_RADIUS + 1),
        _bottle_caption,
    ),
    "sphere": Drawing(
        lambda space: _graticule(space, 30), _along_the_axes, _globe_caption, is_ball=True
    ),
    "projective-plane": Drawing(lambda space: _graticule(space, 15), lambda _: [], _boy_caption),
}
"""By the name of the space."""
