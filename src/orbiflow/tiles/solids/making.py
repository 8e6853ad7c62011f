"""The solid of a tile: how it is made, what the user should know, and its file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from manifold3d import Manifold

from orbiflow import __version__
from orbiflow.arguments import as_choice
from orbiflow.arrays import Array
from orbiflow.drawing import palette
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.runtime import write_atomic
from orbiflow.tiles.exporting import ExportSettings, Layout, layout, neck_notes, place_on
from orbiflow.tiles.likeness import narrowest_slit
from orbiflow.tiles.solids.files import write_3mf, write_stl
from orbiflow.tiles.solids.relief import raised
from orbiflow.tiles.solids.settings import WITH_DRAWING, SolidSettings
from orbiflow.tiles.solids.shapes import Plan, shape
from orbiflow.tiles.tile import EscherTile, TileSource

WRITERS = {"stl": write_stl, "3mf": write_3mf}
FRAGILE = {"cutter": 5.0, "mould": 2.0}  # widths in mm of necks at which dough and casts break


@dataclass(frozen=True, eq=False)
class Solid:
    """A solid in mm as it is printed: z up, from the corner of the bed.

    - `parts`: Closed bodies by name; a puzzle has a "tray" and "piece 1", ...
    - `title`: What a file says about it.
    - `notes`: What the user should know.
    """

    parts: dict[str, Manifold]
    title: str
    notes: tuple[str, ...] = ()

    @property
    def volume(self) -> float:
        """The volume in mm^3."""
        return sum(body.volume() for body in self.parts.values())

    @property
    def size(self) -> Array:
        """Width, depth and height (3,) in mm."""
        boxes = np.array([body.bounding_box() for body in self.parts.values()])
        return boxes[:, 3:].max(axis=0) - boxes[:, :3].min(axis=0)

    def write(self, out: str | Path, format: str | None = None) -> Path:
        """Write a 3mf or binary stl, by its ending where no format is given."""
        known = format or Path(out).suffix.lower().lstrip(".")
        writer = as_choice(known, tuple(WRITERS), "the format")
        return write_atomic(out, WRITERS[writer](self.parts, self.title))


def make_solid(
    tile: TileSource,
    settings: SolidSettings | None = None,
    *,
    picture: str | Path | None = None,
    force: bool = False,
) -> Solid:
    """Return a solid to print, made of a tile.

    Args:
        tile, force: As for `export`; for a drawing the tile needs a map.
        settings: What is made, and how.
        picture: An SVG drawing over the silhouette, for a stamp or mould.

    Raises:
        CertificationError: If the tile is not certified.
        OrbiflowError: If the settings cannot be met.
        InputFileError: If the drawing cannot be read, or is a picture of pixels.
    """
    settings, given = settings or SolidSettings(), EscherTile.of(tile)
    certificate = given.require_certified(
        force=force, otherwise="so no solid is made of it; --force makes one, marked so"
    )
    title = f"{settings.kind} of {given.name} in mm, made with orbiflow {__version__}"
    if not certificate.valid:
        title = f"NOT CERTIFIED: {title}"
    plan, notes = _plan(given, settings, picture)
    parts = shape(plan)
    return Solid(parts, title, (*notes, *_thin_notes(plan)))


def _plan(
    given: EscherTile, settings: SolidSettings, picture: str | Path | None
) -> tuple[Plan, list[str]]:
    page = ExportSettings(tile_size=settings.tile_size, cut="pieces")
    if settings.kind == "puzzle":
        sides = [side - 2 * settings.wall - settings.clearance for side in settings.area]
        page = ExportSettings(tile_size=settings.tile_size, area=(sides[0], sides[1]))
    placed = layout(given.tile, page, y_down=given.y_down)
    notes = [placed.outline.note] if placed.outline.note else []
    if picture is None and not settings.strokes and not settings.eyes:
        return Plan(settings, placed, shapely.Polygon()), notes
    if settings.kind not in WITH_DRAWING:
        raise OrbiflowError(f"a {settings.kind} has no picture; a stamp or mould has: leave it out")
    drawing, said = _drawing(given, placed, settings, picture)
    return Plan(settings, placed, drawing), [*notes, *said]


def _drawing(
    given: EscherTile, placed: Layout, settings: SolidSettings, picture: str | Path | None
) -> tuple[shapely.geometry.base.BaseGeometry, tuple[str, ...]]:
    """Return what is raised of all that is drawn on the tile, in mm, and notes."""
    from orbiflow.tiles.motifs import Over, drawn_motif, read_over, with_map

    tile = with_map(given)
    over = Over() if picture is None else read_over(picture, tile)
    if over.picture is not None:
        raise InputFileError(f"{picture}: a {settings.kind} needs lines: draw it as SVG")
    motif = drawn_motif(tile, settings, palette("ink"), over.drawing)
    drawing = raised(motif.moved(*placed.place), settings.nozzle)
    return drawing, (*tile.notes, *over.notes)


def _thin_notes(plan: Plan) -> list[str]:
    """Say where the tile is so thin that slopes of both sides meet, or that it breaks; and its gaps."""
    settings, ring, kind = plan.settings, plan.ring, plan.settings.kind
    slope = settings.height * settings.slope if kind == "mould" else settings.chamfer
    bevelled = 2 * slope + settings.clearance if kind in ("tile", "mould", "puzzle") else 0.0
    notes = neck_notes(ring, max(settings.nozzle, bevelled, FRAGILE.get(kind, 0.0)))
    slit = narrowest_slit(ring) if kind == "cutter" else None
    if slit is not None and slit.width < 2 * settings.wall:
        thin = ", too thin to print" if slit.width < settings.nozzle else ""
        notes.append(
            f"the walls of both sides are one in a gap of the tile: {slit.width:.2f} mm wide "
            f"{place_on(ring, slit.place)}{thin}"
        )
    return notes
