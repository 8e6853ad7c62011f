"""Export of a tile: the scenes of its sheets, and a file of each."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

from orbiflow import __version__
from orbiflow.arguments import as_path
from orbiflow.drawing import palette
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import Cancel, Progress, Sink, ignore, write_atomic
from orbiflow.tiles.exporting.drawings import drawn_on, with_drawing
from orbiflow.tiles.exporting.jigsaws import jigsaw_scenes
from orbiflow.tiles.exporting.layouts import Layout, layout, pieces_scenes, place_on, tiling_scene
from orbiflow.tiles.exporting.settings import ExportSettings
from orbiflow.tiles.exporting.sheets import calibrated, registered, split
from orbiflow.tiles.exporting.skeletons import skeleton_scene
from orbiflow.tiles.exporting.templates import template_scene
from orbiflow.tiles.likeness import narrowest_neck
from orbiflow.tiles.motifs import Over, read_over, with_map
from orbiflow.tiles.result_file import as_tile
from orbiflow.tiles.scene import (
    Scene,
    flattened,
    write_dxf,
    write_json,
    write_pdf,
    write_png,
    write_svg,
)
from orbiflow.tiles.tile import EscherTile, TileSource
from orbiflow.tiles.tilings import Certificate, colouring

VISIBLE = 0.05  # the least width in mm of a line that shows on a screen


@dataclass(frozen=True, eq=False)
class Exported:
    """The result of an export.

    - `files`: The files that were written, one for each sheet.
    - `scenes`: What is on each sheet.
    - `notes`: What the user should know.
    """

    files: tuple[Path, ...]
    scenes: tuple[Scene, ...]
    notes: tuple[str, ...]

    @property
    def tiles(self) -> int:
        """The number of tiles on all sheets; a tile cut where sheets meet counts on each."""
        return sum(len(scene.tiles) for scene in self.scenes)

    @property
    def tile_size(self) -> float:
        """The longer side in mm of a tile's smallest rectangle."""
        return self.scenes[0].facts["tile_size"]

    def _repr_png_(self) -> bytes:
        """Return what a notebook shows: the first sheet, some 600 pixels wide."""
        sheet = self.scenes[0]
        return write_png(sheet, dpi=600 * 25.4 / max(sheet.width, sheet.height))


def export(
    tile: TileSource,
    out: str | Path,
    settings: ExportSettings | None = None,
    *,
    picture: str | Path | None = None,
    force: bool = False,
    on_event: Sink = ignore,
    cancel: Cancel | None = None,
) -> Exported:
    """Write a tiling, its lines or its pieces in real size.

    Args:
        tile: A tile in memory, or a run's folder; see `read_result`.
        out: The file; with several sheets its name gets a number. Its ending decides the format, unless
            the settings give one.
        settings: How it is drawn.
        picture: The file of a picture or drawing over the silhouette, for which the tile needs a map.
        force: Export a tile that is not certified; the file says so.
        on_event: Called with the `Progress`.
        cancel: Stops the work; nothing is then written.

    Raises:
        CertificationError: If the tile is not certified.
        OrbiflowError: If the settings cannot be met, or nothing says the format.
        OutputError: If a file cannot be written.
        Cancelled: If it was cancelled.
    """
    out, cancel = as_path(out, "the file to export to"), cancel or Cancel()
    settings = (settings or ExportSettings()).for_file(out)
    on_event(Progress(0.0, "laying out"))
    found, notes = scenes(tile, settings, picture=picture, force=force)
    contents: list[str | bytes] = []  # all, before the first file
    for k, scene in enumerate(found):
        cancel.check()
        on_event(Progress((1 + k) / (1 + len(found)), "writing"))
        contents.append(write_scene(scene, settings))
    cancel.check()
    names = sheet_names(out, len(contents))
    files = [write_atomic(name, content) for name, content in zip(names, contents, strict=True)]
    return Exported(tuple(files), tuple(found), notes)


def scenes(
    tile: TileSource,
    settings: ExportSettings,
    *,
    picture: str | Path | None = None,
    force: bool = False,
) -> tuple[list[Scene], tuple[str, ...]]:
    """Return the sheets, and what the user should know. Raises as `export`."""
    given = as_tile(tile)
    certificate = given.require_certified(
        force=force, otherwise="so it is not exported; --force exports it, marked so"
    )
    placed, notes = laid_out(given, settings, picture)
    settings = placed.settings  # a template's tile is as large as the page allows
    notes = (*notes, *_colour_notes(given, settings))
    made = [_described(scene, given, settings, certificate) for scene in _made(placed, given)]
    if settings.cut == "template" and given.bending is None:
        notes = (*notes, "the template has no silhouette: no map of it is known")
    if settings.cut == "jigsaw":
        facts = made[0].facts
        pieces, whole = facts["pieces"], facts["whole_tiles"]
        count = f"{pieces} pieces, {whole} whole tiles and {pieces - whole} at the border"
        note = f"the jigsaw has {count}, the smallest {facts['smallest']:.2f} of a tile"
        if settings.tray:
            note += f"; the tray's two sheets are {made[1].width:g} x {made[1].height:g} mm"
        notes = (*notes, note)
    if settings.marks:
        made = [registered(scene) for scene in made]
    if settings.calibrate:
        # the strip at the foot is the last sheet's; pieces have one on each, a jigsaw's tray has none
        marked = {"pieces": slice(None), "jigsaw": slice(1)}.get(settings.cut, slice(-1, None))
        made[marked] = [calibrated(scene) for scene in made[marked]]
    return made, notes


def laid_out(
    given: EscherTile, settings: ExportSettings, picture: str | Path | None = None
) -> tuple[Layout, tuple[str, ...]]:
    """Return a tile in its place with what lies on it, and what the user should know."""
    over = Over()
    if drawn := picture is not None or bool(settings.strokes or settings.eyes):
        given = with_map(given)
        over = over if picture is None else read_over(picture, given)
    if over.picture is not None and settings.file_format in ("dxf", "json"):
        raise OrbiflowError(
            f"{picture}: DXF and JSON hold lines, and the picture is made of pixels; choose SVG or "
            "PDF, or draw it as SVG"
        )
    placed = layout(given.tile, settings, y_down=given.y_down)
    told = (placed.outline.note, placed.piece[1] if settings.cut == "pieces" else "")
    notes = (*filter(None, told), *_neck_notes(placed))
    if drawn:
        placed = replace(placed, motif=drawn_on(placed, given, over))
        notes = (*given.notes, *over.notes, *notes)
    return placed, notes


def _made(placed: Layout, given: EscherTile) -> list[Scene]:
    settings, fine = placed.settings, placed.fine
    if settings.cut == "pieces":
        made = pieces_scenes(placed)
    elif settings.cut == "jigsaw":
        made = jigsaw_scenes(placed)
    elif settings.cut == "template":
        made = [template_scene(placed, given)]
    else:
        made = [skeleton_scene(placed) if settings.cut == "skeleton" else tiling_scene(placed)]
    painted = settings.cut == "none" and settings.filled
    made = [with_drawing(scene, placed) for scene in made]
    if settings.cut in ("none", "skeleton") and settings.bed is not None:
        made = split(made[0], settings.bed, fine)
    # a machine need not know copies
    return made if painted else [flattened(scene, fine) for scene in made]


def _described(
    scene: Scene, given: EscherTile, settings: ExportSettings, certificate: Certificate
) -> Scene:
    tile = given.tile
    title, notes = given.name, [*scene.notes]
    if not certificate.valid:
        title += ", NOT CERTIFIED"
        notes.insert(0, f"NOT CERTIFIED: {'; '.join(certificate.reasons)}.")
    what = " ".join(part for part in (tile.isohedral_class, tile.group.name) if part)
    notes.append(
        f"{what or 'A tile'}, tiles of {settings.tile_size:g} mm, made with orbiflow {__version__}; "
        "one unit is one millimetre."
    )
    facts = {
        **scene.facts,
        "class": tile.isohedral_class or None,
        "group": tile.group.name or None,
        "rank": given.rank,
        "certified": certificate.valid,
        "cut": settings.cut,
        "tile_size": settings.tile_size,
        "kerf": settings.kerf,
        "clearance": settings.clearance,
        "offset": settings.offset,
        "tolerance": settings.deviation,
    }
    return replace(scene, title=title, notes=tuple(notes), facts=facts)


def _colour_notes(given: EscherTile, settings: ExportSettings) -> tuple[str, ...]:
    if settings.cut == "none" or settings.purpose == "stickers":
        return palette(settings.palette).shortage(colouring(given.tile).count)
    width = settings.stroke_width
    if width is None or width >= VISIBLE:
        return ()
    return (f"its lines of {width:g} mm hardly show on a screen; a cutter follows them",)


def _neck_notes(placed: Layout) -> tuple[str, ...]:
    limit, ring = placed.settings.warn_neck, placed.tile.polygon
    if not limit:
        return ()
    try:
        neck = narrowest_neck(ring)
    except OrbiflowError as error:  # a forced tile may cross itself
        return (f"its necks cannot be measured: {error}",)
    if neck.width >= limit:
        return ()
    place = place_on(ring, neck.place)
    return (f"the tile is thinner than {limit:g} mm: a neck {place} is {neck.width:.2f} mm wide",)


def write_scene(scene: Scene, settings: ExportSettings) -> str | bytes:
    """Return the content of a sheet's file."""
    fine = settings.deviation / 4
    match settings.file_format:
        case "pdf":
            return write_pdf(scene)
        case "png":
            return write_png(scene, dpi=settings.dpi)
        case "dxf":
            return write_dxf(scene, tolerance=fine)
        case "json":
            return write_json(scene, tolerance=fine)
        case _:
            # what rounding moves is far below the tolerance
            return write_svg(scene, decimals=max(3, math.ceil(-math.log10(fine / 5))))


def sheet_names(out: Path, count: int) -> list[Path]:
    """Return a name for each sheet, numbered if there are several.

    >>> [path.name for path in sheet_names(Path("cut.svg"), 2)]
    ['cut-1.svg', 'cut-2.svg']
    """
    if count == 1:
        return [out]
    digits = len(str(count))
    return [out.with_name(f"{out.stem}-{k:0{digits}d}{out.suffix}") for k in range(1, count + 1)]
