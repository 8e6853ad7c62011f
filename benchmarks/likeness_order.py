"""How far the order of tiles agrees with what judges said of them.

    python benchmarks/likeness_order.py [marks] [ranks]

marks: some twenty tiles from bad to good of each of 88 silhouettes (data/likeness_pool.json). Printed
is how well the order and its measures put a silhouette's tiles into the judges' order (the mean of the
silhouettes' correlations of ranks), and how much worse the tile that each puts first is marked than
the best; whether scores are the shares of marks that are good, by tenths of the tiles; and how often
our words are the judges'. The weights were fitted to the part "learn": there it prints also what
weights give that are fitted to all other silhouettes. The part "test" was kept apart.

ranks: eight good tiles of each of 65 silhouettes (data/likeness_ranks.json), whose marks hardly
differ. Printed is how far the order agrees with the judges', and in how many rows the tile that it
puts first is preferred to the first ones of EST and ARAP.
"""

from __future__ import annotations

import argparse
import json
from typing import Any

import numpy as np
from common import HELD, Ring
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.stats import spearmanr

from orbiflow.tiles import Fidelity, Rating
from orbiflow.tiles.likeness.rating import STAR_WORDS

GOOD = 6.5
"""The least mark that is good."""

VALUES = ("stretched", "thickness", "blunted", "moved", "merged", "cost", "length")
MEASURES = ("short pieces", "long pieces", *VALUES[:5])
LATER = dict(zip(("blunted", "moved", "merged"), range(4, 7), strict=True))
"""The measures that came from rankings, and their places among losses."""


def measured(values: dict[str, Any]) -> Fidelity:
    """What the order measures in a tile, as it was published."""
    short, long = values["pieces"]
    return Fidelity((short, long), *(values[name] for name in VALUES))


class Marked:
    """The marked tiles of a silhouette: their values, marks (N,), and those of each judge (K, N)."""

    def __init__(self, tiles: list[dict[str, Any]]) -> None:
        self.values = [tile["values"] for tile in tiles]
        self.readings = np.array([list(tile["marks"].values()) for tile in tiles]).T
        self.marks = self.readings.mean(axis=0)
        kept = [measured(own) for own in self.values]
        self.losses = np.array([own.losses for own in kept])
        self.scores = np.array([own.score for own in kept])

    def orders(self) -> dict[str, Ring]:
        """What tiles can be ordered by, the largest first, by its name."""
        found = {"the order": self.scores, "the order of version 0.1": self.column("before")}
        found |= dict(zip(MEASURES, -self.losses.T, strict=True))
        found |= {name: -self.column(name) for name in ("energy", "displacement")}
        return found | {"IoU": self.column("iou")}

    def column(self, name: str) -> Ring:
        """One value of all tiles; not a number where it was not published."""
        return np.array([own.get(name, np.nan) for own in self.values])

    def against(self, values: Ring) -> tuple[float, float, float]:
        """The correlation of ranks with the marks, the mark of the first, and what it lacks."""
        first = self.marks[np.argmax(values)]
        rank = float(spearmanr(values, self.marks).statistic)
        return rank, first, self.marks.max() - first


def marks() -> None:
    """Print how far the order agrees with the marks of tiles from bad to good."""
    parts: dict[str, list[Marked]] = {}
    for own in json.loads((HELD / "likeness_pool.json").read_text())["silhouettes"].values():
        parts.setdefault(own["part"], []).append(Marked(own["tiles"]))
    for part, found in parts.items():
        print(f"\n{part}: {sum(len(one.marks) for one in found)} tiles of {len(found)} silhouettes")
        print_orders(found, fitted=part == "learn")
        scores = np.concatenate([one.scores for one in found])
        print_calibration(scores, np.concatenate([one.readings for one in found], axis=1))
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
        print(f"{name:36}" + "".join(f"{x:16.2f}" for x in np.mean(rows, axis=0)))
    both = [one.readings[:2] for one in found]
    ranks = np.mean([spearmanr(a, b).statistic for a, b in both])
    first = np.mean([[b[a.argmax()], a[b.argmax()]] for a, b in both])
    print(f"{'one judge, seen by the other':36}{ranks:16.2f}{first:16.2f}")
    ours = fitted_weights(found).round(2)
    print(f"weights fitted to these marks, over those of the order: {ours}")


def fitted_weights(found: list[Marked]) -> Ring:
    """The weights of losses that predict marks best, less each silhouette's mean."""
    losses = np.concatenate([one.losses - one.losses.mean(axis=0) for one in found])
    return nnls(-losses, np.concatenate([one.marks - one.marks.mean() for one in found]))[0]


def print_calibration(scores: Ring, readings: Ring) -> None:
    """Print scores (N,) by tenths, and which share of the marks (K, N) is good."""
    good = (readings >= GOOD).mean(axis=0)
    tenths = np.array_split(np.argsort(scores), min(10, len(scores)))
    print("\nscore, mean of a tenth  " + "".join(f"{scores[own].mean():6.2f}" for own in tenths))
    print(f"marks of {GOOD} or more    " + "".join(f"{good[own].mean():6.2f}" for own in tenths))


def print_words(found: list[Marked]) -> None:
    """Print our words against those of the judges."""
    ours = [Rating.of_likeness(score) for one in found for score in one.scores]
    theirs = [Rating.of_mark(mark) for one in found for mark in one.marks]
    rank = spearmanr([own.stars for own in ours], [own.stars for own in theirs]).statistic
    apart = abs(places(ours) - places(theirs))
    print(
        f"\nour stars and the judges' mean: rank correlation {rank:.2f} over all tiles, the same "
        f"word {np.mean(apart == 0):.0%}, that or the next {np.mean(apart < 2):.0%}"
    )
    rigid = np.concatenate([[one.column("overlap"), one.marks] for one in found], axis=1)
    scores, given = rigid[:, np.isfinite(rigid[0])]
    slope, base = np.polyfit(scores, given, 1)
    print(
        f"tiles for overlap: marks are {slope:.1f} times their scores {base:+.1f}, "
        f"rank correlation {spearmanr(scores, given).statistic:.2f}"
    )


def places(ratings: list[Rating]) -> NDArray[np.int64]:
    """The number of each rating's word."""
    return np.array([list(STAR_WORDS.values()).index(own.word) for own in ratings])


class Ranked:
    """The ranked tiles of a silhouette: ours, and of EST and ARAP."""

    def __init__(self, tiles: list[dict[str, Any]]) -> None:
        ours = [tile for tile in tiles if tile["method"] == "ours"]
        self.kept = [measured(tile["values"]) for tile in ours]
        self.losses = np.array([own.losses for own in self.kept])
        self.places = np.array([tile["places"] for tile in ours])
        self.marks = np.array([tile["marks"] for tile in ours])
        self.others = np.array([tile["places"] for tile in tiles if tile["method"] != "ours"])

    def predicted(self, left_out: list[int]) -> Ring:
        """The marks (N,) that the order predicts without some of its measures."""
        marks = np.array([own.mark for own in self.kept])
        return marks + self.losses[:, left_out].sum(axis=1)

    def chosen(self, best: int, judges: slice) -> tuple[float, float, int, int]:
        """The place among ours of a tile, its mark, and in how many rows it wins, of all."""
        place = float((self.places < self.places[best])[:, judges].sum(axis=0).mean() + 1)
        wins = [self.places[best, judges] < other[judges] for other in self.others]
        return place, float(self.marks[best, judges].mean()), int(np.sum(wins)), np.size(wins)


def ranks() -> None:
    """Print how far the order agrees with the rankings of good tiles."""
    document = json.loads((HELD / "likeness_ranks.json").read_text())
    found = [Ranked(tiles) for tiles in document.values()]
    agree = np.mean([spearmanr(own.places).statistic for own in found])
    print(f"\n{len(found)} silhouettes; two judges agree by {agree:.2f} (correlation of ranks)\n")
    print(f"{'':22}correlation  place of our first  its mark  preferred to EST and ARAP")
    orders = {"the order": []} | {f"without `{name}`": [at] for name, at in LATER.items()}
    for label, left_out in (orders | {"without these three": list(LATER.values())}).items():
        marks = [own.predicted(left_out) for own in found]
        both = list(zip(marks, found, strict=True))
        rank = np.mean([spearmanr(-own, one.places.mean(axis=1)).statistic for own, one in both])
        rows = [one.chosen(int(own.argmax()), slice(0, 2)) for own, one in both]
        print_choice(label, f"{rank:.2f}", rows)
    rows = [
        own.chosen(int(own.places[:, judge].argmin()), slice(1 - judge, 2 - judge))
        for own in found
        for judge in (0, 1)
    ]
    print_choice("one judge's, by other", "", rows)
    scores = np.array([kept.score for own in found for kept in own.kept])
    print_calibration(scores, np.concatenate([own.marks for own in found]).T)


def print_choice(label: str, correlation: str, rows: list[tuple[float, float, int, int]]) -> None:
    """Print what came of the tiles that one order puts first."""
    place, mark, wins, count = np.array(rows).T
    print(
        f"{label:22}{correlation:>11}{place.mean():20.2f}{mark.mean():10.2f}"
        f"{wins.sum():14.0f} of {count.sum():.0f}"
    )


def main() -> None:
    """Print the parts that are asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("parts", nargs="*", choices=("marks", "ranks", []), help="both, if none")
    parts = parser.parse_args().parts
    for part in (marks, ranks):
        if not parts or part.__name__ in parts:
            part()


if __name__ == "__main__":
    main()
