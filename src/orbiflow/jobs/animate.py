"""Writing an animation of a tile: the job of an `AnimateRequest`."""

from __future__ import annotations

from pathlib import Path

from orbiflow.drawing import palette
from orbiflow.jobs.asked import given
from orbiflow.jobs.place import check_place
from orbiflow.jobs.run import Sink
from orbiflow.jobs.tile_requests import AnimateRequest
from orbiflow.runtime import (
    Cancel,
    Finished,
    Note,
    Progress,
    Written,
    write_atomic,
)
from orbiflow.tiles import (
    AnimationSettings,
    animation,
    colouring,
    read_result,
)


def animate(request: AnimateRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Write the file.

    Returns:
        `summary`: the `file`, its size in `bytes`, the `class` and the `kind`.

    Raises:
        OrbiflowError: for anything that the user can mend.
        Cancelled: if it was told to stop; nothing is written.
    """
    settings = _settings(request)
    tile = read_result(request.result, request.tile)
    out = request.out or Path(f"{tile.name}-{settings.kind}.{settings.format}")
    check_place(out, request.result)

    def told(share: float) -> None:
        cancel.check()
        tell(Progress(share, "drawing"))

    for note in palette(settings.palette).shortage(colouring(tile.tile).count):
        tell(Note(note))
    content = animation(tile, settings, force=request.force, told=told)
    cancel.check()
    data = content.encode() if isinstance(content, str) else content
    path = write_atomic(out, data)
    tell(
        Note(
            f"written {path}: {settings.kind} of {tile.tile.isohedral_class}, {settings.seconds:g} s, "
            f"{settings.size} pixels wide, {len(data) / 1000:.0f} kB"
        )
    )
    tell(Written(path))
    summary = {
        "file": str(path),
        "bytes": len(data),
        "class": tile.tile.isohedral_class,
        "kind": settings.kind,
    }
    return Finished("done", summary)


def _settings(request: AnimateRequest) -> AnimationSettings:
    asked = given(request, ("seconds", "fps", "size", "palette"))
    if request.out is not None:
        asked["format"] = request.out.suffix.lower().lstrip(".")
    return AnimationSettings(kind=request.animation, **asked)
