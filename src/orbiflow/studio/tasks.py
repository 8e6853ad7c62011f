"""What the studio's workers do for tiles: read a picture, search, and pull."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orbiflow.errors import OrbiflowError
from orbiflow.runtime import (
    NEVER,
    Cancel,
    Note,
    Outcome,
    Progress,
    Sink,
    as_part,
    cores,
    ignore,
    one_blas_thread,
    operation,
    write_json,
)
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
from orbiflow.studio.words import OF_PICTURE, PREFIXES
from orbiflow.tiles import ReadingSettings

if TYPE_CHECKING:
    from orbiflow.tiles import EscherizeSettings, EscherTile

PER_CLASS = 50  # numbers that a class has for its tiles
MORE_TILES = 4  # tiles of a class, for "more like this one"
NEARLY_ALIKE_IOU = 0.55  # from which one of two pairs is enough to see at first


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

    find_tiles = _search_pairs if has_second(job.project) else _search_single
    with one_blas_thread():  # tiles are measured and written here, beside processes that search
        return find_tiles(job, settings, on_event, cancel)


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
    first, second = (load_target(job.project, number) for number in (0, 1))
    settings = _search_settings(job.project, choice).replace(workers=cores())
    announce_tiles(job, on_event)
    shown: dict[str, dict[int, EscherTile]] = {stage: {} for stage in STAGES}
    origin = {"found_for": marks_of(job.project)}

    def show(tile: EscherTile, stage: str) -> None:
        number, better = tile_number(job.task, len(shown[stage])), shown[stage]
        like = next((key for key, other in better.items() if _nearly_alike(tile, other)), None)
        better[number] = tile
        put_tile(job.project, number, stage, tile, on_event, {**origin, "like": like})

    result = escherize(
        first, settings, second=second, on_tile=show, on_event=on_event, cancel=cancel
    )
    summary = {"tiles": len(result.tiles)}
    if result.interrupted:
        return Outcome(summary, "cancelled")
    gone = sorted(set(tiles_of(job)) - set(shown[STAGES[-1]]))
    for number in gone:
        shutil.rmtree(job.project / "tiles" / str(number), ignore_errors=True)
    return Outcome({**summary, "gone": gone}, "done" if result.tiles else "nothing found")


def _nearly_alike(tile: EscherTile, other: EscherTile) -> bool:
    """Return whether two tiles lie alike and cover nearly the same of the silhouettes."""
    import shapely

    if tile.isohedral_class != other.isohedral_class:
        return False
    first, second = (shapely.Polygon(each.normal_tile.polygon) for each in (tile, other))
    return (first & second).area > NEARLY_ALIKE_IOU * (first | second).area


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

    its_class = read_result(tile_folder(project, number)).isohedral_class
    group = isohedral_class(its_class).group().name
    near = [name for name in CLASSES if isohedral_class(name).group().name == group]
    return tuple(dict.fromkeys([its_class, *near]))


def _is_done(job: Job, place: int) -> bool:
    stage = best_stage(job.project, tile_number(job.task, place * PER_CLASS))
    return stage is not None and stage.name == STAGES[-1]


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
        older = [numbers[ancestor] for ancestor in ancestors(number, parents)]
        origin: dict[str, Any] = {"parent": older[0], "root": older[-1]} if older else {}
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
    folder = tile_folder(job.project, tile)
    write_json(folder.parent / SPACE, space_json(read_result(folder)))
    return Outcome({"tile": tile})


@operation("studio pull")
def pull(
    job: Job,
    tile: int,
    parameters: tuple[float, ...],
    inside: tuple[float, ...] = (),
    *,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Certify a tile that was pulled by hand, and write it as a tile of its own.

    Args:
        tile: The number of the tile that was pulled.
        parameters: Where it was pulled to, in the space that `studio space` wrote.
        inside: Where the free points of its body were pulled to, if these were.
    """
    from orbiflow.studio.pulled_tiles import pulled

    def move(original: EscherTile, report: Callable[[float], None]) -> EscherTile:
        return pulled(original, parameters, report, inside)

    return _by_hand(job, tile, move, on_event, cancel)


@operation("studio class")
def lay_in_class(
    job: Job, tile: int, name: str, *, on_event: Sink = ignore, cancel: Cancel = NEVER
) -> Outcome:
    """Write the tile of another class that is most like a tile, as one of its own.

    Args:
        tile: The number of the tile that it is to be like.
        name: The isohedral class.
    """
    from orbiflow.studio.other_classes import in_class

    def move(original: EscherTile, report: Callable[[float], None]) -> EscherTile:
        with one_blas_thread():
            return in_class(original, name, report)

    return _by_hand(job, tile, move, on_event, cancel)


def _by_hand(
    job: Job,
    tile: int,
    move: Callable[[EscherTile, Callable[[float], None]], EscherTile],
    on_event: Sink,
    cancel: Cancel,
) -> Outcome:
    """Write what a function makes of a tile, which is told how to tell the share of its work."""
    from orbiflow.studio.pulled_tiles import space_json
    from orbiflow.tiles import read_result

    def report(share: float) -> None:
        cancel.check()
        on_event(Progress(share, "checking"))

    report(0.0)
    changed = move(read_result(tile_folder(job.project, tile)), report)
    number, stage = tile_number(job.task, 0), STAGES[-1]
    put_tile(job.project, number, stage, changed, on_event, origin_of_pulled(job.project, tile))
    if place := best_stage(job.project, number):  # at hand when it is pulled again
        write_json(place / SPACE, space_json(changed))
    return Outcome({"tile": number})
