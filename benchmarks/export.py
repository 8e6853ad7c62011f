"""Sizes and times of exported tilings, 10 x 10 and 100 x 100 tiles on a page.

    python benchmarks/export.py [--quick]

Start-up (imports) is not counted. `--quick` leaves out the slow formats of the large page.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from orbiflow.tiles import ExportSettings, Tile, isohedral_class, scenes, write_scene

SIDE = 20.0  # of a tile, in mm


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    tile = wavy_tile()
    print(f"{'':22} {'tiles':>6} {'lay out s':>9} {'write s':>8} {'MB':>8}  bytes a tile")
    for across in (10, 100):
        for cut in ("none", "skeleton"):
            for form in ("svg", "pdf", "dxf", "png", "json"):
                if not (quick and across == 100 and form != "svg"):
                    row(tile, across, cut, form)
    row(tile, 10, "pieces", "svg")


def row(tile: Tile, across: int, cut, form) -> None:
    # a page with so many tiles by area
    side = across * SIDE * np.sqrt(abs(tile.signed_area)) / longer(tile)
    settings = ExportSettings(
        format=form, cut=cut, tile_size=SIDE, area=(side, side), clip=cut == "none"
    )
    if form == "png":
        settings = settings.replace(dpi=100)
    start = time.perf_counter()
    made, _ = scenes(tile, settings)
    middle = time.perf_counter()
    content = write_scene(made[0], settings)
    end = time.perf_counter()
    size, tiles = len(content), len(made[0].tiles)
    print(
        f"{across:>3} x {across:<3} {cut:8} {form:4} {tiles:>7} {middle - start:>9.2f} "
        f"{end - middle:>8.2f} {size / 1e6:>8.2f}  {size / tiles:.0f}"
    )


def wavy_tile() -> Tile:
    """A tile of IH6, its edges bent by a field of its group: 120 vertices."""
    kind = isohedral_class("IH6")
    group, vertices = kind.group(), kind.template()
    share = np.linspace(0, 1, 20, endpoint=False)[:, None]
    ring = np.concatenate(
        [a + share * (b - a) for a, b in zip(vertices, np.roll(vertices, -1, axis=0), strict=True)]
    )
    pushed = []
    for coset in group.cosets:
        u = 2 * np.pi * coset(ring) @ group.inverse_lattice.T
        pushed.append(np.stack([np.cos(u[:, 0] + 1), np.sin(u[:, 0] - u[:, 1])], 1) @ coset.linear)
    return Tile(ring + 0.1 * np.mean(pushed, axis=0), group, kind.name)


def longer(tile: Tile) -> float:
    from orbiflow.tiles.exporting import longer_side

    return longer_side(tile.polygon)


if __name__ == "__main__":
    main()
