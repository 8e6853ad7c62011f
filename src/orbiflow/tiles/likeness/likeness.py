"""How a tile compares with its silhouette: all measures of one tile, and the score that they give."""

from __future__ import annotations

import math
from dataclasses import dataclass

from orbiflow.arrays import Array
from orbiflow.tiles.likeness.faithful import Fidelity
from orbiflow.tiles.likeness.metrics import ShapeMetrics
from orbiflow.tiles.likeness.necks import Thinnest, neck_factor
from orbiflow.tiles.likeness.ranking import rank_score
from orbiflow.tiles.likeness.recognition import Recognisability

NAN = float("nan")
NOT_COMPARED = ShapeMetrics(NAN, NAN, NAN, (NAN, NAN, NAN, NAN), NAN)
NOT_RECOGNISED = Recognisability(NAN, NAN, NAN, NAN)


@dataclass(frozen=True, eq=False)
class Likeness:
    """How a tile compares with its silhouette; NaN or None where that was not measured.

    - `metrics`, `recognisability`: Measures of the certified polygon against the silhouette.
    - `thinnest`: The narrowest neck of the polygon.
    - `min_neck`: Width in square roots of the area below which necks lower the score.
    - `deformation`, `fidelity`: What bending the silhouette costs, and what is left of its outline
      (docs/likeness.md).
    - `bent`, `rest`: The bent silhouette near which the tile was found, and the silhouette as it is:
      outlines (n, 2) in the input's coordinates, point by point.
    - `bent_iou`: The IoU of the tile with the bent silhouette.
    - `pinned`: How far the worst pinned part is from similar to what it was; None without pins.
    - `smoothed`: The share of the silhouette's length below which parts were rounded off, because its
      class has no tile of the silhouette as it is; 0 otherwise. The measures of likeness, `rest` and
      `bent` are of the silhouette without these parts.
    - `known_score`: The score that a file states.
    """

    metrics: ShapeMetrics = NOT_COMPARED
    recognisability: Recognisability = NOT_RECOGNISED
    thinnest: Thinnest | None = None
    min_neck: float = 0.0
    deformation: float | None = None
    fidelity: Fidelity | None = None
    bent: Array | None = None
    rest: Array | None = None
    bent_iou: float | None = None
    pinned: float | None = None
    smoothed: float = 0.0
    known_score: float | None = None

    @property
    def score(self) -> float:
        """What tiles are ranked by, from 0 to 1.

        After a search for likeness the score of its `fidelity`, otherwise `rank_score` of IoU and
        recognisability; less in proportion where a neck is too thin.
        """
        if self.known_score is not None:
            return self.known_score
        if self.fidelity is not None:
            score = self.fidelity.score
        elif math.isnan(self.metrics.iou):
            return NAN
        else:
            score = rank_score(self.metrics.iou, self.recognisability.score)
        if self.thinnest is None:
            return score
        return score * neck_factor(self.thinnest.share, self.min_neck)
