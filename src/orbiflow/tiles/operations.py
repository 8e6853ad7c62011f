"""The operations that make something of a tile: export, draw, animate it, make a solid of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from orbiflow.errors import Advice, SettingError, literal
from orbiflow.runtime import (
    NEVER,
    Cancel,
    Note,
    Outcome,
    Progress,
    Sink,
    Written,
    check_output_file,
    ignore,
    operation,
    write_atomic,
)
from orbiflow.settings import DefaultText, Ending, InMemory, Option
from orbiflow.tiles.make import CURVED, ArtSettings, ExportSettings
from orbiflow.tiles.motion import AnimationSettings
from orbiflow.tiles.solids import BALLS, SolidSettings

if TYPE_CHECKING:
    from orbiflow.tiles.make import Made
    from orbiflow.tiles.solids import Solid
    from orbiflow.tiles.tile import EscherTile, TileSource
else:  # what annotations mean when they are read, without heavy imports
    Made = Solid = Outcome
    TileSource = Annotated[
        Any, InMemory("the folder of a run, its result.json, or a tile's folder")
    ]

Which = Annotated[str | None, DefaultText("1, or the tile whose folder is given")]
"""Which tile of a run is taken: a class, such as IH4, or a rank; 1 is best."""


def _tell(on_event: Sink, notes: Sequence[str], *files: Path) -> None:
    for event in (*map(Note, notes), *map(Written, files)):
        on_event(event)


def _taken(
    result: TileSource,
    tile: str | None,
    out: Path | None,
    name: str,
    *pictures: Path | None,
    best: Callable[[list[EscherTile]], EscherTile | None] | None = None,
) -> tuple[EscherTile, Path]:
    """Return the tile that is meant, and the file to write, which is by default named after it.

    Of a run it is the `best` of its tiles for what is made of it, if one is given, else the first.
    """
    from orbiflow.tiles.result_file import as_tile, read_tiles

    taken = None
    if best is not None and tile is None and isinstance(result, str | Path):
        taken = best(read_tiles(result))
    taken = taken or as_tile(result, tile)
    out = out or Path(name.format(taken.name))
    read = (result,) if isinstance(result, str | Path) else ()
    check_output_file(out, *map(Path, read), *pictures)
    return taken, out


@operation("export")
def export(
    result: TileSource,
    out: Annotated[Path | None, Option("-o"), DefaultText("named after the tile")] = None,
    settings: ExportSettings = ExportSettings(),
    *,
    tile: Which = None,
    profile: str | None = None,
    force: bool = False,
    picture: Path | None = None,
    second_picture: Path | None = None,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Made:
    """Write a tiling in real size: to print, to cut with a laser, to draw, to put on a page.

    Lengths are numbers with a unit: mm, cm, in or pt.

    Args:
        result: A search's folder, its result.json, or the folder of a tile in it.
        out: The file; several sheets are numbered. Its ending decides the format unless one is given.
        tile: A class, such as IH4, or a rank; 1 is best.
        profile: A machine and its material that were kept by name: their settings, unless others are
            given.
        force: Take a tile that is not certified; a file to make things from says so.
        picture: A picture over the silhouette, in the same frame: PNG, JPEG, WebP or an SVG drawing.
        second_picture: One over the second silhouette, of a tile of two figures.

    Raises:
        CertificationError: If the tile is not certified.
        OrbiflowError: If the settings cannot be met, or nothing says the format.
        OutputError: If a file cannot be written.
        Cancelled: If it was cancelled; nothing is then written.
    """
    from orbiflow.tiles import make

    if profile is not None:
        settings, left = make.Profiles().applied(profile, settings)
        if left:
            said = ", ".join(f"{{{name}}}" for name in left) + literal(
                f" of the profile {profile!r}"
            )
            on_event(Note(Advice(f"{said} does nothing for what is cut here, and was left out")))
    settings = settings.for_file(out)
    pictures = picture, second_picture
    taken, out = _taken(result, tile, out, f"{{}}.{settings.format}", *pictures)
    on_event(Progress(0.0, "laying out"))
    made = make.exported(taken, settings, pictures, force=force)
    return _finished(made, out, on_event, cancel)


def _finished(made: Made, out: Path, on_event: Sink, cancel: Cancel) -> Made:
    """Write what was made; return what came of it."""
    cancel.check()
    on_event(Progress(0.2, "writing"))
    done = made.written(out, cancel)
    _tell(on_event, (*done.notes, done.words), *done.files)
    return done


@operation("art")
def art(
    result: TileSource,
    out: Annotated[
        Path | None,
        Option("-o"),
        Ending(".html", ".pdf", ".png", ".svg"),
        DefaultText("a PNG named after the tile"),
    ] = None,
    settings: ArtSettings = ArtSettings(),
    *,
    tile: Which = None,
    force: bool = False,
    picture: Path | None = None,
    second_picture: Path | None = None,
    begin: Path | None = None,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Made:
    """Carry a picture of the silhouette onto its tile and repeat it over the plane.

    Without a picture tiles are coloured by a palette, and lines can be engraved in them.

    Args:
        result: A search's folder, its result.json, or the folder of a tile in it.
        out: The file, .png, .svg or .pdf; a sphere or a disc also .html, to be turned by hand.
        tile: A class, such as IH4, or a rank; 1 is best.
        force: Take a tile that is not certified; a file to make things from says so.
        picture: A picture over the silhouette, in the same frame: PNG, JPEG, WebP or an SVG drawing.
        second_picture: One over the second silhouette, of a tile of two figures or of `begin`.
        begin: A search's folder, or that of a tile in it, of whose tile a metamorphosis begins,
            instead of polygons; it is of the same class.

    Raises:
        InputFileError: If the picture cannot be read.
        OrbiflowError: As `artwork` and `export` raise it.
    """
    settings = settings.for_file(out)
    if begin is not None and settings.metamorphosis is None:
        raise SettingError("{begin} is where a {metamorphosis} begins; give both or neither")

    from orbiflow.tiles import make, motifs, worlds
    from orbiflow.tiles.result_file import read_tiles

    pictures, begins = (picture, second_picture), [] if begin is None else read_tiles(begin)
    best = None
    if settings.world in CURVED:
        best = partial(worlds.best_in_world, orders=settings.order, sign=CURVED[settings.world])
    elif begins:
        best = partial(worlds.best_to_become, begins=begins)
    taken, out = _taken(result, tile, out, f"{{}}.{settings.format}", *pictures, best=best)
    taken.require_certified(
        force=force, otherwise="so it is not drawn; {force} draws it all the same"
    )
    on_event(Progress(0.0, "laying out"))
    taken = motifs.with_map(taken)
    alike = (begin for begin in begins if begin.isohedral_class == taken.isohedral_class)
    first = next(alike, begins[0] if begins else None)
    if first is None:
        motifs.require_figures(taken, settings, 1 + (second_picture is not None))
        overs = motifs.read_overs(pictures, taken)
    else:
        both = zip(pictures, (taken, first), strict=True)
        overs = [carried for over, figure in both for carried in motifs.read_overs((over,), figure)]
    if settings.world or settings.metamorphosis:
        made = worlds.world_artwork(taken, settings, *overs, begin=first, cancel=cancel)
    else:
        made = make.artwork(taken, settings, *overs)
    return _finished(made, out, on_event, cancel)


@operation("solid")
def solid(
    result: TileSource,
    out: Annotated[Path | None, Option("-o"), DefaultText("named after the tile")] = None,
    settings: SolidSettings = SolidSettings(),
    *,
    tile: Which = None,
    force: bool = False,
    picture: Path | None = None,
    second_picture: Path | None = None,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Solid:
    """Make a solid to print in 3D: a tile, cookie cutter, stamp, mould or puzzle.

    It lies as it is printed, without supports. Lengths are numbers with a unit: mm, cm, in or pt.

    Args:
        result: A search's folder, its result.json, or the folder of a tile in it.
        out: The file, .stl or .3mf; several plates are numbered.
        tile: A class, such as IH4, or a rank; 1 is best.
        force: Take a tile that is not certified; a file to make things from says so.
        picture: An SVG drawing over the silhouette, in the same frame; a 3MF has it in a second colour.
        second_picture: One over the second silhouette, of a tile of two figures.

    Raises:
        InputFileError: If the drawing cannot be read, or is a picture of pixels.
        OrbiflowError: As `make_solid` and `export` raise it.
    """
    settings.check_picture(picture or second_picture)
    if settings.kind == "tile" and (picture or second_picture) and not (settings.format or out):
        settings = settings.replace(format="3mf")  # with a second colour
    settings = settings.for_file(out)

    from orbiflow.tiles import worlds
    from orbiflow.tiles.make import sheet_names
    from orbiflow.tiles.solids import make_solid, solid_files

    pictures = picture, second_picture
    name = f"{{}}-{settings.kind}.{settings.format}"
    best = None
    if settings.kind in BALLS:
        best = partial(worlds.best_in_world, orders=settings.order, sign=1)
    taken, out = _taken(result, tile, out, name, *pictures, best=best)
    carried = {"picture": picture, "second_picture": second_picture}
    made = make_solid(taken, settings, **carried, force=force)
    cancel.check()
    contents = solid_files(made, settings.file_format)
    cancel.check()
    names = sheet_names(out, len(contents))
    files = [write_atomic(name, text) for name, text in zip(names, contents, strict=True)]
    done = made.written(files)
    _tell(on_event, (*made.notes, done.words), *files)
    return done


@operation("animate")
def animate(
    result: TileSource,
    out: Annotated[
        Path | None,
        Option("-o"),
        Ending(".gif", ".mp4", ".svg"),
        DefaultText("a GIF named after the tile"),
    ] = None,
    settings: AnimationSettings = AnimationSettings(),
    *,
    tile: Which = None,
    force: bool = False,
    picture: Path | None = None,
    second_picture: Path | None = None,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Write an animation: a tiling becoming animals, a silhouette bending, a tiling that grows.

    It loops, there and back. In a morph every picture is an exact tiling.

    Args:
        result: A search's folder, its result.json, or the folder of a tile in it.
        out: The file: .gif, .svg, or .mp4, which needs ffmpeg.
        tile: A class, such as IH4, or a rank; 1 is best.
        force: Take a tile that is not certified; a file to make things from says so.
        picture: A picture over the silhouette, in the same frame: PNG, JPEG, WebP or an SVG drawing.
        second_picture: One over the second silhouette, of a tile of two figures.

    Raises:
        InputFileError: If the picture cannot be read.
        OrbiflowError: As `export` raises it, and for a picture in an SVG.
    """
    settings = settings.for_file(out)
    if settings.file_format == "svg" and (picture or second_picture):
        raise SettingError(
            "an animated SVG shows tiles in plain colours; leave out {picture}, or choose a .gif or "
            ".mp4"
        )

    from orbiflow.drawing import palette
    from orbiflow.tiles import motion
    from orbiflow.tiles.page import shades
    from orbiflow.tiles.tilings import colouring

    pictures = picture, second_picture
    taken, out = _taken(result, tile, out, f"{{}}-{settings.kind}.{settings.format}", *pictures)
    taken, overs = motion.dressed(taken, settings, pictures)
    colours = colouring(taken.tiling)
    carried = [part.figure for part in taken.figures] if overs else []
    said = [note for source in (*carried, *overs) for note in source.notes]
    for note in (*said, *shades(palette(settings.palette), colours).shortage(colours.count)):
        on_event(Note(note))

    def report(share: float) -> None:
        cancel.check()
        on_event(Progress(share, "drawing"))

    content = motion.animation(taken, settings, *overs, force=force, report=report)
    cancel.check()
    write_atomic(out, content)
    width, height = (round(side * settings.pixels) for side in settings.page)
    note = (
        f"written {out}: {settings.kind} of {taken.isohedral_class}, {settings.seconds:g} s, "
        f"{width} x {height} pixels, {len(content) / 1000:.0f} kB"
    )
    _tell(on_event, (note,), out)
    facts = {"bytes": len(content), "class": taken.isohedral_class, "kind": settings.kind}
    return Outcome({"file": str(out), **facts})
