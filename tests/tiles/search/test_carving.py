"""Tiles that climb to a higher mark."""

import contextlib
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import shapely

from orbiflow.arrays import Array, Complex
from orbiflow.tiles import CLASSES, Pins, complex_points, isohedral_class, plane_points, signed_area
from orbiflow.tiles.likeness import Elastic, Stiffness, kept_of
from orbiflow.tiles.search import Goal, TileSpace, bending, best_placements
from orbiflow.tiles.search.bending import Bent, bent_tiles
from orbiflow.tiles.search.carving import (
    MAX_BEHIND,
    WRINKLE_COST,
    BehindError,
    Carved,
    Laid,
    Race,
    carved,
)
from orbiflow.tiles.search.co_deformation import BentTiles, held_on_tiles
from outlines import SMALL, animal, squirrel_orientations

PLAIN = replace(SMALL, carved=0)


def bend(name: str) -> tuple[Elastic, TileSpace, BentTiles]:
    kind, body = isohedral_class(name), squirrel_orientations()[0].made("coarse", Stiffness())
    own = best_placements(kind, body.rest[: body.size], 1)
    space = TileSpace(kind, own)
    return body, space, held_on_tiles(body, space, body.rest[:, None], 8)


def uncarved(body: Elastic, tiles: BentTiles) -> Carved:
    """The first of bent tiles as it is before it is carved."""
    own = tiles.placements
    corners = (np.cumsum(own.lengths[0]) - own.lengths[0] + own.starts[0]) % body.size
    ring = tiles.points[: body.size, 0]
    return Carved(ring, np.arange(body.size), corners, tiles.linear[0], tiles.offset[0])


def test_what_is_carved_is_a_better_tile_of_its_placement() -> None:
    body, space, tiles = bend("IH69")  # with a mirror
    bent = uncarved(body, tiles)
    before, (found,) = bent.ring, carved(body, space, [bent])
    check_tile(body, space, before, found)
    check_points(body, space, found)
    # and it is no rougher than the points on it
    points, ring, smooth = (_turning(z) for z in (found.outline, found.ring, before))
    assert ring < 1.15 * points
    assert ring < 1.5 * smooth


def check_tile(body: Elastic, space: TileSpace, before: Complex, found: Carved) -> None:
    """Check that a carved tile belongs to its space and has a higher mark than before."""
    nearest = space.nearest(found.ring[None])
    assert abs(space.in_order(nearest.vertices)[0] - found.ring).max() < 1e-6
    assert nearest.linear[0] == pytest.approx(found.linear, abs=1e-5)
    outlines = before, found.outline
    marks = [kept_of(body.measures, z, 0.0).mark for z in outlines]
    laid = (before, np.arange(body.size)), (found.ring, found.places)
    wrinkles = [body.measures.wrinkles(*own)[0] for own in laid]
    gain = marks[1] - marks[0] + WRINKLE_COST * (wrinkles[0] - wrinkles[1])
    assert gain > 0.05
    assert signed_area(plane_points(found.ring)) > 0.2


def check_points(body: Elastic, space: TileSpace, found: Carved) -> None:
    """Check that points slide in order and meet the corners."""
    n, own = body.size, space.placements
    steps = np.diff(np.append(found.places, found.places[0] + n))
    assert steps.min() > 0.05
    assert abs(steps - 1).max() > 0.1
    corners = (np.cumsum(own.lengths[0]) - own.lengths[0] + own.starts[0]) % n
    assert abs(found.outline[found.corners] - found.ring[corners]).max() < 1e-12
    apart = shapely.distance(
        shapely.points(plane_points(found.outline)), shapely.LinearRing(plane_points(found.ring))
    )
    assert apart.max() < 1e-12


def _turning(z: Complex) -> float:
    steps = np.roll(z, -1) - z
    return float(abs(np.angle(steps * np.conj(np.roll(steps, 1)))).sum())


@pytest.mark.parametrize("smooth", [False, True])
def test_gradients_of_laid_points(smooth: bool) -> None:
    rng = np.random.default_rng(3)
    ring, along = (complex_points(rng.normal(size=(12, 2))) for _ in range(2))
    places = np.arange(12) + rng.uniform(-0.4, 0.4, 12)
    lay = Laid.smoothly if smooth else Laid.straight

    def value(ring: Complex, places: Array) -> float:
        return float((np.conj(along) * lay(places).points(ring)).sum().real)

    laid = lay(places)
    for k, step in product(range(12), (1e-6, 1e-6j)):
        change = value(ring + step * (np.arange(12) == k), places) - value(ring, places)
        expected = (np.conj(laid.gradient(along)[k]) * step).real
        assert change == pytest.approx(expected, abs=1e-11)
    for k in range(12):
        change = value(ring, places + 1e-6 * (np.arange(12) == k)) - value(ring, places)
        assert change / 1e-6 == pytest.approx(laid.slide_gradient(ring, along)[k], abs=1e-4)
    assert abs(lay(np.arange(12.0)).points(ring) - ring).max() < 1e-14


def test_tiles_that_cross_themselves_are_carved_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a spider, whose bent tiles of this class all do."""
    both, kind = SMALL.orientations(Goal(animal("nagata/spider_120.dat"))), CLASSES["IH4"]

    def found() -> tuple[list[Bent], int]:
        return bent_tiles(both, kind, SMALL)

    tiles, crossed = found()
    monkeypatch.setattr(bending, "MAX_REPAIRED", 0)
    assert found() == ([], crossed)
    assert tiles[0].score > 0.4
    for bent in tiles:
        assert shapely.Polygon(plane_points(bent.tile.ring)).is_valid


def test_parts_that_are_pinned_are_not_carved() -> None:
    target = animal("squirrel.dat")
    pins = Pins.at(target, [(400.0, 450.0)])
    found = [
        bent_tiles(own.orientations(Goal(target, pins=pins))[:1], CLASSES["IH4"], own)[0]
        for own in (PLAIN, SMALL)
    ]
    assert np.array_equal(found[0][0].points, found[1][0].points)


def goes_on(race: Race, cost: float) -> bool:
    """Return whether a tile with this cost stays in a race."""
    with contextlib.suppress(BehindError):
        race.enter(cost)
        return True
    return False


def test_who_is_far_behind_after_so_many_steps_is_given_up() -> None:
    race = Race()
    costs = 1.0, 1.0 + 2 * MAX_BEHIND, 1.0 + MAX_BEHIND / 2, 0.5, 1.0
    assert [goes_on(race, cost) for cost in costs] == [True, False, True, True, False]


def test_a_race_changes_nothing_for_who_is_not_behind() -> None:
    body, space, tiles = bend("IH4")
    bent, race = uncarved(body, tiles), Race()
    alone, *others = (carved(body, space, [bent], race=own)[0] for own in (None, race, race))
    assert all((other.ring == alone.ring).all() for other in others)
