"""What each part of the search for likeness is worth: the same search without it.

    python benchmarks/likeness_ablations.py [--quick] [NAME ...]

For each change the mean, over goals and the classes IH4, IH5 and IH6, of the mark that is foretold for
the best tile (`orbiflow.tiles.fidelity`, from 0 to 10; tiles of one silhouette differ by about 1) and
of the seconds of CPU. The mark is one measure for all, whatever energy the search minimises, taken by
as many points for all.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from likeness_methods import silhouette

from orbiflow.runtime import one_blas_thread
from orbiflow.tiles import CLASSES, LikenessSearch, fidelity
from orbiflow.tiles.search import bending, carving, co_deformation
from orbiflow.tiles.search.co_deformation import BODIES, TIGHTER, drawn_to_tiles, hands
from orbiflow.tiles.search.likeness_search import ALL_BODIES

NAMES = ("bat_60", "camel_60", "octpus_94", "squirrel1_60")
KINDS = ("IH4", "IH5", "IH6")
PLAIN = LikenessSearch(bodies=("firm",))

Change = tuple[LikenessSearch, dict[str, Any]]


def springs(stages: int) -> dict[str, Any]:
    """Stages of tightening springs, 27 steps in all."""
    strengths = TIGHTER if stages == len(TIGHTER) else tuple(np.geomspace(1.2, 3000.0, stages))
    if stages == 1:
        strengths = (3000.0,)
    drawn = partial(drawn_to_tiles, strengths=strengths, rounds=27 // stages)
    return {"bending.drawn_to_tiles": drawn}


def stiff(**values: Any) -> dict[str, Any]:
    """Another stiffness of the search."""
    return {"bending.BODIES": {**BODIES, "firm": replace(BODIES["firm"], **values)}}


CHANGES: dict[str, Change] = {
    "firm": (PLAIN, {}),
    "corners not moved": (PLAIN, {"co_deformation.MOST_MOVES": 0}),
    "not carved": (replace(PLAIN, carved=0), {}),
    "five carved": (replace(PLAIN, carved=5), {}),
    "wrinkles cost nothing": (PLAIN, {"carving.WRINKLE_COST": 0.0}),
    "all neighbours worked out": (replace(PLAIN, share=1.0), {}),
    "placements chosen rigidly": (replace(PLAIN, placements=32, held=32), {}),
    "springs in one stage": (PLAIN, springs(1)),
    "springs in three stages": (PLAIN, springs(3)),
    "half the points": (replace(PLAIN, multiples=(2,)), {}),
    "half as many more": (replace(PLAIN, multiples=(6,)), {}),
    "never soft": (PLAIN, {"bending.BODIES": {**BODIES, "soft": BODIES["firm"]}}),
    "always soft": (replace(PLAIN, bodies=("soft",)), {}),
    "always stiff": (replace(PLAIN, bodies=("stiff",)), {}),
    "soft, firm and stiff": (replace(PLAIN, bodies=ALL_BODIES), {}),
    "thin parts as stiff": (PLAIN, stiff(salience=0.0)),
    "thin parts stiffer": (PLAIN, stiff(salience=0.5)),
    "thin parts softer still": (PLAIN, stiff(salience=-1.0)),
    "outline not stiff": (PLAIN, stiff(stretch=1e-3)),
    "outline no rod": (PLAIN, stiff(bend=1e-9)),
    "pose pulled as before": (PLAIN, stiff(pose=3.0)),
    "pose pulled five times more": (PLAIN, stiff(pose=300.0)),
}


@contextmanager
def changed(values: dict[str, Any]) -> Iterator[None]:
    """Constants of the search's modules changed for a while."""
    modules = {"bending": bending, "carving": carving, "co_deformation": co_deformation}
    places = {name: (modules[name.split(".")[0]], name.split(".")[1]) for name in values}
    before = {name: getattr(*place) for name, place in places.items()}
    try:
        for name, value in values.items():
            setattr(*places[name], value)
        yield
    finally:
        for name, value in before.items():
            setattr(*places[name], value)


def mark(bent: bending.Bent) -> float:
    """Return the foretold mark of a tile, by as many points whatever it was bent with."""
    body, few = bent.hand.fine, 2 * len(bent.hand.samples.coarse)
    every = slice(0, body.size, body.size // few)
    return fidelity(body.rest[: body.size][every], bent.points[: body.size][every], 0.0).mark


def measured(names: Sequence[str], change: Change) -> tuple[float, float]:
    """Return the mean mark and seconds of CPU."""
    settings, values = change
    marks = []
    began = time.process_time()
    with changed(values), one_blas_thread():
        for name in names:
            both = hands(silhouette(name), settings)
            for kind in KINDS:
                found, _ = bending.bent_tiles(both, CLASSES[kind], settings)
                marks.append(mark(found[0]) if found else np.nan)
    return float(np.nanmean(marks)), (time.process_time() - began) / len(marks)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*")
    parser.add_argument("--quick", action="store_true", help="one goal")
    options = parser.parse_args()
    names: Sequence[str] = options.names or (NAMES[1:2] if options.quick else NAMES)
    print(f"{', '.join(names)}; {', '.join(KINDS)}\n{'':28}  mark  CPU s a class")
    for label, change in CHANGES.items():
        mean, seconds = measured(names, change)
        print(f"{label:28}{mean:6.2f}{seconds:9.2f}", flush=True)


if __name__ == "__main__":
    main()
