"""What the studio's workers do for tiles: read a picture, search, pull, and write files to download."""

from __future__ import annotations

import json
import shutil
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orbiflow.errors import OrbiflowError
from orbiflow.runtime import (
    NEVER,
    Call,
    Cancel,
    Note,
    Outcome,
    Progress,
    Sink,
    as_part,
    cores,
    ignore,
    is_object,
    make_folder,
    one_blas_thread,
    operation,
    write_json,
)
from orbiflow.studio.kinds_of_work import WITH_DRAWING, file_name, making_call
from orbiflow.studio.settings import Job, SearchChoice
from orbiflow.studio.tile_files import (
    STAGES,
    announce_tiles,
    best_stage,
    origin_of_pulled,
    put_tile,
    tile_folder,
    tile_number,
    tiles_of,
)
from orbiflow.studio.words import OF_PICTURE
from orbiflow.tiles import ReadingSettings

if TYPE_CHECKING:
    from orbiflow.tiles import EscherizeSettings, EscherTile

PER_CLASS = 50  # numbers that a class has for its tiles
MORE_TILES = 4  # tiles of a class, for "more like this one"


@operation("studio read")
def read(
    job: Job,
    called: str = "picture",
    reading: ReadingSettings = ReadingSettings(),
    *,
    number: int = 0,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Read the silhouette in a project's picture.

    Args:
        called: What messages call the picture.
        number: 0 for the first picture, 1 for the second.
    """
    from orbiflow.studio.silhouette_file import read_input

    cancel.check()
    on_event(Progress(0.1, "reading the picture"))
    target = read_input(job.project, called, reading, number)
    return Outcome({"read": [number], "vertices": len(target.outline)})


@operation("studio search", keeps_partial=True, starts_processes=True)
def search(
    job: Job,
    settings: SearchChoice = SearchChoice(),
    *,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Search for tiles of a project's silhouettes, and write each as soon as it is found."""
    from orbiflow.studio.silhouette_file import has_second

    if has_second(job.project):
        return _search_pairs(job, settings, on_event, cancel)
    with one_blas_thread():  # tiles are measured and written here, beside processes that search
        return _search_single(job, settings, on_event, cancel)


def _search_single(job: Job, settings: SearchChoice, on_event: Sink, cancel: Cancel) -> Outcome:
    """Search for tiles of one silhouette, stage by stage, without the classes that are done."""
    from orbiflow.studio.silhouette_file import load_target, marks_of
    from orbiflow.tiles import escherize, searched_classes

    target = load_target(job.project)
    whole = _search_settings(job.project, settings)
    names = searched_classes(target, whole)
    left = [name for k, name in enumerate(names) if not _is_done(job, k)]
    announce_tiles(job, on_event)
    if settings.objective != "likeness" and (job.project / "pins.png").exists():
        on_event(
            Note(
                "What was painted with “Keep its shape” counts only where the tile is to look alike"
            )
        )
    if not left:
        return Outcome({"tiles": len(names)})
    seen: dict[tuple[str, str], int] = {}
    origin = {"found_for": marks_of(job.project)}

    def show(tile: EscherTile, stage: str) -> None:
        name = tile.isohedral_class
        place = seen[name, stage] = seen.get((name, stage), -1) + 1
        number = tile_number(job.task, names.index(name) * PER_CLASS + place)
        put_tile(job.project, number, stage, tile, on_event, origin)

    result = escherize(
        target,
        whole.replace(classes=tuple(left), workers=cores()),
        on_tile=show,
        on_event=as_part(on_event, 1 - len(left) / len(names)),
        cancel=cancel,
    )
    if rounded := sum(tile.likeness.smoothed > 0 for tile in result.tiles):
        on_event(
            Note(
                f"The thinnest parts are rounded off in {rounded} of {len(result.tiles)} tiles: let "
                "them grow (Thin parts, where the picture is read) to keep them"
            )
        )
    if result.interrupted:
        return Outcome({"tiles": len(result.tiles)}, "cancelled")
    return Outcome({"tiles": len(result.tiles)}, "done" if result.tiles else "nothing found")


def _search_pairs(job: Job, choice: SearchChoice, on_event: Sink, cancel: Cancel) -> Outcome:
    """Search for tiles of both silhouettes: those of a stage replace the ones before, in order."""
    from orbiflow.studio.silhouette_file import load_target, marks_of
    from orbiflow.tiles import escherize

    if choice.objective != "likeness":
        raise OrbiflowError(
            "two pictures are searched for tiles that look alike; choose “Looks alike”"
        )
    one, two = (load_target(job.project, number) for number in (0, 1))
    settings = _search_settings(job.project, choice).replace(workers=cores())
    announce_tiles(job, on_event)
    shown: dict[str, list[int]] = {stage: [] for stage in STAGES}
    origin = {"found_for": marks_of(job.project)}

    def show(tile: EscherTile, stage: str) -> None:
        number = tile_number(job.task, len(shown[stage]))
        shown[stage].append(number)
        put_tile(job.project, number, stage, tile, on_event, origin)

    result = escherize(one, settings, second=two, on_tile=show, on_event=on_event, cancel=cancel)
    found = {"tiles": len(result.tiles)}
    if result.interrupted:
        return Outcome(found, "cancelled")
    gone = sorted(set(tiles_of(job)) - set(shown[STAGES[-1]]))
    for number in gone:
        shutil.rmtree(job.project / "tiles" / str(number), ignore_errors=True)
    return Outcome({**found, "gone": gone}, "done" if result.tiles else "nothing found")


def _search_settings(project: Path, choice: SearchChoice) -> EscherizeSettings:
    from orbiflow.tiles import EscherizeSettings

    settings = EscherizeSettings(effort=choice.effort, objective=choice.objective, seed=choice.seed)
    for end, prefix in zip(OF_PICTURE, PREFIXES, strict=True):
        emphasis, pins = project / f"emphasis{end}.png", project / f"pins{end}.png"
        if emphasis.exists():
            settings = settings.replace(**{f"{prefix}emphasis": emphasis})
        if pins.exists() and choice.objective == "likeness":
            settings = settings.replace(**{f"{prefix}pin": (str(pins),)})
    if choice.like is None:
        return settings.replace(classes=choice.classes) if choice.classes else settings
    return settings.replace(
        classes=_classes_like(project, choice.like),
        effort="normal",
        per_class=MORE_TILES,
        seed=choice.seed + 1,
    )


def _classes_like(project: Path, number: int) -> tuple[str, ...]:
    """Return the class of a tile, and those of the nine with the same group."""
    from orbiflow.tiles import CLASSES, isohedral_class, read_result

    own = read_result(tile_folder(project, number)).isohedral_class
    group = isohedral_class(own).group().name
    near = [name for name in CLASSES if isohedral_class(name).group().name == group]
    return tuple(dict.fromkeys([own, *near]))


def _is_done(job: Job, place: int) -> bool:
    found = best_stage(job.project, tile_number(job.task, place * PER_CLASS))
    return found is not None and found.name == STAGES[-1]


@operation("studio open")
def open_file(job: Job, *, on_event: Sink = ignore, cancel: Cancel = NEVER) -> Outcome:
    """Take up a project's file that was uploaded into an empty project."""
    from orbiflow.studio.project_file import (
        ENDING,
        ancestors,
        outdated_tiles,
        read_pictures,
        read_tiles,
        reading_of,
        unpack,
    )
    from orbiflow.studio.silhouette_file import marks_of

    project = job.project
    with tempfile.TemporaryDirectory(dir=project) as folder:
        home = Path(folder)
        document = unpack(project / f"opened{ENDING}", home)
        pictures: dict[int, dict[str, Any]] = {}
        for number, end in enumerate(OF_PICTURE):
            for file in [*home.glob(f"input{end}.*")][:1]:
                called, reading = reading_of(document, number)
                about = {"name": called, "type": file.suffix.lstrip(".")}
                pictures[number] = {"input": about, "reading": reading.to_json()}
        tiles = read_tiles(home, document)
        for file in {*home.glob("input*.*"), *home.glob("*.png")}:
            file.replace(project / file.name)
        read_pictures(project, document)
    numbers = {number: tile_number(job.task, place) for place, (_, number, _) in enumerate(tiles)}
    parents = {number: parent for _, number, parent in tiles}
    marks = marks_of(project) if pictures else []
    for tile, number, _ in tiles:
        cancel.check()
        known = [numbers[own] for own in ancestors(number, parents)]
        origin: dict[str, Any] = {"parent": known[0], "root": known[-1]} if known else {}
        if marks:
            old = number in outdated_tiles(document)
            origin["found_for"] = ["earlier"] if old else marks[: len(tile.figures)]
        put_tile(project, numbers[number], STAGES[-1], tile, on_event, origin)
    second = pictures.get(1)
    opened = {
        "name": str(document["name"]),
        "view": document["view"],
        **pictures.get(0, {}),
        "second": second and {**second, "silhouette": None},
    }
    return Outcome({"read": sorted(pictures), "opened": opened})


SPACE = "pull.json"
PICTURE_ENDINGS = (".png", ".jpg", ".jpeg", ".webp")  # of pictures on which lines can be drawn
PREFIXES = ("", "second_")  # of settings and arguments of the first figure, and of the second


@operation("studio space")
def space(job: Job, tile: int, *, on_event: Sink = ignore, cancel: Cancel = NEVER) -> Outcome:
    """Write what a browser needs to pull a tile into the tile's folder.

    Args:
        tile: The number of the tile.
    """
    from orbiflow.studio.pulled_tiles import space_json
    from orbiflow.tiles import read_result

    del on_event
    cancel.check()
    own = tile_folder(job.project, tile)
    write_json(own.parent / SPACE, space_json(read_result(own)))
    return Outcome({"tile": tile})


@operation("studio pull")
def pull(
    job: Job,
    tile: int,
    parameters: tuple[float, ...],
    *,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Certify a tile that was pulled by hand, and write it as a tile of its own.

    Args:
        tile: The number of the tile that was pulled.
        parameters: Where it was pulled to, in the space that `studio space` wrote.
    """
    from orbiflow.studio.pulled_tiles import pulled, space_json
    from orbiflow.tiles import read_result

    cancel.check()
    found = pulled(read_result(tile_folder(job.project, tile)), parameters)
    number, stage = tile_number(job.task, 0), STAGES[-1]
    put_tile(job.project, number, stage, found, on_event, origin_of_pulled(job.project, tile))
    if place := best_stage(job.project, number):  # at hand when it is pulled again
        write_json(place / SPACE, space_json(found))
    return Outcome({"tile": number})


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

    try:
        parts = json.loads(drawing or "{}")
    except (ValueError, RecursionError):
        raise OrbiflowError("the drawing is no JSON; reload the page") from None
    drawings = [parts, parts.get("second")] if is_object(parts) else []
    if not any(is_object(own) and (own.get("strokes") or own.get("eyes")) for own in drawings):
        return result, files, settings
    given = read_result(result)
    tile, scratch = with_any_map(given), make_folder(scratch)
    if tile is not given:
        result = save_tiles([tile], scratch / "tile")
    for number, (own, part) in enumerate(zip(drawings, tile.figures, strict=False)):
        end, prefix = OF_PICTURE[number], PREFIXES[number]
        under: Path | None = files.get(f"{prefix}picture")
        if under is not None and under.suffix not in PICTURE_ENDINGS:
            under = under.with_name(f"backdrop{end}.png")
        made = drawing_settings(own, part.figure, scratch, under, f"drawing{end}")
        if made["picture"] is not None:
            files = {**files, f"{prefix}picture": made["picture"]}
        if made["eyes"]:
            settings = {**settings, f"{prefix}eyes": made["eyes"]}
    return result, files, settings


PREVIEW = "preview.png"
SCRATCH = ".drawn"  # a folder for what is written on the way
MAX_DRAWN_BYTES = 30_000_000  # bytes of a solid that is drawn
PREVIEW_SIDE_PIXELS = 1000.0  # pixels of a preview's longer side


def export_folder(home: Path, task: int) -> Path:
    """Return the folder of the files that a task of a project makes to be taken away."""
    return home / "exports" / str(task)


def files_of(folder: Path) -> list[dict[str, Any]]:
    """Return the name and the size in bytes of each file in a folder, by name."""
    files = sorted(file for file in folder.iterdir() if file.is_file())
    return [{"name": file.name, "bytes": file.stat().st_size} for file in files]


@operation("studio take")
def take(
    job: Job,
    makes: str,
    tile: int,
    settings: str = "{}",
    picture: bool = False,
    drawing: str = "",
    called: str = "",
    *,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Write what a user takes away of a tile.

    Args:
        makes: The operation that writes it: export, art, solid or animate.
        tile: The number of the tile.
        settings: Its settings, as JSON.
        picture: Whether the pictures that were uploaded go onto the figures.
        drawing: What was drawn on the tile, as JSON.
        called: The name of the project, with which that of the file begins.
    """
    folder = make_folder(export_folder(job.project, job.task))
    given, result = json.loads(settings), tile_folder(job.project, tile)
    files = _pictures(job.project, result) if picture else {}
    if drawing and makes in WITH_DRAWING:
        result, files, given = with_drawing(drawing, result, files, given, folder / SCRATCH)
    name = file_name(makes, given, result, called)
    call = making_call(makes, given, result, out=folder / name, **files)
    done = call.operation.function(**call.arguments, on_event=as_part(on_event), cancel=cancel)
    written = files_of(folder)
    preview = False
    with suppress(OrbiflowError):  # what was asked for is there
        preview = _preview(call, folder / written[0]["name"], folder, cancel)
    facts = {name: value for name, value in done.summary.items() if name not in ("file", "files")}
    return Outcome(
        {
            "takeaway": job.task,
            "files": written,
            "preview": preview,
            "facts": facts,
            "chosen": json.loads(settings),
            "made": time.time(),
        }
    )


def _pictures(home: Path, result: Path) -> dict[str, Any]:
    """Return the pictures that were uploaded for the figures of a tile, by argument."""
    from orbiflow.studio.silhouette_file import input_file
    from orbiflow.tiles import read_result

    found: dict[str, Any] = {}
    for prefix, end, _ in zip(PREFIXES, OF_PICTURE, read_result(result).figures, strict=False):
        for file in home.glob(f"input{end}.*"):
            if file.suffix in (*PICTURE_ENDINGS, ".svg"):
                found[f"{prefix}picture"] = file
    return found or {"picture": input_file(home)}


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
    small = settings.replace(
        format="png", dpi=min(300.0, 25.4 * PREVIEW_SIDE_PIXELS / max(settings.page))
    )
    call.operation.function(
        **{**call.arguments, "settings": small, "out": folder / PREVIEW}, cancel=cancel
    )
    return (folder / PREVIEW).is_file()
