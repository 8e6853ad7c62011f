"""A blind comparison of methods: sheets without names for a judge, and what the answers say.

    python benchmarks/likeness_blind.py make --out FOLDER [--seed N] [--rounds 3]
        [--effort fast|normal] [--tiles FOLDER] [--methods METHOD ...] [NAME ...]
    python benchmarks/likeness_blind.py score --out FOLDER ANSWERS.json ...

`make` writes FOLDER/sheets, which is all that a judge is given: INSTRUCTIONS.md, and in a folder for
each round one picture for each goal, the target in blue and the methods' first tiles numbered in an
order that is shuffled anew for every picture. FOLDER/key.json says whose they are. `score` reads one
file for each round and judge. docs/blind.md says more.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.stats
import torch
from common import DATA, GOALS, HELD, Ring, aligned, cell, common_unit, goal, needed, silhouettes
from PIL import Image, ImageDraw, ImageFont

from orbiflow.tiles import LikenessSearch, OverlapSearch, Target, centroid, escherize, signed_area

SEARCHES = {"overlap": OverlapSearch, "likeness": LikenessSearch}
RIVALS = {"arap": "arap_EIR_top20", "est": "est_euclid_top20"}
"""The methods whose tiles are files, and what the files call them."""

BEFORE = "before"
"""An earlier search for likeness: its first tiles lie in the folder of tiles as NAME-before.json."""

METHODS = (*SEARCHES, *RIVALS, BEFORE)
TRIES = 8
"""Turns from which the best similarity is sought: three have missed it for a spider."""

CELL, HEAD, BLUE = 300, 36, "#1f5fbf"  # pixels

INSTRUCTIONS = """\
# What you are asked

Each picture shows one silhouette in blue, the target, and beside it black silhouettes with numbers.
Each black one is an attempt at the target under a constraint that you need not know: none of them can
be a perfect copy.

**Which of the black silhouettes would a person take for the target's subject most readily and find most
like the target? Order all of them, from the most alike to the least.**

Judge each as a whole, as you would a printed silhouette: what it depicts, whether all parts of the
target are there and where they belong, their shapes and proportions. Look at every picture by itself.
The numbers mean nothing and are shuffled from picture to picture: please do not look for a pattern,
and do not look at other rounds, at the key, or at anything else about where the silhouettes come from.

# What you hand back

One file `answers.json` for the round that you judged. For each picture, by its name without `.png`, the
numbers from the most alike to the least:

    {"round": 1, "kind": "ranking", "answers": {"NAME": [3, 1, 2], "OTHER": [2, 3, 1]}}

or, if you would rather give marks from 0 (not recognisable) to 10 (as good as the target), the mark of
number 1, of number 2, and so on; equal marks are a tie:

    {"round": 1, "kind": "scores", "answers": {"NAME": [6.5, 4, 8], "OTHER": [5, 7, 6]}}
"""


def target_of(name: str) -> Target:
    """The silhouette of a goal, of data/likeness_shapes.json, or in a file."""
    if name in GOALS:
        return goal(name)
    shape = silhouettes().get(name)
    return Target.from_polygon(shape["outline"]) if shape else Target.read(needed(Path(name), name))


def first_tiles(name: str, effort: str, folder: Path, methods: Sequence[str]) -> dict[str, Ring]:
    """Of "target" and of each method that has one, its first tile: y up, area 1, upright.

    Searches are slow: what was found is kept in `folder`, to be removed after a change of the search.
    """
    target = target_of(name)
    found = {"target": np.asarray(target.normal)}
    for method in methods:
        kept = (
            folder / f"{Path(name).stem}-{method}{f'-{effort}' if method in SEARCHES else ''}.json"
        )
        if method == BEFORE and not kept.exists():
            raise SystemExit(
                f"{name}: put the first tile of the search before, as points, in {kept}"
            )
        if not kept.exists():
            folder.mkdir(parents=True, exist_ok=True)
            kept.write_text(json.dumps(first_tile(name, target, method, effort)))
        ring = np.array(json.loads(kept.read_text()))
        if len(ring):
            found[method] = (ring - centroid(ring)) / np.sqrt(abs(signed_area(ring)))
    return found


def first_tile(name: str, target: Target, method: str, effort: str) -> list[list[float]]:
    """The first tile of one method laid on the target, or nothing."""
    if method in SEARCHES:
        tiles = escherize(target, method=SEARCHES[method].for_effort(effort)).tiles
        ring = tiles[0].normal_tile.polygon if tiles else None
    else:
        ring = rival(name).get(method)
    if ring is None:
        return []
    return aligned(np.asarray(ring), np.asarray(target.normal), TRIES).tolist()


def rival(name: str) -> dict[str, list[list[float]]]:
    """The first tiles of EST and ARAP, by method, where they are at hand."""
    goals = DATA / "silhouettes" / "baseline_tiles" / f"{name}.json"
    if goals.exists():
        tiles = json.loads(goals.read_text())
        return {method: tiles[key][0]["tile"] for method, key in RIVALS.items()}
    icons = DATA / "silhouettes" / "icons" / "baselines.json"
    known = json.loads(icons.read_text()) if icons.exists() else {}
    fresh = json.loads((HELD / "likeness_rivals.json").read_text())
    found = known.get(name.removesuffix("_80")) or fresh.get(name, {})
    return {method: tile["tile"] for method, tile in found.items()}


def shuffled(methods: Sequence[str], seed: int, round_number: int, index: int) -> list[str]:
    """The methods in the order of one picture: the first has number 1."""
    order = np.random.default_rng([seed, round_number, index]).permutation(len(methods))
    return [methods[int(k)] for k in order]


def sheet(target: Ring, tiles: Sequence[Ring]) -> Image.Image:
    """The target in blue, and the tiles with their numbers, three in a row."""
    columns = min(3, len(tiles) + 1)
    rows = -(-(len(tiles) + 1) // columns)
    page = Image.new("RGB", (columns * CELL, rows * (CELL + HEAD)), "white")
    pen, font = ImageDraw.Draw(page), ImageFont.load_default(size=22)
    unit = common_unit([target, *tiles], CELL)
    for k, ring in enumerate((target, *tiles)):
        x, y = (k % columns) * CELL, (k // columns) * (CELL + HEAD)
        colour, text = ("black", str(k)) if k else (BLUE, "target")
        page.paste(cell(ring, CELL, unit, colour), (x, y + HEAD))
        pen.text((x + CELL / 2, y + HEAD / 2), text, colour, font, "mm")
    return page


def make(options: argparse.Namespace) -> None:
    """Write the sheets, the instructions and the key."""
    rows: dict[str, dict[str, Ring]] = {}
    for name in options.names or GOALS:
        found = first_tiles(name, options.effort, options.tiles, options.methods)
        print(f"{name}: {', '.join(method for method in found if method != 'target')}", flush=True)
        rows[Path(name).stem] = found
    sheets: Path = options.out / "sheets"
    key: dict[str, dict[str, list[str]]] = {}
    for number in range(1, options.rounds + 1):
        folder = sheets / f"round-{number}"
        folder.mkdir(parents=True, exist_ok=True)
        key[str(number)] = {}
        for index, (name, rings) in enumerate(rows.items()):
            present = [method for method in options.methods if method in rings]
            order = shuffled(present, options.seed, number, index)
            sheet(rings["target"], [rings[m] for m in order]).save(folder / f"{name}.png")
            key[str(number)][name] = order
    (sheets / "INSTRUCTIONS.md").write_text(INSTRUCTIONS)
    document = {"seed": options.seed, "effort": options.effort, "rounds": key}
    (options.out / "key.json").write_text(json.dumps(document, indent=1))
    print(f"for the judges: {sheets}; key: {options.out / 'key.json'}")


def ranks(answer: Sequence[float], kind: str, count: int) -> list[float]:
    """The rank of number 1, 2, ..., `count`: 1 is the most alike, ties share the mean.

    Raises:
        ValueError: for an answer that does not rank or score every number once.
    """
    if kind == "ranking":
        if sorted(answer) != list(range(1, count + 1)):
            raise ValueError(f"a ranking needs 1 to {count} once each, got {list(answer)}")
        return [float(answer.index(number) + 1) for number in range(1, count + 1)]
    if kind == "scores":
        if len(answer) != count or not all(0 <= score <= 10 for score in answer):
            raise ValueError(f"{count} scores from 0 to 10 are needed, got {list(answer)}")
        return scipy.stats.rankdata([-score for score in answer]).tolist()
    raise ValueError(f'kind must be "ranking" or "scores", got {kind!r}')


def judged(key: dict[str, Any], answers: dict[str, Any]) -> list[tuple[str, dict[str, float]]]:
    """Of one file of answers, for each picture its name and the rank of each method."""
    orders = key["rounds"][str(answers["round"])]
    missing = set(orders) ^ set(answers["answers"])
    if missing:
        raise ValueError(f"answers and pictures do not match: {', '.join(sorted(missing))}")
    rows = []
    for name, order in orders.items():
        own = ranks(answers["answers"][name], answers["kind"], len(order))
        rows.append((name, dict(zip(order, own, strict=True))))
    return rows


def preferred(rows: list[dict[str, float]], method: str, other: str) -> tuple[float, int]:
    """In how many rows `method` ranks before `other`, ties counted half, of how many with both."""
    both = [(row[method], row[other]) for row in rows if method in row and other in row]
    return sum(float(a < b) + 0.5 * float(a == b) for a, b in both), len(both)


def score(options: argparse.Namespace) -> None:
    """Print what the answers say."""
    key = json.loads((options.out / "key.json").read_text())
    named = []
    for path in options.answers:
        try:
            named += judged(key, json.loads(path.read_text()))
        except (ValueError, KeyError, TypeError) as error:
            raise SystemExit(f"{path}: {type(error).__name__}: {error}") from error
    rows = [row for _, row in named]
    methods = [method for method in METHODS if any(method in row for row in rows)]
    print(f"{len(rows)} rows from {len(options.answers)} files\n\nmean rank\n{'':18}", end="")
    print("".join(f"{method:>10}" for method in methods))
    for name in dict.fromkeys(name for name, _ in named):
        own = [row for other, row in named if other == name]
        print(f"{name:18}" + "".join(_mean(own, method) for method in methods))
    print(f"{'all':18}" + "".join(_mean(rows, method) for method in methods))
    print(f"\nrows in which the method at the left is preferred\n{'':14}", end="")
    print("".join(f"{method:>14}" for method in methods))
    for method in methods:
        print(f"{method:14}" + "".join(_share(rows, method, other) for other in methods))
    print()
    if "likeness" in methods:
        _print_likeness(named)


def _print_likeness(named: list[tuple[str, dict[str, float]]]) -> None:
    """Print in how many rows likeness is preferred, and to ARAP, EST or one of them by silhouettes."""
    rows = [row for _, row in named]
    for other in METHODS:
        wins, count = preferred(rows, "likeness", other)
        if count and other != "likeness":
            print(f"likeness preferred to {other:8}{wins:5g} of {count}  ({wins / count:4.0%})")
    parts = {name: shape["part"] for name, shape in silhouettes().items()}
    groups = {"all": lambda _: True, "the nine goals": GOALS.__contains__}
    groups |= {"others": lambda name: name not in GOALS}
    for part in ("test", "fresh"):
        groups[f"part {part}"] = lambda name, part=part: parts.get(name) == part
    print(f"\n{'likeness preferred to':24}arap   est  one of them  of rows")
    for label, belongs in groups.items():
        own = [row for name, row in named if belongs(name) and {"arap", "est"} <= row.keys()]
        if own:
            arap, est = (preferred(own, "likeness", other)[0] for other in ("arap", "est"))
            one = sum(row["likeness"] < max(row["arap"], row["est"]) for row in own)
            print(f"{label:24}{arap:4g}{est:6g}{one:13}{len(own):9}")


def _mean(rows: list[dict[str, float]], method: str) -> str:
    own = [row[method] for row in rows if method in row]
    return f"{np.mean(own):10.2f}" if own else f"{'':10}"


def _share(rows: list[dict[str, float]], method: str, other: str) -> str:
    wins, count = preferred(rows, method, other)
    return f"{'':14}" if method == other or not count else f"{f'{wins:g} of {count}':>14}"


def main() -> None:
    """Make or score."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(required=True)
    maker = commands.add_parser("make", help="write sheets and key")
    maker.add_argument("names", nargs="*", help="silhouettes or files; default the nine goals")
    maker.add_argument("--out", type=Path, default=Path("out/blind"))
    maker.add_argument("--seed", type=int, default=0)
    maker.add_argument("--rounds", type=int, default=3)
    maker.add_argument("--effort", choices=("fast", "normal"), default="normal")
    maker.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS[:-1]))
    maker.add_argument("--tiles", type=Path, default=Path("out/likeness"), help="kept there")
    maker.set_defaults(command=make)
    scorer = commands.add_parser("score", help="read answers")
    scorer.add_argument("answers", nargs="+", type=Path)
    scorer.add_argument("--out", type=Path, default=Path("out/blind"))
    scorer.set_defaults(command=score)
    options = parser.parse_args()
    torch.set_num_threads(1)
    options.command(options)


if __name__ == "__main__":
    main()
