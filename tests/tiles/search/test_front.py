"""The short list of a search for both: who is on the front, and who is left out."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.runtime import NEVER
from orbiflow.tiles import CLASSES, EscherTile, LikenessSearch
from orbiflow.tiles.search.bending import fit_bending
from orbiflow.tiles.search.both_search import behind, deformation, front_list, measured
from orbiflow.tiles.search.candidates import silent
from orbiflow.tiles.search.co_deformation import hands
from orbiflow.tiles.search.finished_tiles import best_tiles
from outlines import animal

SQUIRREL = animal("squirrel.dat")
QUICK = LikenessSearch(placements=40, held=8, starts=4, finalists=2, rounds=8, multiples=(2,))
HANDS = hands(SQUIRREL, QUICK)


@pytest.fixture(scope="module", name="bent")
def bent_fixture() -> list[EscherTile]:
    fit = fit_bending(SQUIRREL, CLASSES["IH4"], QUICK, HANDS, 1, silent, NEVER)
    return best_tiles(SQUIRREL, fit)


def like(
    one: EscherTile, stretch: float, deformation: float | None, iou: float, objective: str
) -> EscherTile:
    """The same tile made flat, so that no two with different stretches are alike."""
    tile = one.normal_tile
    flat = replace(tile, polygon=tile.polygon * (np.exp(stretch), np.exp(-stretch)))
    return replace(
        one,
        normal=flat,
        deformation=deformation,
        metrics=replace(one.metrics, iou=iou),
        objective=objective,
    )


def test_the_front_and_what_is_near_it(bent: list[EscherTile]) -> None:
    values = [
        (0.0, 0.20, 0.70, "likeness"),  # on the front
        (0.2, 0.10, 0.60, "likeness"),  # least deformation
        (0.4, 0.30, 0.65, "likeness"),  # beaten by far
        (0.6, 0.21, 0.69, "likeness"),  # beaten by a little
        (0.8, 0.60, 0.90, "overlap"),  # the largest overlap
        (1.0, 0.90, 0.80, "overlap"),  # beaten by far
    ]
    results = [like(bent[0], *value) for value in values]
    chosen = front_list(results)
    assert [(r.deformation, r.front) for r in chosen] == [
        (0.20, True),
        (0.10, True),
        (0.21, False),
        (0.60, True),
    ]


def test_of_two_alike_one_is_left(bent: list[EscherTile]) -> None:
    values = [(0.0, 0.20, 0.70, "likeness"), (0.02, 0.19, 0.69, "likeness")]
    values += [(0.5, 0.10, 0.50, "likeness"), (0.9, 0.50, 0.9, "overlap")]
    chosen = front_list([like(bent[0], *value) for value in values])
    assert [r.deformation for r in chosen] == [0.20, 0.10, 0.50]


MANY_ALIKE = st.tuples(
    st.sampled_from((0.0, 0.02, 0.04, 0.3, 0.32, 0.8)),
    st.sampled_from((0.1, 0.11, 0.12, 0.2, 0.5)),
    st.sampled_from((0.6, 0.61, 0.62, 0.7, 0.9)),
    st.sampled_from(("likeness", "overlap")),
)


def test_the_ends_are_listed_and_flags_are_of_what_is_listed(bent: list[EscherTile]) -> None:
    # an end was left out if it was like the other one, and others were then said to be beaten by it
    @settings(max_examples=40, deadline=None)
    @given(st.lists(MANY_ALIKE, min_size=1, max_size=16))
    def check(values: list[tuple[float, float, float, str]]) -> None:
        chosen = front_list([like(bent[0], *value) for value in values])
        points = [(r.deformation or 0.0, r.metrics.iou) for r in chosen]
        assert min((cost, -iou) for _, cost, iou, _ in values) in [(c, -iou) for c, iou in points]
        assert min((-iou, cost) for _, cost, iou, _ in values) in [(-iou, c) for c, iou in points]
        for result, (cost, iou) in zip(chosen, points, strict=True):
            others = [point for point in points if point != (cost, iou)]
            beaten = any(c <= cost and other >= iou for c, other in others)
            assert result.front == (not beaten)

    check()


def test_never_more_than_twelve(bent: list[EscherTile]) -> None:
    many = [like(bent[0], 0.15 * k, 0.1 + 0.01 * k, 0.5 + 0.01 * k, "likeness") for k in range(20)]
    chosen = front_list(many)
    assert len(chosen) == 12
    assert all(r.front for r in chosen)
    assert chosen[0].deformation == many[0].deformation
    assert chosen[-1].deformation == many[-1].deformation


def test_the_first_of_each_search_is_listed(bent: list[EscherTile]) -> None:
    values = [(0.0, 0.9, 0.5, "likeness"), (0.3, 0.1, 0.9, "likeness"), (0.6, 0.8, 0.4, "overlap")]
    chosen = front_list([like(bent[0], *value) for value in values])
    assert [r.front for r in chosen] == [False, True, False]


def test_forced_tiles_without_a_deformation_come_last(bent: list[EscherTile]) -> None:
    odd = like(bent[0], 0.0, None, 0.5, "overlap")
    chosen = front_list([like(bent[0], 0.0, 0.3, 0.6, "likeness"), odd])
    assert [r.front for r in chosen] == [True, False]
    assert [r.front for r in front_list([odd])] == [False]
    assert front_list([]) == []


def test_behind_counts_from_the_nearest_that_is_better() -> None:
    rng = np.random.default_rng(3)
    cost, overlap = rng.random(40) + 0.1, rng.random(40)
    late = behind(cost, overlap)
    front = late == 0
    for k in range(40):
        better = (cost < cost[k]) & (overlap > overlap[k])
        assert front[k] == (not better.any())
        near = (cost > cost[k] * (1 - late[k] - 1e-9)) & (
            overlap < overlap[k] + 0.2 * late[k] + 1e-9
        )
        assert front[k] or (near & better & front).any()
    assert behind(np.array([1.0, 1.0]), np.array([0.5, 0.6]))[0] == pytest.approx(0.5)
    assert len(behind(np.zeros(0), np.zeros(0))) == 0


def test_the_measure_finds_what_the_search_found(bent: list[EscherTile]) -> None:
    """From the polygon alone, without the correspondence that the search knows."""
    for result in bent:
        assert result.deformation is not None
        found = deformation(HANDS[0], result.normal_tile.polygon)
        assert found < 1.1 * result.deformation
        assert found > 0.3 * result.deformation
        # neither where the ring begins nor its sense matters
        turned = np.roll(result.normal_tile.polygon, 17, axis=0)[::-1]
        assert deformation(HANDS[0], turned) == pytest.approx(found, rel=0.1)
        least = measured(result, HANDS[0]).deformation
        assert least == min(found, result.deformation)


def test_the_silhouette_itself_costs_nothing() -> None:
    assert deformation(HANDS[0], SQUIRREL.normal) < 0.002
    assert deformation(HANDS[0], 1.1 * SQUIRREL.normal) < 0.004
