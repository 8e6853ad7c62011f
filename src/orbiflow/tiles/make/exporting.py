"""What an export puts on its sheets, the kinds of cut, and the files that it wrote."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from orbiflow import __version__
from orbiflow.drawing import palette
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import Outcome
from orbiflow.tiles.likeness import narrowest_neck
from orbiflow.tiles.make.cut_order import in_cutting_order
from orbiflow.tiles.make.drawings import drawn_on, with_drawing
from orbiflow.tiles.make.export_settings import ExportSettings
from orbiflow.tiles.make.jigsaws import jigsaw_scenes
from orbiflow.tiles.make.layout import Layout, layout, tiling_scene
from orbiflow.tiles.make.offsets import place_on
from orbiflow.tiles.make.pieces import pieces_scenes
from orbiflow.tiles.make.sheets import calibrated, registered, split
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
from orbiflow.tiles.write import LINES_ALONE, write_png, write_scene

VISIBLE = 0.05  # the least width in mm of a line that shows on a screen

EVERY, FIRST, LAST = slice(None), slice(1), slice(-1, None)


class Maker(NamedTuple):
    """How one kind of cut is made."""

    scenes: Callable[[Layout], list[Scene]]
    called: str  # what is counted on its sheets
    calibrated: slice = LAST  # the sheets that have a strip for the calibration mark
    splits: bool = False  # whether what is larger than the bed is split, cutting tiles


MAKERS = {
    "none": Maker(lambda layout: [tiling_scene(layout)], "tiles", splits=True),
    "skeleton": Maker(skeleton_scenes, "tiles in outline", splits=True),
    "pieces": Maker(pieces_scenes, "pieces", EVERY),
    "jigsaw": Maker(jigsaw_scenes, "pieces of a jigsaw", FIRST),
    "template": Maker(lambda layout: [template_scene(layout)], "template"),
}
"""The kinds of cut: to add one, write its scenes in a file here, name it here and in `cut`."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Exported(Outcome):
    """The result of an export.

    - `settings`: How it was drawn.
    - `files`: The files that were written, one for each sheet.
    - `scenes`: What is on each sheet.
    - `notes`: What the user should know.
    """

    settings: ExportSettings
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

    def written(self, files: tuple[Path, ...]) -> Exported:
        """Return what came of writing the sheets to files, with its facts as JSON has them."""
        name, size = self.scenes[0].facts["class"] or "", self.tile_size
        facts = {"files": list(map(str, files)), "tiles": self.tiles, "class": name}
        return replace(self, files=files, summary={**facts, "tile_size": size})

    @property
    def words(self) -> str:
        """What was written, in a sentence."""
        facts, page, first = self.scenes[0].facts, self.settings.page, self.files[0]
        count, what = facts.get("pieces", self.tiles), MAKERS[facts["cut"]].called
        where = str(first)
        if len(self.files) > 1:
            where = f"{len(self.files)} sheets, {first} to {self.files[-1].name}"
        return (
            f"written {where}: {count} {what} of {facts['class'] or 'a tile'}, "
            f"{self.tile_size:.4g} mm, on {page[0]:g} x {page[1]:g} mm"
        )

    def _repr_png_(self) -> bytes:
        """Return what a notebook shows: the first sheet, some 600 pixels wide."""
        sheet = self.scenes[0]
        return write_png(sheet, dpi=600 * 25.4 / max(sheet.width, sheet.height))


def scenes(
    tile: TileSource,
    settings: ExportSettings,
    *,
    picture: str | Path | None = None,
    second_picture: str | Path | None = None,
    force: bool = False,
) -> tuple[list[Scene], tuple[str, ...]]:
    """Return the sheets of an export, and what the user should know; it raises what `export` does."""
    given = as_tile(tile)
    certificate = given.require_certified(
        force=force, otherwise="so it is not exported; {force} exports it, marked so"
    )
    placed, notes = laid_out(given, settings, (picture, second_picture))
    settings, maker = placed.settings, MAKERS[placed.settings.cut]
    made = _made(placed, maker)
    notes = (*notes, *_colour_notes(given, settings), *made[0].told)
    made = [_described(scene, given, settings, certificate) for scene in made]
    if settings.marks:
        made = [registered(scene) for scene in made]
    if settings.calibrate:
        made[maker.calibrated] = [calibrated(scene) for scene in made[maker.calibrated]]
    return made, notes


def _made(placed: Layout, maker: Maker) -> list[Scene]:
    settings, fine = placed.settings, placed.fine
    made = [with_drawing(scene, placed) for scene in maker.scenes(placed)]
    if maker.splits and settings.bed is not None:
        made = [sheet for scene in made for sheet in split(scene, settings.bed, fine)]
    # a machine need not know copies
    painted = settings.cut == "none" and settings.filled
    made = made if painted else [flattened(scene, fine) for scene in made]
    return made if settings.coloured else [in_cutting_order(scene) for scene in made]


def laid_out(
    given: EscherTile, settings: ExportSettings, pictures: Sequence[str | Path | None] = ()
) -> tuple[Layout, tuple[str, ...]]:
    """Return a tile in its place with what lies on its figures, and what the user should know."""
    overs: list[Over] = []
    require_figures(given, settings, 1 + any(pictures[1:]))
    if settings.draws or any(pictures):
        given = with_map(given)
        overs = read_overs(pictures, given, followed=not settings.coloured)
    if any(over.picture for over in overs) and settings.file_format in LINES_ALONE:
        raise OrbiflowError(
            f"{next(filter(None, pictures))}: DXF and JSON hold lines, and the picture is made of "
            "pixels; choose SVG or PDF, or give an SVG drawing of fills and strokes alone"
        )
    placed = layout(given, settings)
    offset = [note for _, note in placed.pieces] if settings.cut == "pieces" else []
    notes = (*filter(None, [placed.outline.note, *offset]), *_neck_notes(placed))
    if overs:
        motifs = tuple(drawn_on(placed, number, over) for number, over in enumerate(overs))
        placed = replace(placed, motifs=motifs, has_picture=any(pictures))
        if settings.coloured:
            notes = (*notes_on_dark_pictures(given, overs, palette(settings.palette)), *notes)
        carried = [note for part in given.figures for note in part.figure.notes]
        notes = (*carried, *(note for over in overs for note in over.notes), *notes)
    return placed, notes


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
        known = colouring(given.tiling)
        return shades(palette(settings.palette), known).shortage(known.count)
    width = settings.outline
    if width is None or width >= VISIBLE:
        return ()
    return (f"its lines of {width:g} mm hardly show on a screen; a cutter follows them",)


def _neck_notes(placed: Layout) -> tuple[str, ...]:
    limit, found = placed.settings.warn_neck, list[str]()
    for part, ring in zip(placed.tile.figures, placed.prototiles, strict=True):
        name = part.figure.name if placed.tile.parts else ""
        try:
            neck = narrowest_neck(ring) if limit else None
        except OrbiflowError as error:  # a forced tile may cross itself
            whose = f"the necks of {name}" if name else "its necks"
            found.append(f"{whose} cannot be measured: {error}")
            continue
        if neck is not None and neck.width < limit:
            neck_there = f"a neck {place_on(ring, neck.place)} is {neck.width:.2f} mm wide"
            found.append(f"{name or 'the tile'} is thinner than {limit:g} mm: {neck_there}")
    return tuple(found)


def sheet_content(scene: Scene, settings: ExportSettings) -> str | bytes:
    """Return the content of a sheet's file."""
    form, fine = settings.file_format, settings.fine
    return write_scene(scene, form, tolerance=fine, dpi=settings.dpi)


def sheet_names(out: Path, count: int) -> list[Path]:
    """Return a name for each sheet, numbered if there are several.

    >>> [path.name for path in sheet_names(Path("cut.svg"), 2)]
    ['cut-1.svg', 'cut-2.svg']
    """
    if count == 1:
        return [out]
    digits = len(str(count))
    return [out.with_name(f"{out.stem}-{k:0{digits}d}{out.suffix}") for k in range(1, count + 1)]
