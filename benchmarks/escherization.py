"""Tiles for the paper's nine goals, beside published figures and the tiles of EST and ARAP.

    python benchmarks/escherization.py [--effort fast|normal] [--distorted] [--quick] [GOAL ...]
    python benchmarks/escherization.py --against CHECKOUT [--effort ...] [GOAL or FILE ...]

True-aspect polygons, or with --distorted the PNGs that the paper used, each axis stretched to a
square. The rows of EST and ARAP are the best of their twenty tiles by our metrics after the best
similarity (`baseline_tiles.py`). Bars: IoU at least EST's best, Dice at least the best of the paper's
two columns and EST's.

With --against, the search for likeness instead, and that of another checkout: the whole command with
one worker, one after the other for each goal. Printed are seconds by the clock and of the processor,
the marks of the first tiles, whether all is certified, and the ratios' medians.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import torch
from common import BUNDLED, DATA, GOALS, ROOT, goal, needed, published

from orbiflow.tiles import CLASSES, EscherizeSettings, EscherTile, OverlapSearch, Target, escherize
from orbiflow.tiles.likeness.faithful import GOOD_MARK, STEEPNESS

DISTORTED = {"octpus_94": "octpus", "penguin_60": "penguin2", "squirrel1_60": "squirrel"}


def target_of(name: str, distorted: bool) -> Target:
    """The goal as a target."""
    if not distorted:
        return goal(name)
    folder = needed(DATA / "silhouettes" / "nagata_distorted_png", "the paper's distorted PNGs")
    return Target.read(folder / f"{DISTORTED.get(name, name.rsplit('_', 1)[0])}.png")


def search(target: Target, effort: str, seed: int) -> tuple[list[EscherTile], float]:
    """Certified tiles of all classes, largest IoU first, and the seconds that they took."""
    begin = time.perf_counter()
    method, own = (
        OverlapSearch.for_effort(effort, seed=seed),
        EscherizeSettings(workers=os.cpu_count()),
    )
    found = escherize(target, own, method=method)
    assert not found.failures, found.failures
    assert all(result.certificate.valid for result in found.tiles)
    return sorted(found.tiles, key=lambda r: -r.likeness.metrics.iou), time.perf_counter() - begin


def command(tree: Path, picture: Path, effort: str) -> tuple[float, float, float, bool]:
    """Seconds by the clock and of the processor, the first tile's mark, whether all is certified."""
    with tempfile.TemporaryDirectory() as folder:
        own = [str(picture), "--effort", effort, "--workers", "1", "--out", f"{folder}/run"]
        begin, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(
            [sys.executable, "-m", "orbiflow", "escherize", *own],
            env={**os.environ, "PYTHONPATH": str(tree / "src"), "OMP_NUM_THREADS": "1"},
            check=True,
            capture_output=True,
        )
        clock, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
        tiles = json.loads(Path(folder, "run", "result.json").read_text())["tiles"]
    score = min(max(tiles[0]["score"], 1e-9), 1 - 1e-9)
    mark = GOOD_MARK + math.log(score / (1 - score)) / STEEPNESS  # as `Fidelity.score` is made
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return clock, spent, mark, all(tile["certificate"]["valid"] for tile in tiles)


def compare(tree: Path, effort: str, goals: list[str]) -> None:
    """Print the table of this checkout's search and another's."""
    rows = []
    print(f"effort {effort:19} clock: before  now   processor: before  now   marks: before  now")
    for name in goals:
        picture = Path(name) if Path(name).is_file() else BUNDLED / "nagata" / f"{name}.dat"
        before, now = (command(own, picture, effort) for own in (tree, ROOT))
        rows.append((before, now))
        marks = f"{before[2]:15.2f}{now[2]:6.2f}{'' if now[3] else '  NOT CERTIFIED'}"
        print(
            f"{picture.stem:26}{before[0]:9.1f}{now[0]:7.1f}{before[1]:19.1f}{now[1]:7.1f}{marks}",
            flush=True,
        )
    table = np.array([[before[:3], now[:3]] for before, now in rows])
    clock, spent, _ = np.median(table[:, 1] / table[:, 0], axis=0)
    gains = table[:, 1, 2] - table[:, 0, 2]
    print(
        f"medians of ratios: clock {clock:.2f}, processor {spent:.2f}; "
        f"marks {gains.mean():+.3f} in the mean, {gains.min():+.2f} at least"
    )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("goals", nargs="*")
    parser.add_argument("--effort", choices=("fast", "normal"), default="normal")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--distorted", action="store_true")
    parser.add_argument("--against", type=Path, help="another checkout")
    parser.add_argument("--quick", action="store_true", help="one goal, effort fast")
    options = parser.parse_args()
    if options.against:
        compare(options.against, options.effort, options.goals or [*GOALS])
        return
    torch.set_num_threads(1)
    figures = published("nine_goals")
    goals = options.goals or (["dolphin_60"] if options.quick else GOALS)
    targets = {name: target_of(name, options.distorted) for name in goals}
    effort = "fast" if options.quick else options.effort
    kind = "distorted PNGs" if options.distorted else "true-aspect polygons"
    print(f"{kind}, effort {effort}, seed {options.seed}")
    print(
        "goal          class    IoU   Dice  recog  seconds starts dropped |  paper  p.ARAP |"
        " est_best  dice | arap_0 | EST here: IoU   Dice  recog | ARAP here: IoU  recog | bars"
    )
    ious, lines = [], []
    for name, target in targets.items():
        results, seconds = search(target, effort, options.seed)
        best, known = results[0], figures[name]
        ious.append(best.likeness.metrics.iou)
        need = max(known["paper_ours"], known["paper_arap"], known["est_best_dice"])
        met = best.likeness.metrics.iou >= known["est_best"] and best.likeness.metrics.dice >= need
        row = (
            f"{name:14}{best.name:6}{best.likeness.metrics.iou:7.4f}{best.likeness.metrics.dice:7.4f}"
            f"{best.likeness.recognisability.score:7.3f}{seconds:9.1f}"
            f"{sum(r.search.starts for r in results):7}{sum(r.search.dropped for r in results):8} |"
            f"{known['paper_ours']:7.3f}{known['paper_arap']:8.3f} |"
            f"{known['est_best']:9.4f}{known['est_best_dice']:7.4f}|{known['arap_rank0']:7.3f} |"
        )
        if not options.distorted:
            est, arap = known["est"], known["arap"]
            row += f"{est['iou']:14.4f}{est['dice']:7.4f}{est['recognisability']:7.3f} |"
            row += f"{arap['iou']:14.4f}{arap['recognisability']:7.3f} |"
            row += f" {'met' if met else f'Dice below {need}'}"
        print(row, flush=True)
        by_class = {r.name: r.likeness.metrics.iou for r in results}
        lines.append(f"{name:14}" + "".join(f"{by_class[kind]:8.4f}" for kind in CLASSES))
    print(f"mean IoU {np.mean(ious):.4f}\n\nIoU of each class\n{'':14}", end="")
    print("".join(f"{name:>8}" for name in CLASSES))
    print("\n".join(lines))


if __name__ == "__main__":
    main()
