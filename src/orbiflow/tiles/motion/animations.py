"""From a tile to an animation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from orbiflow.arguments import (
    number,
    whole,
)
from orbiflow.arguments import (
    path as as_path,
)
from orbiflow.drawing import DEFAULT_PALETTE, palette
from orbiflow.errors import (
    OrbiflowError,
    OutputError,
)
from orbiflow.runtime import write_atomic
from orbiflow.tiles.motion.kinds import (
    KINDS,
    Kind,
    Motion,
    bend,
    frames,
    grow,
    morph,
)
from orbiflow.tiles.motion.writers import (
    require_ffmpeg,
    write_gif,
    write_motion_svg,
    write_mp4,
)
from orbiflow.tiles.tile import EscherTile, TileSource

Format = Literal["gif", "mp4", "svg"]
FORMATS: tuple[Format, ...] = ("gif", "mp4", "svg")

MOST_FRAMES = 2400


@dataclass(frozen=True)
class AnimationSettings:
    """How a tile is animated.

    - `format`: of the file.
    - `kind`: "morph" (a tiling with straight edges becomes the tile's), "bend" (the silhouette bends
      into the tile, then its tiling grows) or "grow" (the tiling grows around one tile).
    - `seconds`: of the loop, there and back.
    - `fps`: pictures a second; an SVG has none.
    - `size`: width in pixels, an even number; the height is two thirds of it.
    - `palette`: of the fills.

    Raises:
        OrbiflowError: for a setting that cannot be used, by its name.

    >>> AnimationSettings(kind="grow", seconds=3).size
    800
    """

    format: Format = "gif"
    kind: Kind = "morph"
    seconds: float = 6.0
    fps: float = 24.0
    size: int = 800
    palette: str = DEFAULT_PALETTE

    def __post_init__(self) -> None:
        for name, known in (("format", FORMATS), ("kind", KINDS)):
            value = getattr(self, name)
            if value not in known:
                raise OrbiflowError(f"{name} must be one of {', '.join(known)}, got {value!r}")
        number(self.seconds, "seconds", 0.5, 120)
        number(self.fps, "fps", 1, 60)
        whole(self.size, "size", 64, 4000)
        if self.size % 2:
            raise OrbiflowError(f"size must be even, which videos need, got {self.size}")
        palette(self.palette)
        if self.format != "svg" and self.seconds * self.fps > MOST_FRAMES:
            raise OrbiflowError(
                f"{self.seconds:g} seconds of {self.fps:g} pictures are more than {MOST_FRAMES}; "
                "choose fewer seconds or a lower fps"
            )


def animate(
    tile: TileSource,
    out: str | Path,
    settings: AnimationSettings | None = None,
    *,
    force: bool = False,
) -> Path:
    """Write an animation of a tile.

    Args:
        tile: in memory, or a run's folder; see `read_result`.
        out: the file; an ending .gif, .mp4 or .svg decides the format.
        settings: see `AnimationSettings`; their format counts for other endings, which are refused
            without them.
        force: take a tile that is not certified.

    Raises:
        CertificationError: for a tile that is not certified.
        OrbiflowError: for settings that cannot be met, in words.
        OutputError: if the file cannot be written, or nothing says its format.
    """
    out = as_path(out, "the file to animate to")
    ending = out.suffix.lower().lstrip(".")
    form = next((known for known in FORMATS if known == ending), None)
    if settings is None and ending and form is None:
        raise OutputError(
            f"{out.name} ends in .{ending}; give AnimationSettings with a format, or end it in "
            f".{', .'.join(FORMATS)}"
        )
    settings = settings or AnimationSettings()
    settings = replace(settings, format=form or settings.format)
    return write_atomic(out, animation(tile, settings, force=force))


def animation(
    tile: TileSource,
    settings: AnimationSettings | None = None,
    *,
    force: bool = False,
    told: Callable[[float], None] = lambda _: None,
) -> bytes | str:
    """The content of the file.

    Args:
        told: told the share of the work done; what it raises ends it.

    Raises:
        As `animate`.
    """
    settings = settings or AnimationSettings()
    if settings.format == "mp4":
        require_ffmpeg()  # before the work
    given, colours = EscherTile.of(tile), palette(settings.palette)
    given.require_certified(force=force, otherwise="so it is not animated; --force animates it")
    made = motion(given, settings)
    told(0.0)
    loop = frames(settings.seconds, settings.fps)
    match settings.format:
        case "svg":
            title = f"{given.name}: {made.what}"
            name = f"{given.name}-{settings.kind}"
            return write_motion_svg(made, colours, seconds=settings.seconds, name=name, title=title)
        case "gif":
            return write_gif(made, colours, loop, told)
        case "mp4":
            return write_mp4(made, colours, loop, settings.fps, told)


def motion(tile: EscherTile, settings: AnimationSettings) -> Motion:
    """Return what moves, before it is a file.

    Raises:
        OrbiflowError: if the tile lacks what the kind needs.
    """
    match settings.kind:
        case "morph":
            steady = settings.format == "svg"
            return morph(tile.tile, settings.size, y_down=tile.y_down, steady=steady)
        case "grow":
            return grow(tile.tile, settings.size, y_down=tile.y_down)
        case "bend":
            return bend(tile, settings.size)
