"""Searches for overlap: by descent, and by the paper's occupancy method."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from orbiflow.errors import CertificationError
from orbiflow.flows import method
from orbiflow.runtime import NEVER, Cancel, one_thread
from orbiflow.settings import Count, Range, Seed, Settings, refusal
from orbiflow.tiles.flowing.descent import fit_descent, shared_soft_target
from orbiflow.tiles.flowing.occupancy import fit_occupancy
from orbiflow.tiles.flowing.starts import initial_poses, outline_starts
from orbiflow.tiles.flowing.tile_model import MAX_FREQUENCY, MAX_SEGMENTS
from orbiflow.tiles.search import ClassFinalists, Goal, OnProgress, SearchMethod, StillTiles
from orbiflow.tiles.tilings import CLASSES, ISOHEDRAL_TYPES, IsohedralClass

NotNegative = Annotated[float, Range(0)]
Positive = Annotated[float, Range(above=0)]

PREVIEW_POINTS = 60  # points of the outline that the preview looks at
# Length of an outline, in square roots of its area, up to which the settings are as they are
USUAL_LENGTH = 8.0
RAGGEDNESS_POWER = 3.5  # power of the length beyond, by which the number of starts grows
MAX_MORE_STARTS = 6.0  # what a ragged outline may multiply the starts by


EFFORTS: Mapping[str, Mapping[str, Any]] = {
    "fast": {
        "candidates": 8,
        "resolutions": (60,),
        "projected": 800,
        "measured": 150,
        "stages": ((12, 2), (16, 1)),
        "boundary": 120,
        "polish": 0,
        "finalists": 1,
    },
    "normal": {},
}
"""What each level changes."""


class OverlapSearch(Settings, SearchMethod):
    """The search for overlap, by descent; the defaults are effort "normal".

    - `max_frequency`: Omega; 0 moves pose and lattice alone, and IH1 to IH3 along their glides.
    - `starts`: "outline" (tiles that are near the target's outline already) or "template" (the
      template turned and stretched; also what is left when no outline start is simple).
    - `candidates`: outline starts that the descent begins with.
    - `resolutions`: points of the outline from which starts are made.
    - `projected`, `measured`: of each resolution, placements whose nearest tile is computed, and of
      these the nearest whose overlap is measured.
    - `turns`, `stretch`: of template starts.
    - `stages`: (steps, survivors) of the successive halving; a step is a segment of the flow.
    - `boundary`: boundary points of each candidate; divided by each resolution and by 5 and 6.
    - `smoothness`: exponent s of the damping (1 + |kappa|^2)^-s, first and last.
    - `momentum`: share of the last field that is kept.
    - `reach`: how far a boundary point may move in a step, first and last; the target has area 1.
    - `blur`: of the target's edge, first and last.
    - `lattice`: whether the lattice freedom takes part.
    - `polish`: L-BFGS iterations on the exact IoU; 0 for none.
    - `finalists`: survivors of the last stage that are polished, best first.
    - `min_neck`: width of necks below which a tile's score falls, in square roots of the area.
    - `seed`: moves the starts.
    """

    efforts: ClassVar[Mapping[str, Mapping[str, Any]]] = EFFORTS

    max_frequency: Annotated[int, Range(0, MAX_FREQUENCY)] = 10
    starts: Literal["outline", "template"] = "outline"
    candidates: Count = 48
    resolutions: tuple[Annotated[int, Range(24)], ...] = (40, 60, 80)
    projected: Count = 1000
    measured: Count = 200
    turns: Count = 12
    stretch: NotNegative = 0.25
    stages: tuple[tuple[Count, Count], ...] = ((20, 12), (30, 4), (25, 2))
    boundary: Annotated[int, Range(60)] = 240
    smoothness: tuple[NotNegative, NotNegative] = (2.0, 1.25)
    momentum: Annotated[float, Range(0, 1)] = 0.8
    reach: tuple[Positive, Positive] = (0.02, 0.0005)
    blur: tuple[Positive, Positive] = (0.05, 0.006)
    lattice: bool = True
    polish: Annotated[int, Range(0, 1000)] = 20
    finalists: Count = 1
    min_neck: float = 0.0
    seed: Seed = 0

    def check(self) -> None:
        if self.boundary % 30:
            raise refusal("boundary", "a multiple of 30", self.boundary)
        if any(self.boundary % points for points in self.resolutions):
            divisors = f"numbers that divide boundary = {self.boundary}"
            raise refusal("resolutions", divisors, self.resolutions)
        if not 1 <= self.iterations < MAX_SEGMENTS:
            raise refusal("stages", f"from 1 to {MAX_SEGMENTS - 1} steps in all", self.stages)

    @property
    def iterations(self) -> int:
        """Steps of all stages."""
        return sum(steps for steps, _ in self.stages)

    @property
    def phase(self) -> float:
        """The place of an outline's points, in their spacings, which the seed changes."""
        return float(np.random.default_rng(self.seed).random()) if self.seed else 0.0

    def fit(
        self, goal: Goal, kind: IsohedralClass, per_class: int, progress: OnProgress, cancel: Cancel
    ) -> ClassFinalists:
        """Let flows carry near tiles closer to the silhouette."""
        stages = tuple((steps, max(kept, 2 * per_class)) for steps, kept in self.stages)
        search = replace(self, stages=stages)
        with one_thread():
            finalists = fit_descent(
                goal.target, kind, search, emphasis=goal.emphasis, progress=progress, cancel=cancel
            )
        return finalists._replace(enough=1 if per_class == 1 else 2 * per_class)

    def sketch(self, goal: Goal, kind: IsohedralClass, cancel: Cancel = NEVER) -> ClassFinalists:
        """Return the tiles nearest to the outline."""
        if self.starts != "outline":
            return super().sketch(goal, kind, cancel)
        few: dict[str, Any] = {"candidates": 3, "projected": 1000, "measured": 40, "seed": 0}
        few |= {"resolutions": (PREVIEW_POINTS,), "boundary": PREVIEW_POINTS}
        tiles = outline_starts(goal.target, kind, replace(self, **few), cancel=cancel).prototiles
        if not len(tiles):
            raise CertificationError("no tile near the outline is simple")
        return ClassFinalists(StillTiles(kind, tiles), len(tiles), 0, 1)

    def prepare(self, goal: Goal) -> None:
        """Draw the silhouette's soft edge."""
        shared_soft_target(goal.target, goal.emphasis)

    def least_neck(self, goal: Goal) -> float:  # noqa: ARG002
        """Return `min_neck`."""
        return self.min_neck

    def for_outline(self, length: float) -> OverlapSearch:
        """Return settings with more starts for a ragged outline of this `length`; a disc has 3.5."""
        share = min(max((length / USUAL_LENGTH) ** RAGGEDNESS_POWER, 1.0), MAX_MORE_STARTS)
        (steps, kept), *later = self.stages
        return replace(
            self,
            candidates=round(share * self.candidates),
            projected=round(share * self.projected),
            measured=round(share * self.measured),
            stages=((steps, round(share * kept)), *later),
        )


class OccupancySearch(Settings, SearchMethod):
    """The paper's method, by occupancy; the defaults were measured on the paper's goals.

    - `max_frequency`: Omega; 0 leaves the flow the translations that commute with the group.
    - `turns`: starting rotations of the template.
    - `finalists`: starts that survive the affine phase; a third of the flow phase later the better
      half of them goes on.
    - `affine_iterations`, `iterations`: steps of each phase.
    - `points`: sample points an iteration.
    - `hardness`: tau at the start and end of the flow phase, per unit of length (the target has
      area 1); it grows geometrically.
    - `penalty`: factor of the fields' Sobolev energy, start and end. Without it the flow folds
      parts of the tile to nothing, which no integrator follows.
    - `smoothness`: Sobolev exponent s of the fields.
    - `segments`: stationary pieces of the flow.
    - `steps`, `method`: integrator during the optimisation; results are judged at finer steps.
    - `learning_rate`: of Adam on the fields.
    - `seed`: of the sample points.
    """

    method_name: ClassVar[str] = "occupancy"

    max_frequency: Annotated[int, Range(0, MAX_FREQUENCY)] = 10
    turns: Count = 12
    finalists: Count = 4
    affine_iterations: Annotated[int, Range(0)] = 80
    iterations: Count = 200
    points: Count = 800
    hardness: tuple[Positive, Positive] = (8.0, 70.0)
    penalty: tuple[Positive, Positive] = (1e-2, 1e-3)
    smoothness: NotNegative = 2.0
    segments: Count = 1
    steps: Count = 4
    method: str = "midpoint"
    learning_rate: Positive = 0.04
    seed: Seed = 0

    def check(self) -> None:
        method(self.method)

    def fit(
        self, goal: Goal, kind: IsohedralClass, per_class: int, progress: OnProgress, cancel: Cancel
    ) -> ClassFinalists:
        """Let flows carry templates onto the silhouette; each class has a seed of its own."""
        del per_class  # all survivors are given
        number = list(dict.fromkeys((*CLASSES, *ISOHEDRAL_TYPES))).index(kind.name)
        seeded = replace(self, seed=(self.seed * 1009 + number) % 2**32)
        with one_thread():
            model = fit_occupancy(goal.target, kind, seeded, progress, cancel=cancel)
        return ClassFinalists(model, len(initial_poses(kind, self.turns)[0]), 0, model.size)
