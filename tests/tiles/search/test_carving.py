"""Tiles that climb to a higher mark."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orbiflow.tiles import CLASSES, Pins, isohedral_class, plane_points, signed_area
from orbiflow.tiles.likeness import Elastic, kept_of
from orbiflow.tiles.search.bending import bent_tiles
from orbiflow.tiles.search.carving import WRINKLE_COST, carved
from orbiflow.tiles.search.co_deformation import BentTiles, hands, held_on_tiles
from orbiflow.tiles.search.tile_space import TileSpace, best_placements
from outlines import SMALL, animal, squirrel_hands

PLAIN = replace(SMALL, carved=0)
NAMES = (*CLASSES, "IH8", "IH12", "IH69")  # with a half-turn and mirrors of their own


def bend(name: str) -> tuple[Elastic, TileSpace, BentTiles]:
    kind, body = isohedral_class(name), squirrel_hands()[0].fine
    own = best_placements(kind, body.rest[: body.size], 1)
    space = TileSpace(kind, own)
    return body, space, held_on_tiles(body, space, body.rest[:, None], 8)


@pytest.mark.parametrize("name", NAMES)
def test_what_is_carved_is_a_tile_of_its_placement(name: str) -> None:
    body, space, tiles = bend(name)
    found, n = carved(body, space, tiles.points[:, 0]), body.size
    before, after = tiles.points[:n, 0], found.points[:n, 0]
    nearest = space.nearest(after[None])
    assert abs(space.in_order(nearest.vertices)[0] - after).max() < 1e-6
    assert nearest.linear[0] == pytest.approx(found.linear[0], abs=1e-5)
    marks = [kept_of(body.measures, z, 0.0).mark for z in (before, after)]
    wrinkles = [body.measures.wrinkles(z)[0] for z in (before, after)]
    gain = marks[1] - marks[0] + WRINKLE_COST * (wrinkles[0] - wrinkles[1])
    assert gain > 0.05
    assert signed_area(plane_points(after)) > 0.2


@pytest.mark.parametrize("name", ["IH1", "IH4", "IH6"])
def test_a_search_that_carves_has_better_tiles(name: str) -> None:
    plain, best = (
        bent_tiles(squirrel_hands()[:1], CLASSES[name], settings)[0] for settings in (PLAIN, SMALL)
    )
    assert best[0].score >= plain[0].score
    assert best[0].fidelity.mark > plain[0].fidelity.mark + 0.1
    again = bent_tiles(squirrel_hands()[:1], CLASSES[name], SMALL)[0]
    assert np.array_equal(again[0].points, best[0].points)


def test_parts_that_are_pinned_are_not_carved() -> None:
    target = animal("squirrel.dat")
    pins = Pins.at(target, [(400.0, 450.0)])
    found = [
        bent_tiles(hands(target, own, pins=pins)[:1], CLASSES["IH4"], own)[0]
        for own in (PLAIN, SMALL)
    ]
    assert np.array_equal(found[0][0].points, found[1][0].points)
