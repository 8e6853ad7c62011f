"""What an export puts on its sheets, and the kinds of cut."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from orbiflow import __version__
from orbiflow.drawing import palette
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.likeness import narrowest_neck
from orbiflow.tiles.make.cut_order import in_cutting_order
from orbiflow.tiles.make.drawings import drawn_on, with_drawing
from orbiflow.tiles.make.export_settings import ExportSettings
from orbiflow.tiles.make.jigsaws import jigsaw_scenes
from orbiflow.tiles.make.layout import Layout, layout, tiling_scene
from orbiflow.tiles.make.lessons import lesson_scene
from orbiflow.tiles.make.made import Made
from orbiflow.tiles.make.offsets import place_on
from orbiflow.tiles.make.paper import paper_sheets
from orbiflow.tiles.make.pieces import pieces_scenes
from orbiflow.tiles.make.sheets import OVERLAP, calibrated, registered, split
from orbiflow.tiles.make.skeletons import skeleton_scenes
from orbiflow.tiles.make.templates import template_scene
from orbiflow.tiles.motifs import (
    Over,
    notes_on_dark_pictures,
    read_overs,
    require_figures,
    with_map,
)
from orbiflow.tiles.page import Scene, flattened, shades
from orbiflow.tiles.result_file import as_tile
from orbiflow.tiles.tile import EscherTile, TileSource
from orbiflow.tiles.tilings import Certificate, colouring
from orbiflow.tiles.write import LINES_ALONE

VISIBLE = 0.05  # the least width in mm of a line that shows on a screen

EVERY, FIRST, LAST = slice(None), slice(1), slice(-1, None)


class Maker(NamedTuple):
    """How one kind of cut is made."""

    scenes: Callable[[Layout], list[Scene]]
    counted: str  # what is counted on its sheets
    calibrated: slice = LAST  # the sheets that have a strip for the calibration mark
    splits: bool = False  # whether what is larger than the bed is split, cutting tiles


MAKERS = {
    "none": Maker(lambda layout: [tiling_scene(layout)], "tiles", splits=True),
    "skeleton": Maker(skeleton_scenes, "tiles in outline", splits=True),
    "pieces": Maker(pieces_scenes, "pieces", EVERY),
    "jigsaw": Maker(jigsaw_scenes, "pieces of a jigsaw", FIRST),
    "template": Maker(lambda layout: [template_scene(layout)], "template"),
    "lesson": Maker(lambda layout: [lesson_scene(layout)], "lesson"),
}
"""The kinds of cut: to add one, write its scenes in a file here, name it here and in `cut`."""


def exported(
    tile: TileSource,
    settings: ExportSettings,
    pictures: Sequence[str | Path | None] = (),
    *,
    force: bool = False,
) -> Made:
    """Return the sheets of an export, before they are written; it raises what `export` does.

    `pictures` are the files of what lies over the silhouette of each of the tile's figures.
    """
    resolved = as_tile(tile)
    certificate = resolved.require_certified(
        force=force, otherwise="so it is not exported; {force} exports it, marked so"
    )
    placed, notes = laid_out(resolved, settings, pictures)
    settings, maker = placed.settings, MAKERS[placed.settings.cut]
    sheets = _sheets(placed, maker)
    notes = (*notes, *_colour_notes(resolved, settings), *sheets[0].remarks)
    if settings.on_paper and len(sheets) > 1:
        size = f"{sheets[0].width:g} x {sheets[0].height:g} mm"
        notes = (
            *notes,
            f"{len(sheets)} sheets of {size}: print them at 100 %, and join them by their marks",
        )
    sheets = [_described(scene, resolved, settings, certificate) for scene in sheets]
    if settings.marks:
        sheets = [registered(scene) for scene in sheets]
    if settings.calibrate and (len(sheets) == 1 or not settings.on_paper):
        sheets[maker.calibrated] = [calibrated(scene) for scene in sheets[maker.calibrated]]
    return Made(
        tile=placed.tile,
        settings=settings,
        scenes=tuple(sheets),
        counted=maker.counted,
        tiles=sum(len(scene.tiles) for scene in sheets),
        notes=notes,
    )


def _sheets(placed: Layout, maker: Maker) -> list[Scene]:
    settings, fine = placed.settings, placed.fine
    made = [with_drawing(scene, placed) for scene in maker.scenes(placed)]
    if settings.on_paper:
        made = [sheet for scene in made for sheet in paper_sheets(scene, settings)]
    elif maker.splits and settings.bed is not None:
        overlap = settings.overlap or OVERLAP
        made = [sheet for scene in made for sheet in split(scene, settings.bed, fine, overlap)]
    # a machine need not know copies
    painted = settings.cut == "none" and settings.filled
    made = made if painted else [flattened(scene, fine) for scene in made]
    return made if settings.coloured else [in_cutting_order(scene) for scene in made]


def laid_out(
    tile: EscherTile, settings: ExportSettings, pictures: Sequence[str | Path | None] = ()
) -> tuple[Layout, tuple[str, ...]]:
    """Return a tile in its place with what lies on its figures, and what the user should know."""
    overs: list[Over] = []
    require_figures(tile, settings, 1 + any(pictures[1:]))
    if settings.draws or any(pictures):
        tile = with_map(tile)
        overs = read_overs(pictures, tile, followed=not settings.coloured)
    if any(over.picture for over in overs) and settings.file_format in LINES_ALONE:
        raise OrbiflowError(
            f"{next(filter(None, pictures))}: DXF and JSON hold lines, and the picture is made of "
            "pixels; choose SVG or PDF, or give an SVG drawing of fills and strokes alone"
        )
    placed = layout(tile, settings)
    offset = [note for _, note in placed.pieces] if settings.cut == "pieces" else []
    notes = (*filter(None, [placed.outline.note, *offset]), *_neck_notes(placed))
    if overs:
        motifs, carried = drawn_on(placed, overs)
        placed = replace(placed, motifs=motifs, has_picture=any(pictures))
        if settings.coloured:
            notes = (*notes_on_dark_pictures(tile, overs, palette(settings.palette)), *notes)
        notes = (*carried, *notes)
    return placed, notes


def _described(
    scene: Scene, source: EscherTile, settings: ExportSettings, certificate: Certificate
) -> Scene:
    tile = source.tile
    title, notes = source.name, [*scene.notes]
    if not certificate.valid:
        title += ", NOT CERTIFIED"
        notes.insert(0, f"NOT CERTIFIED: {'; '.join(certificate.reasons)}.")
    what = " ".join(part for part in (tile.isohedral_class, tile.group.name) if part)
    notes.append(
        f"{what or 'A tile'}, tiles of {settings.tile_size:g} mm, made with orbiflow {__version__}; "
        "one unit is one millimetre."
    )
    facts = {
        "class": tile.isohedral_class or None,
        "group": tile.group.name or None,
        "rank": source.rank,
        "certified": certificate.valid,
        "cut": settings.cut,
        "tile_size": settings.tile_size,
        "kerf": settings.kerf,
        "clearance": settings.clearance,
        "offset": settings.offset,
        "tolerance": settings.deviation,
        **scene.facts,
    }
    return replace(scene, title=title, notes=tuple(notes), facts=facts)


def _colour_notes(tile: EscherTile, settings: ExportSettings) -> tuple[str, ...]:
    if settings.cut == "none" or settings.purpose == "stickers":
        colours = colouring(tile.tiling)
        return shades(palette(settings.palette), colours).shortage(colours.count)
    width = settings.outline
    if width is None or width >= VISIBLE:
        return ()
    return (f"its lines of {width:g} mm hardly show on a screen; a cutter follows them",)


def _neck_notes(placed: Layout) -> tuple[str, ...]:
    limit, notes = placed.settings.warn_neck, list[str]()
    for part, ring in zip(placed.tile.figures, placed.prototiles, strict=True):
        name = part.figure.name if len(placed.tile.figures) > 1 else ""
        try:
            neck = narrowest_neck(ring) if limit else None
        except OrbiflowError as error:  # a forced tile may cross itself
            whose = f"the necks of {name}" if name else "its necks"
            notes.append(f"{whose} cannot be measured: {error}")
            continue
        if neck is not None and neck.width < limit:
            neck_there = f"a neck {place_on(ring, neck.place)} is {neck.width:.2f} mm wide"
            notes.append(f"{name or 'the tile'} is thinner than {limit:g} mm: {neck_there}")
    return tuple(notes)
