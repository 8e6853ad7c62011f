"""Things to hold in the hand, made of a tile that fills space.

Lengths are in mm; z is up, and the corner of the bed is at 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from manifold3d import Manifold

from orbiflow.arrays import Array
from orbiflow.drawing import write_3mf, write_stl
from orbiflow.errors import OrbiflowError
from orbiflow.solids.assembly import Assembly, Leaving, Pieces
from orbiflow.solids.bodies import moved_body, united
from orbiflow.solids.mesh import Mesh
from orbiflow.solids.offsets import offset_body
from orbiflow.solids.print_advice import lying, print_advice
from orbiflow.solids.settings import BuildSettings
from orbiflow.solids.solid import EscherSolid
from orbiflow.solids.stacks import STACK_PALETTE, StackedCopy, colour_number, stack_of
from orbiflow.solids.sweeping import lifted

CLEARANCE, WALL, FLOOR = 0.25, 3.0, 2.0
"""Gap between printed copies, and thickness of the walls and the floor of blocks and boxes, in mm."""

APART = 4.0
"""Distance in mm of parts on the bed."""

SOCKET = 0.5
"""How high a starting block reaches, as a share of the tile's height."""

BOX_HEIGHT = 0.7
"""Height of a puzzle's box, as a share of the pieces' height."""

GRAIN = 0.01
"""How far in mm a surface may move where bodies are cut out of blocks; no printer shows it."""


@dataclass(frozen=True)
class PrintedParts:
    """Parts to print, in mm.

    - `parts`: Closed bodies by name.
    - `colours`: The colour of each part that has one, #rrggbb.
    - `notes`: What to know, a sentence each.
    - `fixed`: Whether parts are to be printed where they are to each other, some above the bed.
    """

    parts: dict[str, Manifold]
    colours: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    fixed: bool = False

    def file(self, format: str, title: str = "") -> bytes:
        """Return the content of a file, "3mf" with colours or "stl" without."""
        if format == "3mf":
            names = list(self.parts)
            groups = {names[0]: names} if self.fixed else None
            return write_3mf(self.parts, title, colours=self.colours, groups=groups)
        return write_stl(self.parts, title)


def make(solid: EscherSolid, settings: BuildSettings) -> PrintedParts:
    """Return what settings ask for."""
    gap, wall, floor = settings.clearance, settings.wall, settings.floor
    match settings.kind:
        case "tile":
            return make_tile(solid, clearance=gap, nozzle=settings.nozzle)
        case "stack":
            return make_stack(solid, copies=settings.copies, clearance=gap)
        case "block":
            return make_block(solid, clearance=gap, wall=wall, floor=floor)
        case "puzzle":
            return make_puzzle(
                solid,
                copies=settings.copies,
                clearance=gap,
                wall=wall,
                floor=floor,
                assembled=settings.assembled,
            )


def make_tile(
    solid: EscherSolid, *, clearance: float = CLEARANCE, nozzle: float = 0.4
) -> PrintedParts:
    """Return one tile, smaller all around by half of the clearance, as it is best printed.

    Args:
        solid: A tile that fills space.
        clearance: The gap in mm between copies.
        nozzle: The width of the printer's line in mm, for the notes.

    Raises `OrbiflowError` if nothing is left of it.
    """
    mesh = _in_mm(solid.tile, solid)
    body = offset_body(mesh, -clearance / 2)
    body = _on_bed(moved_body(body, lying(mesh)))
    advice = print_advice(body, nozzle=nozzle, name="The tile")
    return PrintedParts({"tile": body}, {"tile": STACK_PALETTE.fill(0)}, notes=advice.sentences)


def make_stack(
    solid: EscherSolid, *, copies: int = 8, clearance: float = CLEARANCE
) -> PrintedParts:
    """Return a stack of copies as they fill space, in colours, standing like the figure.

    Args:
        solid: A tile that fills space.
        copies: How many copies.
        clearance: The gap in mm between them.
    """
    axes = solid.upright
    stack = stack_of(solid.group, solid.tile, copies)
    body = offset_body(_in_mm(solid.tile, solid), -clearance / 2)
    placed = _placed(body, stack, solid, axes.T)
    corner = _corner(placed)
    parts, colours = dict[str, Manifold](), dict[str, str]()
    for k, (copy, own) in enumerate(zip(stack, placed, strict=True), 1):
        number = colour_number(solid.group, copy)
        name = f"copy {k}, position {number + 1}{', mirrored' * copy.is_mirrored}"
        parts[name], colours[name] = own.translate((-corner).tolist()), STACK_PALETTE.fill(number)
    notes = [f"{copies} copies with a gap of {clearance:g} mm."]
    return PrintedParts(parts, colours, notes, fixed=True)


def make_block(
    solid: EscherSolid,
    *,
    clearance: float = CLEARANCE,
    wall: float = WALL,
    floor: float = FLOOR,
    leaving: Leaving | None = None,
) -> PrintedParts:
    """Return a block to start a stack on: its bottom is flat, and a copy fits into its top.

    The block is what copies below fill, cut off by a box. The copy is let in from above, in the
    direction in which copies are best drawn out of a stack; where something would be in its way, the
    block is opened.

    Args:
        solid: A tile that fills space.
        clearance: The gap in mm between block and copy.
        wall: How much wider than the copy the block is, on each side, in mm.
        floor: How thick it is below the copy, in mm.
        leaving: How copies leave a stack. Default: it is found.
    """
    pieces = Pieces(solid.group, solid.tile, clearance / solid.millimetres)
    leaving = leaving or pieces.leaving_stack()
    turn = _upwards(leaving.direction)
    mesh = _in_mm(solid.tile, solid).moved(turn)
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    top = low[2] + SOCKET * (high[2] - low[2])
    # as deep as what is cut out of it, and the floor
    deep = _box([*(low[:2] - wall), 2 * low[2] - high[2]], [*(high[:2] + wall), top])
    larger = _coarser(offset_body(_in_mm(solid.tile, solid), clearance / 2))
    cut = united(_copies_above(solid, larger, turn, deep)) ^ deep
    bottom = cut.bounding_box()[2] - floor
    block = _box([*(low[:2] - wall), bottom], [*(high[:2] + wall), top])
    notes = list[str]()
    if not leaving.is_free:
        cut = cut + lifted(moved_body(larger, turn), top + 1.0)
        notes.append(
            f"Where a copy is lifted out, {100 * leaving.blocked:.2g} % of it meet what is around: "
            "the block was opened for it."
        )
    remains = (block - cut).decompose()
    base = max(remains, key=lambda body: body.volume())
    tile = moved_body(offset_body(_in_mm(solid.tile, solid), -clearance / 2), turn)
    parts = _all_on_bed({"starting block": base, "tile": tile})
    notes += print_advice(parts["starting block"], name="The starting block").sentences
    colours = {"starting block": "#d9d3c7", "tile": STACK_PALETTE.fill(0)}
    return PrintedParts(parts, colours, notes, fixed=True)


def _copies_above(
    solid: EscherSolid, body: Manifold, turn: Array, block: Manifold
) -> list[Manifold]:
    """Return the copies of a body, itself too, that meet a block and are not below the tile."""
    center, up = solid.tile.centroid, turn[2]
    box = np.reshape(block.bounding_box(), (2, 3)) / solid.millimetres
    radius = float(np.linalg.norm(solid.tile.points - center, axis=1).max())
    reach = radius + float(np.linalg.norm(box - turn @ center, axis=1).max())
    placed = [
        moved_body(body, turn @ g.linear, solid.millimetres * turn @ g.translation)
        for g in solid.group.elements_near(center, reach, source=center)
        if (g.linear @ center + g.translation - center) @ up > -1e-6 * radius
    ]
    return [copy for copy in placed if _meet(copy, block)]


def make_puzzle(
    solid: EscherSolid,
    *,
    copies: int = 8,
    clearance: float = CLEARANCE,
    wall: float = WALL,
    floor: float = FLOOR,
    assembled: bool = False,
) -> PrintedParts:
    """Return copies to put together, and an open box in which they sit when they are.

    The box's inside is cut by the pieces themselves, and open upwards: in the direction in which
    copies are best drawn out of a stack.

    Args:
        solid: A tile that fills space.
        copies: How many pieces.
        clearance: The gap in mm between pieces, and between them and the box.
        wall, floor: The thickness in mm of the box.
        assembled: Leave the pieces in the box; else they lie beside it, each as it is best printed.
    """
    pieces = Pieces(solid.group, solid.tile, clearance / solid.millimetres)
    stack = stack_of(solid.group, solid.tile, copies)
    assembly = pieces.assembly(stack)
    direction, notes = _box_direction(pieces, stack, assembly)
    turn = _upwards(direction)
    mesh = _in_mm(solid.tile, solid)
    smaller = offset_body(mesh, -clearance / 2)
    room = united(_placed(_coarser(offset_body(mesh, clearance / 2)), stack, solid, turn))
    corners = np.array(room.bounding_box()).reshape(2, 3)
    height = BOX_HEIGHT * (corners[1, 2] - corners[0, 2])
    outer = [corners[0] - (wall, wall, floor), [*(corners[1, :2] + wall), corners[0, 2] + height]]
    box = _box(*outer) - _coarser(lifted(room, corners[1, 2] + 1.0))
    box = max(box.decompose(), key=lambda body: body.volume())
    placed = _placed(smaller, stack, solid, turn)
    names = [f"piece {k}" for k in range(1, copies + 1)]
    parts = {"box": box, **dict(zip(names, placed, strict=True))}
    if not assembled:
        parts = {"box": box, **_beside(box, smaller, stack, lying(mesh), names)}
    colours = {"box": "#d9d3c7"}
    for name, copy in zip(names, stack, strict=True):
        colours[name] = STACK_PALETTE.fill(colour_number(solid.group, copy))
    parts = _all_on_bed(parts)
    notes = [assembly.words, *notes, *print_advice(parts["box"], name="The box").sentences]
    return PrintedParts(parts, colours, notes, fixed=assembled)


def _box_direction(
    pieces: Pieces, stack: Sequence[StackedCopy], assembly: Assembly
) -> tuple[Array, list[str]]:
    """Return where up is for a box, in which all pieces are put in from above if they can be."""
    leaving = pieces.leaving_stack().direction
    out = -np.sum([step.direction for step in assembly.steps[1:]], axis=0)
    tried = [leaving] if np.linalg.norm(out) < 0.5 else [out / np.linalg.norm(out), leaving]
    tried += [-step.direction for step in assembly.steps[1:3]]
    for direction in [] if assembly.is_interlocked else tried:
        if pieces.order_along(stack, direction) is not None:
            return direction, ["In the box they are put in one by one, straight from above."]
    return leaving, ["In the box not all of them go in straight from above."]


def _in_mm(mesh: Mesh, solid: EscherSolid) -> Mesh:
    return Mesh(solid.millimetres * mesh.points, mesh.faces)


def _placed(
    body: Manifold, stack: Sequence[StackedCopy], solid: EscherSolid, turn: Array
) -> list[Manifold]:
    """Return the copies of a body in mm, turned."""
    return [
        moved_body(body, turn @ copy.linear, solid.millimetres * turn @ copy.shift)
        for copy in stack
    ]


def _upwards(direction: Array) -> Array:
    """Return the rotation (3, 3) that takes a direction up."""
    up = direction / np.linalg.norm(direction)
    aside = np.cross(up, np.eye(3)[np.abs(up).argmin()])
    aside /= np.linalg.norm(aside)
    return np.stack([aside, np.cross(up, aside), up])


def _coarser(body: Manifold) -> Manifold:
    """Return a body with fewer triangles whose surface has hardly moved."""
    coarse = body.simplify(GRAIN)
    return body if coarse.is_empty() else coarse


def _box(low: Sequence[float] | Array, high: Sequence[float] | Array) -> Manifold:
    low, sides = np.asarray(low, float), np.asarray(high, float) - np.asarray(low, float)
    if sides.min() <= 0:
        raise OrbiflowError("the block has no height; choose a larger size")
    return Manifold.cube(sides.tolist()).translate(low.tolist())


def _meet(body: Manifold, other: Manifold) -> bool:
    (low, high), (its_low, its_high) = (
        np.array(body.bounding_box()).reshape(2, 3) for body in (body, other)
    )
    return bool((low < its_high).all() and (its_low < high).all())


def _corner(bodies: Sequence[Manifold]) -> Array:
    """Return the least corner (3,) of the box around bodies."""
    return np.array([body.bounding_box()[:3] for body in bodies]).min(axis=0)


def _on_bed(body: Manifold) -> Manifold:
    return body.translate((-_corner([body])).tolist())


def _all_on_bed(parts: dict[str, Manifold]) -> dict[str, Manifold]:
    shift = (-_corner(list(parts.values()))).tolist()
    return {name: body.translate(shift) for name, body in parts.items()}


def _beside(
    box: Manifold, tile: Manifold, stack: Sequence[StackedCopy], turn: Array, names: Sequence[str]
) -> dict[str, Manifold]:
    """Return pieces in rows beside a box, standing on its level; mirrored ones are mirror images."""
    mirror = np.diag([-1.0, 1.0, 1.0])
    kinds = [_on_bed(moved_body(tile, m @ turn)) for m in (np.eye(3), mirror)]
    step = np.array(kinds[0].bounding_box()[3:5]) + APART
    _, y, z, right, *_ = box.bounding_box()
    columns = int(np.ceil(np.sqrt(len(names))))
    placed = dict[str, Manifold]()
    for k, (name, copy) in enumerate(zip(names, stack, strict=True)):
        row, column = divmod(k, columns)
        place = (right + APART + column * step[0], y + row * step[1], z)
        placed[name] = kinds[copy.is_mirrored].translate(place)
    return placed
