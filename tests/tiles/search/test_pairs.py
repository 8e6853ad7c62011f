"""Two silhouettes in one tiling: glues, placements, bodies of two parts, and certified pairs."""

from functools import cache
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.arrays import Array, Complex
from orbiflow.runtime import Cancel, Cancelled, Event, Progress
from orbiflow.tiles import (
    CLASSES,
    IsohedralClass,
    certify,
    complex_points,
    isohedral_class,
    plane_points,
    resampled,
)
from orbiflow.tiles.likeness import Elastic
from orbiflow.tiles.search import Goal, gluing
from orbiflow.tiles.search.bending import unlike
from orbiflow.tiles.search.glued_body import Couple, Glue, GluedBody
from orbiflow.tiles.search.gluing import Glued, _gains, _Tables, glues, placements, sums_along
from orbiflow.tiles.search.likeness_search import rounded_goals
from orbiflow.tiles.search.pair_search import PairSearch, search_pair
from orbiflow.tiles.search.pairs import BentPair, bent, carved_pair, finer, moved
from orbiflow.tiles.search.tile_space import _gains as every_gain
from orbiflow.tiles.search.tile_space import edge_lengths
from outlines import animal
from small_pairs import FEW, NAMES, small_pairs
from strategies import seeds

NINE = [isohedral_class(name) for name in CLASSES]
SMALL = PairSearch(**FEW)


def rings() -> tuple[Array, Array]:
    """Two silhouettes of area 1."""
    one, two = (np.asarray(animal(name).normal) for name in NAMES)
    return one, two


def parts(count: int = 24) -> tuple[Elastic, Elastic]:
    one, two = (Elastic(resampled(ring, count)) for ring in rings())
    return one, two


@given(seeds, st.integers(4, 9), st.integers(4, 9), st.booleans(), st.booleans())
def test_sums_are_looked_up(seed: int, n: int, m: int, flips: bool, back: bool) -> None:
    rng = np.random.default_rng(seed)
    one, two = (complex_points(rng.normal(size=(k, 2))) for k in (n, m))
    found = sums_along(one, two, flips=flips, back=back)
    k, a, b = (int(rng.integers(size)) for size in found.shape)
    own, other = (np.arange(k) + a) % n, (b + (-1 if back else 1) * np.arange(k)) % m
    expected = ((one if flips else np.conj(one))[own] * two[other]).sum()
    assert found[k, a, b] == pytest.approx(expected, abs=1e-12)


def test_glues_say_how_far_the_outlines_are_apart() -> None:
    one, two = (part.rest[: part.size] for part in parts())
    found = glues(one, two, 20)
    assert found == sorted(found)
    assert len({own.glue for own in found}) == len(found) == 20
    unit = np.mean([abs(np.roll(z, -1) - z) ** 2 for z in (one, two)])
    for own in found:
        path, other = GluedBody(parts(), own.glue).path(one, two)
        steps, back = np.diff(path), np.diff(other)
        turned = back * np.exp(1j * np.angle(np.vdot(back, steps)))
        assert own.missed * unit >= (abs(steps - turned) ** 2).sum() - 1e-9  # and the overlap


@pytest.mark.parametrize("kind", NINE, ids=CLASSES)
def test_the_best_placement_is_the_best_of_all(kind: IsohedralClass) -> None:
    body = GluedBody(parts(14), Glue(0, 3, 5))
    steps = np.diff(body.rest[: body.size], append=body.rest[:1])
    lengths = edge_lengths(kind, body.size)
    every, _ = every_gain(kind, steps, lengths, np.arange(body.size))
    alone = [own.edges[0] for own in kind.edge_classes if len(own.edges) == 1]
    merged = {edge + k for edge in alone for k in (0, 1) if edge + 1 in alone}
    long = [k for k in range(lengths.shape[1]) if k not in merged]
    every = every[(lengths[:, long] >= 2).all(axis=1)]
    gains, _ = _gains(kind, _Tables(steps))
    whole = float((abs(steps) ** 2).sum()) / 2
    assert gains.max() == pytest.approx(every.max() * whole, rel=1e-5)


def test_a_placement_keeps_what_its_residual_says() -> None:
    one, two = parts()
    body = GluedBody((one, two), Glue(2, 5, 6))
    union = body.rest[: body.size]
    found = placements(union, Glued(0.0, body.glue, 1.0), NINE, 0.01, 30)
    assert [own.residual for own in found] == sorted(own.residual for own in found)
    for own in found:
        assert own.corners.lengths.sum() == body.size
        assert (own.corners.lengths >= 1).all()
        assert own.residual >= 1.0 - 1e-4


@given(st.integers(0, 23), st.integers(0, 23), st.integers(3, 12))
def test_figures_keep_their_points_in_a_pair(first: int, second: int, length: int) -> None:
    one, two = parts()
    body = GluedBody((one, two), Glue(first, second, length))
    assert body.size == one.size + two.size - 2 * length
    assert sorted({*body.places[0], *body.places[1]}) == list(range(len(body)))
    path, other = body.path(*body.rings(body.rest))
    np.testing.assert_array_equal(path, other)
    assert len(np.unique(path)) == length + 1
    # all but the path is the outline of both, once around
    ring = body.rings(np.arange(len(body)).astype(complex))
    inner = set(np.arange(body.size, body.outer))
    outer = [k for own in ring for k in own.real.astype(int).tolist() if k not in inner]
    assert sorted({*outer}) == list(range(body.size))


@given(seeds)
def test_forces_are_those_of_the_energies_of_both(seed: int) -> None:
    body = GluedBody(parts(), Glue(1, 7, 5))
    rng = np.random.default_rng(seed)
    z = body.rest[:, None] + 0.02 * complex_points(rng.normal(size=(len(body), 1, 2)))
    way = complex_points(rng.normal(size=(len(body), 1, 2)))

    def energy(z: Complex) -> float:
        own = zip(body.figures, body.places, strict=True)
        return sum(
            float(part.energy(z[at])[0]) + part.stiffness.pose * _pose(part, z[at])
            for part, at in own
        )

    slope = 2 * (np.conj(body.matrix @ z - body.forces(z)) * way).sum().real
    step = 1e-5
    found = (energy(z + step * way) - energy(z - step * way)) / (2 * step)
    assert found == pytest.approx(slope, rel=1e-4, abs=1e-6)


def _pose(part: Elastic, z: Complex) -> float:
    copy, _ = part.copies(z)
    return float((abs(z - copy) ** 2).mean())


def test_processes_find_what_one_does() -> None:
    goals = [Goal(animal(name)) for name in NAMES]
    shares: list[float] = []

    def tell(event: Event) -> None:
        assert isinstance(event, Progress)
        shares.append(event.share)

    with small_pairs():
        found = search_pair(goals, SMALL.replace(workers=2), on_event=tell)
    assert [pair.marks for pair in found] == [pair.marks for pair in pairs()]
    assert [pair.glue for pair in found] == [pair.glue for pair in pairs()]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_a_background_stays_one_where_silhouettes_are_rounded_off() -> None:
    goals = [Goal(animal(NAMES[0])), Goal.background()]
    for share, rounded in rounded_goals(goals):
        assert [goal.is_background for goal in rounded] == [False, True]
        assert (rounded[0].target is goals[0].target) == (share == 0)


def test_nothing_is_found_where_no_glue_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gluing, "MOST_OVERLAP", -1.0)
    monkeypatch.setattr(gluing, "LOOKED_AT", 20)
    assert search_pair([Goal(animal(name)) for name in NAMES], SMALL) == []


def test_a_pair_search_can_be_cancelled() -> None:
    cancel = Cancel()
    cancel.cancel()
    with pytest.raises(Cancelled):
        search_pair([Goal(animal(name)) for name in NAMES], SMALL.replace(ratios=2), cancel=cancel)


@cache
def pairs() -> tuple[BentPair, ...]:
    """What a small search finds."""
    goals = [Goal(animal(name)) for name in NAMES]
    with small_pairs():
        return tuple(search_pair(goals, SMALL))


def test_a_search_finds_certified_pairs() -> None:
    assert pairs()
    scores = [pair.scores for pair in pairs()]
    assert scores == sorted(scores, reverse=True)
    for pair in pairs():
        assert certify(pair.tiling).valid
        assert len(pair.tiling.prototiles) == 2


def test_levels_and_moves_do_not_tear_a_pair() -> None:
    couple = Couple.of(*rings(), ratio=1.2, mirrored=True, count=40)
    one, two = couple.bodies(0)
    found = glues(one.rest[: one.size], two.rest[: two.size], 6)
    placed = [
        own
        for glued in found
        for own in placements(_union(one, two, glued.glue), glued, NINE, 0.02, 2)
    ]
    coarse = bent(couple, placed, 3)
    assert len(unlike(coarse, 3, BentPair.is_twin)) <= 3
    for pair, level in product(coarse, (1, 2)):
        more = finer(pair, level)
        np.testing.assert_allclose(*_outlines(more), atol=1e-9)
        assert more.body.size == pair.body.size * (2, 8)[level - 1]
    best = min(coarse, key=lambda pair: pair.cost)
    assert moved(best).cost <= best.cost * 1.05
    carved = carved_pair(best, 15)
    assert min(carved.marks) > min(best.marks)


def _union(one: Elastic, two: Elastic, glue: Glue) -> Complex:
    body = GluedBody((one, two), glue)
    return body.rest[: body.size]


def _outlines(pair: BentPair) -> tuple[Array, Array]:
    """Return the union's outline, and that of the nearest tile."""
    outline = pair.points[: pair.body.size]
    tile = pair.space.in_order(pair.space.nearest(outline[None]).vertices)[0]
    return plane_points(outline), plane_points(tile)
