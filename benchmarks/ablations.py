"""What each part of the search brings, how its cost grows, and what it needs.

    python benchmarks/ablations.py [ablations] [curve] [growth] [memory] [--quick]

Three goals (bat, beetle, octopus), three classes (IH4, IH6, IH7), one process; all without names.
"""

from __future__ import annotations

import argparse
import resource
import time
from dataclasses import replace

import numpy as np
import torch
from common import goal

from orbiflow.tiles import (
    ClassFailure,
    OccupancySearch,
    OverlapSearch,
    SearchMethod,
    SoftTarget,
    escherize_class,
    isohedral_class,
)
from orbiflow.tiles.search.descent import Descent
from orbiflow.tiles.search.starts import outline_starts

GOALS = ("bat_60", "beetle_60", "octpus_94")
CLASSES = ("IH4", "IH6", "IH7")
NORMAL = OverlapSearch()


def measured(
    settings: SearchMethod, goals: tuple[str, ...], classes: tuple[str, ...]
) -> tuple[list[float], float]:
    """Best IoU of each goal, and the mean seconds of a class."""
    best, seconds, failed = [], [], 0
    for name in goals:
        target, ious = goal(name), [0.0]
        for kind in classes:
            begin = time.perf_counter()
            outcome = escherize_class(target, kind, settings)
            seconds.append(time.perf_counter() - begin)
            if isinstance(outcome, ClassFailure):
                failed += 1
            else:
                ious.append(outcome.metrics.iou)
        best.append(max(ious))
    return best, float(np.mean(seconds))


def ablations(goals: tuple[str, ...], classes: tuple[str, ...]) -> None:
    """One row for each change of the normal effort."""
    rows: dict[str, SearchMethod] = {
        "normal": NORMAL,
        "lattice freedom off": replace(NORMAL, lattice=False),
        "starts: template turned, stretched": replace(NORMAL, starts="template"),
        "starts only, one step": replace(NORMAL, stages=((1, 1),), reach=(1e-6, 1e-6)),
        "Omega 2": replace(NORMAL, max_frequency=2),
        "Omega 5": replace(NORMAL, max_frequency=5),
        "Omega 20": replace(NORMAL, max_frequency=20),
        "one resolution (60)": replace(NORMAL, resolutions=(60,)),
        "effort fast": OverlapSearch.for_effort("fast"),
    }
    print("\nablation" + " " * 30 + "".join(f"{name:>11}" for name in goals) + "  s a class")
    for name, settings in rows.items():
        best, seconds = measured(settings, goals, classes)
        print(f"{name:38}" + "".join(f"{b:11.4f}" for b in best) + f"{seconds:11.2f}", flush=True)
        if name == "normal":
            share = max(1, round(200 * seconds / 12))  # as many steps as take about that long
            equal = OccupancySearch(iterations=share, affine_iterations=max(1, share // 2))
            best, own = measured(equal, goals, classes)
            row = "".join(f"{b:11.4f}" for b in best)
            print(f"{'occupancy loss, about equal time':38}{row}{own:11.2f}", flush=True)


def curve(goals: tuple[str, ...], classes: tuple[str, ...]) -> None:
    """IoU against seconds: the descent's efforts and the occupancy method's iterations."""
    print("\nIoU against seconds       " + "".join(f"{name:>11}" for name in goals) + "  s a class")
    steps: dict[str, SearchMethod] = {
        "descent, starts only": replace(NORMAL, stages=((1, 1),), reach=(1e-6, 1e-6)),
        "descent, fast": OverlapSearch.for_effort("fast"),
        "descent, normal": NORMAL,
        "occupancy, 20 steps": OccupancySearch(iterations=20, affine_iterations=20),
        "occupancy, 100 steps": OccupancySearch(iterations=100),
        "occupancy, 200 steps": OccupancySearch(),
    }
    for name, settings in steps.items():
        best, seconds = measured(settings, goals, classes)
        print(f"{name:26}" + "".join(f"{b:11.4f}" for b in best) + f"{seconds:11.2f}", flush=True)


def growth() -> None:
    """Seconds of a descent step against boundary points, Omega and starts; log-log slopes."""
    target, kind = goal("bat_60"), isohedral_class("IH4")
    soft = SoftTarget(target)

    def step(boundary: int, omega: int, starts: int) -> float:
        settings = replace(NORMAL, max_frequency=omega, boundary=boundary, resolutions=(60,))
        found = outline_starts(target, kind, count=64, resolutions=(60,), vertices=boundary)
        chosen = [k % len(found.prototiles) for k in range(starts)]
        descent = Descent(kind, found.prototiles.take(chosen), settings)
        times = []
        for _ in range(12):
            begin = time.perf_counter()
            descent.step(soft)
            times.append(time.perf_counter() - begin)
        return min(times)

    sweeps = {
        "boundary points": [(n, 10, 16) for n in (120, 240, 480, 960)],
        "Omega": [(240, n, 16) for n in (5, 10, 20, 40)],
        "starts": [(240, 10, n) for n in (4, 16, 64, 256)],
    }
    print("\ngrowth of a step (ms)")
    for index, (name, sweep) in enumerate(sweeps.items()):
        values = [row[index] for row in sweep]
        times = [step(*row) for row in sweep]
        slope = np.polyfit(np.log(values), np.log(times), 1)[0]
        cells = ", ".join(f"{v}: {1e3 * t:.1f}" for v, t in zip(values, times, strict=True))
        print(f"{name:16} {cells}   slope {slope:.2f}", flush=True)


def memory() -> None:
    """Peak memory of a best run of one class."""
    torch.set_num_threads(1)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    outcome = escherize_class(goal("octpus_94"), "IH4", OverlapSearch.for_effort("best"))
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"\nmemory: {before:.0f} MiB after imports, peak {after:.0f} MiB in a best run of IH4")
    if not isinstance(outcome, ClassFailure):
        print(f"(octopus, IoU {outcome.metrics.iou:.4f}, {outcome.seconds:.0f} s)")


def main() -> None:
    """Print the tables asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", choices=("ablations", "curve", "growth", "memory", []))
    parser.add_argument("--quick", action="store_true", help="one goal, one class")
    options = parser.parse_args()
    torch.set_num_threads(1)
    parts = options.parts or (["growth"] if options.quick else None)
    goals, classes = (GOALS[:1], CLASSES[:1]) if options.quick else (GOALS, CLASSES)
    if parts is None or "memory" in parts:
        memory()  # first: the peak is the process's
    if parts is None or "ablations" in parts:
        ablations(goals, classes)
    if parts is None or "curve" in parts:
        curve(goals, classes)
    if parts is None or "growth" in parts:
        growth()


if __name__ == "__main__":
    main()
