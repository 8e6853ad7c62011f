"""A search that somebody watches: its tiles come early, and get better."""

import math
from dataclasses import replace
from functools import cache

import pytest

from orbiflow.runtime import Cancel, ClassFailed, Event, Progress, TileFound
from orbiflow.tiles import CLASSES as NINE
from orbiflow.tiles import (
    ClassFailure,
    EscherizeSettings,
    EscherTile,
    LikenessSearch,
    OverlapSearch,
    SearchResult,
    Target,
    escherize,
    searched_classes,
)
from orbiflow.tiles.likeness import Likeness
from orbiflow.tiles.search.search_record import best_of
from outlines import animal
from small_searches import FEW as SMALL

BOOT = Target.from_polygon([[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2, 2.8], [0.8, 2.5]])
FEW = LikenessSearch(**{**SMALL, "phases": 2})
NAMES = ("IH4", "IH7")


def watched(
    workers: int = 1, cancel: Cancel | None = None
) -> tuple[SearchResult, list[tuple[str, EscherTile]], list[Event]]:
    """Search, and return what was shown and told. With a token: cancel it at the first tile."""
    shown: list[tuple[str, EscherTile]] = []
    events: list[Event] = []

    def show(tile: EscherTile, stage: str) -> None:
        shown.append((stage, tile))
        if cancel is not None:
            cancel.cancel()

    settings = EscherizeSettings(classes=NAMES, workers=workers)
    result = escherize(
        BOOT, settings, method=FEW, on_tile=show, on_event=events.append, cancel=cancel or Cancel()
    )
    return result, shown, events


watched_once = cache(watched)


@pytest.mark.parametrize("workers", [1, 2])
def test_all_classes_are_sketched_before_any_is_finished(workers: int) -> None:
    result, shown, events = watched_once(workers)
    stages = [stage for stage, _ in shown]
    assert stages == sorted(stages, key=["sketch", "better", "final"].index)
    assert {tile.name for stage, tile in shown if stage == "final"} == set(NAMES)
    assert stages.count("final") == len(NAMES)
    sketches = [tile.name for stage, tile in shown if stage == "sketch"]
    assert len(set(sketches)) == len(sketches)  # the first look is one of them
    assert all(tile.certificate.valid and tile.rating for _, tile in shown)
    last = {tile.name: tile for stage, tile in shown if stage == "final"}
    assert {tile.name: tile.score for tile in result.tiles} == {
        name: tile.score for name, tile in last.items()
    }
    for _, tile in shown:
        own = last[
            tile.name
        ]  # of the whole silhouette, where it has been found, whatever its score
        assert (own.likeness.smoothed, -own.score) <= (tile.likeness.smoothed, -tile.score)
    outcomes = [event for event in events if isinstance(event, TileFound | ClassFailed)]
    assert len(outcomes) == len(NAMES)
    shares = [event.share for event in events if isinstance(event, Progress)]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_a_search_that_nobody_watches_finds_the_same() -> None:
    alone = escherize(BOOT, EscherizeSettings(classes=NAMES), method=FEW)
    result, _, _ = watched_once(1)
    for one, other in zip(alone.tiles, result.tiles, strict=True):
        assert one.name == other.name
        assert other.score >= one.score  # its sketch may be better


def test_what_was_shown_is_kept_when_the_search_is_cancelled() -> None:
    result, ((stage, tile),), _ = watched(cancel=Cancel())
    assert stage == "sketch"
    assert [kept.name for kept in result.tiles] == [tile.name]
    assert result.interrupted == set(NAMES)


@pytest.mark.parametrize("effort", ["fast", "normal"])
@pytest.mark.parametrize("kind", [LikenessSearch, OverlapSearch])
def test_levels_are_the_whole_search(
    kind: type[LikenessSearch] | type[OverlapSearch], effort: str
) -> None:
    method = kind.for_effort(effort)
    shares, levels = zip(*method.levels(), strict=True)
    assert math.isclose(sum(shares), 1)
    if not isinstance(method, LikenessSearch):
        assert levels == (method,)
        return
    own = [level for level in levels if isinstance(level, LikenessSearch)]
    assert [level.passed for level in own] == [0, *(level.phases for level in own[:-1])]
    assert replace(own[-1], passed=0) == method
    assert own[0] == LikenessSearch.for_effort("fast")


def test_the_better_of_two_outcomes_is_kept() -> None:
    good, poor = (
        EscherTile(tile.tile, likeness=Likeness(known_score=score))
        for (_, tile), score in zip(watched_once(1)[1][:2], (0.8, 0.2), strict=True)
    )
    none = ClassFailure(good.name, "all cross themselves")
    assert best_of(None, none, 1) is none
    assert best_of(none, poor, 1) is poor
    assert best_of(good, none, 1) is good
    assert best_of(poor, good, 1) is good
    kept = best_of(good, poor, 1)
    assert isinstance(kept, EscherTile)
    assert (kept.score, kept.others) == (0.8, ())


def test_which_classes_are_searched_is_known_before() -> None:
    assert searched_classes(BOOT, EscherizeSettings(classes=("ih6", "IH4"))) == ["IH6", "IH4"]
    mirrored = Target.from_polygon([[0, 0], [4, 0], [4, 3], [3, 3], [2, 5], [1, 3], [0, 3]])
    assert "IH12" in searched_classes(mirrored, EscherizeSettings())
    assert searched_classes(animal("squirrel.dat"), EscherizeSettings()) == list(NINE)
