"""What a search method is: settings that know how to search."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from orbiflow.errors import CertificationError, OrbiflowError
from orbiflow.runtime import NEVER, Cancel
from orbiflow.settings import as_choice, as_instance
from orbiflow.tiles.search.candidates import ClassFinalists, OnProgress
from orbiflow.tiles.silhouette import HOW_TO_GET_A_TARGET, Emphasis, Pins, Target
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import IsohedralClass, isohedral_class

# The classes by how often they come near a silhouette at once, for the time that they take
PREFERRED_CLASSES = ("IH6", "IH5", "IH4", "IH2", "IH3", "IH7", "IH21", "IH28", "IH1")

# Classes whose tiles have a symmetry of their own, by that symmetry. They were chosen by looking at the
# tiles of all 18 with a mirror: in the others many edges must be straight.
SYMMETRIC_CLASSES = {"D1": ("IH13", "IH12", "IH69"), "C2": ("IH8", "IH9")}


@dataclass(frozen=True, eq=False)
class Goal:
    """What tiles are to look like."""

    target: Target
    emphasis: Emphasis | None = None  # what must survive
    pins: Pins | None = None  # what must not bend
    is_background: bool = False  # whether any shape will do, as of what another figure leaves
    has_rounder: bool = False  # whether a rounder silhouette follows, so that a search may give up

    @classmethod
    def background(cls) -> Self:
        """Return the goal of what is left between figures, which would be round."""
        turns = 2 * np.pi * np.arange(72) / 72
        disc = np.stack([np.cos(turns), np.sin(turns)], axis=1)
        return cls(Target.from_polygon(disc, source="background"), is_background=True)

    @classmethod
    def read(
        cls,
        target: Target,
        *,
        emphasis: Path | None = None,
        strength: float | None = None,
        pin: Sequence[str] | None = None,
        keep_angle: bool = False,
    ) -> Self:
        """Return a silhouette with what settings say of it: a mask of what matters, and pins.

        Raises:
            OrbiflowError: For a mask or pin that cannot be read.
        """
        as_instance(target, Target, "the target", HOW_TO_GET_A_TARGET)
        more = {} if strength is None else {"strength": strength}
        mask = None if emphasis is None else Emphasis.read(emphasis, target, **more)
        pins = None if pin is None else Pins.read(pin, target, keep_angle=keep_angle)
        return cls(target, mask, pins)

    @property
    def notes(self) -> list[str]:
        """What was decided for the user about emphasis and pins."""
        return [note for source in (self.emphasis, self.pins) if source for note in source.notes]


class SearchMethod(ABC):
    """A way to search for tiles: derive a class of `Settings`, or a frozen dataclass, and write `fit`.

    A search asks its method for candidates of one class after another, in worker processes if there
    are several, and certifies what it gets. Everything but `fit` has a default.

    - `objective`: What the method is after, for result.json.
    - `method_name`: The name of the method, for result.json.
    - `takes_pins`: Whether it minds parts of the silhouette that must not bend.
    - `takes_symmetric`: Whether classes of symmetric tiles are searched, too, for a silhouette that is
      near to symmetric, unless classes are named.
    - `efforts`: What each level of effort changes, for `for_effort`.
    - `seed`: What a user changes for other tiles.
    """

    objective: ClassVar[str] = "overlap"
    method_name: ClassVar[str] = "descent"
    takes_pins: ClassVar[bool] = False
    takes_symmetric: ClassVar[bool] = False
    efforts: ClassVar[Mapping[str, Mapping[str, Any]]] = {}
    seed: int = 0

    @classmethod
    def for_effort(cls, effort: str, **changes: Any) -> Self:
        """Return the settings of a level of effort, "fast" or "normal", with changes by name.

        Raises:
            OrbiflowError: for an unknown level or setting.
        """
        if not cls.efforts:
            raise OrbiflowError(f"{cls.__name__} has no levels of effort; give its settings")
        return cls(**{**cls.efforts[as_choice(effort, tuple(cls.efforts), "effort")], **changes})

    @abstractmethod
    def fit(
        self, goal: Goal, kind: IsohedralClass, per_class: int, progress: OnProgress, cancel: Cancel
    ) -> ClassFinalists:
        """Return candidates of one class, best first.

        Args:
            goal: The silhouette, and what matters in it; emphasis may be ignored, and only methods
                with `takes_pins` are given pins.
            kind: The class.
            per_class: The number of certified tiles that are wanted.
            progress: To be called with the share of the work done and the best loss so far.
            cancel: To be checked before each step.

        Raises:
            CertificationError: if no candidate is left.
            Cancelled: If the token was cancelled.
        """

    def preview(
        self, goal: Goal, names: Sequence[str], cancel: Cancel = NEVER
    ) -> EscherTile | None:
        """Return a certified tile of one of the classes in a moment, if the method can."""
        from orbiflow.tiles.search.finished_tiles import best_tiles

        kind = isohedral_class(
            next((name for name in PREFERRED_CLASSES if name in names), names[0])
        )
        for share, rounded in Sketches(self).goals(goal):
            with suppress(CertificationError):
                fit = self.sketch(rounded, kind, cancel)._replace(enough=1)
                return best_tiles(rounded.target, fit, original=goal.target, smoothed=share)[0]
        return None

    def sketch(self, goal: Goal, kind: IsohedralClass, cancel: Cancel = NEVER) -> ClassFinalists:  # noqa: ARG002
        """Return candidates in a moment, for `preview`, or raise `CertificationError`."""
        raise CertificationError(f"{self.method_name} has no quick way to tiles of {kind.name}")

    def goals(self, goal: Goal) -> Sequence[tuple[float, Goal]]:
        """Return what is looked for in a class, in turn, until there is a tile.

        Each is the goal, or its silhouette with what is narrower than a share of its length rounded
        off, and that share.
        """
        return [(0.0, goal)]

    def prepare(self, goal: Goal) -> None:  # noqa: B027 - nothing to prepare
        """Compute what the fits of all classes share, so that forked processes find it done."""

    def least_neck(self, goal: Goal) -> float:  # noqa: ARG002
        """Return the width of necks below which scores fall, in square roots of the area."""
        return 0.0

    def levels(self) -> Sequence[tuple[float, SearchMethod]]:
        """Return methods that find more and more, each with the work that it is for a class.

        A search takes one after another, each for the classes that are promising; together they find
        what this one does.
        """
        return [(1.0, self)]

    def is_promising(self, tile: EscherTile, best: EscherTile) -> bool:  # noqa: ARG002
        """Return whether a class whose best tile this is may give the best of all at the next level."""
        return True

    def in_order(self, names: Sequence[str]) -> list[str]:
        """Return classes in the order in which worker processes take them: the longest first."""
        return sorted(names, key=lambda name: -isohedral_class(name).stretch_dim)


@dataclass(frozen=True)
class Sketches(SearchMethod):
    """The quick way of another method as one of its own, of one tile a class."""

    whole: SearchMethod

    def fit(
        self,
        goal: Goal,
        kind: IsohedralClass,
        per_class: int,  # noqa: ARG002
        progress: OnProgress,  # noqa: ARG002
        cancel: Cancel,
    ) -> ClassFinalists:
        """Sketch tiles of the class."""
        return self.whole.sketch(goal, kind, cancel)._replace(enough=1)

    def in_order(self, names: Sequence[str]) -> list[str]:
        """Return those first that soonest give a tile to look at."""
        return [name for name in PREFERRED_CLASSES if name in names] + [
            name for name in names if name not in PREFERRED_CLASSES
        ]

    def goals(self, goal: Goal) -> Sequence[tuple[float, Goal]]:
        """Return the other's, rounded silhouettes first: their sketches seldom cross themselves."""
        first, *rounded = self.whole.goals(goal)
        return [*rounded, first]

    def prepare(self, goal: Goal) -> None:
        """Compute what all fits share."""
        self.whole.prepare(goal)

    def least_neck(self, goal: Goal) -> float:
        """Return the other's."""
        return self.whole.least_neck(goal)
