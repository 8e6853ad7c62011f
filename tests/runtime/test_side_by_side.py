"""Functions side by side: in threads or one after the other, with the same results."""

import threading
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
import pytest
import torch

from density.quick_fits import quick_fits
from orbiflow.density import DensitySettings, Torus, fit_automatic
from orbiflow.runtime import Cancelled, SideBySide, Tell, cores, one_core, process_context
from orbiflow.runtime import side_by_side as module_of


@pytest.fixture(name="count", params=[1, 2, 3])
def cores_fixture(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    """A number of cores, whatever the machine has."""
    monkeypatch.setattr("orbiflow.runtime.side_by_side.cores", lambda: request.param)
    return request.param


def squared(number: int) -> Callable[[Tell], int]:
    def function(tell: Tell) -> int:
        for k in range(number):
            tell(number, k)
        return number**2

    return function


@pytest.mark.usefixtures("count")
def test_what_is_told_is_heard_in_the_callers_thread() -> None:
    heard: list[tuple[int, int]] = []

    def hear(*news: int) -> None:
        assert threading.current_thread() is threading.main_thread()
        heard.append((news[0], news[1]))

    with SideBySide() as beside:
        results = [beside.begin(squared(n), hear) for n in range(6)]
        assert [result() for result in results] == [n**2 for n in range(6)]
        assert [result() for result in results] == [n**2 for n in range(6)]  # done once
    for n in range(6):
        assert [k for own, k in heard if own == n] == list(range(n))


@pytest.mark.usefixtures("count")
def test_a_failure_is_told_where_the_result_is_asked_for() -> None:
    with SideBySide() as beside:
        bad = beside.begin(lambda _: 1 // 0)
        good = beside.begin(squared(2))
        assert good() == 4
        with pytest.raises(ZeroDivisionError):
            bad()


def test_who_hears_can_end_all(count: int) -> None:
    ended: list[bool] = []
    others = threading.active_count()
    begun = threading.Barrier(count)

    def endless(tell: Tell) -> None:
        begun.wait()
        try:
            while True:
                tell()
        finally:
            ended.append(True)

    def refuse() -> None:
        raise Cancelled

    with SideBySide() as beside:
        results = [beside.begin(endless, refuse) for _ in range(count)]
        with pytest.raises(Cancelled):
            results[0]()
    assert len(ended) == count
    assert threading.active_count() == others


def test_torch_has_one_thread_and_no_more_cores(count: int) -> None:
    def seen(_: Tell) -> tuple[int, int]:
        return torch.get_num_threads(), cores()

    with one_core(), SideBySide() as beside:
        torch_threads, inner = beside.begin(seen)()
    assert inner == 1
    assert torch_threads == 1 or count == 1


def test_a_worker_process_has_one_core() -> None:
    with one_core():
        assert cores() == 1
    assert cores() >= 1
    with ProcessPoolExecutor(1, mp_context=process_context()) as pool:
        assert pool.submit(cores).result() == 1


def test_a_fit_is_the_same_on_any_number_of_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    quick_fits(monkeypatch)
    space, rng = Torus(2), np.random.default_rng(0)
    points = space.project(torch.tensor(0.1 * rng.normal(size=(320, 2))))
    few: dict[str, Any] = {"segments": 1, "max_frequency": 2, "iterations": 4}
    settings = DensitySettings(components=("kernels", "flow"), roughness=(1e-3,), **few)
    found: list[Any] = []
    for count in (1, 3):
        monkeypatch.setattr(module_of, "cores", lambda count=count: count)
        shares: list[float] = []
        density, report = fit_automatic(
            space, points, settings, progress=lambda done, _, shares=shares: shares.append(done)
        )
        assert shares == sorted(shares)
        found.append((density.log_prob(points), report.notes, density.weight_of_kind))
    assert torch.equal(found[0][0], found[1][0])
    assert found[0][1:] == found[1][1:]
