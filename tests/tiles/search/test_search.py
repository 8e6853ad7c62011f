"""Searches over classes, in this process and in others; tiles that come early and get better."""

import multiprocessing
import threading
from dataclasses import asdict, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import torch

from orbiflow.runtime import Cancel, Cancelled, ClassFailed, Event, Preview, Progress, TileFound
from orbiflow.tiles import (
    CLASSES,
    ClassFailure,
    EscherizeSettings,
    EscherTile,
    LikenessSearch,
    OccupancySearch,
    OverlapSearch,
    SearchResult,
    Target,
    TileModel,
    escherize,
    escherize_class,
    isohedral_class,
    searched_classes,
)
from orbiflow.tiles import CLASSES as NINE
from orbiflow.tiles.flowing import overlap_search
from orbiflow.tiles.likeness import Likeness, mutual_iou
from orbiflow.tiles.search import ClassFinalists, Goal
from orbiflow.tiles.search.likeness_search import SKETCH
from orbiflow.tiles.search.search_method import Sketches
from orbiflow.tiles.search.search_record import best_of
from orbiflow.tiles.tilings import IsohedralClass
from outlines import animal, searched
from refusals import refused
from small_searches import FEW as SMALL

BOOT = [[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2.0, 2.8], [0.8, 2.5], [-0.3, 1.2]]
QUICK = OccupancySearch(
    max_frequency=3, turns=2, finalists=2, iterations=8, affine_iterations=20, points=100
)
SHORT = replace(QUICK, iterations=2, affine_iterations=1, turns=1)
BRIEF = OverlapSearch.for_effort(
    "fast", stages=((6, 2), (6, 1)), polish=5, projected=100, measured=30
)
TARGET = Target.from_polygon(BOOT, y_down=True)
SQUIRREL = animal("squirrel.dat")


def crossed(*_: object, **__: object) -> TileModel:
    model = TileModel(CLASSES["IH21"], torch.zeros(2), max_frequency=1)
    with torch.no_grad():
        model.shape.add_(2.0)
    return model


def test_the_same_tiles_whatever_the_number_of_workers() -> None:
    events: list[Event] = []
    here, none = searched(TARGET, ["ih4", "28", "IH4"], QUICK, on_event=events.append)
    assert none == []
    assert sorted(r.name for r in here) == ["IH28", "IH4"]
    assert here[0].score >= here[1].score
    assert all(tile.likeness.metrics.iou > 0.7 for tile in here)
    for name in ("IH4", "IH28"):
        *steps, last, outcome = of_class(events, name)
        assert isinstance(outcome, TileFound)
        assert isinstance(last, Progress)
        assert last.class_share == 1.0
        assert all(isinstance(event, Progress) and event.loss is not None for event in steps)
    elsewhere, none = searched(TARGET, ["IH28", "IH4"], QUICK, workers=2)
    assert none == []
    for one, other in zip(here, elsewhere, strict=True):
        assert one.name == other.name
        assert np.array_equal(one.tile.polygon, other.tile.polygon)
        assert one.likeness.metrics == other.likeness.metrics
        assert (one.map and one.map.settings) == (other.map and other.map.settings)


def test_the_number_of_threads_is_put_back() -> None:
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        own = replace(QUICK, iterations=1, affine_iterations=1, turns=1, points=20)
        escherize_class(TARGET, "IH1", own)
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)


@pytest.mark.parametrize("force", [False, True])
def test_a_fit_that_runs_away_is_a_failure(force: bool) -> None:
    outcome = escherize_class(TARGET, "IH4", replace(QUICK, learning_rate=1e4), force=force)
    assert isinstance(outcome, ClassFailure)
    assert outcome.name == "IH4"
    assert "no finite values" in outcome.reason or "finite coordinates" in outcome.reason


def test_a_class_whose_finalists_all_fold(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(overlap_search, "fit_occupancy", crossed)
    events: list[Event] = []
    results, failures = searched(TARGET, ["IH21"], QUICK, on_event=events.append)
    assert results == []
    assert [f.name for f in failures] == ["IH21"]
    assert "crosses itself" in failures[0].reason
    reason = failures[0].reason
    assert events[1:] == [Progress(1.0, "fitting", "IH21", 1.0), ClassFailed("IH21", reason)]
    results, failures = searched(TARGET, ["IH21"], QUICK, force=True)
    assert failures == []
    assert not results[0].certificate.valid
    assert "not simple" in results[0].certificate.reasons[0]


NAMES = ["IH2", "IH7", "IH3", "IH4"]
STEADY = replace(QUICK, iterations=4, affine_iterations=2, turns=1, points=50)
both = pytest.mark.parametrize("workers", [1, 2])


def is_outcome(event: Event) -> bool:
    return isinstance(event, TileFound | ClassFailed)


def of_class(events: list[Event], name: str) -> list[Event]:
    """The steps of a class and its outcome."""
    kinds = (Progress, TileFound, ClassFailed)
    return [event for event in events if isinstance(event, kinds) and event.class_name == name]


def checked(events: list[Event], names: list[str]) -> None:
    """The order that `orbiflow.runtime.events` promises."""
    assert events[0] == Progress(0.0, "fitting")
    previews = [k for k, event in enumerate(events) if isinstance(event, Preview)]
    assert previews in ([], [1])
    for name in names:
        own = of_class(events, name)
        assert [is_outcome(event) for event in own] == [False] * (len(own) - 1) + [True]
        shares = [event.class_share or 0.0 for event in own if isinstance(event, Progress)]
        assert shares == sorted(shares)


@both
def test_events_come_in_order_and_in_this_thread(workers: int) -> None:
    events: list[Event] = []
    threads: set[int] = set()

    def watch(event: Event) -> None:
        events.append(event)
        threads.add(threading.get_ident())

    searched(TARGET, NAMES, STEADY, workers=workers, on_event=watch)
    checked(events, NAMES)
    assert threads == {threading.get_ident()}
    for name in NAMES:
        last = of_class(events, name)[-2]
        assert isinstance(last, Progress)
        assert last.class_share == 1.0
    assert len(events) > 2 * len(NAMES)


@pytest.mark.parametrize(
    ("workers", "error", "with_outcome"),
    [
        *((1, KeyboardInterrupt, False), (1, ZeroDivisionError, True)),
        *((2, ZeroDivisionError, False), (2, KeyboardInterrupt, True)),
    ],
)
def test_what_watch_raises_ends_the_search(
    workers: int, error: type[BaseException], with_outcome: bool
) -> None:
    told: list[Event] = []

    def watch(event: Event) -> None:
        told.append(event)
        if is_outcome(event) == with_outcome:
            raise error

    with pytest.raises(error):
        searched(TARGET, NAMES, STEADY, workers=workers, on_event=watch)
    assert sum(is_outcome(event) == with_outcome for event in told) == 1
    assert multiprocessing.active_children() == []


@both
def test_cancelling_keeps_what_was_finished(workers: int) -> None:
    cancel, events = Cancel(), []

    def watch(event: Event) -> None:
        events.append(event)
        if is_outcome(event):
            cancel.cancel()

    results, failures = searched(
        TARGET, NAMES, SHORT, workers=workers, on_event=watch, cancel=cancel
    )
    checked(events, NAMES)
    # what workers had in hand when they were told may have been finished, too
    assert 1 <= len(results) < len(NAMES)
    assert {f.reason for f in failures} == {"interrupted"}
    assert sorted([r.name for r in results] + [f.name for f in failures]) == sorted(NAMES)


@both
def test_a_fit_is_left_between_two_steps(workers: int) -> None:
    """A million steps would take hours."""
    cancel, events = Cancel(), []

    def watch(event: Event) -> None:
        events.append(event)
        if isinstance(event, Progress) and event.class_name:
            cancel.cancel()

    endless = replace(QUICK, iterations=10**6, affine_iterations=1, turns=1)
    results, failures = searched(
        TARGET, NAMES, endless, workers=workers, on_event=watch, cancel=cancel
    )
    assert results == []
    assert failures == [ClassFailure(name, "interrupted") for name in NAMES]
    checked(events, NAMES)
    assert multiprocessing.active_children() == []


def test_one_class_alone_is_cancelled_by_an_exception() -> None:
    cancel = Cancel()
    endless = replace(QUICK, iterations=10**6, affine_iterations=1, turns=1)
    with pytest.raises(Cancelled):
        escherize_class(TARGET, "IH2", endless, progress=lambda *_: cancel.cancel(), cancel=cancel)


def test_one_class_may_be_given_by_its_name() -> None:
    for given in ("IH4", 4, isohedral_class("ih4")):
        assert escherize_class(TARGET, given, SHORT).name == "IH4"
    with refused("IH94"):
        escherize_class(TARGET, "IH94", QUICK)


def test_arguments_are_checked() -> None:
    with refused("IH94", "IH1"):
        searched(TARGET, ["IH4", "IH94"], QUICK)
    with refused("classes"):
        searched(TARGET, [], QUICK)
    for workers in (0, -1):
        with refused("workers", workers):
            searched(TARGET, ["IH4"], QUICK, workers=workers)


@pytest.mark.parametrize("wrong", ["fast", 3, {"placements": 5}])
def test_settings_of_no_method_are_refused(wrong: object) -> None:
    with refused("method"):
        escherize(TARGET, method=wrong)  # pyright: ignore[reportArgumentType]
    with refused("target", "turtle.png"):
        escherize("turtle.png")  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    "settings",
    [
        LikenessSearch(
            phases=1,
            placements=20,
            held=6,
            starts=4,
            finalists=3,
            rounds=3,
            carved=0,
            multiples=(2,),
        ),
        BRIEF,
    ],
    ids=["likeness", "overlap"],
)
def test_several_of_a_class_differ(settings: LikenessSearch | OverlapSearch) -> None:
    own, _ = searched(SQUIRREL, ["IH5"], settings, per_class=3)
    assert 2 <= len(own) <= 3
    alike = mutual_iou([r.normal_tile.polygon for r in own])
    assert all(alike(i, j) < 0.9 for i in range(len(own)) for j in range(i))


def test_more_effort_never_scores_less() -> None:
    """In a class, also where several of its tiles are asked for."""
    least = LikenessSearch(**{**SMALL, "starts": 1})

    def score(settings: LikenessSearch, per_class: int) -> float:
        tile = escherize_class(SQUIRREL, "IH7", settings, per_class=per_class)
        assert isinstance(tile, EscherTile)
        return tile.score

    for per_class, phases in ((1, 4), (2, 2)):
        few, more = (score(replace(least, phases=count), per_class) for count in (1, phases))
        assert few < more if phases == 4 else few <= more


def test_later_phases_are_of_promising_classes() -> None:
    """A class far behind the best is searched in the first phase alone."""
    method = replace(LikenessSearch(**SKETCH), placements=20, multiples=(2,), phases=2)
    asked: list[tuple[str, int]] = []

    class Watched(type(method)):
        def fit(self, goal: Goal, kind: IsohedralClass, *rest: Any) -> ClassFinalists:
            asked.append((kind.name, self.passed))
            return super().fit(goal, kind, *rest)

    names = ["IH1", "IH3", "IH4", "IH5"]
    tiles, _ = searched(SQUIRREL, names, Watched(**asdict(method)))
    assert [name for name, passed in asked if passed == 0][1:] == names  # after a first look
    first = [tile for tile in tiles if tile.likeness.fidelity]
    again = {name for name, passed in asked if passed}
    assert again < set(names)
    assert first[0].name in again


def test_a_search_that_leaves_no_phase_is_refused() -> None:
    with refused("passed", 2):
        LikenessSearch(phases=2, passed=2)


def test_a_first_look_is_one_small_search() -> None:
    own = replace(LikenessSearch(phases=12), passed=0, **SKETCH)
    assert [level for _, level in own.levels()] == [own]
    assert own.finalists == own.starts <= 2
    assert len(own.bodies) == 1


WATCHED_BOOT = Target.from_polygon([[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2, 2.8], [0.8, 2.5]])
FEW = LikenessSearch(**{**SMALL, "phases": 2})
WATCHED_NAMES = ("IH4", "IH7")


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

    settings = EscherizeSettings(classes=WATCHED_NAMES, workers=workers)
    result = escherize(
        WATCHED_BOOT,
        settings,
        method=FEW,
        on_tile=show,
        on_event=events.append,
        cancel=cancel or Cancel(),
    )
    return result, shown, events


watched_once = cache(watched)


@pytest.mark.parametrize("workers", [1, 2])
def test_all_classes_are_sketched_before_any_is_finished(workers: int) -> None:
    result, shown, events = watched_once(workers)
    stages = [stage for stage, _ in shown]
    assert stages == sorted(stages, key=["sketch", "better", "final"].index)
    assert {tile.name for stage, tile in shown if stage == "final"} == set(WATCHED_NAMES)
    assert stages.count("final") == len(WATCHED_NAMES)
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
    assert len(outcomes) == len(WATCHED_NAMES)
    shares = [event.share for event in events if isinstance(event, Progress)]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_a_search_that_nobody_watches_finds_the_same() -> None:
    alone = escherize(WATCHED_BOOT, EscherizeSettings(classes=WATCHED_NAMES), method=FEW)
    result, _, _ = watched_once(1)
    for one, other in zip(alone.tiles, result.tiles, strict=True):
        assert one.name == other.name
        assert other.score >= one.score  # its sketch may be better


def test_what_was_shown_is_kept_when_the_search_is_cancelled() -> None:
    result, ((stage, tile),), _ = watched(cancel=Cancel())
    assert stage == "sketch"
    assert [kept.name for kept in result.tiles] == [tile.name]
    assert result.interrupted == set(WATCHED_NAMES)


@pytest.mark.parametrize("effort", ["fast", "normal"])
@pytest.mark.parametrize("kind", [LikenessSearch, OverlapSearch])
def test_levels_are_the_whole_search(
    kind: type[LikenessSearch] | type[OverlapSearch], effort: str
) -> None:
    method = kind.for_effort(effort)
    _, levels = zip(*method.levels(), strict=True)
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
    assert searched_classes(WATCHED_BOOT, EscherizeSettings(classes=("ih6", "IH4"))) == [
        "IH6",
        "IH4",
    ]
    mirrored = Target.from_polygon([[0, 0], [4, 0], [4, 3], [3, 3], [2, 5], [1, 3], [0, 3]])
    assert "IH12" in searched_classes(mirrored, EscherizeSettings())
    assert searched_classes(animal("squirrel.dat"), EscherizeSettings()) == list(NINE)


def test_sketches_are_of_every_class_the_quickest_first() -> None:
    order = Sketches(OverlapSearch()).in_order(["IH69", "IH1", "IH4"])
    assert order == ["IH4", "IH1", "IH69"]
