"""Small batches, an executor that stays in this process, and work that kills its worker."""

import csv
import json
import os
import time
from collections.abc import Callable, Generator, Iterable
from functools import cache
from pathlib import Path
from typing import Any

from orbiflow.batch import Executor, Parcel, WorkerReply, dask_cluster, executors
from orbiflow.batch import parcels as parcels_module
from orbiflow.batch.parcels import carry_out
from orbiflow.runtime import Call, Cancel, Event, Failed, Finished, Sink, find
from runtime.searches import BOOT, run

on_cluster, locally = dask_cluster._serve, executors._serve

QUICK: dict[str, Any] = {
    **{"classes": ["IH4"], "method": "occupancy", "turns": 1, "iterations": 2},
    "max_frequency": 1,
}


def write_boot(path: Path, height: float = 145) -> None:
    """A silhouette, which `height` makes another one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps([*BOOT[:5], (100, height), BOOT[6]]))


def boot_parcels(count: int) -> list[Parcel]:
    """Searches of less than a second, with `small_searches`; they import no torch."""
    given = {
        **{"classes": ["IH4"], "effort": "fast", "image": "boot.json", "workers": 1},
        **{"called": "boot", "shown_out": "out"},
    }
    call = find("escherize").call(given)
    data = json.dumps(BOOT).encode()
    return [Parcel(f"boot {k}", call, "out", {"image": ("boot.json", data)}) for k in range(count)]


class Here(Executor):
    """An executor without processes; remembers the keys of what it has done.

    The same work gives what it gave the first time, in whichever test that was.
    """

    def __init__(self) -> None:
        self.done: list[str] = []

    @property
    def place(self) -> str:
        return "this process"

    def answers(
        self,
        parcels: Iterable[Parcel],
        tell: Sink,  # noqa: ARG002
        cancel: Cancel,
    ) -> Generator[WorkerReply, None, None]:
        for parcel in parcels:
            if cancel.cancelled:
                return
            self.done.append(parcel.key)
            order = json.loads(parcel.header())
            if "shown_out" in order["call"]:
                order["call"]["shown_out"] = "out"  # for all tests, so that pages are the same
            found = _carried_out(json.dumps(order), parcel.data, parcels_module.MOST_WRITTEN)
            yield WorkerReply.from_worker(parcel.key, *found)


@cache
def _carried_out(header: str, data: bytes, _most: int) -> tuple[str, dict[str, bytes]]:
    return carry_out(header, data, Cancel())


def run_call(call: Call, cancel: Cancel | None = None) -> tuple[dict[str, Any], list[Event]]:
    """The summary and all events."""
    events: list[Event] = []
    return run(call, events.append, cancel).summary, events


def rows(out: Path) -> dict[str, dict[str, str]]:
    """Of the table, by file."""
    with (out / "batch.csv").open(encoding="utf-8", newline="") as file:
        return {row["file"]: row for row in csv.DictReader(file)}


def without_seconds(files: dict[str, bytes]) -> dict[str, Any]:
    """What two executors must agree in."""

    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {k: plain(v) for k, v in value.items() if k not in ("seconds", "timings")}
        return [plain(part) for part in value] if isinstance(value, list) else value

    return {
        name: plain(json.loads(data)) if name.endswith(".json") else data
        for name, data in files.items()
    }


def small(header: str, data: bytes) -> tuple[str, dict[str, bytes]]:
    """Carry out a parcel on a cluster by a small search."""
    from small_searches import small_searches  # not in processes that only die

    with small_searches():
        return on_cluster(header, data)


def small_locally(*order: Any) -> Any:
    """Carry out a parcel in a local process by a small search."""
    from small_searches import small_searches

    with small_searches():
        return locally(*order)


def deadly_locally(
    order: tuple[str, bytes], _tell: Callable[[Any], None], _cancel: Cancel
) -> tuple[str, dict[str, bytes]]:
    """The same as work of a local process."""
    return deadly(*order)


def deadly(header: str, data: bytes) -> tuple[str, dict[str, bytes]]:
    """Kills the process that works on `b"deadly"`; all else is done at once."""
    if data == b"deadly":
        os._exit(3)
    ended = Finished("done", {"name": json.loads(header)["reads"][0][1]})
    return json.dumps(ended.to_json()), {"file": data}


def endless(_header: str, _data: bytes) -> tuple[str, dict[str, bytes]]:
    """Work that ends once nobody waits for it any more."""
    cancel = dask_cluster._released()
    while not cancel.cancelled:
        time.sleep(0.02)
    return "", {}


def state_of(answer: WorkerReply) -> str:
    """In a word."""
    return answer.end.failure if isinstance(answer.end, Failed) else answer.end.state
