"""The solid of a tile: how it is made, what the user should know, and its file, STL or 3MF."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from manifold3d import Manifold

from orbiflow import __version__
from orbiflow.arguments import as_choice
from orbiflow.arrays import Array
from orbiflow.drawing import rendered
from orbiflow.errors import InputFileError
from orbiflow.runtime import Outcome
from orbiflow.tiles.likeness import narrowest_slit
from orbiflow.tiles.make import ExportSettings, dark_parts, laid_out, place_on
from orbiflow.tiles.page import Motif
from orbiflow.tiles.result_file import as_tile
from orbiflow.tiles.solids.settings import SolidSettings
from orbiflow.tiles.solids.shapes import Plan, shape
from orbiflow.tiles.tile import EscherTile, TileSource

STL_TRIANGLE = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")]


def write_stl(parts: Mapping[str, Manifold], title: str = "") -> bytes:
    """Return a binary STL of all parts, with 80 characters of the title in its header."""
    meshes = [body.to_mesh() for body in parts.values()]
    corners = np.concatenate([mesh.vert_properties[mesh.tri_verts] for mesh in meshes])
    # a normal of 0 leaves it to the reader, who has the order of the corners
    triangles = np.zeros(len(corners), dtype=STL_TRIANGLE)
    triangles["corners"] = corners
    header = title.encode("ascii", "replace")[:80].ljust(80)
    return header + len(corners).to_bytes(4, "little") + triangles.tobytes()


def write_3mf(parts: Mapping[str, Manifold], title: str = "") -> bytes:
    """Return a 3MF file with each part as an object of its own, in millimetres."""
    meshes = {name: body.to_mesh64() for name, body in parts.items()}
    files = {
        "[Content_Types].xml": "content_types.xml",
        "_rels/.rels": "relationships.xml",
        "3D/3dmodel.model": "model.xml",
    }
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, template in files.items():
            text = rendered("orbiflow.tiles.solids", template, meshes=meshes, title=title)
            entry = zipfile.ZipInfo(name)  # without a date
            archive.writestr(entry, text, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


WRITERS = {"stl": write_stl, "3mf": write_3mf}
DARK = 0.9  # share of the tile beyond which a drawing that is raised shows nothing


@dataclass(frozen=True, eq=False, kw_only=True)
class Solid(Outcome):
    """A solid in mm as it is printed: z up, from the corner of the bed.

    - `kind`: What it is, such as "cutter".
    - `tile`: The tile that it is made of.
    - `parts`: Closed bodies by name; a puzzle has a "tray" and "piece 1", ...
    - `title`: What a file says about it.
    - `notes`: What the user should know.
    """

    kind: str
    tile: EscherTile
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

    def written(self, out: Path) -> Solid:
        """Return what came of writing it to a file, with its facts as JSON has them."""
        facts = {"file": str(out), "kind": self.kind, "class": self.tile.isohedral_class}
        size = {"parts": len(self.parts), "size": self.size.tolist(), "volume": self.volume}
        return replace(self, summary={**facts, **size})

    @property
    def words(self) -> str:
        """What was written, in a sentence."""
        size = " x ".join(f"{side:.1f}" for side in self.size)
        what = f"{self.kind} of {self.tile.isohedral_class or 'a tile'}, {size} mm"
        return f"written {self.summary['file']}: {what}, {self.volume / 1000:.1f} cm³"


def solid_file(solid: Solid, format: str) -> bytes:
    """Return the content of a solid's file, binary "stl" or "3mf"."""
    return WRITERS[as_choice(format, tuple(WRITERS), "the format")](solid.parts, solid.title)


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
        settings: What is made, and how; `solid_file` then writes it.
        picture: An SVG drawing over the silhouette, for a stamp or mould.

    Raises:
        CertificationError: If the tile is not certified.
        OrbiflowError: If the settings cannot be met.
        InputFileError: If the drawing cannot be read, or is a picture of pixels.
    """
    settings, given = settings or SolidSettings(), as_tile(tile)
    settings.check_picture(picture)
    certificate = given.require_certified(
        force=force, otherwise="so no solid is made of it; {force} makes one, marked so"
    )
    title = f"{settings.kind} of {given.name} in mm, made with orbiflow {__version__}"
    if not certificate.valid:
        title = f"NOT CERTIFIED: {title}"
    placed, notes = laid_out(given, _page(settings), picture)
    drawing = Motif() if placed.motif is None else placed.motif
    if drawing.rasters:
        raise InputFileError(f"{picture}: a {settings.kind} needs lines: draw it as SVG")
    plan = Plan(settings, placed, dark_parts(drawing, settings.nozzle)[0])
    notes = (*notes, *_gap_notes(plan), *_dark_notes(plan))
    return Solid(kind=settings.kind, tile=given, parts=shape(plan), title=title, notes=notes)


def _page(settings: SolidSettings) -> ExportSettings:
    """Return how the tile is laid out: a puzzle's for most whole tiles within the tray's walls."""
    names = ("tile_size", "warn_neck", "strokes", "eyes")
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
    return (
        "the drawing is dark all over, and raised as one slab: leave out fills, or lighten them",
    )


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
