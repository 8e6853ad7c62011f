"""What people see in bent tiles, and what of it the order of tiles knows: correlations with marks.

    python benchmarks/likeness_marks.py

data/likeness_marks.json holds the marks from 0 to 10 that two judges gave to 165 tiles of 15
silhouettes, on sheets without names, and for each of ours the values of `orbiflow.likeness.fidelity`,
the energy and the displacement. All correlations are within silhouettes: each silhouette's mean is
taken out of marks and values alike. The weights of the order are one over each value's usual spread:
nothing but the choice of its parts was fitted to marks.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
from common import ROOT, Ring
from scipy.stats import spearmanr

from orbiflow.tiles import Fidelity, Rating
from orbiflow.tiles.likeness import likeness_ratings
from orbiflow.tiles.likeness.elastic import POSE_WEIGHT
from orbiflow.tiles.likeness.ranking import WORDS

Row = dict[str, Any]


def _fidelity(row: Row) -> Fidelity:
    own = (row["notches"], row["narrowed"], row["necks"], row["cost"])
    return Fidelity(tuple(row["pieces"]), *own)


VALUES: dict[str, Callable[[Row], float]] = {
    "energy": lambda row: float(np.log(row["cost"] - POSE_WEIGHT * row["displacement"])),
    "displacement": lambda row: float(np.log(row["displacement"])),
    "cost: both": lambda row: float(np.log(row["cost"])),
    "small pieces": lambda row: float(np.log(row["pieces"][0])),
    "middle pieces": lambda row: float(np.log(row["pieces"][1])),
    "large pieces": lambda row: float(np.log(row["pieces"][2])),
    "notches": lambda row: float(np.log(row["notches"] + 1e-3)),
    "narrowed": lambda row: float(np.log(row["narrowed"] + 1e-3)),
    "damage: the order": lambda row: _fidelity(row).damage,
}
"""Smaller is better in all; logarithms of all but the last."""


def within(values: list[Ring]) -> Ring:
    """Values of each silhouette less their mean, all in one."""
    return np.concatenate([value - value.mean() for value in values])


def _foretold(ours: dict[str, list[Row]], lengths: dict[str, float], name: str) -> list[Rating]:
    """Ratings of a silhouette's tiles, their weights fitted to the marks of the others."""

    def terms(silhouette: str) -> Ring:
        odds = np.array([-_fidelity(row).damage / 4 for row in ours[silhouette]])
        whole = np.ones((len(odds), 1)) * (1, odds.max(), np.log(lengths[silhouette]))
        return np.column_stack([whole, odds.max() - odds])

    others = [other for other in ours if other != name]
    marks = [np.mean(row["marks"]) for other in others for row in ours[other]]
    known = np.concatenate([terms(other) for other in others])
    weights = np.linalg.lstsq(known, np.array(marks), rcond=None)[0]
    return [Rating.of_mark(mark) for mark in terms(name) @ weights]


def _print_ratings(ours: dict[str, list[Row]], lengths: dict[str, float]) -> None:
    marks = np.array([row["marks"] for rows in ours.values() for row in rows])
    said = [Rating.of_mark(mark) for mark in marks.mean(axis=1)]
    rated = [
        rating
        for name, rows in ours.items()
        for rating in likeness_ratings([_fidelity(row).score for row in rows], lengths[name])
    ]
    first, second = ([Rating.of_mark(mark) for mark in own] for own in marks.T)
    pairs = {
        "stars, and the judges' mean": (rated, said),
        "with weights fitted to other silhouettes": (
            [rating for name in ours for rating in _foretold(ours, lengths, name)],
            said,
        ),
        "the judges with each other": (first, second),
    }
    words = list(WORDS.values())
    print(
        "\nall silhouettes together                  correlation of ranks  same word  or the next"
    )
    for label, (a, b) in pairs.items():
        places = [[words.index(rating.word) for rating in side] for side in (a, b)]
        apart = abs(np.subtract(places[0], places[1]))
        rank = spearmanr([r.stars for r in a], [r.stars for r in b]).statistic
        print(f"{label:42}{rank:20.2f}{np.mean(apart == 0):11.2f}{np.mean(apart < 2):13.2f}")
    table = np.zeros((4, 4), dtype=int)
    np.add.at(table, tuple([words.index(r.word) for r in side] for side in (rated, said)), 1)
    print("\nour word, and the judges'" + "".join(f"{word:>11}" for word in words))
    for word, row in zip(words, table, strict=True):
        print(f"{word:26}" + "".join(f"{count:11}" for count in row))


def main() -> None:
    """Print the tables."""
    document = json.loads((ROOT / "benchmarks" / "data" / "likeness_marks.json").read_text())
    tiles: dict[str, list[Row]] = document["silhouettes"]
    both = [np.array([row["marks"] for row in rows]).T for rows in tiles.values()]
    agree = np.corrcoef(within([a for a, _ in both]), within([b for _, b in both]))[0, 1]
    print(f"{sum(map(len, tiles.values()))} tiles; the judges with each other: {agree:.2f}")

    ours = {name: [row for row in rows if "cost" in row] for name, rows in tiles.items()}
    marks = {name: np.mean([row["marks"] for row in rows], axis=1) for name, rows in ours.items()}
    seen = within(list(marks.values()))
    best = np.mean([mark.max() for mark in marks.values()])
    mean = np.mean([mark.mean() for mark in marks.values()])
    print(f"\nmarks: mean {mean:.2f}; the best of each silhouette {best:.2f}")
    print("value              correlation   mark of the tile that it puts first")
    for label, value in VALUES.items():
        own = {name: np.array([value(row) for row in rows]) for name, rows in ours.items()}
        correlation = np.corrcoef(within(list(own.values())), seen)[0, 1]
        first = np.mean([marks[name][np.argmin(own[name])] for name in own])
        print(f"{label:20}{correlation:10.2f}{first:24.2f}")

    _print_ratings(ours, document["lengths"])
    print("\nARAP's first tile: its mark, and that of the tile that we would put first")
    for name, rows in tiles.items():
        for row in (row for row in rows if row["method"] == "arap"):
            first = int(np.argmin([VALUES["damage: the order"](own) for own in ours[name]]))
            print(f"{name:14}{np.mean(row['marks']):6.2f}{marks[name][first]:6.2f}")


if __name__ == "__main__":
    main()
