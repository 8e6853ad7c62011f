"""Tiles for the paper's nine goals, beside published figures and the tiles of EST and ARAP.

    python benchmarks/escherization.py [--effort fast|normal|best] [--distorted] [--quick] [GOAL ...]

True-aspect polygons, or with --distorted the PNGs that the paper used, each axis stretched to a
square. EST's and ARAP's twenty tiles of each goal are scored by our metrics after the best
similarity. Bars: IoU at least EST's best, Dice at least the best of the paper's two columns and EST's.
"""

from __future__ import annotations

import argparse
import json
import os
import time

import numpy as np
import shapely
import torch
from common import SILHOUETTES, aligned, reference

from orbiflow.escher import DescentSettings, TileResult, escherize
from orbiflow.likeness.metrics import compare
from orbiflow.likeness.recognition import Recogniser
from orbiflow.silhouette import Target
from orbiflow.tilings import CLASSES

DISTORTED = {"octpus_94": "octpus", "penguin_60": "penguin2", "squirrel1_60": "squirrel"}


def target_of(goal: str, distorted: bool) -> Target:
    """The goal as a target."""
    if distorted:
        name = DISTORTED.get(goal, goal.rsplit("_", 1)[0])
        return Target.read(SILHOUETTES / "nagata_distorted_png" / f"{name}.png")
    return Target.read(SILHOUETTES / "nagata" / f"{goal}.dat")


def baselines(goal: str) -> dict[str, tuple[float, float, float]]:
    """Best IoU, Dice and recognisability over EST's and ARAP's tiles, by our metrics."""
    document = json.loads((SILHOUETTES / "baseline_tiles" / f"{goal}.json").read_text())
    target = Target.read(SILHOUETTES / "nagata" / f"{goal}.dat")
    recognise = Recogniser(target.outline)
    best = {}
    for key, name in (("est_euclid_top20", "EST"), ("arap_EIR_top20", "ARAP")):
        scores = []
        for tile in document[key]:
            ring = np.array(tile["tile"])
            if not shapely.Polygon(ring).is_valid:
                continue
            moved = aligned(ring, np.asarray(target.outline))
            metrics = compare(moved, target.outline)
            scores.append((metrics.iou, metrics.dice, recognise(moved).score))
        best[name] = max(scores)
    return best


def search(target: Target, effort: str, seed: int) -> tuple[list[TileResult], float]:
    """Certified tiles of all classes, largest IoU first, and the seconds that they took."""
    begin = time.perf_counter()
    results, failures = escherize(
        target,
        CLASSES,
        DescentSettings.for_effort(effort, seed=seed),
        workers=os.cpu_count() or 1,
    )
    assert not failures, failures
    assert all(result.certificate.valid for result in results)
    return sorted(results, key=lambda r: -r.metrics.iou), time.perf_counter() - begin


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("goals", nargs="*")
    parser.add_argument("--effort", choices=("fast", "normal", "best"), default="normal")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--distorted", action="store_true")
    parser.add_argument("--quick", action="store_true", help="one goal, effort fast")
    options = parser.parse_args()
    torch.set_num_threads(1)
    published = reference()
    goals = options.goals or (["dolphin_60"] if options.quick else list(published))
    effort = "fast" if options.quick else options.effort
    kind = "distorted PNGs" if options.distorted else "true-aspect polygons"
    print(f"{kind}, effort {effort}, seed {options.seed}")
    print(
        "goal          class    IoU   Dice  recog  seconds starts dropped |  paper  p.ARAP |"
        " est_best  dice | arap_0 | EST here: IoU   Dice  recog | ARAP here: IoU  recog | bars"
    )
    ious, lines = [], []
    for goal in goals:
        target = target_of(goal, options.distorted)
        results, seconds = search(target, effort, options.seed)
        best, known = results[0], published[goal]
        ious.append(best.metrics.iou)
        need = max(known["paper_ours"], known["paper_arap"], known["est_best_dice"])
        met = best.metrics.iou >= known["est_best"] and best.metrics.dice >= need
        row = (
            f"{goal:14}{best.name:6}{best.metrics.iou:7.4f}{best.metrics.dice:7.4f}"
            f"{best.recognisability.score:7.3f}{seconds:9.1f}"
            f"{sum(r.starts for r in results):7}{sum(r.dropped for r in results):8} |"
            f"{known['paper_ours']:7.3f}{known['paper_arap']:8.3f} |"
            f"{known['est_best']:9.4f}{known['est_best_dice']:7.4f}|{known['arap_rank0']:7.3f} |"
        )
        if not options.distorted:
            own = baselines(goal)
            est, arap = own["EST"], own["ARAP"]
            row += f"{est[0]:14.4f}{est[1]:7.4f}{est[2]:7.3f} |{arap[0]:14.4f}{arap[2]:7.3f} |"
            row += f" {'met' if met else f'Dice below {need}'}"
        print(row, flush=True)
        by_class = {r.name: r.metrics.iou for r in results}
        lines.append(f"{goal:14}" + "".join(f"{by_class[name]:8.4f}" for name in CLASSES))
    print(f"mean IoU {np.mean(ious):.4f}\n\nIoU of each class\n{'':14}", end="")
    print("".join(f"{name:>8}" for name in CLASSES))
    print("\n".join(lines))


if __name__ == "__main__":
    main()
