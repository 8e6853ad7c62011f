"""The folder of a search: a folder for each tile, overviews, and `result.json`."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path, PurePath

from orbiflow.drawing import Sheet
from orbiflow.runtime import (
    Note,
    ResultFolder,
    SideBySide,
    Sink,
    Written,
    ignore,
    make_folder,
    work,
    write_atomic,
    write_json,
)
from orbiflow.settings import as_instance, as_path
from orbiflow.tiles.pictures import ScenePicture, comparison, tile_picture, tiling_picture
from orbiflow.tiles.result_file import RESULT, folder_names, part_file
from orbiflow.tiles.run_folder.files import (
    FIELD_FILES,
    FIGURE_FILES,
    INDEX,
    OVERVIEW,
    READ,
    READ_NEXT,
    READ_NEXT_FILES,
    TILE_FILES,
    files_of,
    written_files,
)
from orbiflow.tiles.run_folder.html_page import index_page
from orbiflow.tiles.run_folder.overview import overview_png
from orbiflow.tiles.search import SearchResult, report
from orbiflow.tiles.silhouette import Target, doubts
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tile_map import TileMap
from orbiflow.tiles.tilings import Colouring, colouring


def figure_files(result: EscherTile) -> tuple[str, ...]:
    """Return the `FIGURE_FILES` of a tile: there is no flow where the silhouette bent into the tile."""
    flows = result.map is not None and result.map.has_flow
    return tuple(file for file in FIGURE_FILES if flows or file not in FIELD_FILES)


def write_tile_folder(
    result: EscherTile,
    targets: Sequence[Target],
    folder: Path,
    *,
    colours: Colouring | None = None,
    figures: bool = False,
) -> list[Path]:
    """Write the `TILE_FILES` of a tile into its folder, and the `FIGURE_FILES`, which take much longer.

    There is a target for each of its figures.

    Raises `OutputError` if a file cannot be written.
    """
    make_folder(folder)
    prototiles, y_down = result.tiling, result.y_down
    colours = colours or colouring(prototiles)
    label = f"{result.isohedral_class} ({result.group_name})"
    title = f"{' and '.join(PurePath(target.source).name for target in targets)}, {label}"
    if not result.certificate.valid:
        title += ", NOT CERTIFIED"

    def field(sheet: Sheet) -> bytes:
        normal = result.normal_tile
        # flows need torch, which the search for likeness does without
        from orbiflow.drawing import field_picture
        from orbiflow.tiles.flowing import as_model, placed_field

        return field_picture(
            placed_field(as_model(result)), normal.group, normal, sheet=sheet
        ).file()

    printed = Sheet.column()

    def tiling(sheet: Sheet | None = None) -> ScenePicture:
        return tiling_picture(prototiles, y_down=y_down, title=title, colours=colours, sheet=sheet)

    contents: dict[str, Callable[[], str | bytes]] = {
        "tile.svg": lambda: tile_picture(prototiles, y_down=y_down, title=title).svg(),
        "tiling.svg": lambda: tiling(Sheet.column(300.0)).svg(),
        "tiling.png": lambda: tiling(Sheet.screen(1200)).png(),
        "tiling.pdf": lambda: tiling(printed).file(),
        "field.png": lambda: field(Sheet.screen(1200)),
        "field.pdf": lambda: field(Sheet.column()),
    }
    for number, (figure, target) in enumerate(zip(result.likenesses, targets, strict=True)):
        label = figure.name if len(result.figures) > 1 else label
        more: dict[str, Callable[[], str | bytes]] = {
            "overlay.png": partial(_overlay, figure, target, label),
            "overlay.pdf": partial(_overlay, figure, target, label, printed),
            "model.safetensors": (figure.map or TileMap()).to_bytes,
        }
        contents |= {part_file(name, number): content for name, content in more.items()}
    names = files_of((*TILE_FILES, *(figure_files(result) if figures else ())), len(targets))
    return [write_atomic(folder / name, contents[name]()) for name in names]


def _overlay(figure: EscherTile, target: Target, label: str, printed: Sheet | None = None) -> bytes:
    if printed is None:
        return comparison(figure, target, label=label).png()
    return comparison(figure, target, sheet=printed).file()


def write_gallery(
    result: SearchResult, out: Path, *, figures: bool = False, shown_out: str = "."
) -> None:
    """Write each tile's folder, `overview.png` and `index.html`.

    As many processes as searched draw `figures`; without these, starting one would take longer than
    drawing, and threads do. There is at least one tile. `shown_out` is what the page's commands call
    the folder.

    Raises:
        OutputError: If a file cannot be written.
    """
    tiles, targets, failures = result.tiles, result.targets, result.failures
    names = folder_names([tile.isohedral_class for tile in tiles])
    colours = [colouring(tile.tiling) for tile in tiles]
    draw = functools.partial(_draw, targets, figures)
    items = list(zip(tiles, colours, (out / name for name in names), strict=True))
    if result.workers == 1 or len(tiles) == 1:
        for item in items:
            draw(item)
    elif not figures:
        with SideBySide() as beside:
            for drawn in [beside.begin(functools.partial(draw, item)) for item in items]:
                drawn()
    else:
        with contextlib.closing(work(draw, items, result.workers)) as news:
            for _ in news:
                pass
    write_atomic(out / OVERVIEW, overview_png(tiles, targets, colours, failures=failures))
    extra = [figure_files(tile) if figures else () for tile in tiles]
    read, more = (out / READ).is_file(), {"failures": failures, "figures": extra}
    page = index_page(tiles, targets, names, out=shown_out, read=read, colours=colours, **more)
    write_atomic(out / INDEX, page)


def _draw(
    targets: Sequence[Target], figures: bool, item: tuple[EscherTile, Colouring, Path], *_: object
) -> None:
    """Write the folder of one tile; this may run in a worker process."""
    tile, colours, folder = item
    write_tile_folder(tile, targets, folder, colours=colours, figures=figures)


def result_folder(out: str | Path) -> ResultFolder:
    """Return the folder that a run is written to, which holds nothing else."""
    return ResultFolder(as_path(out, "the folder to write into"), written_files)


def show_reading(
    target: Target, picture: bytes, out: Path, on_event: Sink = ignore, *, number: int = 0
) -> None:
    """Write `read.png` into the folder at once and tell what was read and what may be wrong with it.

    That of the second silhouette, whose `number` is 1, is `read-2.png`. Beside an earlier run it is
    `read-next.png`, until this run replaces that one.

    Raises:
        OutputError: If the folder holds what orbiflow did not write, or cannot be written.
    """
    folder = result_folder(out)
    is_beside_a_run = (folder.path / RESULT).is_file()
    name = part_file(READ, number)
    path = make_folder(folder.path) / (part_file(READ_NEXT, number) if is_beside_a_run else name)
    write_atomic(path, picture)
    for note in target.notes:
        on_event(Note(note))
    soon = f", and in {out / name} once this run replaces the earlier one" * is_beside_a_run
    on_event(Note(f"what was read is drawn in {path}{soon}"))
    for doubt in doubts(target):
        on_event(Note(doubt, warning=True))


def write_run(
    result: SearchResult,
    out: str | Path,
    pictures: Sequence[bytes] = (),
    *,
    figures: bool = False,
    shown_out: str | None = None,
    on_event: Sink = ignore,
) -> list[Path]:
    """Write what a search found as a result folder: a folder a class, overviews, `result.json`.

    An earlier run there is replaced whole, unless the search was interrupted before any class had
    its tile: a first look is less than an earlier run's tiles.

    Args:
        result: What the search found.
        out: The folder, which every command on a RESULT takes.
        pictures: What was read of each silhouette, as `read_png` draws it.
        figures: Write the figures for print, too, in as many processes as the search had.
        shown_out: What the page's commands call the folder. Default: its path.
        on_event: Called with each `Note` and `Written`.

    Returns:
        The files; none if an earlier run was left as it is.

    Raises:
        OutputError: If the folder holds what orbiflow did not write, or cannot be written.
    """
    as_instance(result, SearchResult, "the result", "escherize(target) gives one")
    folder, tiles = result_folder(out), result.tiles
    earlier = folder.has_a_run and (folder.path / OVERVIEW).is_file()
    if earlier and all(tile.isohedral_class in result.interrupted for tile in tiles):
        for name in READ_NEXT_FILES:
            (folder.path / name).unlink(missing_ok=True)
        return []
    if tiles and figures and not any(FIELD_FILES[0] in figure_files(tile) for tile in tiles):
        on_event(Note("no flow made these tiles, so there is none to draw"))
    with folder.replaced() as staged:
        for number, picture in enumerate(pictures):
            write_atomic(staged / part_file(READ, number), picture)
        if tiles:
            write_gallery(result, staged, figures=figures, shown_out=shown_out or str(out))
        write_json(staged / RESULT, report(result))
        files = [path.relative_to(staged) for path in staged.rglob("*") if path.is_file()]
    if earlier:
        on_event(Note(f"the earlier run in {out} was replaced"))
    written = [folder.path / path for path in sorted(files)]
    for path in written:
        on_event(Written(path))
    return written
