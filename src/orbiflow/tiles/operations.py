"""The operations on tiles: find them, export, draw and animate one, list the classes."""

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
    check_output_file,
    check_output_folder,
    ignore,
    operation,
)
from orbiflow.settings import DefaultText, Ending, Hidden, Option, Parsed, Settings
from orbiflow.tiles.art import ArtSettings
from orbiflow.tiles.exporting import ExportSettings
from orbiflow.tiles.motion import AnimationSettings
from orbiflow.tiles.search import EscherizeSettings, class_names
from orbiflow.tiles.silhouette import ReadingSettings
from orbiflow.tiles.solids import SolidSettings

if TYPE_CHECKING:
    from orbiflow.tiles.exporting import Exported
    from orbiflow.tiles.search import SearchResult
    from orbiflow.tiles.tile import EscherTile


class TileChoice(Settings):
    """Which tile of a result is taken."""

    tile: Annotated[str | None, DefaultText("1, or the tile whose folder is given")] = None
    """A class, such as IH4, or a rank; 1 is best."""

    force: bool = False
    """Take a tile that is not certified; an exported file says so."""

    def read(self, result: Path) -> EscherTile:
        """Return the tile of a run."""
        from orbiflow.tiles.result_file import read_result

        return read_result(result, self.tile)


@operation("escherize", keeps_partial=True, starts_processes=True)
def escherize(
    image: Path,
    out: Annotated[Path, Option("-o")] = Path("out"),
    settings: EscherizeSettings = EscherizeSettings(),
    reading: ReadingSettings = ReadingSettings(),
    *,
    figures: bool = False,
    verbose: bool = False,
    called: Annotated[str | None, Hidden()] = None,
    shown_out: Annotated[str | None, Hidden()] = None,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Find tiles that look like a silhouette and tile the plane, and prove it.

    Writes read.png, a picture of what was read, into the folder at once. Then come result.json,
    overview.png and index.html, and for each class a folder with tile.svg, tiling.svg, tiling.png,
    overlay.png and model.safetensors.

    Args:
        image: The silhouette: PNG, JPEG, WebP, SVG, or a polygon (.json, .geojson, .dat, .csv, .wkt).
        out: Folder for the results, made if need be.
        figures: Also write for print tiling.pdf and overlay.pdf, and of the flow field.png and
            field.pdf.
        verbose: Also show the scores and other figures of result.json.
        called: What the results call the silhouette. Default: its path.
        shown_out: What the page's commands call the folder. Default: its path.
    """
    from orbiflow.tiles import pages, search

    begin = time.perf_counter()
    target = reading.read(image, called)
    pages.result_folder(out)
    check_output_folder(out, image, settings.emphasis, *map(Path, settings.pin or ()))
    picture = pages.read_png(target, image)
    show = functools.partial(pages.show_reading, target, picture, out, on_event)
    settings = settings.replace(workers=settings.workers or os.cpu_count() or 1)
    result = search.escherize(target, settings, on_checked=show, on_event=on_event, cancel=cancel)
    for text in _remarks(result):
        on_event(Note(text))
    written = pages.write_run(
        result, out, picture, figures=figures, shown_out=shown_out, on_event=on_event
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
    figures = _table("Figures", [_figures(tile) for tile in tiles])
    return [_table("Tiles, best first", [_words(tile) for tile in tiles]), figures]


def _table(title: str, rows: Sequence[dict[str, str]]) -> Table:
    """A table of rows by the names of their columns."""
    return Table(title, tuple(rows[0]), tuple(tuple(row.values()) for row in rows))


def _words(tile: EscherTile) -> dict[str, str]:
    """Return a line about a tile, in 80 characters."""
    rating, lies = tile.rating, tile.arrangement
    return {
        "class": f"{tile.name} ({tile.group_name})",
        "stars": str(rating or ""),
        "likeness": rating.word if rating else "",
        "how its copies lie": lies or "NOT CERTIFIED: they do not tile",
    }


def _figures(tile: EscherTile) -> dict[str, str]:
    """The same in figures."""
    mismatch, bent = tile.certificate.edge_mismatch, tile.deformation
    return {
        "class": f"{tile.name} ({tile.group_name})",
        "score": f"{tile.score:.3f}",
        "bent": "-" if bent is None else f"{bent:.3f}",
        "IoU": f"{tile.metrics.iou:.4f}",
        "recognised": f"{tile.recognisability.score:.3f}",
        "certified": "yes" if tile.certificate.valid else "NO",
        "edges": f"{mismatch:.0e}" if mismatch < float("inf") else "-",
        "s": f"{tile.seconds:.1f}",
    }


def _closing(out: Path, written: bool, result: SearchResult, seconds: float) -> list[Note]:
    """What was written, or why nothing was; and the silhouette's doubts again, if they explain it."""
    from orbiflow.tiles.search import rounded_for, why_poor
    from orbiflow.tiles.silhouette import doubts, is_mere_line

    explains = not result.tiles or is_mere_line(result.target)
    again = [Note(text, warning=True) for text in doubts(result.target)] if explains else []
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
    mismatch = tile.certificate.edge_mismatch
    return {
        "class": tile.isohedral_class,
        "group": tile.group_name,
        "objective": tile.objective,
        "deformation": tile.deformation,
        "arrangement": tile.arrangement,
        "stars": tile.rating and tile.rating.stars,
        "word": tile.rating and tile.rating.word,
        "score": tile.score,
        "iou": tile.metrics.iou,
        "dice": tile.metrics.dice,
        "recognised": tile.recognisability.score,
        "certified": tile.certificate.valid,
        "edge_mismatch": mismatch if mismatch < float("inf") else None,
        "seconds": tile.seconds,
    }


def _tell(on_event: Sink, notes: Sequence[str], *files: Path) -> None:
    for event in (*map(Note, notes), *map(Written, files)):
        on_event(event)


@operation("export")
def export(
    result: Path,
    settings: ExportSettings = ExportSettings(),
    choice: TileChoice = TileChoice(),
    *,
    out: Annotated[Path | None, Option("-o"), DefaultText("named after the tile")] = None,
    picture: Path | None = None,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Write a tiling in real size: to print, to cut with a laser, to draw, to put on a page.

    Lengths are numbers with a unit: mm, cm, in or pt.

    Args:
        result: A search's folder, its result.json, or the folder of a tile in it.
        out: The file.
        picture: A picture over the silhouette, in the same frame: PNG, JPEG, WebP or an SVG drawing.
    """
    settings = settings.for_file(out)

    from orbiflow.tiles import exporting

    tile = choice.read(result)
    out = out or Path(f"{tile.name}.{settings.format}")
    check_output_file(out, result, picture)
    done = exporting.export(
        tile, out, settings, picture=picture, force=choice.force, on_event=on_event, cancel=cancel
    )
    _tell(on_event, (*done.notes, _exported(done, settings, tile.isohedral_class)), *done.files)
    return Outcome(
        {
            "files": [str(path) for path in done.files],
            "tiles": done.tiles,
            "class": tile.isohedral_class,
            "tile_size": done.tile_size,
        }
    )


def _exported(done: Exported, settings: ExportSettings, name: str) -> str:
    width, height = settings.page
    words = {
        "skeleton": "tiles in outline",
        "pieces": "pieces",
        "jigsaw": "pieces of a jigsaw",
        "template": "template",
    }
    what = words.get(settings.cut, "tiles")
    count = done.scenes[0].facts.get("pieces", done.tiles)
    files = str(done.files[0])
    if len(done.files) > 1:
        files = f"{len(done.files)} sheets, {done.files[0]} to {done.files[-1].name}"
    return (
        f"written {files}: {count} {what} of {name}, {done.tile_size:.4g} mm, on "
        f"{width:g} x {height:g} mm"
    )


@operation("art")
def art(
    result: Path,
    settings: ArtSettings = ArtSettings(),
    choice: TileChoice = TileChoice(),
    *,
    out: Annotated[
        Path | None, Option("-o"), Ending(".png", ".svg"), DefaultText("a PNG named after the tile")
    ] = None,
    picture: Path | None = None,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Carry a picture of the silhouette onto its tile and repeat it over the plane.

    Without a picture tiles are coloured by a palette, and --engrave draws inside them.

    Args:
        result: A search's folder, its result.json, or the folder of a tile in it.
        out: The file, .png or .svg.
        picture: A picture over the silhouette, in the same frame: PNG, JPEG, WebP or an SVG drawing.
    """
    settings = settings.for_file(out)

    from orbiflow.tiles.art import draw_art

    tile = choice.read(result)
    out = out or Path(f"{tile.name}.{settings.format}")
    check_output_file(out, result, picture)
    drawn = draw_art(
        tile, out, settings, picture=picture, force=choice.force, on_event=on_event, cancel=cancel
    )
    page = drawn.page
    note = (
        f"written {out}: {page.width} x {page.height} pixels, {page.shown:.0f} tiles of "
        f"{tile.isohedral_class}, {page.tile_size:.0f} pixels each"
    )
    _tell(on_event, (*drawn.notes, note), out)
    return Outcome(
        {
            "file": str(out),
            "width": page.width,
            "height": page.height,
            "tiles": page.shown,
            "class": tile.isohedral_class,
            "tile_size": page.tile_size,
        }
    )


@operation("solid")
def solid(
    result: Path,
    settings: SolidSettings = SolidSettings(),
    choice: TileChoice = TileChoice(),
    *,
    out: Annotated[Path | None, Option("-o"), DefaultText("named after the tile")] = None,
    picture: Path | None = None,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Make a solid to print in 3D: a tile, cookie cutter, stamp, mould or puzzle.

    It lies as it is printed, without supports. Lengths are numbers with a unit: mm, cm, in or pt.

    Args:
        result: A search's folder, its result.json, or the folder of a tile in it.
        out: The file, .stl or .3mf.
        picture: An SVG drawing over the silhouette, in the same frame, for a stamp or mould.
    """
    settings = settings.for_file(out)
    settings.check_picture(picture)

    from orbiflow.tiles.solids import make_solid

    tile = choice.read(result)
    out = out or Path(f"{tile.name}-{settings.kind}.{settings.format}")
    check_output_file(out, result, picture)
    made = make_solid(tile, settings, picture=picture, force=choice.force)
    cancel.check()
    made.write(out, settings.format)
    size = " x ".join(f"{side:.1f}" for side in made.size)
    cubic = made.volume / 1000
    note = f"written {out}: {settings.kind} of {tile.isohedral_class}, {size} mm, {cubic:.1f} cm³"
    _tell(on_event, (*made.notes, note), out)
    return Outcome(
        {
            "file": str(out),
            "kind": settings.kind,
            "class": tile.isohedral_class,
            "parts": len(made.parts),
            "size": made.size.tolist(),
            "volume": made.volume,
        }
    )


@operation("animate")
def animate(
    result: Path,
    settings: AnimationSettings = AnimationSettings(),
    choice: TileChoice = TileChoice(),
    *,
    out: Annotated[
        Path | None,
        Option("-o"),
        Ending(".gif", ".mp4", ".svg"),
        DefaultText("a GIF named after the tile"),
    ] = None,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Write an animation: a tiling becoming animals, a silhouette bending, a tiling that grows.

    It loops, there and back. In a morph every picture is an exact tiling.

    Args:
        result: A search's folder, its result.json, or the folder of a tile in it.
        out: The file: .gif, .svg, or .mp4, which needs ffmpeg.
    """
    settings = settings.for_file(out)

    from orbiflow.tiles import motion

    tile = choice.read(result)
    out = out or Path(f"{tile.name}-{settings.kind}.{settings.format}")
    check_output_file(out, result)
    motion.animate(tile, out, settings, force=choice.force, on_event=on_event, cancel=cancel)
    size = out.stat().st_size
    note = (
        f"written {out}: {settings.kind} of {tile.isohedral_class}, {settings.seconds:g} s, "
        f"{settings.size} pixels wide, {size / 1000:.0f} kB"
    )
    _tell(on_event, (note,), out)
    return Outcome(
        {"file": str(out), "bytes": size, "class": tile.isohedral_class, "kind": settings.kind}
    )


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
    from orbiflow.runtime import write_atomic
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
