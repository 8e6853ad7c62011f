"""Searches for overlap: by descent, and by the paper's occupancy method."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from orbiflow.arguments import as_array, as_instance, as_number, as_whole
from orbiflow.errors import CertificationError, OrbiflowError
from orbiflow.runtime import NEVER, Cancel, one_thread
from orbiflow.tiles.search.candidates import Fit, OnProgress, silent
from orbiflow.tiles.search.method import MAX_FREQUENCY, MAX_SEGMENTS, Goal, SearchMethod
from orbiflow.tiles.tilings import CLASSES, IsohedralClass

POINTS = 60  # points of the outline that the preview looks at
# Length of an outline, in square roots of its area, up to which the settings are as they are
PLAIN = 8.0


RAGGED = 3.5  # power of the length beyond, by which the number of starts grows
MOST_TIMES = 6.0  # what a ragged outline may multiply the starts by


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
    "best": {
        "max_frequency": 15,
        "candidates": 400,
        "resolutions": (30, 48, 96, 120),
        "boundary": 480,
        "projected": 4000,
        "measured": 1000,
        "stages": ((20, 60), (35, 16), (45, 5), (40, 4)),
        "polish": 100,
        "finalists": 4,
    },
}
"""What each level changes."""


@dataclass(frozen=True)
class OverlapSearch(SearchMethod):
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

    modules: ClassVar[tuple[str, ...]] = ("orbiflow.tiles.search.descent",)
    efforts: ClassVar[Mapping[str, Mapping[str, Any]]] = EFFORTS

    max_frequency: int = 10
    starts: str = "outline"
    candidates: int = 48
    resolutions: tuple[int, ...] = (40, 60, 80)
    projected: int = 1000
    measured: int = 200
    turns: int = 12
    stretch: float = 0.25
    stages: tuple[tuple[int, int], ...] = ((20, 12), (30, 4), (25, 2))
    boundary: int = 240
    smoothness: tuple[float, float] = (2.0, 1.25)
    momentum: float = 0.8
    reach: tuple[float, float] = (0.02, 0.0005)
    blur: tuple[float, float] = (0.05, 0.006)
    lattice: bool = True
    polish: int = 20
    finalists: int = 1
    min_neck: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("candidates", "projected", "measured", "turns", "finalists"):
            as_whole(getattr(self, name), name, 1)
        as_whole(self.max_frequency, "max_frequency", 0, MAX_FREQUENCY)
        if self.starts not in ("outline", "template"):
            raise OrbiflowError(f'starts must be "outline" or "template", got {self.starts!r}')
        if as_whole(self.boundary, "boundary", 0) < 60 or self.boundary % 30:
            raise OrbiflowError(f"boundary must be a multiple of 30 from 60, got {self.boundary}")
        for points in as_array(self.resolutions, "resolutions", ("n",)):
            if points < 24 or self.boundary % points:
                raise OrbiflowError(
                    f"resolutions must be at least 24 and divide boundary = {self.boundary}, "
                    f"got {points:g}"
                )
        stages = as_array(self.stages, "stages", (...,))
        pairs = stages.ndim == 2 and stages.shape[1] == 2
        if not pairs or (stages < 1).any() or (stages % 1).any():
            raise OrbiflowError(f"stages need steps and survivors of at least 1: {self.stages}")
        if self.iterations >= MAX_SEGMENTS:
            raise OrbiflowError(f"stages must have less than {MAX_SEGMENTS} steps in all")
        for value in as_array(self.smoothness, "smoothness", (2,)):
            as_number(value, "smoothness, first and last,", 0)
        for name in ("reach", "blur"):
            for value in as_array(getattr(self, name), name, (2,)):
                as_number(value, f"{name}, first and last,", above=0)
        as_number(self.momentum, "momentum", 0, 1)
        as_number(self.stretch, "stretch", 0)
        as_whole(self.polish, "polish", 0, 1000)
        as_whole(self.seed, "seed", 0, 2**32 - 1)

    @property
    def iterations(self) -> int:
        """Steps of all stages."""
        return sum(steps for steps, _ in self.stages)

    def fit(
        self,
        goal: Goal,
        kind: IsohedralClass,
        *,
        per_class: int = 1,
        progress: OnProgress = silent,
        cancel: Cancel = NEVER,
    ) -> Fit:
        """Let flows carry near tiles closer to the silhouette."""
        from orbiflow.tiles.search.descent import fit_descent, shared_soft_target

        stages = tuple((steps, max(kept, 2 * per_class)) for steps, kept in self.stages)
        with one_thread():
            found = fit_descent(
                goal.target,
                kind,
                replace(self, stages=stages),
                soft=shared_soft_target(goal.target, goal.emphasis),
                progress=progress,
                cancel=cancel,
            )
        return found._replace(enough=1 if per_class == 1 else 2 * per_class)

    def sketch(self, goal: Goal, kind: IsohedralClass, cancel: Cancel = NEVER) -> Fit:
        """Return the tiles nearest to the outline."""
        from orbiflow.tiles.search.model import TileModel
        from orbiflow.tiles.search.starts import outline_starts

        if self.starts != "outline":
            return super().sketch(goal, kind, cancel)
        few: dict[str, Any] = {
            "count": 3,
            "resolutions": (POINTS,),
            "measured": 40,
            "vertices": POINTS,
        }
        own = outline_starts(goal.target, kind, **few, cancel=cancel).prototiles
        if not len(own):
            raise CertificationError("no tile near the outline is simple")
        return Fit(TileModel(kind, max_frequency=1, steps=1, prototiles=own), len(own), 0, 1)

    def prepare(self, goal: Goal) -> None:
        """Draw the silhouette's soft edge."""
        from orbiflow.tiles.search.descent import shared_soft_target

        shared_soft_target(goal.target, goal.emphasis)

    def least_neck(self, goal: Goal) -> float:  # noqa: ARG002
        """Return `min_neck`."""
        return self.min_neck

    def for_outline(self, length: float) -> OverlapSearch:
        """More starts for a ragged silhouette, with an outline of this `length`; a disc has 3.5."""
        share = min(max((length / PLAIN) ** RAGGED, 1.0), MOST_TIMES)
        (steps, kept), *later = self.stages
        return replace(
            self,
            candidates=round(share * self.candidates),
            projected=round(share * self.projected),
            measured=round(share * self.measured),
            stages=((steps, round(share * kept)), *later),
        )


@dataclass(frozen=True)
class OccupancySearch(SearchMethod):
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
    modules: ClassVar[tuple[str, ...]] = ("orbiflow.tiles.search.occupancy",)

    max_frequency: int = 10
    turns: int = 12
    finalists: int = 4
    affine_iterations: int = 80
    iterations: int = 200
    points: int = 800
    hardness: tuple[float, float] = (8.0, 70.0)
    penalty: tuple[float, float] = (1e-2, 1e-3)
    smoothness: float = 2.0
    segments: int = 1
    steps: int = 4
    method: str = "midpoint"
    learning_rate: float = 0.04
    seed: int = 0

    def __post_init__(self) -> None:
        from orbiflow.flows import method as integrator

        for name in ("turns", "finalists", "iterations", "points", "segments", "steps"):
            as_whole(getattr(self, name), name, 1)
        as_whole(self.max_frequency, "max_frequency", 0, MAX_FREQUENCY)
        integrator(as_instance(self.method, str, "method"))
        as_whole(self.affine_iterations, "affine_iterations", 0)
        as_number(self.smoothness, "smoothness", 0)
        as_number(self.learning_rate, "learning_rate", above=0)
        for name in ("hardness", "penalty"):
            for value in as_array(getattr(self, name), name, (2,)):
                as_number(value, f"{name}, first and last,", above=0)
        as_whole(self.seed, "seed", 0, 2**32 - 1)

    def fit(
        self,
        goal: Goal,
        kind: IsohedralClass,
        *,
        per_class: int = 1,  # noqa: ARG002 - all survivors are given
        progress: OnProgress = silent,
        cancel: Cancel = NEVER,
    ) -> Fit:
        """Let flows carry templates onto the silhouette; each class has a seed of its own."""
        from orbiflow.tiles.search.occupancy import fit_occupancy
        from orbiflow.tiles.search.starts import initial_poses

        number = list(CLASSES).index(kind.name)
        own = replace(self, seed=(self.seed * 1009 + number) % 2**32)
        with one_thread():
            model = fit_occupancy(goal.target, kind, own, progress, cancel=cancel)
        return Fit(model, len(initial_poses(kind, self.turns)[0]), 0, model.size)
