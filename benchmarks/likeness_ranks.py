"""The best tiles of a silhouette, ranked blind: what the order of tiles says of them.

    python benchmarks/likeness_ranks.py make --out FOLDER NAME ...
    python benchmarks/likeness_ranks.py publish --out FOLDER ANSWERS.json ...
    python benchmarks/likeness_ranks.py order

Marks of twenty tiles from bad to good say little of the best ones, whose marks hardly differ. So
judges rank eight tiles of a silhouette that the order holds for good ones, each unlike the others (an
IoU below .93): the first of the search for likeness at effort normal, those of EST and ARAP where they
are at hand, the first of a rigid body and of the search for overlap, and the next of the search for
likeness.

`make` writes FOLDER/tiles/NAME.json and FOLDER/sheets, which is all that a judge is given: one picture
of each silhouette, its tiles shuffled, and INSTRUCTIONS.md. A judge answers with one JSON file: the
numbers of each picture's tiles from the most alike to the least, {"NAME": [3, 1, 2, ...]}. `publish`
writes the tiles, what the order measures in them, and their places in each judge's ranking to
data/likeness_ranks.json, which `order` reads. The silhouettes are those of the part "learn" of
likeness_shapes.json.
"""

from __future__ import annotations

import argparse
import json
import zlib
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from common import ROOT
from likeness_blind import INSTRUCTIONS, sheet
from likeness_pool import (
    BentCandidate,
    Candidate,
    iou,
    other_candidates,
    overlap_candidates,
    rounded,
    write,
)
from likeness_pool_marks import VALUES
from likeness_shapes import silhouettes
from scipy.stats import spearmanr

from orbiflow.runtime import NEVER, one_blas_thread
from orbiflow.tiles import CLASSES, Fidelity, LikenessSearch, Target, complex_points, fidelity
from orbiflow.tiles.likeness import least_neck
from orbiflow.tiles.search import bending
from orbiflow.tiles.search.co_deformation import BODIES, hands
from orbiflow.tiles.search.starts import template_symmetries

RANKS = ROOT / "benchmarks" / "data" / "likeness_ranks.json"
COUNT, ALIKE = 8, 0.93
SEARCHED = ("soft", "firm", "stiff")  # the bodies of the search at effort normal


def bent_candidates(target: Target) -> Iterator[Candidate]:
    """Yield what bodies of four stiffnesses are bent into, with the numbers of effort normal."""
    usual = replace(LikenessSearch.for_effort("normal"), below=0)
    usual = replace(usual, min_neck=least_neck(target.normal, usual.min_neck))
    for kind in CLASSES.values():
        both = hands(target, usual, step=int(np.lcm(6, kind.divisor)))
        for hand in both[:1] if template_symmetries(kind)[1] else both:
            for name, body in BODIES.items():
                with one_blas_thread():
                    bents, _ = bending._finalists(hand, body, kind, usual, NEVER)
                yield from (BentCandidate.of(name, kind.name, bent) for bent in bents)


def chosen(found: list[Candidate]) -> list[Candidate]:
    """Return the eight that are ranked."""
    ranked = sorted(found, key=lambda one: -one.score)
    taken: list[Candidate] = []

    def take(*methods: str) -> None:
        for one in ranked:
            unlike = all(iou(one.ring, other.ring) < ALIKE for other in taken)
            if one.method in methods and unlike and one.sound():
                taken.append(one)
                return

    for methods in (SEARCHED, ("est",), ("arap",), ("rigid",), ("overlap",), *[SEARCHED] * COUNT):
        if len(taken) < COUNT:
            take(*methods)
    return taken


def make(options: argparse.Namespace) -> None:
    """Make the tiles and the pictures."""
    shapes, folder = silhouettes(), options.out / "sheets"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "INSTRUCTIONS.md").write_text(INSTRUCTIONS.partition("# What you hand back")[0])
    for name in options.names:
        target = Target.from_polygon(shapes[name]["outline"])
        hand, _ = hands(target, LikenessSearch.for_effort("normal"))
        found = [*bent_candidates(target), *overlap_candidates(target)]
        tiles = chosen([*found, *other_candidates(name, target)])
        order = np.random.default_rng(zlib.crc32(name.encode())).permutation(len(tiles))
        tiles = [tiles[k] for k in order]
        rows = [one.row(target, hand) for one in tiles]
        rest = rounded(hand.samples.fine)
        write(options.out / "tiles" / f"{name}.json", {"rest": rest, "tiles": rows})
        outline = np.asarray(target.normal)
        sheet(outline, [one.ring for one in tiles]).save(folder / f"{name}.png")
        print(f"{name}: {', '.join(one.method for one in tiles)}", flush=True)


def publish(options: argparse.Namespace) -> None:
    """Write what was ranked, and each tile's place in each ranking, from 1."""
    answers = [json.loads(path.read_text()) for path in options.answers]
    rows = []
    for name in sorted({name for own in answers for name in own}):
        document = json.loads((options.out / "tiles" / f"{name}.json").read_text())
        rankings = [own[name] for own in answers if name in own]
        for ranking in rankings:
            if sorted(ranking) != list(range(1, len(document["tiles"]) + 1)):
                raise SystemExit(f"{name}: {ranking} does not rank every number once")
        rest = complex_points(np.array(document["rest"]))
        tiles = []
        for number, row in enumerate(document["tiles"], 1):
            kept = asdict(fidelity(rest, complex_points(np.array(row["bent"])), 0.0))
            values = {key: np.round(value, 5).tolist() for key, value in kept.items()}
            places = [ranking.index(number) + 1 for ranking in rankings]
            own = {"method": row["method"], "class": row["class"]}
            tiles.append({**own, "values": values, "places": places})
        rows.append(f"{json.dumps(name)}:{json.dumps(tiles, separators=(',', ':'))}")
    RANKS.write_text("{\n" + ",\n".join(rows) + "\n}\n")
    print(f"{len(rows)} silhouettes: {RANKS}")


Order = Callable[[Fidelity], float]

ORDERS: dict[str, Order] = {
    "the order": lambda kept: kept.mark,
    "without `blunted`": lambda kept: kept.mark + kept.losses[4],
    "without `moved`": lambda kept: kept.mark + kept.losses[5],
    "without both": lambda kept: kept.mark + kept.losses[4] + kept.losses[5],
}


def order(_: argparse.Namespace) -> None:
    """Print how far the order agrees with the rankings."""
    found = json.loads(RANKS.read_text())
    places = {name: np.array([tile["places"] for tile in own]) for name, own in found.items()}
    agree = np.mean([spearmanr(*own[:, :2].T).statistic for own in places.values()])
    print(f"{len(found)} silhouettes; two judges agree by {agree:.2f} (correlation of ranks)\n")
    _print_places(found)
    print(f"{'':20}rank correlation  place of our first  preferred to EST and ARAP")
    for label, measure in ORDERS.items():
        values = {
            name: np.array([measure(_kept(tile["values"])) for tile in own])
            for name, own in found.items()
        }
        ranks, first, rows = [], [], []
        for name, own in found.items():
            mean = places[name].mean(axis=1)
            ranks.append(spearmanr(-values[name], mean).statistic)
            ours = np.array([tile["method"] in SEARCHED for tile in own])
            best = int(np.argmax(np.where(ours, values[name], -np.inf)))
            first.append(mean[best])
            others = [k for k, tile in enumerate(own) if tile["method"] in ("est", "arap")]
            rows += [np.mean(places[name][best] < places[name][k]) for k in others]
        print(
            f"{label:20}{np.mean(ranks):16.2f}{np.mean(first):20.2f}"
            f"{2 * np.sum(rows):21.0f} of {2 * len(rows)}"
        )


def _print_places(found: dict[str, list[dict[str, Any]]]) -> None:
    """Print each method's mean place, and what comes of it if one judge chooses ours."""
    tiles = [tile for own in found.values() for tile in own]
    for method in dict.fromkeys(tile["method"] for tile in tiles):
        places = [tile["places"] for tile in tiles if tile["method"] == method]
        print(f"{method:20}{len(places):4} tiles, mean place {np.mean(places):.1f}")
    first: list[int] = []
    rows: list[bool] = []
    for own in found.values():
        ours = [tile["places"] for tile in own if tile["method"] in SEARCHED]
        others = [tile["places"] for tile in own if tile["method"] in ("est", "arap")]
        for judge in (0, 1):
            chosen = min(ours, key=lambda places, judge=judge: places[judge])
            first.append(chosen[1 - judge])
            rows += [chosen[1 - judge] < other[1 - judge] for other in others]
    print(
        f"ours that one judge chooses: place {np.mean(first):.2f} by the other, who prefers it to EST "
        f"and ARAP in {sum(rows)} of {len(rows)}\n"
    )


def _kept(values: dict[str, Any]) -> Fidelity:
    short, long = values["pieces"]
    return Fidelity((short, long), *(values[name] for name in VALUES))


def main() -> None:
    """Make sheets, publish rankings, or compare the order with what was published."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(required=True)
    for command, wanted in ((make, "names"), (publish, "answers"), (order, None)):
        own = commands.add_parser(command.__name__, help=str(command.__doc__))
        own.set_defaults(command=command)
        if wanted:
            own.add_argument("--out", type=Path, default=Path("out/ranks"))
            own.add_argument(wanted, nargs="+", type=str if wanted == "names" else Path)
    options = parser.parse_args()
    torch.set_num_threads(1)
    options.command(options)


if __name__ == "__main__":
    main()
