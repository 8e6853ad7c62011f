"""The twenty PhyloPic silhouettes: all classes, mean and worst IoU, a contact sheet.

python benchmarks/phylopic.py [--effort fast|normal|best] [--sheet FILE.png] [--quick]
"""

from __future__ import annotations

import argparse
import io
import os
import time
from pathlib import Path

import numpy as np
import torch
from common import DATA, needed
from PIL import Image, ImageDraw, ImageFont

from orbiflow.tiles import (
    EscherizeSettings,
    EscherTile,
    OverlapSearch,
    Target,
    escherize,
    overlay_raster,
    tiling_raster,
)

PANEL = 420  # pixels


def sheet(found: list[tuple[str, Target, EscherTile]]) -> Image.Image:
    """Each silhouette under its best tile, and the tiling."""
    columns = 4
    rows = -(-len(found) // columns)
    page = Image.new("RGB", (columns * 2 * PANEL, rows * (PANEL + 40)), "white")
    pen, font = ImageDraw.Draw(page), ImageFont.load_default(size=24)
    for i, (name, target, best) in enumerate(found):
        x, y = (i % columns) * 2 * PANEL, (i // columns) * (PANEL + 40)
        text = f"{name}  {best.name}  IoU {best.metrics.iou:.3f}"
        pen.text((x + 12, y + 8), text, fill="#1a1a1a", font=font)
        pictures = (
            overlay_raster(best.tile, target.outline, y_down=target.y_down, width_px=640).png(),
            tiling_raster(best.tile, y_down=target.y_down, width_px=640).png(),
        )
        for j, data in enumerate(pictures):
            picture = Image.open(io.BytesIO(data)).convert("RGB")
            picture.thumbnail((PANEL - 20, PANEL - 10), Image.Resampling.LANCZOS)
            page.paste(picture, (x + j * PANEL + 10, y + 40))
    return page


def main() -> None:
    """Print the table and write the sheet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--effort", choices=("fast", "normal", "best"), default="normal")
    parser.add_argument("--sheet", type=Path, default=Path("out/phylopic.png"))
    parser.add_argument("--quick", action="store_true", help="two silhouettes, effort fast")
    options = parser.parse_args()
    torch.set_num_threads(1)
    folder = needed(DATA / "silhouettes" / "phylopic", "the twenty PhyloPic silhouettes")
    files = sorted(folder.glob("*.png"))[: 2 if options.quick else None]
    settings = OverlapSearch.for_effort("fast" if options.quick else options.effort)
    print("silhouette         vertices class     IoU   Dice  recog  certified  failed seconds")
    found: list[tuple[str, Target, EscherTile]] = []
    for path in files:
        target = Target.read(path)
        begin = time.perf_counter()
        search = escherize(target, EscherizeSettings(workers=os.cpu_count()), method=settings)
        results, failures = search.tiles, search.failures
        seconds = time.perf_counter() - begin
        best = results[0]
        found.append((path.stem, target, best))
        sound = sum(result.certificate.valid for result in results)
        print(
            f"{path.stem:19}{len(target.outline):8} {best.name:6}{best.metrics.iou:8.4f}"
            f"{best.metrics.dice:7.4f}{best.recognisability.score:7.3f}{sound:8} of 9"
            f"{len(failures):7}{seconds:8.1f}",
            flush=True,
        )
    ious = [best.metrics.iou for _, _, best in found]
    print(f"mean IoU {np.mean(ious):.4f}, worst {min(ious):.4f}")
    options.sheet.parent.mkdir(parents=True, exist_ok=True)
    sheet(found).save(options.sheet)
    print(f"contact sheet: {options.sheet}")


if __name__ == "__main__":
    main()
