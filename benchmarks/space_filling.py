"""What space groups are worth for solids that fill space, and what whole searches find.

    python benchmarks/space_filling.py --groups all MESH ...      # the table of groups
    python benchmarks/space_filling.py [--effort fast|normal] MESH ...   # whole searches

The table has for each group the least cost of its best poses after a short bend: the share of space
that is left uncovered, that covered twice, and a quarter of the strain; and how it ranks, animal by
animal. A row of a whole search is of the first solid.
"""

from __future__ import annotations

import argparse
import time
from functools import partial
from pathlib import Path

import numpy as np

from orbiflow.errors import OrbiflowError
from orbiflow.runtime import NEVER, Team, ignore
from orbiflow.solids import FillSettings, GroupFamily, fill, read_mesh
from orbiflow.solids.search import EFFORTS, ROUGH_SPACING, Goal, quick_bend, starting_poses

MOST_COSETS = 8  # of groups in the table: solids of larger ones have no room for limbs


def main() -> None:
    """Print one of both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--groups", help="names between commas, or all: print the table of groups")
    parser.add_argument("--effort", choices=("fast", "normal"), default="normal")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("files", nargs="+", type=Path)
    options = parser.parse_args()
    if options.groups:
        _groups(options.files, options.groups, options.workers)
    else:
        _searches(options.files, options.effort, options.workers)


def _groups(files: list[Path], names: str, workers: int) -> None:
    families: list[GroupFamily] = []
    for name in range(1, 231) if names == "all" else names.split(","):
        try:
            own = GroupFamily.named(name)
        except OrbiflowError:
            continue  # it has mirrors
        if own.order <= MOST_COSETS:
            families.append(own)
    costs = np.zeros((len(files), len(families)))
    for row, file in zip(costs, files, strict=True):
        goal = Goal.of(read_mesh(file).mesh, FillSettings())
        job = partial(_cost, goal, goal.body(ROUGH_SPACING))
        row[:] = Team(__name__, workers, ignore, NEVER).each(job, families, file.stem, 1.0)
        print(
            file.stem,
            *(f"{f.name}={c:.3f}" for f, c in zip(families, row, strict=True)),
            flush=True,
        )
    worth = (costs - costs.min(axis=1, keepdims=True)).mean(axis=0)
    print(f"{'group':12} order  mean loss  " + "  ".join(f"{file.stem[:9]:>9}" for file in files))
    for k in np.argsort(worth, kind="stable"):
        cells = "  ".join(f"{cost:9.3f}" for cost in costs[:, k])
        print(f"{families[k].name:12} {families[k].order:5}  {worth[k]:9.3f}  {cells}")


def _cost(goal: Goal, body: object, family: GroupFamily) -> float:
    effort = EFFORTS["normal"]
    poses = starting_poses(effort, goal.inner_points, (family, np.random.SeedSequence(0)))
    return min(quick_bend(body, pose)[0] for pose in poses[: effort.per_group])


def _searches(files: list[Path], effort: str, workers: int) -> None:
    print(f"{'solid':20} group        score  overlap  shadows  kept  strain  found  seconds")
    for file in files:
        begin = time.perf_counter()
        settings = FillSettings(effort=effort, workers=workers)
        found = fill(read_mesh(file).mesh, settings, name=file.stem)
        seconds = time.perf_counter() - begin
        if not found:
            print(f"{file.stem:20} nothing found {seconds:51.0f}", flush=True)
            continue
        own, best = found[0].likeness, found[0]
        row = f"{file.stem:20} {best.group_name:12} {own.score:5.3f}  {own.overlap:7.3f}"
        row += f"  {own.shadows:7.3f}  {own.kept:4.2f}  {own.strain:6.3f}  {len(found):5}"
        print(f"{row}  {seconds:7.0f}", flush=True)


if __name__ == "__main__":
    main()
