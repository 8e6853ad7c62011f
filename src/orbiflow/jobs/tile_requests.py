"""What can be asked for of silhouettes and tiles: one frozen dataclass a job, checked when made."""

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


@dataclass(frozen=True)
class ExportRequest(Request):
    """Write a tile's tiling, lines or pieces in real size; see `orbiflow export --help`.

    Lengths are text with their unit, such as "40mm"; sizes such as "300x200mm"; an area may be
    "single" or "double", a journal's columns.

    - `result`: a search's folder, or its result.json. `tile`: a class or a rank.
    - `out`: the file, None for one named after the tile in the working directory.
    - `purpose`: "laser", "print", "paper", "web" or "plotter", for what the other fields leave open.
    - `format`: None for the file's ending, or the purpose's.
    - others: as in `orbiflow.export.ExportSettings`; None is its default, or the purpose's.
    """

    KIND = "export"

    result: Path
    out: Path | None = None
    tile: str = "1"
    purpose: Literal["laser", "print", "paper", "web", "plotter"] | None = None
    format: Literal["svg", "pdf", "dxf", "png", "json"] | None = None
    tile_size: str | None = None
    area: str | None = None
    cut: Literal["none", "skeleton", "pieces"] | None = None
    kerf: str | None = None
    clearance: str | None = None
    spacing: str | None = None
    copies: int | None = None
    clip: bool | None = None
    border: bool = False
    bed: str | None = None
    calibrate: bool = False
    tolerance: str | None = None
    warn_neck: str | None = None
    palette: str | None = None
    dpi: float | None = None
    force: bool = False

    def check(self) -> None:
        at_least_one(self, "copies")
        if self.dpi is not None and not 1 <= self.dpi <= 10_000:
            raise RecordError(f"{{dpi}} must be from 1 to 10000, got {self.dpi:g}")
        if self.dpi is not None and self.format not in ("png", None):
            raise RecordError("{dpi} belongs to {format} png")


@dataclass(frozen=True)
class ArtRequest(Request):
    """Carry a picture onto a tile and repeat it over the plane; see `orbiflow art --help`.

    Sizes are text: pixels such as "3000x2000" and "400", or lengths such as "300x200mm" and "40mm".

    - `result`: a search's folder, or its result.json. `tile`: a class or a rank.
    - `out`: a .png or .svg; None for one named after the tile in the working directory.
    - `picture`: over the silhouette: an image, or an SVG drawing.
    - `engrave`, `strokes`: draw lines inside the tile; strokes of a kind.
    - `eyes`: each "x,y" or "x,y,radius" in the silhouette's coordinates.
    - others: as in `orbiflow.export.ArtSettings`; None is its default.
    """

    KIND = "art"

    result: Path
    out: Path | None = None
    tile: str = "1"
    picture: Path | None = None
    size: str | None = None
    tile_size: str | None = None
    repeat: bool = False
    tolerance: float | None = None
    palette: str | None = None
    colour: Literal["aspect", "neighbour", "one"] | None = None
    outline: str | None = None
    engrave: bool = False
    strokes: Literal["hatch", "echoes", "feathers"] | None = None
    eyes: tuple[str, ...] = ()
    dpi: float | None = None
    force: bool = False

    def check(self) -> None:
        if self.dpi is not None and not 1 <= self.dpi <= 10_000:
            raise RecordError(f"{{dpi}} must be from 1 to 10000, got {self.dpi:g}")
        if self.tolerance is not None and not 0 <= self.tolerance <= 0.2:
            raise RecordError(f"{{tolerance}} must be from 0 to 0.2, got {self.tolerance:g}")
        if self.repeat and self.size is not None:
            raise RecordError(
                "{size} is the page's; the cell of {repeat} has its own, which {tile_size} decides"
            )
        if self.tolerance is not None and not self.repeat:
            raise RecordError("{tolerance} belongs to {repeat}")
        if self.out is not None and self.out.suffix.lower() not in (".png", ".svg"):
            raise RecordError(f"{{out}} must end in .png or .svg, got {self.out.name}")


@dataclass(frozen=True)
class AnimateRequest(Request):
    """Write an animation of a tile; see `orbiflow animate --help`.

    - `result`: a search's folder, or its result.json. `tile`: a class or a rank.
    - `out`: the file, .gif, .mp4 or .svg; None for a GIF named after the tile in the working directory.
    - `animation`: "morph" (a tiling with straight edges becomes the tile's), "bend" (the silhouette
      bends into the tile, then its tiling grows) or "grow".
    - `seconds`, `fps`, `size`, `palette`: of the loop; None is the default of
      `orbiflow.export.AnimationSettings`.
    """

    KIND = "animate"

    result: Path
    out: Path | None = None
    tile: str = "1"
    animation: Literal["morph", "bend", "grow"] = "morph"
    seconds: float | None = None
    fps: float | None = None
    size: int | None = None
    palette: str | None = None
    force: bool = False

    def check(self) -> None:
        ending = "" if self.out is None else self.out.suffix.lower()
        if self.out is not None and ending not in (".gif", ".mp4", ".svg"):
            raise RecordError(f"{{out}} must end in .gif, .mp4 or .svg, got {self.out.name!r}")
        if self.seconds is not None and not 0.5 <= self.seconds <= 120:
            raise RecordError(f"{{seconds}} must be from 0.5 to 120, got {self.seconds:g}")
        if self.fps is not None and not 1 <= self.fps <= 60:
            raise RecordError(f"{{fps}} must be from 1 to 60, got {self.fps:g}")
        if self.fps is not None and ending == ".svg":
            raise RecordError("{fps} belongs to .gif and .mp4: an SVG moves evenly")
        if self.size is not None and (not 64 <= self.size <= 4000 or self.size % 2):
            raise RecordError(f"{{size}} must be an even number from 64 to 4000, got {self.size}")
