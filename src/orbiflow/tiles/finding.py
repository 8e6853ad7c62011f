"""The operations that find tiles and list their classes."""

from __future__ import annotations

import functools
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from orbiflow.runtime import (
    NEVER,
    Cancel,
    Note,
    Outcome,
    Sink,
    Table,
    Written,
    check_output_folder,
    ignore,
    operation,
    write_atomic,
)
from orbiflow.settings import DefaultText, Ending, Hidden, Option, Parsed, Positional
from orbiflow.tiles.search import EscherizeSettings, class_names
from orbiflow.tiles.silhouette import ReadingSettings

if TYPE_CHECKING:
    from orbiflow.tiles.search import SearchResult
    from orbiflow.tiles.tile import EscherTile


@operation("escherize", keeps_partial=True, starts_processes=True)
def escherize(
    image: Path,
    out: Annotated[Path, Option("-o")] = Path("out"),
    settings: EscherizeSettings = EscherizeSettings(),
    reading: ReadingSettings = ReadingSettings(),
    *,
    second: Annotated[Path | None, Positional()] = None,
    figures: bool = False,
    verbose: bool = False,
    called: Annotated[str | None, Hidden()] = None,
    second_called: Annotated[str | None, Hidden()] = None,
    shown_out: Annotated[str | None, Hidden()] = None,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Find tiles that look like a silhouette and tile the plane, and prove it.

    With a second silhouette, find two figures that tile the plane together, one like each.

    Writes read.png, a picture of what was read, into the folder at once. Then come result.json,
    overview.png and index.html, and for each class a folder with tile.svg, tiling.svg, tiling.png,
    overlay.png and model.safetensors.

    Args:
        image: The silhouette: PNG, JPEG, WebP, SVG, or a polygon (.json, .geojson, .dat, .csv, .wkt).
        second: A second silhouette.
        out: Folder for the results, made if need be.
        figures: Also write for print tiling.pdf and overlay.pdf, and of the flow field.png and
            field.pdf.
        verbose: Also show the scores and other figures of result.json.
        called: What the results call the silhouette. Default: its path.
        second_called: What they call the second one. Default: its path.
        shown_out: What the page's commands call the folder. Default: its path.
    """
    from orbiflow.tiles import run_folder, search

    begin = time.perf_counter()
    target = reading.read(image, called)
    other = None if second is None else reading.read(second, second_called)
    if other is None:
        settings.check_single()
    run_folder.result_folder(out)
    check_output_folder(out, image, second, *settings.files)
    silhouettes = [(target, image)]
    if other is not None and second is not None:
        silhouettes.append((other, second))
    pictures = functools.cache(lambda: [run_folder.read_png(*source) for source in silhouettes])

    def show() -> None:
        for number, (source, picture) in enumerate(zip(silhouettes, pictures(), strict=True)):
            run_folder.show_reading(source[0], picture, out, on_event, number=number)

    settings = settings.replace(workers=settings.workers or os.cpu_count() or 1)
    result = search.escherize(
        target, settings, second=other, on_checked=show, on_event=on_event, cancel=cancel
    )
    for text in _remarks(result):
        on_event(Note(text))
    written = run_folder.write_run(
        result, out, pictures(), figures=figures, shown_out=shown_out, on_event=on_event
    )
    tiles = result.tiles if written else ()
    summary = {
        "folder": str(out),
        "written": bool(written),
        "seconds": time.perf_counter() - begin,
        "tiles": [_measures(tile) for tile in tiles],
        "failed": [{"class": f.name, "reason": f.reason} for f in result.failures],
    }
    for table in _tables(tiles)[: 1 + verbose]:
        on_event(table)
    for note in _closing(out, bool(written), result, summary["seconds"]):
        on_event(note)
    if result.interrupted or cancel.cancelled:
        return Outcome(summary, "cancelled")
    return Outcome(summary, "done" if result.tiles else "nothing found")


def _tables(tiles: Sequence[EscherTile]) -> list[Table]:
    """Return a table of the tiles, in words and in figures; empty if there are none."""
    if not tiles:
        return []
    rows = [_figures(tile, figure) for tile in tiles for figure in tile.likenesses]
    figures = _table("Figures", rows)
    return [_table("Tiles, best first", [_words(tile) for tile in tiles]), figures]


def _table(title: str, rows: Sequence[dict[str, str]]) -> Table:
    """A table of rows by the names of their columns."""
    return Table(title, tuple(rows[0]), tuple(tuple(row.values()) for row in rows))


def _words(tile: EscherTile) -> dict[str, str]:
    """Return a line about a tile, in 80 characters."""
    lies, ratings = tile.arrangement, [figure.rating for figure in tile.likenesses]
    words = dict.fromkeys(rating.word for rating in ratings if rating)
    return {
        "class": f"{tile.name} ({tile.group_name})",
        "stars": ", ".join(str(rating) for rating in ratings if rating),
        "likeness": ", ".join(words),
        "how its copies lie": lies or "NOT CERTIFIED: they do not tile",
    }


def _figures(tile: EscherTile, figure: EscherTile) -> dict[str, str]:
    """The same in figures, of one of its parts."""
    mismatch, bent = tile.certificate.edge_mismatch, figure.likeness.deformation
    return {
        "class": f"{tile.name} ({tile.group_name})",
        **({"figure": figure.name} if len(tile.figures) > 1 else {}),
        "score": f"{figure.score:.3f}",
        "bent": "-" if bent is None else f"{bent:.3f}",
        "IoU": f"{figure.likeness.metrics.iou:.4f}",
        "recognised": f"{figure.likeness.recognisability.score:.3f}",
        "certified": "yes" if tile.certificate.valid else "NO",
        "edges": f"{mismatch:.0e}" if mismatch < float("inf") else "-",
        "s": f"{tile.search.seconds:.1f}",
    }


def _closing(out: Path, written: bool, result: SearchResult, seconds: float) -> list[Note]:
    """What was written, or why nothing was; and the silhouette's doubts again, if they explain it."""
    from orbiflow.tiles.search import rounded_for, why_poor
    from orbiflow.tiles.silhouette import doubts, is_mere_line, left_out_share

    explains = not result.tiles or any(map(is_mere_line, result.targets))
    # beside the stars, which are of what was read
    doubtful = result.targets if explains else filter(left_out_share, result.targets)
    again = [Note(text, warning=True) for target in doubtful for text in doubts(target)]
    if poor := why_poor(result.tiles[0]) if result.tiles else "":
        again = [Note(poor), *again]
    if rounded := rounded_for(result.tiles):
        again = [Note(rounded), *again]
    if written and result.tiles:
        where = f"look at {out / 'overview.png'} first, or open {out / 'index.html'}"
        return [Note(f"written to {out} in {seconds:.0f} s; {where}"), *again]
    where = f"{out} still holds the tiles of an earlier run"
    if written:
        where = f"see {out / 'result.json'}"
    return [Note(f"no certified tile was found; {where}", warning=True), *again]


def _remarks(result: SearchResult) -> list[str]:
    """What the user should know of a search's tiles."""
    names = sorted(result.interrupted & {tile.isohedral_class for tile in result.tiles})
    return [f"{name} has its first tile only: its search was interrupted" for name in names]


def _measures(tile: EscherTile) -> dict[str, Any]:
    mismatch, likeness = tile.certificate.edge_mismatch, tile.worst.likeness
    return {
        "class": tile.isohedral_class,
        "group": tile.group_name,
        "objective": tile.search.objective,
        "deformation": likeness.deformation,
        "arrangement": tile.arrangement,
        "stars": tile.rating and tile.rating.stars,
        "word": tile.rating and tile.rating.word,
        "score": tile.score,
        "iou": likeness.metrics.iou,
        "dice": likeness.metrics.dice,
        "recognised": likeness.recognisability.score,
        "certified": tile.certificate.valid,
        "edge_mismatch": mismatch if mismatch < float("inf") else None,
        "seconds": tile.search.seconds,
    }


@operation("classes")
def classes(
    *,
    classes: Annotated[
        tuple[str, ...] | None,
        Parsed(class_names, "classes such as IH12,IH26, or all", "CLASSES"),
        DefaultText("the nine"),
    ] = None,
    out: Annotated[Path | None, Option("-o"), Ending(".png", "")] = None,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """List isohedral classes: their groups, the symmetry of their tiles, and how edges are identified.

    The nine that are listed by default give every shape that tiles the plane isohedrally. In others of
    the 81 types a tile has a symmetry of its own: D1 is a mirror, C2 a half-turn. Edges are numbered in
    order around the tile; "0=3" is moved by a translation, "0~5" by a glide reflection, "0>4" by a
    rotation, "0|3" by a mirror; "2o" turns about its own midpoint, and "2|" lies on a mirror.

    Args:
        classes: The classes, or all 81 types.
        out: Also draw them into this PNG file.
    """
    from orbiflow.tiles.pictures import classes_png
    from orbiflow.tiles.tilings import CLASSES, ISOHEDRAL_TYPES, isohedral_class

    cancel.check()
    every = [name.strip().lower() for name in classes or ()] == ["all"]
    names = ISOHEDRAL_TYPES if every else classes or CLASSES
    kinds = tuple(isohedral_class(name) for name in names)
    facts = [kind.facts() for kind in kinds]
    title = "Isohedral classes" if classes else "The nine isohedral classes"
    shown = ("class", "group", "tile", "symbol", "identified", "rotations", "stretch")
    on_event(_table(title, [{name: row[name] for name in shown} for row in facts]))
    if out is not None:
        write_atomic(out, classes_png(kinds))
        on_event(Written(out))
        on_event(Note(f"drawn in {out}"))
    return Outcome({"classes": facts, "file": None if out is None else str(out)})
