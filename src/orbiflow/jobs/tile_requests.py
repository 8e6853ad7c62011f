"""What can be asked for of a silhouette in a batch."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from orbiflow.jobs.request import Request, at_least_one
from orbiflow.runtime import RecordError


@dataclass(frozen=True)
class EscherizeRequest(Request):
    """Find tiles that look like a silhouette; options as in `orbiflow escherize --help`.

    - `image`: the silhouette. `out`: folder for the results.
    - `classes`: isohedral classes, None for all nine.
    - `method`, `effort`, `max_frequency`, `turns`, `iterations`, `seed`: of the fit; None is the
      method's own default.
    - `objective`: "likeness" (the default: the silhouette bends until it is a tile), "overlap" (the
      tile overlaps the silhouette as it is) or "both"; of the descent.
    - `min_neck`: width of necks that a tile may have, in square roots of its area.
    - `emphasis`, `strength`: mask of what must survive, and how many times more it counts.
    - `pin`: what must keep its shape, in the search for likeness: "x,y" or "x,y,radius" in the
      input's coordinates, or the path of a mask. `pin_angle`: it keeps its angle, too.
    - `per_class`: tiles of each class at most. `force`: keep tiles that are not certified.
    - `figures`: draw the flow of each tile that one made, too (`field.png`).
    - `workers`: processes, None for one a core.
    - `threshold`, `invert`: how the picture is read, None to find out.
    - `called`: what the results call the silhouette, None for its path.
    """

    KIND = "escherize"

    image: Path
    out: Path = Path("out")
    classes: tuple[str, ...] | None = None
    method: Literal["descent", "occupancy"] = "descent"
    objective: Literal["likeness", "overlap", "both"] | None = None
    min_neck: float | None = None
    effort: Literal["fast", "normal", "best"] | None = None
    emphasis: Path | None = None
    strength: float | None = None
    pin: tuple[str, ...] | None = None
    pin_angle: bool = False
    per_class: int = 1
    max_frequency: int | None = None
    seed: int = 0
    turns: int | None = None
    iterations: int | None = None
    figures: bool = False
    workers: int | None = None
    threshold: float | None = None
    invert: bool | None = None
    force: bool = False
    called: str | None = None

    def check(self) -> None:
        at_least_one(self, "per_class")
        if self.strength is not None and self.emphasis is None:
            raise RecordError("{strength} needs {emphasis}: the mask that it belongs to")
        if self.method == "occupancy":
            for name in ("emphasis", "effort", "objective", "min_neck", "pin"):
                if getattr(self, name) is not None:
                    raise RecordError(f"{{{name}}} belongs to {{method}} descent")
        else:
            for name in ("turns", "iterations"):
                if getattr(self, name) is not None:
                    raise RecordError(
                        f"{{{name}}} belongs to {{method}} occupancy; the descent has {{effort}} "
                        "instead"
                    )
        likeness = self.method == "descent" and self.objective in (None, "likeness")
        if self.max_frequency is not None and likeness:
            raise RecordError("{max_frequency} belongs to {objective} overlap or both")
        self._check_pins()
        if self.min_neck is not None and not 0 <= self.min_neck <= 0.2:
            raise RecordError(f"{{min_neck}} must be from 0 to 0.2, got {self.min_neck:g}")
        at_least_one(self, "workers")
        if self.threshold is not None and not 0 <= self.threshold <= 1:
            raise RecordError(f"{{threshold}} must lie between 0 and 1, got {self.threshold:g}")

    def _check_pins(self) -> None:
        if self.pin == ():
            raise RecordError("{pin} names no part; give x,y or x,y,radius, or a mask")
        if self.pin and self.objective == "overlap":
            raise RecordError("{pin} belongs to {objective} likeness or both: nothing bends here")
        if self.pin_angle and not self.pin:
            raise RecordError("{pin_angle} needs {pin}: the part that keeps its angle")
