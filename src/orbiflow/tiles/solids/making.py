"""The solid of a tile: its shape from cross-sections, and what the user should know.

Lengths are in mm; cross-sections have y down as on a page, and z is up.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely
from manifold3d import Error, Manifold, Mesh64, triangulate
from shapely.geometry.base import BaseGeometry

from orbiflow import __version__
from orbiflow.arguments import as_choice
from orbiflow.arrays import Array
from orbiflow.drawing import write_3mf, write_stl
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.runtime import Outcome
from orbiflow.tiles.geometry import orient, polygons_in
from orbiflow.tiles.likeness import narrowest_slit
from orbiflow.tiles.make import ExportSettings, Layout, cut_ring, dark_parts, laid_out, place_on
from orbiflow.tiles.page import Motif
from orbiflow.tiles.result_file import as_tile
from orbiflow.tiles.solids.settings import SolidSettings
from orbiflow.tiles.tile import EscherTile, TileSource

WRITERS = {"stl": write_stl, "3mf": write_3mf}
DARK = 0.9  # share of the tile beyond which a drawing that is raised shows nothing


@dataclass(frozen=True, eq=False, kw_only=True)
class Solid(Outcome):
    """A solid in mm as it is printed: z up, from the corner of the bed.

    - `kind`: What it is, such as "cutter".
    - `tile`: The tile that it is made of.
    - `parts`: Closed bodies by name; a puzzle has a "tray" and "piece 1", ..., and what is made of
      two figures one body for each.
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
    second_picture: str | Path | None = None,
    force: bool = False,
) -> Solid:
    """Return a solid to print, made of a tile.

    Args:
        tile, force: As for `export`; for a drawing the tile needs a map.
        settings: What is made, and how; `solid_file` then writes it.
        picture: An SVG drawing over the silhouette, for a stamp or mould.
        second_picture: One over the second silhouette, of a tile of two figures.

    Raises:
        CertificationError: If the tile is not certified.
        OrbiflowError: If the settings cannot be met.
        InputFileError: If the drawing cannot be read, or is a picture of pixels.
    """
    settings, given = settings or SolidSettings(), as_tile(tile)
    settings.check_picture(picture or second_picture)
    certificate = given.require_certified(
        force=force, otherwise="so no solid is made of it; {force} makes one, marked so"
    )
    title = f"{settings.kind} of {given.name} in mm, made with orbiflow {__version__}"
    if not certificate.valid:
        title = f"NOT CERTIFIED: {title}"
    pictures = picture, second_picture
    placed, notes = laid_out(given, _page(settings), pictures)
    drawings = placed.motifs or (Motif(),) * len(given.figures)
    for file, drawing in zip(pictures, drawings, strict=False):
        if drawing.rasters:
            raise InputFileError(f"{file}: a {settings.kind} needs lines: draw it as SVG")
    plans = [
        Plan(settings, placed, dark_parts(drawing, settings.nozzle)[0], number)
        for number, drawing in enumerate(drawings)
    ]
    notes = (*notes, *(note for plan in plans for note in _gap_notes(plan) + _dark_notes(plan)))
    return Solid(kind=settings.kind, tile=given, parts=shape(plans), title=title, notes=notes)


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


FLATNESS = 0.01  # how far in mm straight sides may be from the tile's curves: no printer shows it
MOST_PIECES = 400  # of a puzzle, so that its file stays below some 100 MB
GRAIN = 1e-4  # the finest detail in mm: the 32 bits of an STL tell it up to a metre
APART = 3.0  # distance in mm of a puzzle's parts on the bed


class Plan(NamedTuple):
    """What solids are made from: the tile in its place, and what is drawn on it, in mm."""

    settings: SolidSettings
    layout: Layout
    drawing: BaseGeometry
    number: int = 0  # which of the tile's figures it is made of

    @property
    def ring(self) -> Array:
        """The figure's outline (N, 2)."""
        curve = self.layout.outline.closed[self.number]
        rings = [curve.flattened(flatness) for flatness in (FLATNESS, FLATNESS / 16)]
        # hair-thin parts cross where a line is taken for their curves
        return next((ring for ring in rings if shapely.Polygon(ring).is_valid), rings[0])

    @property
    def piece(self) -> shapely.Polygon:
        """The tile, smaller by half of the clearance all around."""
        return shapely.Polygon(cut_ring(self.ring, 0.0, self.settings.clearance))


def shape(plans: Sequence[Plan]) -> dict[str, Manifold]:
    """Return the parts of a solid by name, as they are printed and seen from above.

    What is made of two figures lies side by side.

    What a cutter, stamp or mould makes is seen from its other side: they are mirrored, so that it
    looks like the tile.
    """
    makers = {"tile": _tile, "cutter": _cutter, "stamp": _stamp, "mould": _mould}
    kind = plans[0].settings.kind
    across = -1.0 if kind in ("cutter", "stamp", "mould") else 1.0
    if kind == "puzzle":
        found = _puzzle(plans)
    elif len(plans) == 1:
        found = {kind: makers[kind](plans[0])}
    else:
        figures = (part.figure.name for part in plans[0].layout.tile.figures)
        names = [f"{kind} {number}, {name}" for number, name in enumerate(figures, 1)]
        found = dict(zip(names, map(makers[kind], plans), strict=True))
        found = dict(zip(names, _in_a_row(list(found.values()), across), strict=True))
    turned = [body.scale((across, -1.0, 1.0)) for body in found.values()]
    x, y = np.min([body.bounding_box()[:2] for body in turned], axis=0)
    return {name: body.translate((-x, -y, 0.0)) for name, body in zip(found, turned, strict=True)}


def _in_a_row(bodies: Sequence[Manifold], across: float) -> list[Manifold]:
    """Return bodies moved apart, from left to right once x is multiplied by `across`."""
    placed: list[Manifold] = []
    right = 0.0
    for body in bodies:
        low, _, _, high, *_ = body.bounding_box()
        left = low if across > 0 else -high
        placed.append(body.translate((across * (right - left), 0.0, 0.0)))
        right += high - low + APART
    return placed


def _grown(region: BaseGeometry, distance: float) -> BaseGeometry:
    """Return a region grown by a distance, or shrunk, unless nothing is left."""
    found = region.buffer(distance, quad_segs=12) if distance else region
    if found.is_empty:
        raise OrbiflowError(
            f"nothing is left of the tile {-distance:.3g} mm inside its edge; choose a larger tile size"
        )
    return found


def _tile(plan: Plan) -> Manifold:
    settings, piece = plan.settings, plan.piece
    top = Level(settings.height, _grown(piece, -settings.chamfer))
    return stacked(Level(0.0, piece), Level(settings.height - settings.chamfer, piece), top)


def _cutter(plan: Plan) -> Manifold:
    """Return a cutter that stands on its rim, blade up; its walls stand outside of the tile."""
    settings, tile = plan.settings, shapely.Polygon(plan.ring)
    widths = (settings.foot, settings.wall, settings.blade)
    foot, wall, blade = (_grown(tile, width).difference(tile) for width in widths)
    rim, top = settings.floor, settings.floor + settings.height
    thins = Level(top - settings.height / 3, wall)
    return stacked(Level(0.0, foot), Level(rim, foot), Level(rim, wall), thins, Level(top, blade))


def _stamp(plan: Plan) -> Manifold:
    """Return a stamp, face up: the tile's border and the drawing inside it are raised."""
    settings, tile = plan.settings, shapely.Polygon(plan.ring)
    low = tile.buffer(-settings.wall).difference(plan.drawing)
    raised = tile.difference(low)
    base, top = settings.height, settings.height + settings.relief
    return stacked(Level(0.0, tile), Level(base, tile), Level(base, raised), Level(top, raised))


def _mould(plan: Plan) -> Manifold:
    """Return a block with a cavity that is the tile at its mouth, with the drawing on its floor."""
    settings, mouth = plan.settings, plan.piece
    block = shapely.box(*mouth.bounds).buffer(settings.wall)
    bottom = _grown(mouth, -settings.slope * settings.height)
    middle = _grown(mouth, -settings.slope * (settings.height - settings.relief))
    drawing = plan.drawing.intersection(bottom.buffer(-settings.nozzle))
    floor, relief = settings.floor, settings.floor + settings.relief
    return stacked(
        Level(0.0, block),
        Level(floor, block),
        Level(floor, block.difference(bottom).union(drawing)),
        Level(relief, block.difference(middle).union(drawing)),
        Level(relief, block.difference(middle)),
        Level(floor + settings.height, block.difference(mouth)),
    )


def _puzzle(plans: Sequence[Plan]) -> dict[str, Manifold]:
    """Return a tray and its pieces, in it or beside it on the bed."""
    plan, copies = plans[0], plans[0].layout.page.copies
    settings = plan.settings
    fit = min(len(copies), MOST_PIECES)
    wanted = settings.copies or max(fit, 1)
    if wanted > fit:
        raise OrbiflowError(
            f"a tray of {settings.area[0]:g} x {settings.area[1]:g} mm holds {fit} pieces of "
            f"{settings.tile_size:g} mm, not {wanted}; choose a larger area or a smaller tile size"
        )
    centers = copies.centers()
    far = np.linalg.norm(centers - centers.mean(axis=0), axis=1)
    copies = copies.select(np.sort(np.argsort(far, kind="stable")[:wanted]))
    tray, kinds = _tray(plan, copies.rings([own.ring for own in plans])), list(map(_tile, plans))
    moves = np.zeros((wanted, 3, 4))
    moves[:, :2, :2] = copies.group.linear_parts[copies.cosets]
    moves[:, :2, 3], moves[:, 2, 2] = copies.translations, 1.0
    moves[:, 2, 3] = settings.floor if settings.assembled else 0.0
    numbers = copies.prototiles.tolist()
    pieces = [kinds[k].transform(move) for k, move in zip(numbers, moves, strict=True)]
    pieces = pieces if settings.assembled else _beside(tray, pieces)
    return {"tray": tray, **{f"piece {k}": body for k, body in enumerate(pieces, 1)}}


def _tray(plan: Plan, rings: Sequence[Array]) -> Manifold:
    """Return a tray around tiles (N, 2), half as deep as the pieces are high."""
    settings, gap = plan.settings, plan.settings.clearance / 2
    polygons = [shapely.Polygon(ring) for ring in rings]
    grown = shapely.buffer(polygons, gap, join_style="mitre", mitre_limit=2)
    cavity = shapely.union_all(grown)
    if settings.tray_border == "straight":
        around = shapely.box(*cavity.bounds).buffer(settings.wall)
    else:
        parts = polygons_in(cavity.buffer(settings.wall))
        around = shapely.union_all([shapely.Polygon(part.exterior) for part in parts])
    floor, walls = settings.floor, around.difference(cavity)
    top = Level(floor + settings.height / 2, walls)
    return stacked(Level(0.0, around), Level(floor, around), Level(floor, walls), top)


def _beside(tray: Manifold, pieces: Sequence[Manifold]) -> list[Manifold]:
    """Return pieces moved apart, in rows beside a tray."""
    boxes = np.array([piece.bounding_box() for piece in pieces]).reshape(-1, 2, 3)[:, :, :2]
    step = np.ptp(boxes, axis=1).max(axis=0) + APART
    _, top, _, right, *_ = tray.bounding_box()
    row, column = np.divmod(np.arange(len(pieces)), math.ceil(math.sqrt(len(pieces))))
    places = np.array([right + APART, top]) + np.stack([column, row], axis=1) * step
    moves = places - boxes[:, 0]
    return [piece.translate((x, y, 0.0)) for piece, (x, y) in zip(pieces, moves, strict=True)]


class Level(NamedTuple):
    """The cross-section of a solid at a height in mm; two at one height are a step."""

    z: float
    region: BaseGeometry


def stacked(*levels: Level) -> Manifold:
    """Return the solid with these cross-sections, from the lowest up, straight between them.

    Of two successive regions one holds the other. A ring that both have becomes an upright wall. The
    rest of their difference is triangulated without new points, each vertex at its own level's
    height: a slope that is exact at both levels, even where rings part or vanish, or a flat at a
    step. So the faces meet by construction, and the library makes sure of it.
    """
    nothing = shapely.Polygon()
    closed = [Level(levels[0].z, nothing), *levels, Level(levels[-1].z, nothing)]
    faces = [part for below, above in pairwise(closed) for part in _between(below, above)]
    points, corners = np.unique(np.concatenate(faces).reshape(-1, 3), axis=0, return_inverse=True)
    made = Manifold(Mesh64(points, corners.reshape(-1, 3).astype(np.uint64)))
    if made.status() != Error.NoError or made.volume() <= 0:
        raise RuntimeError(f"the solid broke its promise to be closed: {made.status()}")
    return made.simplify(GRAIN)


def _between(below: Level, above: Level) -> Iterator[Array]:
    """Yield triangles (n, 3, 3) between two levels, counter-clockwise from outside."""
    old, new = _rings(below), _rings(above)
    shared = [key for key in old if key in new]
    for low, high in ((old.pop(key), new.pop(key)) for key in shared):
        if below.z < above.z:
            sides = np.stack([low, np.roll(low, -1, 0), np.roll(high, -1, 0), high], axis=1)
            yield from (sides[:, [0, 1, 2]], sides[:, [0, 2, 3]])
    grows = above.region.area > below.region.area
    outer, inner = (new, old) if grows else (old, new)
    rings = [*outer.values(), *(ring[::-1] for ring in inner.values())]
    if rings:
        band = np.concatenate(rings)[triangulate([ring[:, :2] for ring in rings])]
        yield band[:, ::-1] if grows else band


def _rings(level: Level) -> dict[bytes, Array]:
    """Return the rings (n, 3) of a level, its region on their left, by their bytes in the plane."""
    found = dict[bytes, Array]()
    for polygon in polygons_in(shapely.normalize(level.region)):
        for k, line in enumerate([polygon.exterior, *polygon.interiors]):
            ring = orient(shapely.get_coordinates(line)[:-1], counter_clockwise=k == 0)
            found[ring.tobytes()] = np.column_stack([ring, np.full(len(ring), level.z)])
    return found
