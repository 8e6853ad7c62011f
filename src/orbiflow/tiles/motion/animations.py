"""From a tile to an animation."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from orbiflow.arguments import path as as_path
from orbiflow.drawing import palette
from orbiflow.runtime import Cancel, Note, Progress, Sink, ignore, write_atomic
from orbiflow.tiles.motion.kinds import Motion, bend, frames, grow, morph
from orbiflow.tiles.motion.settings import AnimationSettings
from orbiflow.tiles.motion.writers import (
    require_ffmpeg,
    write_gif,
    write_motion_svg,
    write_mp4,
)
from orbiflow.tiles.tile import EscherTile, TileSource
from orbiflow.tiles.tilings import colouring


def animate(
    tile: TileSource,
    out: str | Path,
    settings: AnimationSettings | None = None,
    *,
    force: bool = False,
    on_event: Sink = ignore,
    cancel: Cancel | None = None,
) -> Path:
    """Write an animation of a tile.

    Args:
        tile: A tile in memory, or a run's folder; see `read_result`.
        out: The file. Its ending, .gif, .mp4 or .svg, decides the format, unless the settings give one.
        settings: How it is animated.
        force: Animate a tile that is not certified.
        on_event: Called with each `Note` and `Progress`.
        cancel: Stops the work; nothing is then written.

    Raises:
        CertificationError: If the tile is not certified.
        OrbiflowError: If the settings cannot be met, or nothing says the format.
        OutputError: If the file cannot be written.
        Cancelled: If it was cancelled.
    """
    out, cancel = as_path(out, "the file to animate to"), cancel or Cancel()
    settings, given = (settings or AnimationSettings()).for_file(out), EscherTile.of(tile)

    def told(share: float) -> None:
        cancel.check()
        on_event(Progress(share, "drawing"))

    for note in palette(settings.palette).shortage(colouring(given.tile).count):
        on_event(Note(note))
    content = animation(given, settings, force=force, told=told)
    cancel.check()
    return write_atomic(out, content)


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
    settings = (settings or AnimationSettings()).for_file(None)
    if settings.format == "mp4":
        require_ffmpeg()  # before the work
    given, colours = EscherTile.of(tile), palette(settings.palette)
    given.require_certified(force=force, otherwise="so it is not animated; --force animates it")
    made = motion(given, settings)
    told(0.0)
    loop = frames(settings.seconds, settings.fps)
    match settings.file_format:
        case "svg":
            title = f"{given.name}: {made.what}"
            name = f"{given.name}-{settings.kind}"
            return write_motion_svg(made, colours, seconds=settings.seconds, name=name, title=title)
        case "mp4":
            return write_mp4(made, colours, loop, settings.fps, told)
        case _:
            return write_gif(made, colours, loop, told)


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
