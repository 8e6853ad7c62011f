"""One picture of the paper's nine goals: our tile, filled, over the goal's outline, three by three.

    python benchmarks/nine_goals_picture.py [--effort fast|normal|best] [--seed N] [--quick]
        [--picture FILE.png]

Each goal is fitted in the class that suits it best (`BEST`), at its true aspect, and every tile is
certified before it is drawn.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import torch
from common import goal

from orbiflow.arrays import Window
from orbiflow.drawing import Sheet, fill_rings, plane_axes
from orbiflow.runtime import write_atomic
from orbiflow.tiles import EscherizeSettings, EscherTile, OverlapSearch, Target, escherize

BEST = {
    "bat_60": ("bat", "IH6"),
    "beetle_60": ("beetle", "IH4"),
    "camel_60": ("camel", "IH6"),
    "dolphin_60": ("dolphin", "IH6"),
    "octpus_94": ("octopus", "IH6"),
    "pegasus_60": ("pegasus", "IH6"),
    "penguin_60": ("penguin", "IH7"),
    "spider_120": ("spider", "IH4"),
    "squirrel1_60": ("squirrel", "IH5"),
}
"""Of each goal's file: its name in words, and its class of largest IoU in `escherization.py`."""

COLUMNS = 3
PANEL, CAPTION, LEGEND, MARGIN = (500, 360), 52, 52, 20  # pixels
TILE, GOAL, INK = "#8ab6d9", "#c0480a", "#1a1a1a"

Found = tuple[str, Target, EscherTile]


def fitted(file: str, effort: str, seed: int) -> Found:
    """The goal's name, the goal, and its certified tile."""
    name, isohedral = BEST[file]
    target = goal(file)
    settings = OverlapSearch.for_effort(effort, seed=seed)
    found = escherize(target, EscherizeSettings(classes=(isohedral,)), method=settings)
    assert not found.failures, found.failures
    assert found.tiles[0].certificate.valid
    return name, target, found.tiles[0]


def window(found: Found) -> Window:
    """Around the tile and the goal, in the shape of a panel."""
    _, target, result = found
    points = np.concatenate([result.tile.polygon, target.outline])
    low, high = points.min(axis=0), points.max(axis=0)
    size = np.array(PANEL, dtype=float)
    pixel = float(((high - low) / (size - 2 * MARGIN)).max())  # a pixel in the goal's units
    half = pixel * size / 2
    (xmin, ymin), (xmax, ymax) = (low + high) / 2 - half, (low + high) / 2 + half
    return float(xmin), float(ymin), float(xmax), float(ymax)


def picture(found: list[Found], effort: str) -> bytes:
    """PNG of all of them, and what is what."""
    rows = -(-len(found) // COLUMNS)
    width, height = COLUMNS * PANEL[0], rows * (PANEL[1] + CAPTION) + LEGEND
    sheet = Sheet.screen(width)
    figure = sheet.figure(height / sheet.dpi)
    for i, one in enumerate(found):
        name, target, result = one
        row, column = divmod(i, COLUMNS)
        bottom = height - (row + 1) * (PANEL[1] + CAPTION)
        left = column * PANEL[0] / width
        box = (left, (bottom + CAPTION) / height, PANEL[0] / width, PANEL[1] / height)
        axes = plane_axes(figure, window(one), y_down=target.y_down, box=box)
        fill_rings(axes, [result.tile.polygon], TILE, INK, 0.5)
        fill_rings(axes, [target.outline], "none", GOAL, 1.1)
        figure.text(
            left + PANEL[0] / width / 2,
            (bottom + CAPTION / 2) / height,
            f"{name}   {result.name}   IoU {result.metrics.iou:.3f}",
            ha="center",
            va="center",
            fontsize=8.5,
            color=INK,
        )
    strip = LEGEND / height
    for x, text, colour in (
        (0.05, "filled: the tile", "#3f7fb0"),
        (0.22, "line: the goal", GOAL),
        (0.38, f"effort {effort}, each goal in its best class, every tile certified", INK),
    ):
        figure.text(x, strip / 2, text, va="center", fontsize=7.5, color=colour)
    return sheet.file(figure)


def main() -> None:
    """Fit, say what came of it, and draw."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else "")
    parser.add_argument("--effort", choices=("fast", "normal", "best"), default="normal")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--picture", type=Path, default=Path("out/nine-goals.png"))
    parser.add_argument("--quick", action="store_true", help="three goals, effort fast")
    options = parser.parse_args()
    torch.set_num_threads(1)
    effort = "fast" if options.quick else options.effort
    found = []
    for file in list(BEST)[: COLUMNS if options.quick else None]:
        name, target, result = fitted(file, effort, options.seed)
        print(
            f"{name:10}{result.name:6}IoU {result.metrics.iou:.4f}  {result.seconds:5.1f} s",
            flush=True,
        )
        found.append((name, target, result))
    options.picture.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(options.picture, picture(found, effort))
    print(f"picture: {options.picture}")


if __name__ == "__main__":
    main()
