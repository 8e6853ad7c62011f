"""The paper's method: its settings, and how it searches (`occupancy`)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from orbiflow.arguments import instance, number, numbers, whole
from orbiflow.runtime import Cancel, one_thread
from orbiflow.tiles.search.candidates import Fit, Progress
from orbiflow.tiles.search.method import Goal, SearchMethod, check_max_frequency
from orbiflow.tiles.tilings import CLASSES, IsohedralClass


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
            whole(getattr(self, name), name, 1)
        check_max_frequency(self.max_frequency)
        integrator(instance(self.method, str, "method"))
        whole(self.affine_iterations, "affine_iterations", 0)
        number(self.smoothness, "smoothness", 0)
        number(self.learning_rate, "learning_rate", 0, above=True)
        for name in ("hardness", "penalty"):
            for value in numbers(getattr(self, name), name, (2,)):
                number(value, f"{name}, first and last,", 0, above=True)
        whole(self.seed, "seed", 0, 2**32 - 1)

    def fit(
        self,
        goal: Goal,
        kind: IsohedralClass,
        *,
        per_class: int = 1,  # noqa: ARG002 - all survivors are given
        progress: Progress | None = None,
        cancel: Cancel | None = None,
    ) -> Fit:
        """Let flows carry templates onto the silhouette; each class has a seed of its own."""
        from orbiflow.tiles.search.occupancy import fit_occupancy
        from orbiflow.tiles.search.starts import initial_poses

        number = list(CLASSES).index(kind.name)
        own = replace(self, seed=(self.seed * 1009 + number) % 2**32)
        with one_thread():
            model = fit_occupancy(goal.target, kind, own, progress, cancel=cancel)
        return Fit(model, len(initial_poses(kind, self.turns)[0]), 0, model.size)
