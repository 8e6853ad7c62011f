"""What the studio's workers do for what is taken away of a tile: show it, and write its files."""

from __future__ import annotations

import base64
import json
import shutil
import time
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

from orbiflow.errors import OrbiflowError
from orbiflow.runtime import (
    NEVER,
    Call,
    Cancel,
    Note,
    Outcome,
    Sink,
    as_part,
    ignore,
    is_object,
    make_folder,
    operation,
)
from orbiflow.settings import Range
from orbiflow.studio.kinds_of_work import WITH_DRAWING, file_name, making_call
from orbiflow.studio.settings import Job, TakeAway
from orbiflow.studio.tile_files import tile_folder
from orbiflow.studio.words import OF_PICTURE, PREFIXES

PICTURE_ENDINGS = (".png", ".jpg", ".jpeg", ".webp")  # of pictures on which lines can be drawn


def with_drawing(
    drawing: str, result: Path, files: dict[str, Any], settings: dict[str, Any], scratch: Path
) -> tuple[Path, dict[str, Any], dict[str, Any]]:
    """Return the result, files and settings of a take-away with a drawing on its tile.

    Args:
        drawing: What the project remembers as its drawing, as JSON; "" for nothing.
        result: The tile's folder.
        files: The files that the take-away is given; the pictures go below the drawing.
        settings: The settings of `export` or `art`.
        scratch: A folder for what is written on the way.
    """
    from orbiflow.studio.tile_drawing import drawing_settings, with_any_map
    from orbiflow.tiles import read_result, save_tiles

    parts = json.loads(drawing or "{}")
    drawings = [parts, parts.get("second")] if is_object(parts) else []
    if not any(
        is_object(layer) and (layer.get("strokes") or layer.get("eyes")) for layer in drawings
    ):
        return result, files, settings
    source = read_result(result)
    tile, scratch = with_any_map(source), make_folder(scratch)
    if tile is not source:
        result = save_tiles([tile], scratch / "tile")
    for number, (layer, part) in enumerate(zip(drawings, tile.figures, strict=False)):
        end, prefix = OF_PICTURE[number], PREFIXES[number]
        under: Path | None = files.get(f"{prefix}picture")
        if settings.get("world") and settings.get("format") == "html":
            under = None  # a page to turn shows lines, but no pixels
        elif under is not None and under.suffix not in PICTURE_ENDINGS:
            under = under.with_name(f"backdrop{end}.png")
        made = drawing_settings(layer, part.figure, scratch, under, f"drawing{end}")
        if made["picture"] is not None:
            files = {**files, f"{prefix}picture": made["picture"]}
        if made["eyes"]:
            settings = {**settings, f"{prefix}eyes": made["eyes"]}
    return result, files, settings


PREVIEW = "preview.png"
SCRATCH = ".drawn"  # a folder for what is written on the way
MAX_DRAWN_BYTES = 30_000_000  # bytes of a solid that is drawn
PREVIEW_SIDE_PIXELS = 1000.0  # pixels of a preview's longer side
LEAST_TILE_PIXELS = 8.1  # of a tile, below which no picture of it can be made
SHOWN_PROGRESS = 0.7  # share of an animation at which it is shown


def export_folder(home: Path, task: int) -> Path:
    """Return the folder of the files that a task of a project makes to be taken away."""
    return home / "exports" / str(task)


def files_of(folder: Path) -> list[dict[str, Any]]:
    """Return the name and the size in bytes of each file in a folder, by name."""
    files = sorted(file for file in folder.iterdir() if file.is_file())
    return [{"name": file.name, "bytes": file.stat().st_size} for file in files]


@operation("studio preview")
def preview(
    job: Job,
    choice: TakeAway,
    side: Annotated[int, Range(100, 2000)] = 800,
    *,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Draw what a user would take away of a tile, small, by what makes the file.

    The outcome has the `image`, a PNG in base 64, and its `notes`.

    Args:
        side: The pixels of the picture's longer side, where it can be chosen.
    """
    del on_event
    folder = make_folder(export_folder(job.project, job.task))
    notes: list[str] = []

    def hear(event: object) -> None:
        if isinstance(event, Note) and not event.text.startswith("written "):
            notes.append(event.text)

    try:
        result, files, wanted = _asked(job, choice, _small_pictures, folder)
        call = making_call(choice.makes, wanted, result, **files)
        image = _drawn(call, folder, side, hear, cancel)
        return Outcome({"image": base64.b64encode(image).decode(), "notes": notes})
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _small_pictures(home: Path, result: Path) -> dict[str, Any]:
    """Return the pictures of `_pictures`, those of pixels as the page shows them, which are smaller."""
    pictures = _pictures(home, result)
    for end, prefix in zip(OF_PICTURE, PREFIXES, strict=True):
        small, uploaded = home / f"backdrop{end}.png", pictures.get(f"{prefix}picture")
        if uploaded is not None and uploaded.suffix in PICTURE_ENDINGS and small.exists():
            pictures[f"{prefix}picture"] = small
    return pictures


def _drawn(call: Call, folder: Path, side: float, hear: Sink, cancel: Cancel) -> bytes:
    """Return a picture of what a call would write, its longer side of so many pixels."""
    settings, makes = call.arguments["settings"], call.operation.name
    if makes == "animate":
        from orbiflow.tiles import still

        pictures = [call.arguments.get(f"{prefix}picture") for prefix in PREFIXES]
        return still(call.arguments["result"], settings, SHOWN_PROGRESS, side, pictures)
    out = folder / PREVIEW
    # what holds no pixels refuses pictures
    if makes == "solid" or settings.file_format in ("dxf", "json"):
        out = out.with_suffix(f".{settings.file_format}")
    else:
        settings = _small(settings, side)
    arguments = {**call.arguments, "settings": settings, "out": out}
    done: Any = call.operation.function(**arguments, on_event=hear, cancel=cancel)
    if makes == "solid":
        _preview(call, min(folder.glob(f"*{out.suffix}")), folder, cancel)
    elif out.suffix == ".png":
        out = min(folder.glob("*.png"))  # of several sheets the first
    else:
        from orbiflow.tiles import write_scene

        drawn = write_scene(done.scenes[0], "png", dpi=_small_dpi(settings, side))
        return bytes(drawn) if isinstance(drawn, bytes) else b""
    return (out if out.suffix == ".png" else folder / PREVIEW).read_bytes()


def _small(settings: Any, side: float) -> Any:
    """Return settings of the same page as a PNG whose longer side has so many pixels."""
    same = {} if getattr(settings, "repeat", None) else {"area": settings.page}
    return settings.replace(format="png", dpi=_small_dpi(settings, side), **same)


def _small_dpi(settings: Any, side: float) -> float:
    """Return the pixels to an inch at which a page has this longer side, or tiles show at all."""
    least = 0.0 if settings.tile_size is None else 25.4 * LEAST_TILE_PIXELS / settings.tile_size
    return min(settings.dpi, max(least, 25.4 * side / max(settings.page)))


@operation("studio take")
def take(
    job: Job, choice: TakeAway, called: str = "", *, on_event: Sink = ignore, cancel: Cancel = NEVER
) -> Outcome:
    """Write what a user takes away of a tile.

    Args:
        called: The name of the project, with which that of the file begins.
    """
    folder = make_folder(export_folder(job.project, job.task))
    result, files, wanted = _asked(job, choice, _pictures, folder)
    call = making_call(choice.makes, wanted, result, **files)
    out = folder / file_name(call, called)
    arguments = {**call.arguments, "out": out}
    done = call.operation.function(**arguments, on_event=as_part(on_event), cancel=cancel)
    written = files_of(folder)
    preview = False
    with suppress(OrbiflowError):  # what was asked for is there
        preview = _preview(call, folder / written[0]["name"], folder, cancel)
    if len(written) > 1:
        written = _in_one_file([folder / file["name"] for file in written], out)
    facts = {name: value for name, value in done.summary.items() if name not in ("file", "files")}
    return Outcome(
        {
            "takeaway": job.task,
            "files": written,
            "preview": preview,
            "facts": facts,
            "chosen": json.loads(choice.settings),
            "made": time.time(),
        }
    )


def _in_one_file(files: list[Path], name: Path) -> list[dict[str, Any]]:
    """Pack files into one ZIP, so that whoever takes them away has them in one click."""
    packed = name.with_suffix(".zip")
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in files:
            archive.write(file, file.name)
            file.unlink()
    return [{"name": packed.name, "bytes": packed.stat().st_size}]


def _asked(
    job: Job, choice: TakeAway, pictures: Callable[[Path, Path], dict[str, Any]], folder: Path
) -> tuple[Path, dict[str, Any], dict[str, Any]]:
    """Return the tile's folder, the files that go onto it and the settings that a browser wants."""
    wanted, result = json.loads(choice.settings), tile_folder(job.project, choice.tile)
    files = pictures(job.project, result) if choice.picture else {}
    if choice.drawing and choice.makes in WITH_DRAWING:
        return with_drawing(choice.drawing, result, files, wanted, folder / SCRATCH)
    return result, files, wanted


def _pictures(home: Path, result: Path) -> dict[str, Any]:
    """Return the pictures that were uploaded for the figures of a tile, by argument."""
    from orbiflow.studio.silhouette_file import input_file
    from orbiflow.tiles import read_result

    pictures: dict[str, Any] = {}
    for prefix, end, _ in zip(PREFIXES, OF_PICTURE, read_result(result).figures, strict=False):
        for file in home.glob(f"input{end}.*"):
            if file.suffix in (*PICTURE_ENDINGS, ".svg"):
                pictures[f"{prefix}picture"] = file
    return pictures or {"picture": input_file(home)}


def _preview(call: Call, first: Path, folder: Path, cancel: Cancel) -> bool:
    """Write a picture of a take-away if it can be drawn; return whether it was."""
    if first.suffix == ".png":
        shutil.copyfile(first, folder / PREVIEW)
        return True
    if call.operation.name in ("solid", "build") and first.stat().st_size < MAX_DRAWN_BYTES:
        from orbiflow.drawing import read_triangles, solid_picture

        solid_picture(read_triangles(first)).save(folder / PREVIEW)
        return True
    if call.operation.name != "export":
        return False
    settings = call.arguments["settings"]
    small = _small(settings, PREVIEW_SIDE_PIXELS)
    call.operation.function(
        **{**call.arguments, "settings": small, "out": folder / PREVIEW}, cancel=cancel
    )
    return (folder / PREVIEW).is_file()
