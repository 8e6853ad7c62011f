"""The energy of deforming each goal into its tiles: one scorer for the tiles of any method.

    python benchmarks/likeness_energy.py [--effort fast|normal|best] [--all] [--quick]
        [--tiles FOLDER] [GOAL ...]

The scorer, fixed: the body is the goal's own polygon, scaled to area 1 and triangulated by
`orbiflow.silhouette.mesh`; its energy is as rigid as possible (`orbiflow.likeness.elastic`) with
cotangent weights clipped to [0.05, 40] and nothing else, every pair of neighbours counted once: the
integral of |J - R|^2, the Jacobian less a rotation, but for the rotations' being those of
neighbourhoods. The tile's images of the goal's vertices are held, at area 1,
and the inner points are relaxed. Tiles of EST and ARAP have one vertex for each of the goal's, up to
the first vertex and the hand: the least energy counts. The trial's tiles are 240 points by arc length
from an unknown first one: again the least energy counts. Ours say which points of the outline became
them.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from common import DATA, GOALS, LikenessTile, Ring, goal, likeness_tiles, needed
from likeness_methods import kept
from numpy.typing import NDArray

from orbiflow.tiles import complex_points, orient, plane_points, ring_length, signed_area
from orbiflow.tiles.likeness import Elastic, Stiffness
from orbiflow.tiles.silhouette import triangulate

Complex = NDArray[np.complex128]

BARE = Stiffness(stretch=0.0, bend=0.0, salience=0.0, pose=0.0)
"""Areas alone, as ARAP counts."""

TRIED = 12
"""Of all first vertices and both hands, those nearest to the goal by a similarity, whose energy is
computed: the least has been the nearest or the second in nearly all cases."""

ROUNDS, SETTLED = 300, 1e-6
"""Relaxing ends when no energy falls by more than this share, or after so many rounds."""

EXTRA = "squirrel2_60"
"""A row of its own, outside the mean."""


class Scorer:
    """The energy of tiles of one goal.

    Args:
        outline: (n, 2) of area 1, counter-clockwise.
    """

    def __init__(self, outline: Ring) -> None:
        self.outline = outline
        spacing = ring_length(outline) / len(outline)
        corners = complex_points(outline)[:, None]
        self._at = np.arange(len(outline), dtype=float)
        mesh = triangulate(outline, spacing)
        while len(mesh.sides):  # sides had to be divided: these points are held, too
            ends = np.append(self._at, len(outline))
            step = np.diff(ends)[mesh.sides]
            self._at = np.sort(np.append(self._at, self._at[mesh.sides] + mesh.shares * step))
            mesh = triangulate(plane_points(self._on_sides(corners)[:, 0]), spacing)
        self._body = Elastic(mesh.points[: mesh.size], BARE, mesh=mesh)

    def energies(self, images: Complex) -> Ring:
        """Energies (C,) with the goal's vertices held at images (n, C), scaled to area 1."""
        body = self._body
        held = self._on_sides(images / np.sqrt(_areas(images)))
        inner = body.condensed.follow @ held.real + 1j * (body.condensed.follow @ held.imag)
        z = np.concatenate([held, inner])
        last = body.energy(z)
        for _ in range(ROUNDS):
            z = body.condensed.whole(held, body.forces(z))
            energy = body.energy(z)
            settled = (last - energy <= SETTLED * last).all()
            last = energy
            if settled:
                break
        return last / 2  # the body counts every pair from either end

    def of_vertices(self, tile: Ring) -> float:
        """Of a tile (n, 2) whose vertices are the goal's, from an unknown first one."""
        n = len(self.outline)
        if len(tile) != n:
            raise ValueError(f"{n} vertices are needed, got {len(tile)}")
        shifts = np.arange(n)[:, None] + np.arange(n)
        return self._least(tile, shifts.astype(float))

    def of_points(self, tile: Ring) -> float:
        """Of a tile (M, 2) of points by arc length from an unknown first one.

        A corner of the goal may have become the nearest of the points, or its image lies between
        two: the better of both.
        """
        count = len(tile)
        at = self._along() * count
        shifts = np.arange(count)[:, None]
        return min(self._least(tile, shifts + at), self._least(tile, shifts + np.round(at)))

    def of_images(self, tile: Ring, source: Ring) -> float:
        """Of a tile (M, 2) that points (M, 2) of the goal's outline became, both in order."""
        at = _arc_lengths(source, self.outline)
        first = int(np.argmin(at))
        at, images = np.roll(at, -first), np.roll(complex_points(tile), -first)
        around = np.concatenate([[at[-1] - 1], at, [at[0] + 1]])
        images = np.concatenate([images[-1:], images, images[:1]])
        wanted = self._along()
        own = np.interp(wanted, around, images.real) + 1j * np.interp(wanted, around, images.imag)
        return float(self.energies(own[:, None])[0])

    def _least(self, tile: Ring, at: Ring) -> float:
        """Of the images at places (K, n) among the points of a tile, and of its mirror image."""
        own = complex_points(orient(tile))
        every = np.concatenate(
            [_between(ring, at) for ring in (own, np.roll(np.conj(own[::-1]), 1))]
        ).T
        goal_points = complex_points(self.outline)
        rest = goal_points - goal_points.mean()
        images = every - every.mean(axis=0)
        factor = np.conj(images).T @ rest / (abs(images) ** 2).sum(axis=0)
        far = (abs(factor * images - rest[:, None]) ** 2).mean(axis=0)
        nearest = np.argsort(far, kind="stable")[:TRIED]
        return float(self.energies(images[:, nearest]).min())

    def _on_sides(self, images: Complex) -> Complex:
        """Images (n, C) of the goal's vertices with those of points on its sides between them."""
        return _between(images.T, np.broadcast_to(self._at, (images.shape[1], len(self._at)))).T

    def _along(self) -> Ring:
        """(n,) how far along the outline the vertices lie, 0 to 1."""
        return _arc_lengths(self.outline, self.outline)


def _between(points: Complex, at: Ring) -> Complex:
    """Places (K, P) among the points of closed rings (M,) or (K, M), counted in vertices."""
    below = np.floor(at).astype(int)
    share, count = at - below, points.shape[-1]
    rings = np.broadcast_to(points, (len(at), count))
    start, end = (np.take_along_axis(rings, (below + k) % count, axis=1) for k in (0, 1))
    return start + share * (end - start)


def _arc_lengths(points: Ring, ring: Ring) -> Ring:
    """(P,) how far along a closed ring its nearest points to `points` (P, 2) lie, 0 to 1."""
    starts, sides = complex_points(ring), complex_points(np.roll(ring, -1, 0) - ring)
    z = complex_points(points)[:, None] - starts
    share = np.clip((z * np.conj(sides)).real / abs(sides) ** 2, 0, 1)
    side = np.argmin(abs(z - share * sides), axis=1)
    lengths = abs(sides)
    before = np.cumsum(lengths) - lengths
    own = share[np.arange(len(side)), side]
    return (before[side] + own * lengths[side]) / lengths.sum() % 1


def _areas(images: Complex) -> Ring:
    return np.asarray(abs(signed_area(plane_points(images.T))), dtype=np.float64)


def energies(name: str, own: list[LikenessTile]) -> dict[str, list[float]]:
    """Of each method, the energies of its tiles in its own order; ours are given."""
    scorer = Scorer(np.asarray(goal(name).normal))
    silhouettes = DATA / "silhouettes"
    document = json.loads((silhouettes / "baseline_tiles" / f"{name}.json").read_text())
    found = {"ours": [scorer.of_images(tile.bent, tile.source) for tile in own]}
    for method, key in (("arap", "arap_EIR_top20"), ("est", "est_euclid_top20")):
        found[method] = [scorer.of_vertices(np.array(tile["tile"])) for tile in document[key]]
    trial = silhouettes / "trial_tiles.json"
    tiles = json.loads(trial.read_text()) if trial.exists() else {}
    found["trial"] = [scorer.of_points(np.array(tiles[name]))] if name in tiles else []
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("goals", nargs="*")
    parser.add_argument("--effort", choices=("fast", "normal", "best"), default="normal")
    parser.add_argument("--tiles", type=Path, help="where our tiles are kept: no search anew")
    parser.add_argument("--all", action="store_true", help="the energies of all tiles, too")
    parser.add_argument("--quick", action="store_true", help="one goal, effort fast")
    options = parser.parse_args()
    needed(DATA / "silhouettes" / "baseline_tiles", "the tiles of EST and ARAP")
    effort = "fast" if options.quick else options.effort
    names = options.goals or (["dolphin_60"] if options.quick else [*GOALS, EXTRA])
    print(f"effort {effort}; ARAP and EST: best of their twenty")
    print("goal          class ours: first  least |   ARAP    EST  trial | first/ARAP least/ARAP")
    rows: dict[str, list[float]] = {}
    for name in names:
        target = goal(name)
        own = kept(options.tiles, name, effort, lambda t=target: likeness_tiles(t, effort))
        found = energies(name, own)
        arap, est = min(found["arap"]), min(found["est"])
        first, least = found["ours"][0], min(found["ours"])
        trial = found["trial"][0] if found["trial"] else float("nan")
        rows[name] = [first, least, arap, est, trial]
        print(f"{name:14}{own[0].name:6}{_row(rows[name])}", flush=True)
        for method, values in found.items() if options.all else ():
            print(f"    {method:6}" + " ".join(f"{value:.4f}" for value in values), flush=True)
    mean = [rows[name] for name in names if name != EXTRA]
    if mean:
        print(f"{f'mean of {len(mean)}':20}{_row(np.mean(mean, axis=0).tolist())}")


def _row(values: list[float]) -> str:
    first, least, arap, est, trial = values
    return (
        f"{first:11.4f}{least:7.4f} |{arap:7.4f}{est:7.4f}{trial:7.4f} |"
        f"{first / arap:11.3f}{least / arap:11.3f}"
    )


if __name__ == "__main__":
    main()
