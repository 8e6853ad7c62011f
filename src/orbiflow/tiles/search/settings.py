"""Knobs of the search for likeness, and its levels of effort."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

from orbiflow.arguments import (
    number,
    numbers,
    whole,
)
from orbiflow.errors import OrbiflowError

Settings = TypeVar("Settings")


def settings_for(
    kind: type[Settings],
    efforts: Mapping[str, Mapping[str, Any]],
    effort: str,
    changes: Mapping[str, Any],
) -> Settings:
    """Settings of a level of effort, with changes.

    Args:
        kind: a dataclass of settings.
        efforts: what each level changes, by name.
        effort: the level.
        changes: settings that differ from it, by name.

    Raises:
        OrbiflowError: for an unknown level or setting.
    """
    if effort not in efforts:
        raise OrbiflowError(f"effort must be one of {', '.join(efforts)}, got {effort!r}")
    known = {field.name for field in fields(kind)}  # pyright: ignore[reportArgumentType]
    unknown = [name for name in changes if name not in known]
    if unknown:
        raise OrbiflowError(f"unknown settings {', '.join(unknown)}")
    return kind(**{**efforts[effort], **changes})


@dataclass(frozen=True)
class BendingSettings:
    """Knobs of the search by co-deformation; the defaults are effort "normal" without what is below.

    - `placements`: ways to lay the outline along the template's edges that are tried, a class.
    - `held`: of these, the best after the springs, whose energy is minimised among tiles.
    - `starts`: of these, the best whose corners are moved along the outline, step by step.
    - `share`: of all such steps that are worked out, those that look best.
    - `finalists`: of what comes of it, the best that are worked out with all of the outline's detail,
      a class and hand.
    - `rounds`: steps of the minimisation for finalists.
    - `below`: levels of effort below that are searched, too, so that more effort never finds less.
    - `multiples`: points of a tile for each point of the search, the first that holds the corners.
    - `min_neck`: width of necks below which a tile's score falls, in square roots of the area; if
      above 0, a part of the silhouette's own narrowest if more, see `likeness.necks.least_neck`.
    - `seed`: moves the outline's points.
    """

    placements: int = 300
    held: int = 80
    starts: int = 32
    share: float = 0.3
    finalists: int = 5
    rounds: int = 20
    below: int = 0
    multiples: tuple[int, ...] = (4, 6)
    min_neck: float = 0.01
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("placements", "held", "starts", "finalists", "rounds"):
            if getattr(self, name) < 1:
                raise OrbiflowError(f"{name} must be at least 1, got {getattr(self, name)}")
        if not 0 < self.share <= 1:
            raise OrbiflowError(f"share must be above 0, at most 1, got {self.share}")
        if not 0 <= self.below <= 2:
            raise OrbiflowError(f"below must be 0, 1 or 2, got {self.below}")
        if not self.multiples or min(self.multiples) < 1:
            raise OrbiflowError(f"multiples must be at least 1, got {self.multiples}")
        if not 0 <= self.min_neck <= 0.2:
            raise OrbiflowError(f"min_neck must be from 0 to 0.2, got {self.min_neck}")
        if not 0 <= self.seed < 2**32:
            raise OrbiflowError(f"seed must be from 0 to 2^32 - 1, got {self.seed}")

    @classmethod
    def for_effort(cls, effort: str, **changes: Any) -> BendingSettings:
        """The settings of a level of effort: "fast", "normal" or "best".

        >>> BendingSettings.for_effort("fast", seed=3).seed
        3
        """
        return settings_for(cls, BENDING_EFFORTS, effort, changes)

    def searches(self, wanted: int = 1) -> tuple[BendingSettings, ...]:
        """Those of the levels below, least first, and these: none with levels below.

        Args:
            wanted: finalists at least, for which each gets twice as many starts at least.

        >>> [own.starts for own in BendingSettings.for_effort("best").searches()]
        [8, 32, 128]
        """
        below = (FAST, NORMAL)[: self.below]
        each = [replace(self, below=0, **changes) for changes in (*below, {})]
        return tuple(own if own.finalists >= wanted else own._with(wanted) for own in each)

    def _with(self, finalists: int) -> BendingSettings:
        return replace(self, finalists=finalists, starts=max(self.starts, 2 * finalists))


FAST = {
    "placements": 80,
    "held": 20,
    "starts": 8,
    "share": 0.15,
    "finalists": 2,
    "rounds": 12,
}
NORMAL = {name: getattr(BendingSettings(), name) for name in FAST}
BEST = {
    "placements": 1500,
    "held": 300,
    "starts": 128,
    "share": 1.0,
    "finalists": 12,
    "rounds": 40,
}

BENDING_EFFORTS: dict[str, dict[str, Any]] = {
    "fast": FAST,
    "normal": {**NORMAL, "below": 1},
    "best": {**BEST, "below": 2},
}
"""What each level changes."""


MAX_FREQUENCY = 60
"""Largest Omega that a fit takes on; time and memory grow with its square."""


def check_max_frequency(value: int) -> None:
    """Do nothing for an Omega from 0, constant fields (paper, figure of Omega), to `MAX_FREQUENCY`.

    Raises:
        OrbiflowError: for any other.
    """
    if not 0 <= whole(value, "max_frequency", 0) <= MAX_FREQUENCY:
        raise OrbiflowError(
            f"max_frequency must be from 0 to {MAX_FREQUENCY}, got {value}: "
            "10 is plenty for most silhouettes"
        )


MAX_SEGMENTS = 2000
"""Of a flow; the descent adds one a step."""

PLAIN = 8.0
"""Length of an outline, in square roots of its area, up to which the settings are as they are."""


RAGGED = 3.5
"""Power of the length beyond, by which the number of starts grows."""

MOST_TIMES = 6.0
"""What a ragged outline may multiply the starts by."""


@dataclass(frozen=True)
class DescentSettings:
    """Knobs of the descent; the defaults are effort "normal", measured on the paper's goals.

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
            whole(getattr(self, name), name, 1)
        check_max_frequency(self.max_frequency)
        if self.starts not in ("outline", "template"):
            raise OrbiflowError(f'starts must be "outline" or "template", got {self.starts!r}')
        if whole(self.boundary, "boundary", 0) < 60 or self.boundary % 30:
            raise OrbiflowError(f"boundary must be a multiple of 30 from 60, got {self.boundary}")
        for points in numbers(self.resolutions, "resolutions", ("n",)):
            if points < 24 or self.boundary % points:
                raise OrbiflowError(
                    f"resolutions must be at least 24 and divide boundary = {self.boundary}, "
                    f"got {points:g}"
                )
        self._check_stages()
        for name in ("smoothness", "reach", "blur"):
            for value in numbers(getattr(self, name), name, (2,)):
                number(value, f"{name}, first and last,", 0, above=name != "smoothness")
        number(self.momentum, "momentum", 0, 1)
        number(self.stretch, "stretch", 0)
        whole(self.polish, "polish", 0, 1000)
        whole(self.seed, "seed", 0, 2**32 - 1)

    def _check_stages(self) -> None:
        stages = numbers(self.stages, "stages", (...,))
        pairs = stages.ndim == 2 and stages.shape[1] == 2
        if not pairs or (stages < 1).any() or (stages % 1).any():
            raise OrbiflowError(f"stages need steps and survivors of at least 1: {self.stages}")
        if self.iterations >= MAX_SEGMENTS:
            raise OrbiflowError(f"stages must have less than {MAX_SEGMENTS} steps in all")

    @property
    def iterations(self) -> int:
        """Steps of all stages."""
        return sum(steps for steps, _ in self.stages)

    def for_outline(self, length: float) -> DescentSettings:
        """More starts for a ragged silhouette: there are more ways to lay it out, and more fail.

        Args:
            length: of the outline, in square roots of the silhouette's area; a disc has 3.5.
        """
        share = min(max((length / PLAIN) ** RAGGED, 1.0), MOST_TIMES)
        (steps, kept), *later = self.stages
        return replace(
            self,
            candidates=round(share * self.candidates),
            projected=round(share * self.projected),
            measured=round(share * self.measured),
            stages=((steps, round(share * kept)), *later),
        )

    def with_survivors(self, least: int) -> DescentSettings:
        """The same, with at least that many candidates after each stage."""
        stages = tuple((steps, max(kept, least)) for steps, kept in self.stages)
        return replace(self, stages=stages)

    @classmethod
    def for_effort(cls, effort: str, **changes: object) -> DescentSettings:
        """The settings of a level of effort: "fast", "normal" or "best".

        Args:
            effort: the level.
            changes: settings that differ from it, by name.

        >>> DescentSettings.for_effort("fast", seed=3).seed
        3
        """
        return settings_for(cls, DESCENT_EFFORTS, effort, changes)


DESCENT_EFFORTS: dict[str, dict[str, object]] = {
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
