"""A search method of one's own, in one file: templates laid over the silhouette, none moved."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from orbiflow.runtime import Cancel
from orbiflow.tiles import (
    CLASSES,
    ClassFinalists,
    EscherizeSettings,
    EscherTile,
    Pins,
    Target,
    escherize,
    report,
    trainable,
)
from orbiflow.tiles.flowing.starts import template_starts
from orbiflow.tiles.search import Goal, OnProgress, SearchMethod, StillTiles
from orbiflow.tiles.tilings import IsohedralClass
from outlines import searched
from refusals import refused

BOOT = Target.from_polygon([[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2, 2.8], [0.8, 2.5]])


@dataclass(frozen=True)
class TemplateSearch(SearchMethod):
    """Take the class's template, turned and stretched in a few ways."""

    method_name = "template"
    turns: int = 5
    seed: int = 0

    def fit(
        self, goal: Goal, kind: IsohedralClass, per_class: int, progress: OnProgress, cancel: Cancel
    ) -> ClassFinalists:
        starts = template_starts(kind, turns=self.turns, stretch=0.2, phase=self.seed / 10)
        cancel.check()
        progress(1.0, float(goal.target.area))
        return ClassFinalists(StillTiles(kind, starts), len(starts), 0, per_class)


@pytest.mark.parametrize("workers", [1, 2])
def test_a_method_of_one_s_own_is_searched_with(workers: int) -> None:
    method = TemplateSearch()
    settings = EscherizeSettings(classes=("IH4", "IH6"), workers=workers)
    found = escherize(BOOT, settings, method=method)
    assert found.failures == []
    assert {tile.isohedral_class for tile in found.tiles} == {"IH4", "IH6"}
    assert all(isinstance(tile, EscherTile) and tile.certificate.valid for tile in found.tiles)
    document = report(found)
    assert (document["method"], document["objective"]) == ("template", "overlap")
    assert document["settings"] == {"turns": 5, "seed": 0}


def blas_threads() -> list[int]:
    return [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]


def test_no_part_of_it_shares_its_work_among_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    # two threads of linear algebra took ten times as long as one
    threads: list[int] = []

    def told(name: str) -> None:
        whole = getattr(TemplateSearch, name)

        def part(*arguments: Any) -> Any:
            threads.extend(blas_threads())
            return whole(*arguments)

        monkeypatch.setattr(TemplateSearch, name, part)

    for name in ("sketch", "fit", "least_neck"):
        told(name)
    with threadpool_limits(2, user_api="blas"):
        assert set(blas_threads()) == {2}
        escherize(BOOT, EscherizeSettings(classes=("IH4",)), method=TemplateSearch())
    assert len(threads) >= 3
    assert set(threads) == {1}


def test_what_it_does_not_take_is_refused() -> None:
    pins = Pins.at(BOOT, [(0.2, 0.2)])
    with refused("pins"):
        searched(BOOT, ["IH4"], TemplateSearch(), pins=pins)


@pytest.mark.parametrize("name", CLASSES)
def test_tiles_that_no_flow_moves_are_those_of_a_flow_of_zero(name: str) -> None:
    kind = CLASSES[name]
    still = StillTiles(kind, template_starts(kind, turns=3, stretch=0.2))
    for index in (0, still.size - 1):
        tile, own = still.finished(index)
        other, flow = trainable(still).finished(index)
        assert np.abs(tile.polygon - other.polygon).max() < 1e-15
        assert (own.has_flow, flow.has_flow) == (False, True)
        assert own.arrays == {}
