"""Densities on torus and sphere in space: pictures, and pages with surfaces to turn."""

from __future__ import annotations

from typing import Any

import numpy as np

from orbiflow.density import COLOURS, PlotSettings, density_page
from reproduction.densities import NAMES, square_values
from reproduction.density_fits import TARGETS, fit_work
from reproduction.drawing import INK, Canvas, caption, draw_surface, grid_box, text_size
from reproduction.exhibit import Exhibit, Extent, Findings, Work
from reproduction.spaces import TITLES

EMBEDDED = ("torus", "sphere")
TORUS_TURN = (3.9, 0.85)  # from where the ring is seen; spheres have their highest density in front


def _needs(extent: Extent) -> list[Work]:
    return [fit_work(space, name, extent) for space in EMBEDDED for name in TARGETS]


def _draw(canvas: Canvas, extent: Extent, values: list[Any]) -> Findings:
    from matplotlib import colormaps

    height = 0.66
    figure = canvas.figure(height)
    size = text_size(figure)
    pages = {}
    for k, one in enumerate(values):
        row, column = divmod(k, len(TARGETS))
        density = one.density()
        # the chart of the sphere stretches the middle of the square
        finer = 1.0 if one.space == "torus" else 1.5
        shown = square_values(density, round(finer * extent.resolution))
        top = float(np.quantile(shown, 0.998))
        box = grid_box(row, column, 2, 3, title=0.02, gap=0.0, left=0.04, top=0.05)
        axes = figure.add_axes(box)
        colours = colormaps[COLOURS](np.clip(shown / top, 0, 1))[..., :3]
        at = np.unravel_index(shown.argmax(), shown.shape)
        front = (float(at[0] + 0.5) / len(shown), float(at[1] + 0.5) / len(shown))
        turn = TORUS_TURN if one.space == "torus" else None
        draw_surface(axes, density.space, colours, turn=turn, front=front)
        if row == 0:
            caption(
                figure, (box[0], box[1], box[2], box[3] + 0.01), NAMES[one.target], weight="bold"
            )
        if column == 0:
            figure.text(
                0.02, box[1] + box[3] / 2, TITLES[one.space], rotation=90, va="center", ha="center",
                fontsize=size, weight="bold", color=INK,
            )  # fmt: skip
        title = f"{NAMES[one.target]} on the {TITLES[one.space]}"
        settings = PlotSettings(measure="square", scale="linear")
        pages[f"{one.space}-{one.target}"] = density_page(
            density, settings, resolution=min(extent.resolution, 120), title=title
        )
    canvas.add(
        figure,
        "Two rows of three surfaces: rings above, spheres below, coloured by densities of four "
        "Gaussians, six Gaussians and a checkerboard.",
        "Colour: density per area of the square, as the targets are given. To turn them yourself:",
        pages=pages,
        exact=True,
    )
    return Findings(
        "agrees",
        "The standard embeddings, coloured by the estimated densities: the colours close over "
        "the seams, since the densities are invariant under the group.",
        "On the sphere these colours are a texture, not the density of points on it: the "
        "square's area is not the sphere's, and per round area the density grows without bound "
        "towards the three places that the square's corners become. A density on the sphere is "
        "one with respect to its area; Table 5 has fits of that kind, too.",
        numbers={f"{one.space}, {one.target}": one.kl for one in values},
    )  # fmt: skip


EXHIBIT = Exhibit(
    "figure-11",
    "Figure 11",
    "Densities on torus and sphere, in space",
    "The densities estimated on torus and sphere with the standard embedding, for 4 Gaussians, 6 "
    "Gaussians and the 5 × 5 checkerboard.",
    _draw,
    _needs,
)
