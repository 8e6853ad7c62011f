"""What judges said of the pool of tiles, how far they agree, and how far the order of tiles agrees.

    python benchmarks/likeness_pool_marks.py agree --out FOLDER ANSWERS.json ...
    python benchmarks/likeness_pool_marks.py publish --out FOLDER [--to FILE.json] ANSWERS.json ...
    python benchmarks/likeness_pool_marks.py order [FILE.json]

FOLDER is that of likeness_pool.py, and each file of answers is one judge's marks of one round of a
part. `agree` prints, for each two files that share pictures, the correlation of their marks, the
correlation within silhouettes (each silhouette's mean is taken out), that of ranks, and how far apart
the marks are. `publish` writes all tiles that were marked: the values of `fidelity`, the score by the
order before it (`before`), the marks, and points of the outline, in thousandths of the root of the
silhouette's area, which correspond to those of the silhouette.

`order` needs only what was published. Of each part it prints how well the order and its measures put a
silhouette's tiles into the judges' order (the mean of the silhouettes' correlations of ranks), and how
much worse the tile that each puts first is marked than the best one; whether scores are the shares of
marks that are good, by tenths of the tiles; and our words against the judges'. The weights were fitted
to the part "learn", so there it prints also what weights fitted to all other silhouettes give.
"""

from __future__ import annotations

import argparse
import itertools
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from common import ROOT, Ring
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.stats import spearmanr

from orbiflow.tiles import Fidelity, Rating, complex_points, fidelity
from orbiflow.tiles.likeness.ranking import WORDS

MARKS = ROOT / "benchmarks" / "data" / "likeness_pool.json"
POINTS = 48  # of each outline: all tiles together stay below 1.5 MB
ALSO = ("energy", "displacement", "neck", "iou")  # values that the order has no use for
GOOD = 6.5  # the least mark that is good
# after `pieces`
VALUES = ("stretched", "thickness", "blunted", "moved", "merged", "cost", "length")
MEASURES = ("short pieces", "long pieces", *VALUES[:5])
SEARCHED = ("soft", "firm", "firm-600")  # the bodies of the search for likeness

Reading = dict[str, Ring]  # the marks of each silhouette's tiles, in the order of their file


def reading(key: dict[str, dict[str, list[int]]], answers: dict[str, Any]) -> Reading:
    """Return one file's marks in the order of the tiles instead of that of the numbers.

    Raises:
        ValueError: for a mark beyond 0 to 10, or another count of marks than of numbers.
    """
    found: Reading = {}
    for name, marks in answers["marks"].items():
        order = key[name][f"round{answers['round']}"]
        if len(marks) != len(order) or not all(0 <= mark <= 10 for mark in marks):
            raise ValueError(f"{name}: {len(order)} marks from 0 to 10 are needed, got {marks}")
        found[name] = np.empty(len(order))
        found[name][order] = marks
    return found


def readings(options: argparse.Namespace) -> dict[str, Reading]:
    """Read all files of answers; each is named by its judge and round."""
    key, found = json.loads((options.out / "key.json").read_text()), {}
    for path in options.answers:
        answers = json.loads(path.read_text())
        try:
            marks = reading(key, answers)
            name = f"{answers['judge']}{answers['round']}"
        except (ValueError, KeyError, TypeError) as error:
            raise SystemExit(f"{path}: {type(error).__name__}: {error}") from error
        twice = found.setdefault(name, {}).keys() & marks.keys()
        if twice:
            raise SystemExit(f"{path}: {name} has marked {', '.join(sorted(twice))} before")
        found[name] |= marks
    return found


def agreement(one: Reading, other: Reading) -> tuple[int, float, float, float, float]:
    """Compare two readings of the same tiles.

    Returns:
        How many silhouettes both have marked, the correlation of all marks, that within silhouettes,
        the mean of the silhouettes' correlations of ranks, and the mean distance of two marks.
    """
    names = sorted(one.keys() & other.keys())
    pairs = [(one[name], other[name]) for name in names]
    a, b = (np.concatenate(side) for side in zip(*pairs, strict=True))
    own, others = (
        np.concatenate([marks - marks.mean() for marks in side])
        for side in zip(*pairs, strict=True)
    )
    ranks = [spearmanr(x, y).statistic for x, y in pairs]
    return (
        len(names),
        float(np.corrcoef(a, b)[0, 1]),
        float(np.corrcoef(own, others)[0, 1]),
        float(np.nanmean(ranks)),
        float(abs(a - b).mean()),
    )


def agree(options: argparse.Namespace) -> None:
    """Print how far readings agree."""
    found = readings(options)
    for name, marks in found.items():
        values = np.concatenate(list(marks.values()))
        print(
            f"{name:8}{len(marks):4} silhouettes, marks {values.mean():.2f} +- {values.std():.2f}"
        )
    print(f"\n{'':18}silhouettes  all tiles  within one  ranks within  marks apart")
    for one, other in itertools.combinations(found, 2):
        if found[one].keys() & found[other].keys():
            count, *values = agreement(found[one], found[other])
            row = "".join(f"{value:12.2f}" for value in values)
            print(f"{one + ', ' + other:18}{count:11}{row}")


def published(document: dict[str, Any], marks: dict[str, list[float]]) -> dict[str, Any]:
    """Return a silhouette's tiles as they are published, with the marks of each reading."""
    rest = np.array(document["rest"])
    every = np.arange(POINTS) * len(rest) // POINTS
    tiles = []
    for k, row in enumerate(document["tiles"]):
        own, bent = row["values"], np.array(row["bent"])
        kept = asdict(fidelity(complex_points(rest), complex_points(bent), own["cost"]))
        values = kept | {name: own[name] for name in ALSO}
        if "notches" in own:
            values["before"] = score_before(own)
        if row["method"] == "overlap":
            values["overlap"] = row["score"]
        tiles.append(
            {
                "method": row["method"],
                "class": row["class"],
                "values": {name: np.round(value, 4).tolist() for name, value in values.items()},
                "marks": {name: marked[k] for name, marked in marks.items()},
                "outline": thousandths(bent, every),
            }
        )
    about = {key: document[key] for key in ("part", "least_neck")}
    return {**about, "rest": thousandths(rest, every), "tiles": tiles}


def score_before(values: dict[str, Any]) -> float:
    """Return the score by the order of tiles that was in use when the first of the pool were made."""
    usual = np.array([0.12, 0.16, 0.13, 0.3, 0.037, 0.25])
    weights = (6.5, 6.5, 6.5, 2.6, 2.3, 6.5)
    own = [*values["pieces"], values["notches"], values["narrowed"], values["cost"]]
    damage = values["necks"] + weights @ np.log((0.3 + own / usual) / 1.3)
    return float(1 / (1 + np.exp(damage / 4)))


def thousandths(ring: Ring, every: NDArray[np.int64]) -> list[int]:
    """Return x, y, x, y, ... of some points of a ring (n, 2), as whole numbers."""
    return (1000 * ring[every]).round().astype(int).ravel().tolist()


def publish(options: argparse.Namespace) -> None:
    """Write all marked tiles."""
    found = readings(options)
    rows = []
    for name in sorted({name for marks in found.values() for name in marks}):
        document = json.loads((options.out / "tiles" / f"{name}.json").read_text())
        marks = {key: own[name].tolist() for key, own in found.items() if name in own}
        own = json.dumps(published(document, marks), separators=(",", ":"))
        rows.append(f"{json.dumps(name)}:{own}")
    options.to.write_text('{"silhouettes":{\n' + ",\n".join(rows) + "\n}}\n")
    print(f"{len(rows)} silhouettes, {options.to.stat().st_size / 1e6:.2f} MB: {options.to}")


class Marked:
    """The marked tiles of a silhouette."""

    def __init__(self, tiles: list[dict[str, Any]]) -> None:
        self.values = [tile["values"] for tile in tiles]
        self.searched = np.array([tile["method"] in SEARCHED for tile in tiles])
        self.readings = np.array([list(tile["marks"].values()) for tile in tiles]).T
        self.marks = self.readings.mean(axis=0)
        self.kept = [
            Fidelity((own["pieces"][0], own["pieces"][1]), *(own[name] for name in VALUES))
            for own in self.values
        ]
        self.losses = np.array([own.losses for own in self.kept])
        self.scores = np.array([own.score for own in self.kept])

    def orders(self) -> dict[str, Ring]:
        """Return what tiles can be ordered by, the largest first, by its name."""
        found = {"the order": self.scores}
        if all("before" in own for own in self.values):
            found["the order before"] = self.column("before")
        found |= dict(zip(MEASURES, -self.losses.T, strict=True))
        found |= {name: -self.column(name) for name in ("energy", "displacement")}
        return found | {"IoU": self.column("iou")}

    def column(self, name: str) -> Ring:
        """Return one value of all tiles."""
        return np.array([own[name] for own in self.values])

    def against(self, values: Ring) -> tuple[float, float, float]:
        """Return the correlation of ranks with the marks, the mark of the first, and what it lacks."""
        first = self.marks[np.argmax(values)]
        rank = float(spearmanr(values, self.marks).statistic) if np.ptp(values) else np.nan
        return rank, first, self.marks.max() - first


def order(options: argparse.Namespace) -> None:
    """Print how far the order of tiles agrees with the published marks."""
    parts: dict[str, list[Marked]] = {}
    for own in json.loads(options.file.read_text())["silhouettes"].values():
        parts.setdefault(own["part"], []).append(Marked(own["tiles"]))
    for part, found in parts.items():
        count = sum(len(one.marks) for one in found)
        print(f"\n{part}: {count} tiles of {len(found)} silhouettes")
        print_orders(found, fitted=part == "learn")
        print_calibration(found)
        print_words(found)


def print_orders(found: list[Marked], *, fitted: bool) -> None:
    """Print how well each order agrees with the marks within silhouettes."""
    orders = [one.orders() for one in found]
    if fitted:
        for k, one in enumerate(found):
            weights = fitted_weights(found[:k] + found[k + 1 :])
            orders[k]["its weights fitted to the others"] = -one.losses @ weights
    print(f"\n{'':36}rank correlation  mark of its first  less than the best")
    for name in orders[0]:
        rows = [one.against(own[name]) for one, own in zip(found, orders, strict=True)]
        ranks, first, less = np.array(rows).T
        rank = np.nanmean(ranks) if np.isfinite(ranks).any() else np.nan
        row = (rank, first.mean(), less.mean())
        print(f"{name:36}" + "".join(f"{x:16.2f}" for x in row))
    ours = np.mean([one.marks[np.argmax(one.scores * one.searched)] for one in found])
    print(f"{'the order, among tiles of our search':52}{ours:16.2f}")
    shown = np.mean([one.marks[0] for one in found])
    print(f"{'the tile that was shown before':52}{shown:16.2f}")
    both = [one.readings[:2] for one in found if len(one.readings) > 1]
    if both:
        ranks = np.mean([spearmanr(a, b).statistic for a, b in both])
        first = np.mean([[b[a.argmax()], a[b.argmax()]] for a, b in both])
        print(f"{'one judge, seen by the other':36}{ranks:16.2f}{first:16.2f}")
    print(
        f"weights fitted to these marks, over those of the order: {fitted_weights(found).round(2)}"
    )


def fitted_weights(found: list[Marked]) -> Ring:
    """Return the weights of losses that foretell marks best, less each silhouette's mean."""
    losses = np.concatenate([one.losses - one.losses.mean(axis=0) for one in found])
    return nnls(-losses, np.concatenate([one.marks - one.marks.mean() for one in found]))[0]


def print_calibration(found: list[Marked]) -> None:
    """Print the scores by tenths, and which share of the marks is good."""
    scores = np.concatenate([one.scores for one in found])
    good = np.concatenate([(one.readings >= GOOD).mean(axis=0) for one in found])
    tenths = np.array_split(np.argsort(scores), min(10, len(scores)))
    print("\nscore, mean of a tenth  " + "".join(f"{scores[own].mean():6.2f}" for own in tenths))
    print(f"marks of {GOOD} or more    " + "".join(f"{good[own].mean():6.2f}" for own in tenths))


def print_words(found: list[Marked]) -> None:
    """Print our words against those of the judges."""
    ours = [Rating.of_likeness(score) for one in found for score in one.scores]
    theirs = [Rating.of_mark(mark) for one in found for mark in one.marks]
    print_agreement("\nour stars and the judges' mean", ours, theirs)
    rows = [pair for one in found for pair in zip(one.values, one.marks, strict=True)]
    rigid = np.array([(own["overlap"], mark) for own, mark in rows if "overlap" in own])
    if len(rigid) > 2:
        scores, marks = rigid.T
        slope, base = np.polyfit(scores, marks, 1)
        line = f"marks are {slope:.1f} times their scores {base:+.1f}"
        print(
            f"tiles for overlap: {line}, rank correlation {spearmanr(scores, marks).statistic:.2f}"
        )
    both = [one.readings[:2] for one in found if len(one.readings) > 1]
    if both:
        readings = np.concatenate(both, axis=1)
        print_agreement(
            "one judge's and the other's", *([*map(Rating.of_mark, r)] for r in readings)
        )
    table = np.zeros((4, 4), dtype=int)
    np.add.at(table, (places(ours), places(theirs)), 1)
    print("our word, and the judges'" + "".join(f"{word:>11}" for word in WORDS.values()))
    for word, row in zip(WORDS.values(), table, strict=True):
        print(f"{word:25}" + "".join(f"{count:11}" for count in row))


def print_agreement(label: str, ours: list[Rating], theirs: list[Rating]) -> None:
    """Print how far two lists of ratings agree."""
    apart = abs(places(ours) - places(theirs))
    stars, others = ([own.stars for own in side] for side in (ours, theirs))
    rank = spearmanr(stars, others).statistic
    print(
        f"{label}: rank correlation {rank:.2f} over all tiles, the same word "
        f"{np.mean(apart == 0):.0%}, that or the next {np.mean(apart < 2):.0%}"
    )


def places(ratings: list[Rating]) -> NDArray[np.int64]:
    """Return the number of each rating's word."""
    return np.array([list(WORDS.values()).index(own.word) for own in ratings])


def main() -> None:
    """Compare the answers, publish them, or compare the order with what was published."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(required=True)
    for name, command in (("agree", agree), ("publish", publish)):
        own = commands.add_parser(name, help=str(command.__doc__))
        own.add_argument("answers", nargs="+", type=Path)
        own.add_argument("--out", type=Path, default=Path("out/pool"))
        own.set_defaults(command=command)
        if command is publish:
            own.add_argument("--to", type=Path, default=MARKS)
    own = commands.add_parser("order", help=str(order.__doc__))
    own.add_argument("file", nargs="?", type=Path, default=MARKS)
    own.set_defaults(command=order)
    options = parser.parse_args()
    options.command(options)


if __name__ == "__main__":
    main()
