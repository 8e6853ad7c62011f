"""A batch in local processes and on a Dask cluster with a worker killed: the same tiles, and the times.

    python benchmarks/batch.py [--count 200] [--effort fast] [--classes IH4,IH6] [--workers 2] [--quick]

The silhouettes are those of ../shared/data and examples/silhouettes, each bent by a small smooth
displacement with a seed, so that no two are the same. The local batch is stopped at its half and gone
on with; on the cluster, of so many workers with one thread each, one is killed with SIGKILL at a third.
All files of both but for their seconds must be the same, byte for byte. Last, both are asked for again:
nothing is to be done.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import torch
from common import BUNDLED, DATA

from orbiflow.errors import OrbiflowError
from orbiflow.runtime import Call, Cancel, Cancelled, Event, Finished, ItemDone, find
from orbiflow.tiles import Target

SEED = 15
BEND = 0.012
"""Size of a displacement's waves, in square roots of the area."""


def sources() -> list[Path]:
    """Files of silhouettes."""
    found = [*BUNDLED.glob("*.png"), *BUNDLED.glob("*.svg"), *BUNDLED.glob("*.dat")]
    found += [*(DATA / "silhouettes" / "nagata").glob("*.dat")]
    found += [*(DATA / "silhouettes" / "phylopic").glob("*.svg")]
    return sorted(found, key=lambda path: path.name)


def bent(outline: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """An outline (N, 2) of area about 1 under a smooth map near the identity."""
    waves, moved = rng.normal(size=(6, 2)) * 2.0, outline.copy()
    for wave in waves:
        phase = outline @ wave + rng.uniform(0, 2 * np.pi)
        moved += BEND * rng.normal(size=2) * np.sin(phase)[:, None]
    return moved


def write_silhouettes(folder: Path, count: int) -> None:
    """So many polygons, each simple and different."""
    rng = np.random.default_rng(SEED)
    outlines = []
    for path in sources():
        try:
            outlines.append((path.stem, Target.read(path).normal))
        except OrbiflowError as error:
            print(f"{path.name} is left out: {error}")
    folder.mkdir()
    for k in range(count):
        name, outline = outlines[k % len(outlines)]
        moved = bent(outline, rng)
        while not shapely.Polygon(moved).is_valid:
            moved = bent(outline, rng)
        path = folder / f"{k:04d}-{name}.json"
        path.write_text(json.dumps((moved * 100).round(6).tolist()))


def timed(
    call: Call, watch: Callable[[int, Cancel], None] | None = None
) -> tuple[dict[str, Any], float]:
    """The summary and the seconds; `watch` is told how many are done."""
    cancel, done, begin = Cancel(), 0, time.perf_counter()
    last: list[Event] = []

    def sink(event: Event) -> None:
        nonlocal done
        last[:] = [event]
        if isinstance(event, ItemDone):
            done += 1
            if watch is not None:
                watch(done, cancel)

    with suppress(Cancelled):
        call.run(sink, cancel)
    (finished,) = last
    assert isinstance(finished, Finished)
    return finished.summary, time.perf_counter() - begin


def contents(folder: Path) -> dict[str, Any]:
    """All files of all results; of JSON its value without seconds."""
    found: dict[str, Any] = {}
    for path in sorted(folder.glob("*/**/*")):
        name = path.relative_to(folder).as_posix()
        if path.name == "result.json":
            found[name] = _without_seconds(json.loads(path.read_text()))
        elif path.is_file():
            found[name] = path.read_bytes()
    return found


def _without_seconds(value: Any) -> Any:
    if isinstance(value, dict):
        timed = ("seconds", "timings")
        return {k: _without_seconds(v) for k, v in value.items() if k not in timed}
    return [_without_seconds(part) for part in value] if isinstance(value, list) else value


def different(one: dict[str, Any], other: dict[str, Any]) -> list[str]:
    """Names of the files that are not the same in both."""
    return sorted(name for name in one.keys() | other.keys() if one.get(name) != other.get(name))


def pids(address: str) -> list[int]:
    """Of a cluster's workers."""
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        found: Any = client.run(os.getpid)
        return list(found.values())


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--effort", choices=("fast", "normal"), default="fast")
    parser.add_argument("--classes", default="IH4,IH6")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="six silhouettes, one class")
    options = parser.parse_args()
    count = 6 if options.quick else options.count
    classes = ["IH4"] if options.quick else options.classes.split(",")
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        write_silhouettes(folder / "in", count)
        print(f"{count} silhouettes, effort {options.effort}, classes {', '.join(classes)}")
        each = {"effort": options.effort, "classes": classes}
        compare(folder, count, each, options.workers)


def compare(folder: Path, count: int, each: dict[str, Any], workers: int) -> None:
    """Both executors, the second after the first."""
    from distributed import LocalCluster

    given = {"folder": folder / "in", **each}
    local = find("batch").call({**given, "out": folder / "local", "workers": workers})

    def stop(done: int, cancel: Cancel) -> None:
        if done == count // 2:
            cancel.cancel()

    first, seconds = timed(local, stop)
    print(f"{workers} local processes, stopped: {_row(first, seconds)}")
    second, more = timed(local)
    print(f"{workers} local processes, gone on: {_row(second, more)}")
    with LocalCluster(
        n_workers=workers, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    ) as cluster:
        address = str(getattr(cluster, "scheduler_address"))  # noqa: B009  (it may be a coroutine)
        remote = find("batch").call({**given, "out": folder / "dask", "scheduler": address})
        victim = pids(address)[0]

        def kill(done: int, _cancel: Cancel) -> None:
            if done == max(1, count // 3):
                os.kill(victim, signal.SIGKILL)
                print(f"  worker {victim} killed after {done}")

        third, seconds = timed(remote, kill)
        print(f"{workers} workers of Dask, one killed: {_row(third, seconds)}")
        fourth, seconds = timed(remote)
        print(f"asked for again, Dask: {_row(fourth, seconds)}")
    fifth, seconds = timed(local)
    print(f"asked for again, local: {_row(fifth, seconds)}")
    wrong = different(contents(folder / "local"), contents(folder / "dask"))
    files = len(contents(folder / "local"))
    print(f"{files} files of results, {len(wrong)} of them different {wrong[:3]}")
    assert not wrong
    assert fourth["kept"] == fifth["kept"] == count


def _row(summary: dict[str, Any], seconds: float) -> str:
    new = summary["files"] - summary["kept"] - summary["left"]
    parts = [f"{seconds:8.1f} s", f"{new} done now", f"{summary['kept']} before"]
    if new:
        parts.append(f"{seconds / new:.2f} s each")
    without = summary["failed"] + summary["nothing"]
    return ", ".join(parts + ([f"{without} without a result"] if without else []))


if __name__ == "__main__":
    main()
