"""Searches over classes, in this process and in others."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from orbiflow.errors import OrbiflowError
from orbiflow.escher import methods
from orbiflow.escher.model import TileModel
from orbiflow.escher.occupancy import OccupancySettings
from orbiflow.escher.result import ClassFailure, TileResult
from orbiflow.escher.search import Event, escherize, escherize_class
from orbiflow.silhouette.target import Target
from orbiflow.tilings import CLASSES

BOOT = [[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2.0, 2.8], [0.8, 2.5], [-0.3, 1.2]]
QUICK = OccupancySettings(
    max_frequency=3, turns=3, finalists=2, iterations=15, affine_iterations=20, points=200
)
TARGET = Target.from_polygon(BOOT, y_down=True)


def crossed(*_: object) -> TileModel:
    model = TileModel(CLASSES["IH21"], torch.zeros(2), max_frequency=1)
    with torch.no_grad():
        model.shape.add_(2.0)
    return model


def test_the_same_tiles_whatever_the_number_of_workers() -> None:
    events: list[Event] = []
    here, none = escherize(TARGET, ["ih4", "28", "IH4"], QUICK, watch=events.append)
    assert none == []
    assert sorted(r.name for r in here) == ["IH28", "IH4"]
    assert here[0].metrics.iou > here[1].metrics.iou > 0.7
    for name in ("IH4", "IH28"):
        own = [event for event in events if event.name == name]
        shares = [event.share for event in own]
        assert shares == sorted(shares)
        assert shares[-1] == 1.0
        assert isinstance(own[-1].outcome, TileResult)
        assert all(event.outcome is None and math.isfinite(event.loss) for event in own[:-1])
    elsewhere, none = escherize(TARGET, ["IH28", "IH4"], QUICK, workers=2)
    assert none == []
    for one, other in zip(here, elsewhere, strict=True):
        assert one.name == other.name
        assert np.array_equal(one.tile.polygon, other.tile.polygon)
        assert one.metrics == other.metrics
        assert one.model.settings == other.model.settings


def test_every_seed_that_settings_take_can_be_searched_with() -> None:
    own = replace(QUICK, seed=2**32 - 1, iterations=1, affine_iterations=1, turns=1, points=20)
    assert isinstance(escherize_class(TARGET, "IH21", own), TileResult)


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
    monkeypatch.setattr(methods, "fit_occupancy", crossed)
    events: list[Event] = []
    results, failures = escherize(TARGET, ["IH21"], QUICK, watch=events.append)
    assert results == []
    assert [f.name for f in failures] == ["IH21"]
    assert "crosses itself" in failures[0].reason
    assert events == [Event("IH21", 1.0, events[0].loss, failures[0])]
    results, failures = escherize(TARGET, ["IH21"], QUICK, force=True)
    assert failures == []
    assert not results[0].certificate.valid
    assert "not simple" in results[0].certificate.reasons[0]


def test_an_interrupt_keeps_what_was_finished() -> None:
    own = replace(QUICK, iterations=2, affine_iterations=1, turns=1)

    def interrupt(event: Event) -> None:
        if event.name == "IH7":
            raise KeyboardInterrupt

    results, failures = escherize(TARGET, ["IH2", "IH7", "IH3"], own, watch=interrupt)
    assert [r.name for r in results] == ["IH2"]
    assert failures == [ClassFailure("IH7", "interrupted"), ClassFailure("IH3", "interrupted")]


@pytest.mark.parametrize("workers", [1, 2])
def test_an_interrupt_while_a_tile_is_announced_keeps_it(workers: int) -> None:
    own = replace(QUICK, iterations=2, affine_iterations=1, turns=1)

    def interrupt(event: Event) -> None:
        if event.outcome is not None:
            raise KeyboardInterrupt

    names = ["IH2", "IH7", "IH3", "IH4"]
    results, failures = escherize(TARGET, names, own, workers=workers, watch=interrupt)
    assert len(results) == 1
    assert {f.reason for f in failures} == {"interrupted"}
    assert sorted([results[0].name, *(f.name for f in failures)]) == sorted(names)


def test_arguments_are_checked() -> None:
    with pytest.raises(OrbiflowError, match=r"unknown isohedral class 'IH8'; the nine are IH1, .*"):
        escherize(TARGET, ["IH4", "IH8"], QUICK)
    with pytest.raises(OrbiflowError, match="no isohedral class was given"):
        escherize(TARGET, [], QUICK)
    for workers in (0, -1):
        with pytest.raises(OrbiflowError, match=f"workers must be at least 1, got {workers}"):
            escherize(TARGET, ["IH4"], QUICK, workers=workers)
