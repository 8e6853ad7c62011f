"""Tiles from rigid to supple of many silhouettes, and sheets of them for judges.

    python benchmarks/likeness_pool.py make --out FOLDER [--part learn|test] [NAME ...]
    python benchmarks/likeness_pool.py sheets --out FOLDER

For each silhouette of likeness_shapes.py, at effort fast:

- the search for likeness with four bodies: the soft one (a pull to the pose of 3), the usual one (60),
  and the usual one with pulls of 600 and 6,000;
- the search for overlap;
- the first tiles of EST and ARAP, of the icons and the nine goals.

Twenty certified tiles are kept: the first of today's search, the first of each of these that is another
(an IoU below .97), and then one from each in turn, by its score and at random alternately, whose IoU
with all that were taken is below .9. Each is laid on the silhouette by the similarity of largest IoU,
mirror images included. The tiles of EST and ARAP are taken as they are.

`make` writes FOLDER/tiles/NAME.json, as each silhouette is done; what is there is not made again.
FOLDER/sheets is all that a judge is given: INSTRUCTIONS.md, and for each part and round one picture of
each silhouette, the tiles shuffled anew for each picture. FOLDER/key.json says which number is which
tile of the JSON, counted from 0. The part "test" is made, and looked at, last. docs/blind.md says more.
"""

from __future__ import annotations

import argparse
import json
import time
import zlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import torch
from common import Ring
from likeness_methods import baseline, cell, common_unit
from likeness_shapes import silhouettes
from PIL import Image, ImageDraw, ImageFont

from orbiflow.errors import CertificationError
from orbiflow.runtime import NEVER, one_blas_thread
from orbiflow.tiles import (
    CLASSES,
    Fidelity,
    LikenessSearch,
    OverlapSearch,
    Target,
    centroid,
    certify,
    complex_points,
    escherize,
    fidelity,
    orient,
    plane_points,
    ring_length,
    signed_area,
)
from orbiflow.tiles.geometry import best_similarity
from orbiflow.tiles.likeness import Overlap, bent_onto, best_overlay, least_neck, narrowest_neck
from orbiflow.tiles.likeness.elastic import POSE_WEIGHT
from orbiflow.tiles.search import bending
from orbiflow.tiles.search.bending import Bent, PlacedBent, placed_best, prototile
from orbiflow.tiles.search.candidates import StillTiles
from orbiflow.tiles.search.co_deformation import BODIES as SEARCHED
from orbiflow.tiles.search.co_deformation import Hand, hands
from orbiflow.tiles.search.finished_tiles import recogniser
from orbiflow.tiles.search.starts import template_symmetries

SEED, COUNT, ALIKE, SAME = 25, 20, 0.9, 0.97
BODIES = {
    "soft": SEARCHED["soft"],
    "firm": SEARCHED["firm"],
    "firm-600": SEARCHED["stiff"],
    "firm-6000": SEARCHED["rigid"],
}
"""Bodies by their pull to the pose, which is 3, 60, 600 and 6,000."""

FINALISTS = 4  # tiles of each class, hand and body to choose from
TURNS, REFINED = 24, 3  # turns in which a tile of others is laid on the silhouette
CELL, HEAD, BLUE, ROUNDS = 240, 26, "#1f5fbf", (1, 2)  # pixels

INSTRUCTIONS = """\
# What you are asked

Each picture shows one silhouette in blue, the target, and beside it black silhouettes with numbers.
Each black one is an attempt at the target under a constraint that you need not know: none of them can
be a perfect copy. The target is drawn twice as large; it lies as the attempts do.

**Give each number a mark from 0 to 10: would people take it for the target's subject, and find it like
the target?**

- 10: as good as the target
- 5: one sees what is meant
- 0: not recognisable

Use the whole scale, in steps of a half, and the same scale for all pictures: a picture may hold good
ones alone, or none. Judge each as a whole, as you would a printed silhouette: what it depicts, whether
all parts of the target are there and where they belong, whether there are parts that do not belong,
their shapes and proportions. The numbers mean nothing and are shuffled from picture to picture: please
do not look for a pattern, and do not look at other rounds or at anything else about where they come
from.

# What you hand back

One JSON file for the round that you judged, with the marks of number 1, of number 2, and so on, for
each picture by its name without `.png`, as many as the picture has numbers:

    {"part": "learn", "round": 1, "judge": "A", "marks": {"NAME": [6.5, 4, 8], "OTHER": [5, 7, 6]}}
"""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A tile that may be shown: its outline (M, 2) laid on the silhouette, and how well it did."""

    method: str
    kind: str
    score: float  # what its own search orders by
    ring: Ring

    def sound(self) -> bool:
        """Whether it is certified; tiles of other searches are taken as they are."""
        return True

    def row(self, target: Target, hand: Hand) -> dict[str, Any]:
        """Return its outline, the silhouette bent onto it, and all values of the order."""
        body, n = hand.fine, hand.fine.size
        z = bent_onto(body, orient(self.ring))
        kept = fidelity(body.rest[:n], z[:n], float(body.cost(z[:, None])[0]))
        neck = narrowest_neck(self.ring).share
        row = self.valued(target, self.ring, kept, body.displacement(z[:, None])[0], neck)
        return {**row, "bent": rounded(plane_points(z[:n])), "tile": rounded(self.ring)}

    def valued(
        self, target: Target, ring: Ring, kept: Fidelity, away: float, neck: float
    ) -> dict[str, Any]:
        """Return what is kept of any tile."""
        values = {
            **asdict(kept),
            "energy": kept.cost - POSE_WEIGHT * float(away),
            "displacement": float(away),
            "neck": neck,
            "iou": iou(ring, target.normal),
            "recognised": recogniser(target)(shapely.Polygon(ring)).score,
        }
        return {"method": self.method, "class": self.kind, "score": self.score, "values": values}


@dataclass(frozen=True, eq=False)
class BentCandidate(Candidate):
    """A bent silhouette, whose points are known, laid roughly."""

    placed: PlacedBent

    @classmethod
    def of(cls, method: str, kind: str, bent: Bent) -> BentCandidate:
        """Lay a bent silhouette by least squares."""
        points, rest = bent.points, bent.hand.fine.rest
        factor = complex(best_similarity(points, rest))
        placed = PlacedBent(bent, factor, complex(rest.mean() - factor * points.mean()))
        ring = placed.place(bent.ring)
        return cls(method, kind, bent.score, ring, placed)

    def sound(self) -> bool:
        """Whether it is certified."""
        kind = CLASSES[self.kind]
        try:
            tile, _ = StillTiles(kind, prototile(kind, self.placed)).finished(0)
        except CertificationError:
            return False
        return certify(tile).valid

    def row(self, target: Target, hand: Hand) -> dict[str, Any]:
        """Return what is kept, laid by the similarity of largest IoU."""
        bent, hand = self.placed.bent, self.placed.bent.hand
        n, flip = hand.fine.size, (1.0, -1.0 if hand.mirrored else 1.0)
        placed = placed_best(bent, Overlap(target.normal * flip))
        rings = [placed.place(own) for own in (bent.ring, bent.points[:n])]
        if hand.mirrored:  # read backwards from the same first point
            rings = [ring[-np.arange(n) % n] for ring in rings]
        ring, points = rings
        away = hand.fine.displacement(bent.points[:, None])[0]
        neck = narrowest_neck(ring).share
        row = self.valued(target, ring, bent.fidelity, away, neck)
        return {**row, "bent": rounded(points), "tile": rounded(ring)}


def rounded(ring: Ring) -> list[list[float]]:
    """Return a ring as JSON has it."""
    return ring.round(4).tolist()


def bent_candidates(target: Target) -> tuple[dict[str, list[Candidate]], list[Candidate]]:
    """Return what bodies of each stiffness are bent into, and what today's search would look at.

    That takes the soft body where fewer than half of the firm one's tiles are simple.
    """
    usual = LikenessSearch.for_effort("fast")
    both, wide = hands(target, usual), least_neck(target.normal, usual.min_neck)
    (settings,) = replace(usual, below=0, min_neck=wide).searches(FINALISTS)
    found: dict[str, list[Candidate]] = {name: [] for name in BODIES}
    seen: list[Candidate] = []
    for kind in CLASSES.values():
        for hand in both[:1] if template_symmetries(kind)[1] else both:
            own: dict[str, list[Candidate]] = {}
            for name, body in BODIES.items():
                with one_blas_thread():
                    bents = bending._finalists(hand, body, kind, settings, NEVER)
                own[name] = [
                    BentCandidate.of(name, kind.name, bent) for bent in bents if bent.sound
                ]
                found[name] += own[name]
            few = 2 * len(own["firm"]) < settings.finalists
            seen += own["firm"] + (own["soft"] if few else [])
    return found, seen


def overlap_candidates(target: Target) -> Iterator[Candidate]:
    """Yield what the search for overlap finds."""
    for tile in escherize(target, method=OverlapSearch.for_effort("fast")).tiles:
        ring = orient(tile.normal_tile.polygon)
        yield Candidate("overlap", tile.name, tile.score, ring)


def other_candidates(name: str, target: Target) -> Iterator[Candidate]:
    """Yield the first tiles of EST and ARAP, where they are at hand."""
    for method, tile in baseline(name).items():
        yield Candidate(method, tile["ih"], 0.0, laid(np.array(tile["tile"]), target))


def laid(ring: Ring, target: Target) -> Ring:
    """Return a ring (M, 2) moved by the similarity of largest IoU with the silhouette."""
    overlap, own = Overlap(target.normal), orient(ring)
    z = complex_points(own - centroid(own)) / np.sqrt(signed_area(own))
    turns = np.exp(2j * np.pi * np.arange(TURNS) / TURNS)
    rough = [
        (overlap.iou(plane_points(t * y))[0], t, y) for y in (z, np.conj(z)[::-1]) for t in turns
    ]
    rough.sort(key=lambda one: -one[0])
    fine = [(best_overlay(y, overlap, complex(t)), y) for _, t, y in rough[:REFINED]]
    (factor, middle, _), y = max(fine, key=lambda one: one[0][2])
    return plane_points(factor * y + middle)


def chosen(
    usual: list[Candidate], groups: list[list[Candidate]], rng: np.random.Generator
) -> list[Candidate]:
    """Choose tiles that differ: the usual first, the first of each group, then one of each in turn."""
    first, *left = [sorted(group, key=lambda one: -one.score) for group in (usual, *groups)]
    found: list[Candidate] = []

    def take(group: list[Candidate], *, best: bool, alike: float) -> None:
        while group:
            one = group.pop(0 if best else int(rng.integers(len(group))))
            if all(iou(one.ring, other.ring) < alike for other in found) and one.sound():
                found.append(one)
                return

    take(first, best=True, alike=SAME)
    for group in left:
        if group and group[0] not in found:
            take(group, best=True, alike=SAME)
    turn = 0
    while any(left) and len(found) < COUNT:
        for group in left:
            if len(found) < COUNT:
                take(group, best=turn % 2 == 0, alike=ALIKE)
        turn += 1
    return found


def iou(ring: Ring, other: Ring) -> float:
    """Return the IoU of two rings as they lie."""
    a, b = shapely.Polygon(ring), shapely.Polygon(other)
    common = a.intersection(b).area
    return float(common / (a.area + b.area - common))


def pool(name: str, shape: dict[str, Any]) -> dict[str, Any]:
    """Return the tiles of one silhouette."""
    began = time.process_time()
    target = Target.from_polygon(shape["outline"])
    bent, usual = bent_candidates(target)
    groups = [*bent.values(), list(overlap_candidates(target))]
    groups += [[one] for one in other_candidates(name, target)]
    rng = np.random.default_rng([SEED, zlib.crc32(name.encode())])
    settings = LikenessSearch.for_effort("fast")
    hand, _ = hands(target, settings)
    rows = [one.row(target, hand) for one in chosen(usual, groups, rng)]
    return {
        "part": shape["part"],
        "least_neck": least_neck(target.normal, settings.min_neck),
        "length": ring_length(np.asarray(target.normal)),
        "found": {own[0].method: len(own) for own in groups if own},
        "seconds": round(time.process_time() - began, 1),
        "outline": rounded(np.asarray(target.normal)),
        "rest": rounded(hand.samples.fine),
        "tiles": rows,
    }


def order(name: str, round_number: int, count: int) -> list[int]:
    """Return which tile has number 1, 2, ... in the picture of a round."""
    rng = np.random.default_rng([SEED, round_number, zlib.crc32(name.encode())])
    return rng.permutation(count).tolist()


def sheet(outline: Ring, tiles: list[Ring]) -> Image.Image:
    """Draw the target in blue, twice as large, and the tiles with their numbers."""
    columns, tall = 6, CELL + HEAD
    places = [(c, r) for r in range(2) for c in range(2, columns)]
    places += [(c, r) for r in range(2, 9) for c in range(columns)]
    rows = 1 + max(r for _, r in places[: len(tiles)])
    page = Image.new("RGB", (columns * CELL, max(rows, 2) * tall), "white")
    pen, font = ImageDraw.Draw(page), ImageFont.load_default(size=22)
    unit = common_unit([outline, *tiles], CELL, 0.94)
    page.paste(cell(outline, 2 * CELL, 2 * unit, BLUE), (0, HEAD))
    pen.text((CELL, HEAD / 2), "target", BLUE, font, "mm")
    for k, (ring, (column, row)) in enumerate(zip(tiles, places, strict=False), 1):
        page.paste(cell(ring, CELL, unit), (column * CELL, row * tall + HEAD))
        pen.text(((column + 0.5) * CELL, row * tall + HEAD / 2), str(k), "black", font, "mm")
    return page


def draw(out: Path, name: str, document: dict[str, Any]) -> None:
    """Write a silhouette's pictures, and the key of all."""
    rings = [np.array(row.get("tile", row["bent"])) for row in document["tiles"]]
    for number in ROUNDS:
        folder = out / "sheets" / document["part"] / f"round{number}"
        folder.mkdir(parents=True, exist_ok=True)
        own = [rings[k] for k in order(name, number, len(rings))]
        sheet(np.array(document["outline"]), own).save(folder / f"{name}.png")
    key_path = out / "key.json"
    key = json.loads(key_path.read_text()) if key_path.exists() else {}
    key[name] = {f"round{number}": order(name, number, len(rings)) for number in ROUNDS}
    write(key_path, key)


def write(path: Path, document: Any) -> None:
    """Write a JSON file whole."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.with_suffix(".part").write_text(json.dumps(document))
    path.with_suffix(".part").replace(path)


def make(options: argparse.Namespace) -> None:
    """Make the tiles and the pictures, in an order that mixes the sources."""
    shapes = silhouettes()
    names = [name for name, shape in shapes.items() if shape["part"] == options.part]
    names = options.names or np.random.default_rng(SEED).permutation(names).tolist()
    write_instructions(options.out)
    for k, name in enumerate(names, 1):
        path = options.out / "tiles" / f"{name}.json"
        if not path.exists():
            write(path, pool(name, shapes[name]))
            draw(options.out, name, json.loads(path.read_text()))
        document = json.loads(path.read_text())
        found, seconds = document["found"], document["seconds"]
        print(
            f"{k}/{len(names)} {name}: {len(document['tiles'])} of {found}, {seconds} s", flush=True
        )


def write_instructions(out: Path) -> None:
    """Write what the judges are asked."""
    (out / "sheets").mkdir(parents=True, exist_ok=True)
    (out / "sheets" / "INSTRUCTIONS.md").write_text(INSTRUCTIONS)


def sheets(options: argparse.Namespace) -> None:
    """Draw all pictures again."""
    write_instructions(options.out)
    for path in sorted((options.out / "tiles").glob("*.json")):
        draw(options.out, path.stem, json.loads(path.read_text()))


def main() -> None:
    """Make the tiles, or draw them again."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(required=True)
    maker = commands.add_parser("make", help="make tiles and pictures")
    maker.add_argument("names", nargs="*", help="of silhouettes; default: all of the part")
    maker.add_argument("--part", choices=("learn", "test"), default="learn")
    maker.set_defaults(command=make)
    drawer = commands.add_parser("sheets", help="draw the pictures again")
    drawer.set_defaults(command=sheets)
    for command in (maker, drawer):
        command.add_argument("--out", type=Path, default=Path("out/pool"))
    options = parser.parse_args()
    torch.set_num_threads(1)
    options.command(options)


if __name__ == "__main__":
    main()
