"""What is made of a tile to print: its plates, their files, and what the user should know."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from manifold3d import Manifold

from orbiflow import __version__
from orbiflow.arrays import Array
from orbiflow.drawing import write_3mf, write_stl
from orbiflow.errors import InputFileError
from orbiflow.runtime import Outcome
from orbiflow.settings import as_choice
from orbiflow.tiles.likeness import narrowest_slit
from orbiflow.tiles.make import ExportSettings, dark_parts, fit_words, laid_out, place_on
from orbiflow.tiles.page import Motif
from orbiflow.tiles.result_file import as_tile
from orbiflow.tiles.solids.plates import Plate, plates_of
from orbiflow.tiles.solids.settings import BALLS, SolidSettings
from orbiflow.tiles.solids.shapes import Plan
from orbiflow.tiles.tile import EscherTile, TileSource

FORMATS = ("stl", "3mf")
SUNK = ("tile", "puzzle")  # what has a drawing sunk in it; of others it stands out
DARK = 0.9  # share of the tile beyond which a drawing that is raised shows nothing


@dataclass(frozen=True, eq=False, kw_only=True)
class Solid(Outcome):
    """A solid in mm as it is printed: z up, from the corner of the bed.

    - `kind`: What it is, such as "cutter".
    - `tile`: The tile that it is made of.
    - `plates`: What is printed together, a file each: closed bodies by name, with what fills the
      drawing that is sunk in them. A puzzle has a "tray" and "piece 1", ..., and what is made of two
      figures one body for each.
    - `title`: What a file says about it.
    - `notes`: What the user should know.
    """

    kind: str
    tile: EscherTile
    plates: tuple[Plate, ...]
    title: str
    notes: tuple[str, ...] = ()

    @property
    def parts(self) -> dict[str, Manifold]:
        """The closed bodies of all plates by name."""
        return {name: body.solid for plate in self.plates for name, body in plate.items()}

    @property
    def volume(self) -> float:
        """The volume in mm^3."""
        return sum(body.volume() for body in self.parts.values())

    @property
    def size(self) -> Array:
        """Width, depth and height (3,) in mm that hold each of the plates."""
        boxes = np.array([body.bounding_box() for body in self.parts.values()])
        return boxes[:, 3:].max(axis=0) - boxes[:, :3].min(axis=0)

    def written(self, files: Sequence[Path]) -> Solid:
        """Return what came of writing its plates to files, with its facts as JSON has them."""
        names = list(map(str, files))
        facts = {"files": names, "kind": self.kind, "class": self.tile.isohedral_class}
        size = {"parts": len(self.parts), "size": self.size.tolist(), "volume": self.volume}
        return replace(self, summary={**facts, **size})

    @property
    def words(self) -> str:
        """What was written, in a sentence."""
        size = " x ".join(f"{side:.1f}" for side in self.size)
        what = f"{self.kind} of {self.tile.isohedral_class or 'a tile'}, {size} mm"
        first, *others = self.summary["files"]
        where = f"{len(others) + 1} plates, {first} to {Path(others[-1]).name}" if others else first
        return f"written {where}: {what}, {self.volume / 1000:.1f} cm³"


GROUND, DRAWN = "#e8c468", "#2b2b2b"
"""The colours of what drawings are sunk in, and of what fills them."""


def solid_files(solid: Solid, format: str) -> list[bytes]:
    """Return the content of a file for each plate, binary "stl" or "3mf".

    A 3MF has what fills a drawing as a part in a second colour; in an STL the drawing is sunk.
    """
    if as_choice(format, FORMATS, "the format") == "stl":
        plates = [{name: body.solid for name, body in plate.items()} for plate in solid.plates]
        return [write_stl(bodies, solid.title) for bodies in plates]
    return [_coloured(plate, solid.title) for plate in solid.plates]


def _coloured(plate: Plate, title: str) -> bytes:
    bodies, groups, colours = dict[str, Manifold](), dict[str, list[str]](), dict[str, str]()
    for name, body in plate.items():
        bodies[name] = body.solid
        if body.inlay is not None:
            drawing = f"{name}, drawing"
            bodies[drawing], groups[name] = body.inlay, [name, drawing]
            colours[name], colours[drawing] = GROUND, DRAWN
    return write_3mf(bodies, title, colours=colours, groups=groups)


def make_solid(
    tile: TileSource,
    settings: SolidSettings | None = None,
    *,
    picture: str | Path | None = None,
    second_picture: str | Path | None = None,
    force: bool = False,
) -> Solid:
    """Return a solid to print, made of a tile.

    Args:
        tile, force: As for `export`; for a drawing the tile needs a map.
        settings: What is made, and how; `solid_files` then writes it.
        picture: An SVG drawing over the silhouette: sunk in a tile or in pieces, raised on a stamp or
            a mould's floor.
        second_picture: One over the second silhouette, of a tile of two figures.

    Raises:
        CertificationError: If the tile is not certified.
        OrbiflowError: If the settings cannot be met.
        InputFileError: If the drawing cannot be read, or is a picture of pixels.
    """
    settings, resolved = settings or SolidSettings(), as_tile(tile)
    settings.check_picture(picture or second_picture)
    certificate = resolved.require_certified(
        force=force, otherwise="so no solid is made of it; {force} makes one, marked so"
    )
    title = f"{settings.kind} of {resolved.name} in mm, made with orbiflow {__version__}"
    if not certificate.valid:
        title = f"NOT CERTIFIED: {title}"
    if settings.kind in BALLS:
        from orbiflow.tiles.solids.ball import ball_of  # other worlds, which flat solids do without

        bodies, notes = ball_of(resolved, settings)
        facts = {"kind": settings.kind, "tile": resolved, "title": title, "notes": notes}
        return Solid(plates=(bodies,), **facts)
    pictures = picture, second_picture
    placed, notes = laid_out(resolved, _page(settings), pictures)
    drawings = placed.motifs or (Motif(),) * len(resolved.figures)
    for file, drawing in zip(pictures, drawings, strict=False):
        if drawing.rasters:
            raise InputFileError(f"{file}: a {settings.kind} needs lines: draw it as SVG")
    plans = [
        Plan(settings, placed, dark_parts(drawing, settings.nozzle)[0], number)
        for number, drawing in enumerate(drawings)
    ]
    notes = (*notes, *(note for plan in plans for note in _gap_notes(plan) + _dark_notes(plan)))
    if settings.fit_test:
        notes = (*notes, fit_words(settings.clearance))
    plates = plates_of(plans)
    return Solid(kind=settings.kind, tile=resolved, plates=plates, title=title, notes=notes)


def _page(settings: SolidSettings) -> ExportSettings:
    """Return how the tile is laid out: a puzzle's for most whole tiles within the tray's walls."""
    names = ("tile_size", "warn_neck", "strokes", "eyes", "second_eyes")
    page = ExportSettings(**{name: getattr(settings, name) for name in names})
    if settings.kind != "puzzle":
        return page.replace(cut="pieces")
    sides = [side - 2 * settings.wall - settings.clearance for side in settings.area]
    return page.replace(area=(sides[0], sides[1]))


def _dark_notes(plan: Plan) -> tuple[str, ...]:
    """Say that nothing of a drawing shows, as it is dark all over the tile."""
    tile = plan.piece
    if (plan.drawing & tile).area < DARK * tile.area:
        return ()
    how = "sunk as one hollow" if plan.settings.kind in SUNK else "raised as one slab"
    return (f"the drawing is dark all over, and {how}: leave out fills, or lighten them",)


def _gap_notes(plan: Plan) -> tuple[str, ...]:
    """Say where the walls of a cutter meet in a gap of the tile."""
    settings, ring = plan.settings, plan.ring
    slit = narrowest_slit(ring) if settings.kind == "cutter" else None
    if slit is None or slit.width >= 2 * settings.wall:
        return ()
    thin = ", too thin to print" if slit.width < settings.nozzle else ""
    return (
        f"the walls of both sides are one in a gap of the tile: {slit.width:.2f} mm wide "
        f"{place_on(ring, slit.place)}{thin}",
    )
