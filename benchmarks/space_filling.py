"""What space groups are worth for solids that fill space, and what whole searches find.

    python benchmarks/space_filling.py [--effort fast] [--separable] [--out FOLDER] MESH ...
    python benchmarks/space_filling.py --groups all MESH ...      # what groups are worth

A row of a search is of the first solid: how much it looks like the figure, how many of a million points
of a grid are in no copy or in several, and whether a copy with the gap of a print
leaves a stack by a straight move. With --out
the sheet of each first solid is written into a folder, and solids.png, the solids alone, for people to
name.

The table of groups has for each the least cost of its best poses after a short bend: the share of space
that is left uncovered, that covered twice, and a quarter of the strain.
"""

from __future__ import annotations

import argparse
import random
import time
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from orbiflow.drawing import ShadedPart, SolidView, draw_solids, font
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import NEVER, Team, ignore
from orbiflow.solids import EscherSolid, FillSettings, GroupFamily, fill, read_mesh, usual_up
from orbiflow.solids.body import Body
from orbiflow.solids.distance import points_inside
from orbiflow.solids.pictures import solid_sheet
from orbiflow.solids.search import EFFORTS, SolidGoal, quick_bend, starting_poses
from orbiflow.solids.separable import pieces_with_gap

MOST_COSETS = 8  # of groups in the table: solids of larger ones have little room for limbs


def main() -> None:
    """Print one of both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--groups", help="names between commas, or all: print the table of groups")
    parser.add_argument("--effort", choices=("fast", "normal"), default="normal")
    parser.add_argument("--method", choices=("bending", "flow"), default="bending")
    parser.add_argument("--separable", action="store_true", help="only solids that come apart")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path)
    parser.add_argument("files", nargs="+", type=Path)
    options = parser.parse_args()
    if options.groups:
        _groups(options.files, options.groups, options.workers)
    else:
        settings = FillSettings(
            effort=options.effort,
            method=options.method,
            separable=options.separable,
            workers=options.workers,
        )
        _searches(options.files, settings, options.out)


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
        goal = SolidGoal.of(read_mesh(file).mesh, FillSettings())
        job = partial(_cost, goal, goal.body(EFFORTS["fast"].rough))
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


def _cost(goal: SolidGoal, body: Body, family: GroupFamily) -> float:
    effort = EFFORTS["fast"]
    poses = starting_poses(effort, goal.inner_points, (family, np.random.SeedSequence(0)))
    return min(quick_bend(body, pose)[0] for pose in poses)


def _searches(files: list[Path], settings: FillSettings, out: Path | None) -> None:
    print(
        "solid       group      score overlap shadows kept smooth bent  missed  leaves  found  seconds"
    )
    best = list[EscherSolid]()
    for file in files:
        begin = time.perf_counter()
        found = fill(read_mesh(file).mesh, settings.replace(up=usual_up(file)), name=file.stem)
        seconds = time.perf_counter() - begin
        if not found:
            print(f"{file.stem[:11]:11} nothing found {seconds:60.0f}", flush=True)
            continue
        own = found[0].likeness
        row = f"{file.stem[:11]:11} {found[0].group_name:10} {own.score:5.3f} {own.overlap:7.3f}"
        row += f" {own.shadows:7.3f} {own.kept:4.2f} {own.smooth:6.2f} {own.strain:4.2f}"
        pieces = pieces_with_gap(found[0].group, found[0].tile)
        leaves = pieces.leaving_stack(found[0].group.linear_parts if settings.separable else None)
        free = "yes" if leaves.is_free else f"{100 * leaves.blocked:.1f} %"
        row += f"  {missed(found[0]):6} {free:>7} {len(found):6} {seconds:8.0f}"
        print(row, flush=True)
        best.append(found[0])
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        for solid in best:
            solid_sheet(solid).save(out / f"{solid.name}.png")
        solids_picture(best).save(out / "solids.png")


def missed(solid: EscherSolid, side: int = 100) -> int:
    """Return how many points of a grid, `side` each way, are not in exactly one copy of a solid."""
    box = float(np.ptp(solid.tile.points, axis=0).max())
    middle, spacing = solid.tile.centroid, box / side
    low = np.rint((middle - box / 2) / spacing).astype(int)
    counts = np.zeros((side,) * 3, dtype=int)
    reach = box * np.sqrt(3) / 2 + float(np.linalg.norm(solid.tile.points - middle, axis=1).max())
    for g in solid.group.elements_near(middle, reach, source=middle):
        places = points_inside(solid.tile.moved(g.linear, g.translation), spacing)
        at = np.rint(places / spacing).astype(int) - low
        counts[tuple(at[((at >= 0) & (at < side)).all(axis=1)].T)] += 1
    return int((counts != 1).sum())


def solids_picture(solids: list[EscherSolid], size: int = 480) -> Image.Image:
    """Return a picture of solids alone, numbered in a random order, and print their names."""
    solids = random.Random(0).sample(solids, len(solids))
    picture = Image.new("RGB", (2 * size, size * len(solids)), "white")
    pen = ImageDraw.Draw(picture)
    for k, solid in enumerate(solids):
        part = ShadedPart.smooth(solid.tile.points, solid.tile.faces, "#e9b44c")
        for column, side in enumerate(((0.6, -1.0, 0.35), (-0.9, -0.5, 0.25))):
            direction, up = solid.upright @ side, solid.upright[:, 2]
            view = SolidView(tuple(direction.tolist()), tuple(up.tolist()))
            picture.paste(draw_solids([part], (size, size), view), (column * size, k * size))
        pen.text((8, k * size + 8), str(k + 1), "black", font(24))
    print("; ".join(f"{k} {own.name}" for k, own in enumerate(solids, 1)))
    return picture


if __name__ == "__main__":
    main()
