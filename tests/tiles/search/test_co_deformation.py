"""A silhouette that bends until it is a tile, and corners that move to where they best lie."""

from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.arrays import Array, Complex
from orbiflow.runtime import Cancel, Cancelled
from orbiflow.tiles import (
    CLASSES,
    LikenessSearch,
    certify,
    complex_points,
    plane_points,
    resampled,
    signed_area,
)
from orbiflow.tiles.geometry import apart
from orbiflow.tiles.likeness import Elastic
from orbiflow.tiles.search import (
    Goal,
    Placements,
    TileSpace,
    bending,
    best_placements,
    co_deformation,
)
from orbiflow.tiles.search.bending import TWIN_DISTANCE, bent_tiles
from orbiflow.tiles.search.co_deformation import _moves, drawn_to_tiles, held_on_tiles, shifted
from outlines import SMALL, animal, bent_squirrel, squirrel_orientations
from strategies import seeds

RING = resampled(animal("squirrel.dat").normal, 60)
BODY = Elastic(RING)


@cache
def placements(name: str, count: int = 10) -> Placements:
    return best_placements(CLASSES[name], complex_points(RING), count)


def objective(body: Elastic, z: Complex) -> Array:
    copies, _ = body.copies(z)
    return body.energy(z) + body.stiffness.pose * (abs(z - copies) ** 2).mean(axis=0)


def off_the_space(space: TileSpace, z: Complex) -> float:
    outlines = z[: space.size].T
    return float(abs(space.in_order(space.nearest(outlines).vertices) - outlines).max())


@pytest.mark.parametrize("name", ["IH1", "IH5", "IH21", "IH28"])
def test_the_energy_never_grows(name: str) -> None:
    z, space = drawn_to_tiles(BODY, CLASSES[name], placements(name))
    z = held_on_tiles(BODY, space, z, 1).points  # on the tiles
    before = objective(BODY, z)
    for _ in range(12):
        tiles = held_on_tiles(BODY, space, z, 1)
        z = tiles.points
        assert off_the_space(space, z) < 1e-7
        after = objective(BODY, z)
        assert (after <= before * (1 + 1e-7) + 1e-12).all()
        before = after
    assert tiles.linear.shape == (10, 2, 2)
    assert tiles.offset.shape == (10, 2)


@pytest.mark.parametrize("name", ["IH1", "IH5", "IH21", "IH28"])
@settings(max_examples=4)
@given(seed=seeds)
def test_a_tile_stays_as_it_is(name: str, seed: int) -> None:
    """An outline that is a tile already: nothing has to bend."""
    body, own = a_tile(name)
    space = TileSpace(CLASSES[name], own)
    rng = np.random.default_rng(seed)
    z = body.rest[:, None] + 0.005 * rng.normal(size=(len(body), 1))
    tiles = held_on_tiles(body, space, z, 200)
    assert body.energy(tiles.points)[0] < 1e-6
    assert objective(body, tiles.points)[0] < 1e-6
    assert body.displacement(tiles.points)[0] < 1e-6


@pytest.mark.parametrize(
    ("name", "mirrored"), [*((name, False) for name in CLASSES), ("IH4", True), ("IH21", True)]
)
def test_bent_squirrels_certify(name: str, mirrored: bool) -> None:
    case = bent_squirrel(name, mirrored)
    bent, n = case.bent, case.bent.orientation.fine.size
    assert bent.orientation.mirrored == mirrored
    certificate = certify(case.tile)
    assert certificate.valid
    ring = case.images[:n]
    assert abs(abs(signed_area(ring)) - abs(case.tile.signed_area)) < 0.01
    apart = shapely.distance(shapely.points(ring), shapely.LinearRing(case.tile.polygon))
    assert apart.max() < 1e-3


def test_finalists_are_in_order_and_told() -> None:
    shares: list[float] = []
    several = replace(SMALL, finalists=3, multiples=(2,))
    own = several.orientations(Goal(animal("squirrel.dat"))), CLASSES["IH5"], several
    found, dropped = bent_tiles(*own, shares.append)
    assert shares == sorted(shares)
    assert 0 < shares[0] < shares[-1] < 1
    scores = [bent.fidelity.score for bent in found]
    assert scores == sorted(scores, reverse=True)
    assert 1 <= len(found) <= 3
    assert dropped <= 3
    again, _ = bent_tiles(*own)
    assert [bent.fidelity.score for bent in again] == scores


def test_a_class_is_given_up_where_most_shapes_cross_themselves(monkeypatch) -> None:
    several = replace(SMALL, starts=4, finalists=2, carved=2)
    own = squirrel_orientations(), CLASSES["IH5"], several
    monkeypatch.setattr(bending, "MAX_CROSSED_SHARE", -0.1)
    assert bent_tiles(*own, may_give_up=True) == ([], 0)
    assert bent_tiles(*own)[0]


def test_finalists_are_the_best_of_all_bodies_and_no_twins() -> None:
    """No two alike; and the best of all bodies together is about as good as that of most alone."""
    several = replace(SMALL, starts=6, finalists=3, carved=0)
    own = squirrel_orientations()[:1], CLASSES["IH4"]
    found, _ = bent_tiles(*own, several)
    assert len(found) > 1
    pairs = combinations([bent.tile.ring for bent in found], 2)
    assert all(apart(one, other) > TWIN_DISTANCE for one, other in pairs)
    alone = [bent_tiles(*own, replace(several, bodies=(body,)))[0] for body in several.bodies]
    best = [max((bent.fidelity.mark for bent in tiles), default=-np.inf) for tiles in alone]
    assert found[0].fidelity.mark > sorted(best)[1] - 0.05


def test_symmetric_tiles_are_searched_with_half_the_work() -> None:
    whole = LikenessSearch(placements=9, held=8, starts=5)
    half = whole.of_class(symmetric=True)
    assert (half.placements, half.held, half.starts) == (5, 4, 3)
    assert whole.of_class(wanted=4).finalists == 4


def at_rest(body: Elastic, count: int) -> np.ndarray:
    return np.repeat(body.rest[:, None], count, axis=1)


@cache
def a_tile(name: str) -> tuple[Elastic, Placements]:
    """A body whose outline is a tile, and its placement."""
    kind = CLASSES[name]
    space = TileSpace(kind, best_placements(kind, complex_points(RING), 40))
    found = space.nearest(np.tile(complex_points(RING), (40, 1)))
    rings = plane_points(space.in_order(found.vertices))
    sound = shapely.is_valid(shapely.polygons(rings)) & (signed_area(rings) > 0.3)
    sound &= (space.placements.lengths >= 3).all(axis=1) & (np.linalg.det(found.linear) > 1e-3)
    chosen = np.flatnonzero(sound)[:1]
    ring = rings[chosen[0]] / np.sqrt(signed_area(rings[chosen[0]]))
    return Elastic(ring), space.placements._replace(turns=space.turns).take(chosen)


@pytest.mark.parametrize("name", CLASSES)
@given(step=st.integers(1, 4))
def test_moves_keep_to_the_class(name: str, step: int) -> None:
    kind = CLASSES[name]
    lengths, starts = _moves(kind, step)
    assert (lengths.sum(axis=1) == 0).all()
    for pair in kind.identified_edges:
        assert (lengths[:, pair.first] == lengths[:, pair.second]).all()
    both = np.column_stack([lengths, starts])
    assert len(np.unique(both, axis=0)) == len(both)
    assert {(-step,), (step,)} <= {
        (int(s),) for s, change in zip(starts, lengths, strict=True) if not change.any()
    }


@pytest.mark.parametrize("name", CLASSES)
@settings(max_examples=3)
@given(seed=seeds)
def test_corners_find_back_to_a_tile(name: str, seed: int) -> None:
    """An outline that is a tile: from corners moved by a step they return."""
    body, own = a_tile(name)
    lengths, starts = _moves(CLASSES[name], 1)
    back = {
        (*change, start)
        for change, start in zip((-lengths).tolist(), (-starts).tolist(), strict=True)
    }
    ways = [k for k, change in enumerate(lengths.tolist()) if (*change, int(starts[k])) in back]
    way = ways[seed % len(ways)]
    away = own._replace(
        lengths=own.lengths + lengths[way], starts=(own.starts + starts[way]) % body.size
    )
    found = shifted(body, CLASSES[name], away, at_rest(body, 1), 1, share=1.0)
    assert (found.placements.lengths == own.lengths).all()
    assert found.placements.starts == own.starts


@pytest.mark.parametrize("share", [0.2, 1.0])
@pytest.mark.parametrize("name", ["IH1", "IH4", "IH5", "IH21"])
def test_no_placement_becomes_worse(name: str, share: float) -> None:
    kind = CLASSES[name]
    placements = best_placements(kind, complex_points(RING), 12)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(co_deformation, "MAX_MOVES", 0)
        stay = shifted(BODY, kind, placements, at_rest(BODY, 12), 1, share=share)
    gone = shifted(BODY, kind, placements, at_rest(BODY, 12), 2, share=share)
    gone = shifted(BODY, kind, gone.placements, gone.points, 1, share=share)
    assert (np.diff(gone.costs) >= 0).all()
    assert gone.costs[0] <= stay.costs[0]
    assert gone.costs[0] < 0.999 * stay.costs[0] or name in ("IH1", "IH2", "IH3", "IH7", "IH28")
    assert (gone.placements.lengths.sum(axis=1) == BODY.size).all()
    corners = np.column_stack([gone.placements.lengths, gone.placements.starts])
    assert len(np.unique(corners, axis=0)) == len(corners)


def test_it_can_be_cancelled() -> None:
    cancel = Cancel()
    cancel.cancel()
    placements = best_placements(CLASSES["IH4"], complex_points(RING), 2)
    with pytest.raises(Cancelled):
        shifted(BODY, CLASSES["IH4"], placements, at_rest(BODY, 2), 1, share=1.0, cancel=cancel)
