"""The same parcels by every executor: the same answers; deaths cost their time and nothing else."""

import gc
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from batch.small_batches import (
    Here,
    boot_parcels,
    deadly,
    deadly_locally,
    endless,
    small,
    small_locally,
    state_of,
    without_seconds,
)
from orbiflow import __version__
from orbiflow.batch import (
    Executor,
    LocalProcesses,
    Parcel,
    WorkerReply,
    dask_cluster,
    executors,
    parcels,
)
from orbiflow.batch.dask_cluster import DaskCluster
from orbiflow.batch.parcels import carry_out
from orbiflow.runtime import Cancel, Event, Failed, Finished, Note, Polled, find
from refusals import names, refused
from small_searches import small_searches

pytestmark = pytest.mark.usefixtures("small_searches")
DEADLY = find("escherize").call({"image": "any.png"})


@pytest.fixture(name="cluster", scope="module")
def cluster_fixture() -> Iterator[Any]:
    """A Dask cluster of two worker processes, on the loopback interface alone."""
    dask = pytest.importorskip("dask", reason="the extra of Dask is not installed")
    import distributed

    settings = {"distributed.scheduler.allowed-failures": 1, "distributed.admin.log-length": 0}
    with (
        dask.config.set(settings),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
        ) as cluster,
    ):
        yield cluster
    # a thread that stays would keep the tests after this from forking their workers
    distributed.utils._offload_executor.shutdown()
    distributed.utils._offload_executor = ThreadPoolExecutor(1)


@contextmanager
def until(cluster: Any, holds: Callable[[], bool]) -> Iterator[None]:
    """Wait after the block until something holds of a cluster's tasks and workers."""
    from distributed.diagnostics.plugin import SchedulerPlugin

    happened = threading.Event()

    class Watch(SchedulerPlugin):
        name = "watch"

        def transition(self, *_: Any, **__: Any) -> None:
            if holds():
                happened.set()

        remove_worker = transition

    cluster.scheduler.add_plugin(Watch())
    yield
    if not holds():
        happened.wait()
    cluster.scheduler.remove_plugin("watch")


def parcels_of(*data: bytes) -> list[Parcel]:
    return [Parcel(f"{k}", DEADLY, "out", {"image": (f"{k}.png", d)}) for k, d in enumerate(data)]


def answers(
    executor: Executor, sent: list[Parcel], events: list[Event] | None = None
) -> dict[str, WorkerReply]:
    tell = [].append if events is None else events.append
    with executor:
        return {answer.key: answer for answer in executor.answers(sent, tell, Cancel())}


@pytest.fixture(name="expected", scope="module")
def expected_fixture() -> dict[str, Any]:
    with small_searches():
        (answer,) = answers(Here(), boot_parcels(1)).values()
    assert state_of(answer) == "done"
    return without_seconds(dict(answer.files))


def test_local_processes_give_the_same(expected: dict[str, Any], monkeypatch) -> None:
    monkeypatch.setattr(executors, "_serve", small_locally)
    found = answers(LocalProcesses(2, ("orbiflow.tiles.search",)), boot_parcels(2))
    assert sorted(found) == ["boot 0", "boot 1"]
    for answer in found.values():
        assert without_seconds(dict(answer.files)) == expected


def test_a_cluster_gives_the_same_though_a_worker_is_killed(
    expected: dict[str, Any], cluster: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dask_cluster, "_serve", small)
    executor, killed = DaskCluster(cluster.scheduler_address), []
    with executor:
        assert executor.place.startswith("2 workers of tcp://127.0.0.1:")
        found = {}
        for answer in executor.answers(boot_parcels(2), [].append, Cancel()):
            found[answer.key] = answer
            if not killed:
                workers = list(cluster.scheduler.workers.values())
                at_work = [worker for worker in workers if worker.processing] or workers
                nannies = {own.worker_address: own for own in cluster.workers.values()}
                killed.append(nannies[at_work[0].address].pid)
                os.kill(killed[0], signal.SIGKILL)
    assert sorted(found) == ["boot 0", "boot 1"]
    for answer in found.values():
        assert without_seconds(dict(answer.files)) == expected


def test_what_kills_processes_fails_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(executors, "_serve", deadly_locally)
    events: list[Event] = []
    found = answers(LocalProcesses(2), parcels_of(b"a", b"deadly", b"b", b"c"), events)
    assert [state_of(found[key]) for key in "0123"] == ["done", "died", "done", "done"]
    end = found["1"].end
    assert isinstance(end, Failed)
    names(end.message, 3)
    (note,) = events
    assert isinstance(note, Note)
    names(note.text, 3, 1)


def test_what_kills_workers_fails_alone(monkeypatch: pytest.MonkeyPatch, cluster: Any) -> None:
    monkeypatch.setattr(dask_cluster, "_serve", deadly)
    monkeypatch.setattr(cluster.scheduler, "allowed_failures", 0)
    events: list[Event] = []
    sent = parcels_of(b"a", b"deadly", b"b", b"c", b"d")
    found = answers(DaskCluster(cluster.scheduler_address), sent, events)
    assert [state_of(found[key]) for key in "01234"] == ["done", "died", *["done"] * 3]
    assert any(isinstance(event, Note) for event in events)
    assert found["0"].files == {"file": b"a"}


def test_a_worker_killed_once_its_result_is_fetched(monkeypatch, cluster: Any) -> None:
    monkeypatch.setattr(dask_cluster, "_serve", deadly)
    tasks, workers = cluster.scheduler.tasks, cluster.scheduler.workers
    with DaskCluster(cluster.scheduler_address) as executor:
        found = executor.answers(parcels_of(b"a", b"b", b"c"), [].append, Cancel())
        with until(cluster, lambda: all(own.state == "memory" for own in list(tasks.values()))):
            keys = [next(found).key]
        before = {*workers}
        with until(cluster, lambda: not before & workers.keys()):
            for nanny in list(cluster.workers.values()):
                os.kill(nanny.pid, signal.SIGKILL)
        keys += [answer.key for answer in found]
    assert sorted(keys) == ["0", "1", "2"]


def test_stopping_a_cluster_leaves_nothing_on_it(monkeypatch, cluster: Any) -> None:
    monkeypatch.setattr(dask_cluster, "_serve", deadly)
    cancel = Cancel()
    with DaskCluster(cluster.scheduler_address) as executor:
        found = executor.answers(parcels_of(*[b"a"] * 9), [].append, cancel)
        next(found)
        cancel.cancel()
        assert len(list(found)) <= 2  # those that had come
    clients = [client.client_key for client in cluster.scheduler.clients.values()]
    assert not [key for key in clients if key.startswith("orbiflow")]


def test_stopping_a_cluster_at_work_prints_no_traceback(monkeypatch, cluster: Any) -> None:
    monkeypatch.setattr(dask_cluster, "_serve", endless)

    def all_at_work() -> bool:
        return all(worker.processing for worker in cluster.scheduler.workers.values())

    printed: list[str] = []
    with DaskCluster(cluster.scheduler_address) as executor:
        assert executor._client
        loop = executor._client.loop.asyncio_loop
        loop.set_exception_handler(lambda _, context: printed.append(context["message"]))
        parcels = parcels_of(b"a", b"b")
        assert not list(executor.answers(parcels, [].append, Polled(all_at_work)))
    gc.collect()  # of tasks whose exceptions nobody has seen
    loop.set_exception_handler(None)
    assert printed == []


def test_another_version_on_the_workers(monkeypatch: pytest.MonkeyPatch, cluster: Any) -> None:
    monkeypatch.setattr(dask_cluster, "__version__", "999")
    with refused(__version__, 999):
        DaskCluster(cluster.scheduler_address).__enter__()
    (late,) = boot_parcels(1)
    header = late.header().replace(f'"version": "{__version__}"', '"version": "999"')
    text, files = carry_out(header, late.data, Cancel())
    assert not files
    end = WorkerReply.from_worker("late", text, files).end
    assert isinstance(end, Failed)
    names(end.message, __version__, 999)


def test_what_could_not_connect_is_closed() -> None:
    """Its own end, in a garbage collection, could wait for the start of the next one for ever."""
    pytest.importorskip("distributed", reason="the extra of Dask is not installed")
    from distributed import Client

    gc.disable()
    try:
        for address in ("tcp://127.0.0.1:1", "127.0.0.1:1", "nonsense", "ftp://a:1"):
            with refused(address):
                DaskCluster(address, timeout=0.2).__enter__()
        found = [client for client in gc.get_objects() if issubclass(type(client), Client)]
    finally:
        gc.enable()
    assert all(client.status == "closed" for client in found)


def test_an_answer_cannot_write_elsewhere_and_has_an_end() -> None:
    text = '{"kind": "finished", "state": "done", "summary": {}}'
    for name in ("/etc/passwd", "../up", "a/../../b", "", "a\\b"):
        with refused(repr(name)):
            WorkerReply.from_worker("key", text, {name: b""})
    with refused():
        WorkerReply.from_worker("key", '{"kind": "note", "text": ""}', {})


@given(st.binary(max_size=200))
def test_whatever_the_bytes_are_there_is_an_answer(data: bytes) -> None:
    call = find("escherize").call({"image": "a.svg"})
    one = Parcel("key", call, "out", {"image": ("a.svg", data)})
    answer = WorkerReply.from_worker("key", *carry_out(one.header(), one.data, Cancel()))
    assert isinstance(answer.end, Failed)
    assert answer.end.failure == "mistake"
    assert "orbiflow-" not in answer.end.message  # the folder that it was in
    assert not answer.files


def test_what_is_too_large_is_not_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parcels, "MOST_WRITTEN", 1000)
    (answer,) = answers(Here(), boot_parcels(1)).values()
    assert state_of(answer) == "mistake"
    assert not answer.files


@pytest.mark.skipif(os.name != "posix", reason="it has another allocator")
def test_memory_can_be_kept() -> None:
    # in a process of its own: what it sets is for good
    code = "from orbiflow.batch.dask_cluster import keep_memory as k; k(); print(len(bytearray(2**20)))"
    environment = {**os.environ, "MALLOC_TRIM_THRESHOLD_": "65536"}
    run = [sys.executable, "-c", code]
    assert subprocess.check_output(run, env=environment, text=True) == f"{2**20}\n"


def test_a_cancelled_parcel_says_so() -> None:
    cancel = Cancel()
    cancel.cancel()
    (one,) = boot_parcels(1)
    answer = WorkerReply.from_worker("key", *carry_out(one.header(), one.data, cancel))
    assert isinstance(answer.end, Finished)
    assert answer.end.state == "cancelled"
