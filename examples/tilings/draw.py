"""Tilings with symmetric tiles and with several prototiles, certified and drawn.

python examples/tilings/draw.py [--out tilings.png]
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

from orbiflow import (
    WALLPAPER_GROUPS,
    Tile,
    Tiling,
    certify,
    dirichlet_tile,
    dirichlet_tiling,
    isohedral_class,
    tilings_png,
    wallpaper_group,
)
from orbiflow.runtime import write_atomic

SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])


def of_the_square() -> dict[str, Tiling]:
    """The cell of p4m, and two ways to cut it."""
    p4m = wallpaper_group("p4m")
    return {
        "p4m: the cell": Tiling(p4m, [SQUARE]),
        "p4m: a quarter": Tiling(p4m, [[[0, 0], [0.5, -0.5], [0.5, 0.5]]]),
        "p4m: an eighth": Tiling(p4m, [[[0, 0], [0.5, 0], [0.5, 0.5]]]),
    }


def waves(count: int, seed: int, height: float) -> np.ndarray:
    """(count,) a random smooth curve over [0, 1] that is 0 at both ends."""
    share, rng = np.linspace(0, 1, count), np.random.default_rng(seed)
    return height * sum(rng.normal() / k * np.sin(math.pi * k * share) for k in range(1, 5))


def mirror_tiles() -> dict[str, Tiling]:
    """Tiles that are their own mirror images."""
    share, bend = np.linspace(0, 1, 41), waves(41, 4, 0.16)
    # pm: straight along the mirrors at 1/2 and -1/2; below as above, the same on both sides of 0
    low = np.stack([share - 0.5, bend + bend[::-1]], axis=1)
    pm = wallpaper_group("pm")
    below = np.concatenate([low, low[::-1] + np.array([0.0, 1.0])])
    # cmm: between two mirrors, about a third; on the right an edge with a half-turn about its middle
    bend = waves(41, 9, 0.1)
    right = np.stack([0.25 + bend - bend[::-1], share / 2], axis=1)
    cmm = wallpaper_group("cmm")
    u, v = cmm.lattice.T
    beside = np.concatenate([right, right[::-1] * np.array([-1.0, 1.0])])
    return {
        "pm: mirror tiles": Tiling(pm, [below @ pm.lattice.T]),
        "cmm: mirror tiles": Tiling(cmm, [beside @ np.stack([u + v, u - v])]),
    }


def cut(name: str, start: int, end: int, seed: int) -> Tiling:
    """A tile of a class with wavy edges, cut in two from one of its corners to another."""
    kind, sides = isohedral_class(name), 30
    corners, edges = kind.template(), {}
    for number, pair in enumerate(kind.identified_edges):
        first = wavy(
            corners[pair.first], corners[(pair.first + 1) % len(corners)], sides, seed + number
        )
        if pair.folded:
            half = first[: sides // 2 + 1]
            half[-1] = (first[0] + first[-1]) / 2
            edges[pair.first] = np.concatenate([half, pair.isometry(half)[-2::-1]])
        else:
            image = pair.isometry(first)
            edges[pair.first], edges[pair.second] = first, image[::-1] if pair.reversed else image
    ring = np.concatenate([edges[k][:-1] for k in range(len(corners))])
    path = wavy(corners[start], corners[end], sides, seed + 10)
    i, j = start * sides, end * sides
    one = np.concatenate([ring[i:j], path[:0:-1]])
    other = np.concatenate([ring[j:], ring[:i], path[:-1]])
    return Tiling(kind.group(), [one, other])


def wavy(start: np.ndarray, end: np.ndarray, sides: int, seed: int) -> np.ndarray:
    """(sides + 1, 2) a curve from one point to another."""
    share, across = np.linspace(0, 1, sides + 1)[:, None], end - start
    turned = np.array([-across[1], across[0]])
    return start + share * across + waves(sides + 1, seed, 0.14)[:, None] * turned


def archimedean() -> dict[str, Tiling]:
    """Regular polygons of two and three kinds, as Dirichlet cells of special points."""
    p4m, p6m = wallpaper_group("p4m"), wallpaper_group("p6m")
    hexagon = [[math.cos(a) / 2, math.sin(a) / 2] for a in np.arange(6) * math.pi / 3]
    triangle = [[0.5, 0], [0.75, math.sqrt(3) / 4], [0.25, math.sqrt(3) / 4]]
    return {
        "p6m: two symmetric tiles": Tiling(p6m, [hexagon, triangle]),
        "p4m: three prototiles": dirichlet_tiling(p4m, [(0, 0), (0.5, 0.5), (0.33, 0.14)]),
    }


def dirichlet_cells() -> dict[str, Tile]:
    """A cell of each of the 17 groups."""
    found = {}
    for name in WALLPAPER_GROUPS:
        group = wallpaper_group(name)
        found[name] = dirichlet_tile(group, group.lattice @ np.array([0.31, 0.12]))
    return found


def main() -> None:
    """Certify all of them and draw them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("tilings.png"))
    given = parser.parse_args()
    pairs = {
        "p1: two prototiles": cut("IH1", 0, 3, 45),
        "p2: two prototiles": cut("IH4", 1, 4, 41),
        "pgg: two prototiles": cut("IH6", 0, 3, 46),
    }
    shown = {**of_the_square(), **mirror_tiles(), **pairs, **archimedean(), **dirichlet_cells()}
    for name, tiling in shown.items():
        found = certify(tiling)
        found.require()
        print(f"{name:30} edges agree to {found.edge_mismatch:.0e}, {found.neighbours} neighbours")
    write_atomic(given.out, tilings_png(shown))
    print(f"drawn in {given.out}")


if __name__ == "__main__":
    main()
