"""What judges said of the pool of tiles: how far they agree, and the marks in one file.

    python benchmarks/likeness_pool_marks.py agree --out FOLDER ANSWERS.json ...
    python benchmarks/likeness_pool_marks.py publish --out FOLDER [--to FILE.json] ANSWERS.json ...

FOLDER is that of likeness_pool.py, and each file of answers is one judge's marks of one round of a
part. `agree` prints, for each two files that share pictures, the correlation of their marks, the
correlation within silhouettes (each silhouette's mean is taken out), that of ranks, and how far apart
the marks are. `publish` writes all tiles that were marked: the values of the order, the marks, and
points of the outline, in thousandths of the root of the silhouette's area, which correspond to those of
the silhouette.
"""

from __future__ import annotations

import argparse
import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np
from common import ROOT, Ring
from numpy.typing import NDArray
from scipy.stats import spearmanr

MARKS = ROOT / "benchmarks" / "data" / "likeness_pool.json"
POINTS = 48  # of each outline: all tiles together stay below 1.5 MB

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
    every = np.arange(POINTS) * len(document["rest"]) // POINTS
    tiles = []
    for k, row in enumerate(document["tiles"]):
        kept = {key: row[key] for key in ("method", "class")}
        values = {"score": row["score"], **row["values"]}
        kept["values"] = {name: np.round(value, 4).tolist() for name, value in values.items()}
        kept["marks"] = {name: own[k] for name, own in marks.items()}
        tiles.append({**kept, "outline": thousandths(row["bent"], every)})
    about = {key: document[key] for key in ("part", "least_neck", "length")}
    return {**about, "rest": thousandths(document["rest"], every), "tiles": tiles}


def thousandths(ring: list[list[float]], every: NDArray[np.int64]) -> list[int]:
    """Return x, y, x, y, ... of some points of a ring (n, 2), as whole numbers."""
    return (1000 * np.array(ring)[every]).round().astype(int).ravel().tolist()


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


def main() -> None:
    """Compare the answers, or publish them."""
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
    options = parser.parse_args()
    options.command(options)


if __name__ == "__main__":
    main()
