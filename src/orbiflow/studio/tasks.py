"""What the studio's workers do first: read a picture, and search for tiles."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

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
    operation,
)
from orbiflow.studio.settings import Job, SearchChoice
from orbiflow.studio.tile_files import (
    PLACES,
    STAGES,
    best_stage,
    put_tile,
    tell_tile,
    tile_folder,
    tile_number,
)
from orbiflow.tiles import ReadingSettings

if TYPE_CHECKING:
    from orbiflow.tiles import EscherizeSettings, EscherTile

PER_CLASS = 50  # numbers that a class has for its tiles
MORE = 4  # tiles of a class, for "more like this one"
LONGER = {"fast": "normal", "normal": "best", "best": "best"}


@operation("studio read")
def read(
    job: Job,
    called: str = "picture",
    reading: ReadingSettings = ReadingSettings(),
    *,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Read the silhouette in a project's picture.

    Args:
        called: What messages call the picture.
    """
    from orbiflow.studio.silhouette_file import read_input

    cancel.check()
    on_event(Progress(0.1, "reading the picture"))
    target = read_input(job.project, called, reading)
    return Outcome({"read": True, "vertices": len(target.outline)})


@operation("studio search", keeps_partial=True, starts_processes=True)
def search(
    job: Job,
    settings: SearchChoice = SearchChoice(),
    *,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Search for tiles of a project's silhouette, and write each as soon as it is found."""
    from orbiflow.studio.silhouette_file import load_target
    from orbiflow.tiles import escherize, searched_classes

    target = load_target(job.project)
    whole = _search_settings(job.project, settings)
    names = searched_classes(target, whole)
    left = [name for k, name in enumerate(names) if not _is_done(job, k)]
    _tell_again(job, on_event)
    if not left:
        return Outcome({"tiles": len(names)})
    seen: dict[tuple[str, str], int] = {}

    def show(tile: EscherTile, stage: str) -> None:
        name = tile.isohedral_class
        place = seen[name, stage] = seen.get((name, stage), -1) + 1
        number = tile_number(job.task, names.index(name) * PER_CLASS + place)
        put_tile(job.project, number, stage, tile, on_event)

    result = escherize(
        target,
        whole.replace(classes=tuple(left), workers=cores()),
        on_tile=show,
        on_event=as_part(on_event, 1 - len(left) / len(names)),
        cancel=cancel,
    )
    if rounded := sum(tile.smoothed > 0 for tile in result.tiles):
        on_event(
            Note(
                f"The thinnest parts are rounded off in {rounded} of {len(result.tiles)} tiles: let "
                "them grow (Thin parts, where the picture is read) to keep them"
            )
        )
    if result.interrupted:
        return Outcome({"tiles": len(result.tiles)}, "cancelled")
    return Outcome({"tiles": len(result.tiles)}, "done" if result.tiles else "nothing found")


def _search_settings(project: Path, choice: SearchChoice) -> EscherizeSettings:
    from orbiflow.tiles import EscherizeSettings

    settings = EscherizeSettings(effort=choice.effort, objective=choice.objective, seed=choice.seed)
    emphasis, pins = project / "emphasis.png", project / "pins.png"
    if emphasis.exists():
        settings = settings.replace(emphasis=emphasis)
    if pins.exists() and choice.objective == "likeness":
        settings = settings.replace(pin=(str(pins),))
    if choice.like is None:
        return settings.replace(classes=choice.classes) if choice.classes else settings
    return settings.replace(
        classes=_classes_like(project, choice.like),
        effort=LONGER[choice.effort],
        per_class=MORE,
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


def _tell_again(job: Job, on_event: Sink) -> None:
    """Tell of tiles that this task found before it was interrupted."""
    for number in sorted(
        int(folder.name) for folder in (job.project / "tiles").glob("[0-9]*") if folder.is_dir()
    ):
        if number // PLACES == job.task and (found := best_stage(job.project, number)):
            tell_tile(number, found.name, on_event)


@operation("studio open")
def open_file(job: Job, *, on_event: Sink = ignore, cancel: Cancel = NEVER) -> Outcome:
    """Take up a project's file that was uploaded into an empty project."""
    from orbiflow.studio.project_file import ENDING, read_tiles, reading_of, unpack
    from orbiflow.studio.silhouette_file import read_input

    project = job.project
    with tempfile.TemporaryDirectory(dir=project) as folder:
        home = Path(folder)
        document = unpack(project / f"opened{ENDING}", home)
        (picture,) = [*home.glob("input.*")][:1] or [None]
        called, reading = reading_of(document)
        tiles = read_tiles(home, document)
        for file in {*home.glob("input.*"), *home.glob("*.png")}:
            file.replace(project / file.name)
        if picture is not None:
            read_input(project, called, reading)
    numbers = {number: tile_number(job.task, place) for place, (_, number, _) in enumerate(tiles)}
    for tile, number, parent in tiles:
        cancel.check()
        known = None if parent is None else numbers.get(parent)
        put_tile(project, numbers[number], STAGES[-1], tile, on_event, parent=known)
    opened = {
        "name": str(document["name"]),
        "view": document["view"],
        "reading": reading.to_json(),
        "input": picture and {"name": called, "type": picture.suffix.lstrip(".")},
    }
    return Outcome({"read": picture is not None, "opened": opened})
