"""The best tiles of a silhouette, ranked blind: what the order of tiles says of them.

    python benchmarks/likeness_ranks.py make --out FOLDER NAME ...
    python benchmarks/likeness_ranks.py publish --out FOLDER ANSWERS-1.json ANSWERS-2.json
    python benchmarks/likeness_ranks.py order

Marks of twenty tiles from bad to good say little of the best ones, whose marks hardly differ. So
judges rank eight tiles that the search at effort normal would show: of the three best of each class
those that are unlike all better ones (an IoU below .93), the first five and three of the next eleven;
and the first ones of EST and ARAP where they are at hand.

`make` writes FOLDER/tiles/NAME.json and, for each of two judges, FOLDER/sheets/judge-K, which is all
that the judge is given: one picture of each silhouette, its tiles shuffled anew, and INSTRUCTIONS.md. A
judge answers with one JSON file, {"NAME": {"order": [3, 1, 2, ...], "marks": [7, 4.5, ...]}}: the
numbers of each picture's tiles from the most alike to the least, and the marks, 0 to 10, of number 1, 2
and so on. `publish` writes what the order measures in the tiles, their places and their marks to
data/likeness_ranks.json, which `order` reads. No silhouette is of the part "test" of
likeness_shapes.json.
"""

from __future__ import annotations

import argparse
import json
import zlib
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from common import ROOT
from likeness_blind import sheet
from likeness_pool import BentCandidate, Candidate, iou, other_candidates, rounded, write
from likeness_pool_marks import GOOD, VALUES
from likeness_shapes import silhouettes
from scipy.stats import spearmanr

from orbiflow.runtime import one_blas_thread
from orbiflow.tiles import CLASSES, Fidelity, LikenessSearch, Target, complex_points, fidelity
from orbiflow.tiles.likeness import least_neck
from orbiflow.tiles.search.bending import bent_tiles
from orbiflow.tiles.search.co_deformation import hands

RANKS = ROOT / "benchmarks" / "data" / "likeness_ranks.json"
ALIKE, OF_A_CLASS, AT_MOST, FIRST, MORE = 0.93, 3, 16, 5, 3
JUDGES = (1, 2)

INSTRUCTIONS = """\
# What you are asked

Each picture shows one silhouette in blue, the target, and beside it eight to ten black silhouettes with
numbers. Each black one is an attempt at the target under a constraint that you need not know: none of
them can be a perfect copy.

**Which of the black silhouettes would a person take for the target's subject most readily and find most
like the target?** Order all of them, from the most alike to the least, and give each a mark from 0 to
10 in steps of a half (10: as good as the target; 5: one sees what is meant; 0: not recognisable). Use
the same scale for all pictures.

Judge each as a whole, as you would a printed silhouette: what it depicts, whether all parts of the
target are there and where they belong, whether there are parts that do not belong, their shapes and
proportions. Take care with the best three or four: which of them would people choose? Look at every
picture by itself. The numbers mean nothing and are shuffled from picture to picture: do not look for a
pattern, and do not look at anything outside your folder.

# What you hand back

One JSON file, {"NAME": {"order": [3, 1, 2, ...], "marks": [mark of number 1, mark of number 2, ...]},
...} for every picture by its name without .png.
"""


def found_tiles(target: Target, settings: LikenessSearch) -> list[Candidate]:
    """Return the best tiles of all classes that are unlike all better ones, the best first."""
    found: list[Candidate] = []
    for kind in CLASSES.values():
        both = hands(target, settings, step=int(np.lcm(6, kind.divisor)))
        with one_blas_thread():
            bents, _ = bent_tiles(both, kind, settings)
        found += [BentCandidate.of("ours", kind.name, bent) for bent in bents[:OF_A_CLASS]]
    taken: list[Candidate] = []
    for one in sorted(found, key=lambda one: -one.score):
        unlike = all(iou(one.ring, other.ring) < ALIKE for other in taken)
        if len(taken) < AT_MOST and unlike and one.sound():
            taken.append(one)
    return taken


def make(options: argparse.Namespace) -> None:
    """Make the tiles and the pictures."""
    shapes = silhouettes()
    folders = [options.out / "sheets" / f"judge-{judge}" for judge in JUDGES]
    for folder in folders:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "INSTRUCTIONS.md").write_text(INSTRUCTIONS)
    for name in options.names:
        target = Target.from_polygon(shapes[name]["outline"])
        usual = LikenessSearch.for_effort("normal")
        usual = replace(usual, min_neck=least_neck(target.normal, usual.min_neck))
        hand, _ = hands(target, usual)
        seed = zlib.crc32(name.encode())
        found = found_tiles(target, usual)
        later = np.random.default_rng(seed).permutation(max(0, len(found) - FIRST))[:MORE]
        tiles = [*found[:FIRST], *(found[FIRST + k] for k in sorted(later))]
        tiles += other_candidates(name, target)
        shuffles = [
            np.random.default_rng([seed, judge]).permutation(len(tiles)).tolist()
            for judge in JUDGES
        ]
        rows = [one.row(target, hand) for one in tiles]
        document = {"rest": rounded(hand.samples.fine), "tiles": rows, "shuffles": shuffles}
        write(options.out / "tiles" / f"{name}.json", document)
        for folder, shuffle in zip(folders, shuffles, strict=True):
            own = [tiles[k].ring for k in shuffle]
            sheet(np.asarray(target.normal), own).save(folder / f"{name}.png")
        print(f"{name}: {len(tiles)} tiles", flush=True)


def publish(options: argparse.Namespace) -> None:
    """Write what was ranked: each tile's place in each ranking, from 1, and its marks."""
    answers = [json.loads(path.read_text()) for path in options.answers]
    rows = []
    for name in sorted(set.intersection(*map(set, answers))):
        document = json.loads((options.out / "tiles" / f"{name}.json").read_text())
        count = len(document["tiles"])
        places, marks = np.zeros((count, len(answers)), int), np.zeros((count, len(answers)))
        for k, (own, shuffle) in enumerate(zip(answers, document["shuffles"], strict=True)):
            ranking, given = own[name]["order"], own[name]["marks"]
            if sorted(ranking) != list(range(1, count + 1)) or len(given) != count:
                raise SystemExit(f"{name}: {ranking} does not rank every number once")
            places[np.array(shuffle)[np.array(ranking) - 1], k] = np.arange(1, count + 1)
            marks[shuffle, k] = given
        rest = complex_points(np.array(document["rest"]))
        tiles = []
        for row, place, mark in zip(document["tiles"], places, marks, strict=True):
            kept = asdict(fidelity(rest, complex_points(np.array(row["bent"])), 0.0))
            values = {key: np.round(value, 5).tolist() for key, value in kept.items()}
            own = {"method": row["method"], "class": row["class"], "values": values}
            tiles.append({**own, "places": place.tolist(), "marks": mark.tolist()})
        rows.append(f"{json.dumps(name)}:{json.dumps(tiles, separators=(',', ':'))}")
    RANKS.write_text("{\n" + ",\n".join(rows) + "\n}\n")
    print(f"{len(rows)} silhouettes: {RANKS}")


Order = Callable[[Fidelity], float]

ORDERS: dict[str, Order] = {
    "the order": lambda kept: kept.mark,
    "without `blunted`": lambda kept: kept.mark + kept.losses[4],
    "without `moved`": lambda kept: kept.mark + kept.losses[5],
    "without `merged`": lambda kept: kept.mark + kept.losses[6],
    "without these three": lambda kept: kept.mark + sum(kept.losses[4:]),
}


class Ranked:
    """The ranked tiles of a silhouette: ours, and of EST and ARAP."""

    def __init__(self, tiles: list[dict[str, Any]]) -> None:
        ours = [tile for tile in tiles if tile["method"] == "ours"]
        self.kept = [_kept(tile["values"]) for tile in ours]
        self.places = np.array([tile["places"] for tile in ours])
        self.marks = np.array([tile["marks"] for tile in ours])
        self.others = np.array([tile["places"] for tile in tiles if tile["method"] != "ours"])

    def chosen(self, best: int, judges: slice) -> tuple[float, float, int, int]:
        """Return the place among ours of a tile, its mark, and in how many rows it wins, of all."""
        place = float((self.places < self.places[best])[:, judges].sum(axis=0).mean() + 1)
        wins = [self.places[best, judges] < other[judges] for other in self.others]
        return place, float(self.marks[best, judges].mean()), int(np.sum(wins)), np.size(wins)


def order(_: argparse.Namespace) -> None:
    """Print how far the order agrees with the rankings."""
    found = [Ranked(tiles) for tiles in json.loads(RANKS.read_text()).values()]
    agree = np.mean([spearmanr(*own.places.T).statistic for own in found])
    print(f"{len(found)} silhouettes; two judges agree by {agree:.2f} (correlation of ranks)\n")
    print(f"{'':22}correlation  place of our first  its mark  preferred to EST and ARAP")
    for label, measure in ORDERS.items():
        values = [np.array([measure(kept) for kept in own.kept]) for own in found]
        ranks = [
            spearmanr(-mark, own.places.mean(axis=1)).statistic
            for mark, own in zip(values, found, strict=True)
        ]
        rows = [
            own.chosen(int(mark.argmax()), slice(0, 2))
            for mark, own in zip(values, found, strict=True)
        ]
        _print_row(label, f"{np.mean(ranks):.2f}", rows)
    rows = [
        own.chosen(int(own.places[:, judge].argmin()), slice(1 - judge, 2 - judge))
        for own in found
        for judge in (0, 1)
    ]
    _print_row("one judge's, by other", "", rows)
    scores = np.array([kept.score for own in found for kept in own.kept])
    good = np.concatenate([(own.marks >= GOOD).mean(axis=1) for own in found])
    tenths = np.array_split(np.argsort(scores), 10)
    print("\nscore, mean of a tenth  " + "".join(f"{scores[own].mean():6.2f}" for own in tenths))
    print(f"marks of {GOOD} or more    " + "".join(f"{good[own].mean():6.2f}" for own in tenths))


def _print_row(label: str, correlation: str, rows: list[tuple[float, float, int, int]]) -> None:
    place, mark, wins, count = np.array(rows).T
    print(
        f"{label:22}{correlation:>11}{place.mean():20.2f}{mark.mean():10.2f}"
        f"{wins.sum():14.0f} of {count.sum():.0f}"
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
