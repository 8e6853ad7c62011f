"""What lies on each of the printer's plates: one figure or two, a puzzle, a test of fits."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import shapely
from manifold3d import Manifold

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.make import dice, fit_clearances, two_neighbours
from orbiflow.tiles.solids.sections import CrossSection, stacked
from orbiflow.tiles.solids.shapes import SHAPES, ClosedBody, Plan, tile_body
from orbiflow.tiles.tilings import Copies

MOST_PIECES = 400  # of a puzzle, so that its files stay below some 100 MB
APART = 3.0  # distance in mm of parts on the bed

Plate = dict[str, ClosedBody]
"""Bodies by name that are printed together, seen from above."""


def plates_of(plans: Sequence[Plan]) -> tuple[Plate, ...]:
    """Return the plates of what is made of one or two figures, from the corner of the bed, z up.

    What a cutter, stamp or mould makes is seen from its other side: they are mirrored, so that it
    looks like the tile.
    """
    settings = plans[0].settings
    across = 1.0
    if settings.fit_test:
        plates = _fit_test(plans)
    elif settings.kind == "puzzle":
        plates = _puzzle(plans)
    else:
        across = 1.0 if settings.kind == "tile" else -1.0
        plates = [_side_by_side(plans, across)]
    return tuple(_on_the_bed(plate, across) for plate in plates)


def _on_the_bed(plate: Plate, across: float) -> Plate:
    """Return a plate with y up that begins at the bed's corner."""
    turned = [
        body.changed(lambda manifold: manifold.scale((across, -1.0, 1.0)))
        for body in plate.values()
    ]
    x, y = np.min([body.solid.bounding_box()[:2] for body in turned], axis=0)
    moved = [body.changed(lambda manifold: manifold.translate((-x, -y, 0.0))) for body in turned]
    return dict(zip(plate, moved, strict=True))


def _side_by_side(plans: Sequence[Plan], across: float) -> Plate:
    """Return a body for each figure, from left to right once x is multiplied by `across`."""
    kind, placed, right = plans[0].settings.kind, Plate(), 0.0
    for number, plan in enumerate(plans, 1):
        body = SHAPES[kind](plan)
        low, _, _, high, *_ = body.solid.bounding_box()
        left = low if across > 0 else -high
        figure = plan.layout.tile.figures[plan.number].figure.name
        name = kind if len(plans) == 1 else f"{kind} {number}, {figure}"
        placed[name] = _moved(body, (across * (right - left), 0.0))
        right += high - low + APART
    return placed


def _moved(body: ClosedBody, shift: Sequence[float]) -> ClosedBody:
    x, y = shift
    return body.changed(lambda manifold: manifold.translate((x, y, 0.0)))


def _puzzle(plans: Sequence[Plan]) -> list[Plate]:
    """Return a tray and its pieces: in it, or on plates of their own."""
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
    tray = ClosedBody(_tray(plan, copies.rings([figure_plan.ring for figure_plan in plans])))
    z = settings.floor if settings.assembled else 0.0
    pieces = _copied([tile_body(figure_plan) for figure_plan in plans], copies, z)
    named = {f"piece {k}": body for k, body in enumerate(pieces, 1)}
    if settings.assembled:
        return [{"tray": tray, **named}]
    return [{"tray": tray}, *_in_rows(named, settings.area)]


def _copied(kinds: Sequence[ClosedBody], copies: Copies, z: float) -> list[ClosedBody]:
    """Return a body of its kind for each copy, at a height."""
    moves = np.zeros((len(copies), 3, 4))
    moves[:, :2, :2] = copies.group.linear_parts[copies.cosets]
    moves[:, :2, 3], moves[:, 2, 2], moves[:, 2, 3] = copies.translations, 1.0, z
    numbers = copies.prototiles.tolist()
    return [
        kinds[k].changed(lambda manifold, move=move: manifold.transform(move))
        for k, move in zip(numbers, moves, strict=True)
    ]


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
    top = CrossSection(floor + settings.height / 2, walls)
    return stacked(
        CrossSection(0.0, around), CrossSection(floor, around), CrossSection(floor, walls), top
    )


def _in_rows(bodies: Mapping[str, ClosedBody], area: tuple[float, float]) -> Iterator[Plate]:
    """Yield plates no larger than an area with bodies apart in rows, as few as their boxes allow."""
    boxes = np.array([body.solid.bounding_box() for body in bodies.values()])
    boxes = boxes.reshape(-1, 2, 3)[:, :, :2]
    step = np.ptp(boxes, axis=1).max(axis=0) + APART
    columns, rows = np.maximum((np.array(area) + APART) // step, 1).astype(int).tolist()
    if len(bodies) <= columns * rows:  # a square, rather than one long row
        columns = min(columns, math.ceil(math.sqrt(len(bodies) * step[1] / step[0])))
    plate = Plate()
    for k, (name, body) in enumerate(bodies.items()):
        row, column = divmod(k % (columns * rows), columns)
        plate[name] = _moved(body, np.array([column, row]) * step - boxes[k, 0])
        if len(plate) == columns * rows:
            yield plate
            plate = Plate()
    if plate:
        yield plate


def _fit_test(plans: Sequence[Plan]) -> list[Plate]:
    """Return two neighbours at each of several clearances, with the number of each in dots."""
    settings, pair = plans[0].settings, two_neighbours(plans[0].layout.page.tiling)
    plate = Plate()
    for number, clearance in enumerate(fit_clearances(settings.clearance), 1):
        adjusted = settings.replace(clearance=clearance)
        kinds = list[ClosedBody]()
        for plan in plans:
            face = plan.piece.buffer(-settings.chamfer - settings.nozzle)
            marked = plan._replace(settings=adjusted, drawing=dice(face, number))
            kinds.append(tile_body(marked))
        for side, body in zip("ab", _copied(kinds, pair, 0.0), strict=True):
            plate[f"pair {number}{side}, {clearance:.3g} mm"] = body
    return list(_in_rows(plate, settings.area))
