"""Heads that must not bend: how far they are from what they were, with a pin and without.

    python benchmarks/likeness_pins.py [--effort fast|normal|best] [--picture FILE.png] [--quick]

For each of three goals and four classes: the misfit of the head (root mean square distance after the
best similarity, over that from its middle), and its turn against the whole tile in degrees. The
picture has the squirrel's IH5 without and with its head pinned. Where all tiles cross themselves: nan.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import torch
from common import goal

from orbiflow.arrays import Complex
from orbiflow.drawing import Sheet, fill_rings, plane_axes
from orbiflow.runtime import write_atomic
from orbiflow.tiles import (
    EscherizeSettings,
    EscherTile,
    LikenessSearch,
    Pins,
    Target,
    best_similarity,
    escherize,
)

HEADS = {
    "squirrel1_60": ("squirrel", "225,185,185"),
    "pegasus_60": ("pegasus", "625,110,110"),
    "camel_60": ("camel", "150,160,115"),
}
CLASSES = ("IH4", "IH5", "IH6", "IH7")
TILE, INK, WAS, HEAD = "#d7dee6", "#24567f", "#9a8c7a", "#1f9d55"


def tiles(target: Target, effort: str, pins: Pins | None) -> dict[str, EscherTile]:
    """The certified tiles of the four classes."""
    settings, method = EscherizeSettings(classes=CLASSES), LikenessSearch.for_effort(effort)
    found = escherize(target, settings.replace(workers=2), method=method, pins=pins).tiles
    assert all(tile.certificate.valid for tile in found)
    return {tile.name: tile for tile in found}


def outlines(tile: EscherTile) -> tuple[Complex, Complex]:
    """The silhouette's outline (n,) as it was, and bent."""
    assert tile.rest is not None
    assert tile.bent is not None
    was, now = (np.asarray(ring @ [1, 1j], np.complex128) for ring in (tile.rest, tile.bent))
    return was, now


def head(tile: EscherTile, pins: Pins, target: Target) -> tuple[Complex, Complex]:
    """The head's outline (n,) as it was, and bent."""
    was, now = outlines(tile)
    held = pins.holds(target.to_normal(np.stack([was.real, was.imag], axis=1)))
    return was[held], now[held]


def measures(tile: EscherTile, pins: Pins, target: Target) -> tuple[float, float]:
    """The misfit of the head, and its turn in degrees."""
    was, now = head(tile, pins, target)
    factor, whole = best_similarity(was, now), best_similarity(*outlines(tile))
    own = now - now.mean()
    left = np.linalg.norm(own - factor * (was - was.mean())) / np.linalg.norm(own)
    return float(left), float(np.degrees(np.angle(factor / whole)))


def picture(target: Target, pins: Pins, free: EscherTile, pinned: EscherTile) -> bytes:
    """Two tiles with the silhouette as it was, and the head's own shape where it fits best."""
    sheet, both = Sheet.screen(1400), (free, pinned)
    points = np.concatenate([target.outline, *(tile.tile.polygon for tile in both)])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.04 * float((high - low).max())
    (xmin, ymin), (xmax, ymax) = low - margin, high + margin
    aspect = (ymax - ymin) / (xmax - xmin)
    legend = 60 / 1400
    height = aspect / 2 + legend
    figure = sheet.figure(height * 1400 / sheet.dpi)
    for k, (tile, words) in enumerate(zip(both, ("nothing pinned", "head pinned"), strict=True)):
        box = (k / 2, legend / height, 0.5, 1 - legend / height)
        axes = plane_axes(figure, (xmin, ymin, xmax, ymax), y_down=target.y_down, box=box)
        fill_rings(axes, [tile.tile.polygon], TILE, INK, 2.0)
        closed = np.concatenate([target.outline, target.outline[:1]])
        axes.plot(*closed.T, color=WAS, lw=1.2, ls=(0, (6, 4)))
        was, now = head(tile, pins, target)
        own = now.mean() + best_similarity(was, now) * (was - was.mean())
        # from behind the gap: what is pinned is one piece of the outline
        own = np.roll(own, -1 - int(np.argmax(abs(np.roll(was, -1) - was))))
        axes.plot(own.real, own.imag, color=HEAD, lw=2.6, ls=(0, (1, 1)))
        middle = legend / height / 2
        figure.text(k / 2 + 0.02, middle, words, va="center", fontsize=7, fontweight="bold")
        for x, text, colour in (
            (0.20, "- - -  as it was", WAS),
            (0.31, ". . .  the head's own shape", HEAD),
        ):
            figure.text(k / 2 + x, middle, text, va="center", fontsize=7, color=colour)
    return sheet.file(figure)


def main() -> None:
    """Search thrice for each goal, print the table and draw."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--effort", choices=("fast", "normal", "best"), default="normal")
    parser.add_argument("--picture", type=Path, default=Path("out/squirrel-pin.png"))
    parser.add_argument("--quick", action="store_true", help="the squirrel alone, effort fast")
    options = parser.parse_args()
    torch.set_num_threads(1)
    effort = "fast" if options.quick else options.effort
    print("head      class  misfit: free  pinned  turn: free  angle kept")
    for name, (words, spot) in list(HEADS.items())[: 1 if options.quick else None]:
        target = goal(name)
        pins, still = (Pins.read([spot], target, keep_angle=keep) for keep in (False, True))
        free, pinned, kept = (tiles(target, effort, own) for own in (None, pins, still))
        for kind in CLASSES:
            own = (found.get(kind) for found in (free, pinned, kept))
            (misfit, turn), (held, _), (_, angle) = (
                (np.nan, np.nan) if tile is None else measures(tile, pins, target) for tile in own
            )
            print(f"{words:9} {kind:6} {misfit:11.3f} {held:8.4f} {turn:10.0f}° {angle:10.0f}°")
        if words == "squirrel" and "IH5" in free and "IH5" in pinned:
            options.picture.parent.mkdir(parents=True, exist_ok=True)
            write_atomic(options.picture, picture(target, pins, free["IH5"], pinned["IH5"]))
            print(f"picture: {options.picture}", flush=True)


if __name__ == "__main__":
    main()
