"""The outline of the method: points about the goal, mapped back to where the template is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
import torch

from orbiflow.arrays import Array
from orbiflow.drawing import fill_rings
from orbiflow.errors import OrbiflowError
from orbiflow.tiles import CLASSES, EscherTile, OccupancySamples, TileModel, occupancy_loss
from reproduction.animal import OMEGA, animal_work
from reproduction.drawing import INK, Canvas, caption, draw_over, grid_box, panel_of
from reproduction.exhibit import Exhibit, Extent, Findings
from reproduction.published import animal

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CLASS = "IH4"
COUNT = 2500
HARDNESS = 70.0  # tau, as at the end of the fit
INSIDE, OUTSIDE, WRONG = "#1d4e79", "#b8c4cf", "#d1242f"


class Pulled:
    """Sample points around the animal, and where a map takes them back to.

    - `points`: The points q (N, 2).
    - `inside`: Whether (N,) the animal contains each point, o(q).
    - `affine`, `full`: The points (N, 2) mapped back to the template's frame, by the affine map alone
      and by all of D^-1.
    """

    def __init__(self, model: TileModel) -> None:
        samples = OccupancySamples(animal(), COUNT, seed=3, dtype=torch.float64)
        self.points: Array = samples.points.numpy()
        self.inside: Array = samples.inside.numpy() > 0.5
        with torch.no_grad():
            self.template: Array = model.template()[0].numpy()
            self.affine: Array = model.unplace(samples.points)[0].numpy()
            self.full: Array = model.inverse(samples.points)[0].numpy()
            self.losses = [
                float(occupancy_loss(model, samples.points, samples.inside, HARDNESS, affine=a)[0])
                for a in (True, False)
            ]

    def wrong(self, places: Array) -> Array:
        """Return whether (N,) a point is inside the animal and outside the template, or the reverse."""
        region = shapely.Polygon(self.template)
        return shapely.contains_xy(region, *places.T) != self.inside


def _draw(canvas: Canvas, _extent: Extent, values: list[Any]) -> Findings:
    result = values[0]
    if not isinstance(result, EscherTile):
        raise OrbiflowError(f"{CLASS} gave no certified tile: {result.reason}")
    pulled = Pulled(result.model())
    outline, ring = animal().normal, result.normal_tile.polygon
    figure = canvas.figure(0.30)
    boxes = [grid_box(0, k, 1, 4, title=0.12, gap=0.01) for k in range(4)]
    titles = (
        "samples q about S",
        "A⁻¹ q: affine map alone",
        "D⁻¹ q: with the flow",
        "the tile D(T) over S",
    )
    for box, title in zip(boxes, titles, strict=True):
        caption(figure, box, title)
    side = np.where(pulled.inside, INSIDE, OUTSIDE)
    _dots(panel_of(figure, boxes[0], [outline, ring], 0.12), outline, pulled.points, side)
    for box, places in ((boxes[1], pulled.affine), (boxes[2], pulled.full)):
        axes = panel_of(figure, box, [pulled.template], 0.32)
        _dots(axes, pulled.template, places, np.where(pulled.wrong(places), WRONG, side))
    draw_over(panel_of(figure, boxes[3], [outline, ring], 0.12), [ring], outline, 1.4)
    canvas.add(
        figure,
        "Four panels: points in and about a turtle; the same points over a hexagon after an "
        "affine map, many of them red; after the inverse flow, few of them red; the tile, laid "
        "over the turtle.",
        "Blue: inside S. Grey: outside. Red: on the wrong side of the template's boundary, what "
        f"the occupancy loss punishes. {CLASS}, Ω = {OMEGA}.",
    )
    shares = [float(pulled.wrong(places).mean()) for places in (pulled.affine, pulled.full)]
    return Findings(
        "agrees" if shares[1] < shares[0] else "differs",
        f"With the affine map alone {100 * shares[0]:.1f} % of the points come to lie on the "
        f"wrong side, with the flow {100 * shares[1]:.1f} %; the loss falls from "
        f"{pulled.losses[0]:.3f} to {pulled.losses[1]:.3f} (τ = {HARDNESS:g}). Two thirds of the "
        "points are scattered about the outline, where they teach most.",
        "The loss is the paper's; what precedes it is not all of the paper: the lattice's own "
        "freedom (two parameters for p2) is fitted as well, since a periodic flow cannot change "
        "its lattice.",
        numbers={"wrong_affine": shares[0], "wrong_flow": shares[1], "losses": pulled.losses},
    )


def _dots(axes: Axes, ring: Array, points: Array, colours: Array) -> None:
    fill_rings(axes, [ring], "#f4ecdc", INK, 1.0)
    axes.scatter(*points.T, s=5, c=list(colours), linewidths=0, zorder=4)


EXHIBIT = Exhibit(
    "figure-5",
    "The method: inverse map and occupancy loss",
    "Points sampled about the target S are mapped to the template's domain through D⁻¹. Points "
    "inside S must land inside the template T, points outside S outside; the occupancy loss "
    "punishes those that do not. The diffeomorphism that minimises it yields the tile.",
    _draw,
    lambda extent: [animal_work(extent, OMEGA)[list(CLASSES).index(CLASS)]],
)
