"""The page of a cross-validation: the verdict, the folds' figures drawn and in a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orbiflow.arrays import Array
from orbiflow.batch import Entry
from orbiflow.density.comparing import ModelComparison
from orbiflow.density.cross_validation.operations import UNIFORM, CrossValidation
from orbiflow.density.cross_validation.results import HeldOut
from orbiflow.density.cross_validation.splits import Fit, Split
from orbiflow.density.cross_validation.strips import Strip, strips
from orbiflow.density.pictures import space_title
from orbiflow.drawing import rendered

MOST_LISTED = 200
"""Folds of the table on the page; all are in cv.csv."""

FoldMeans = Sequence[tuple[int, int, Array]]
"""Split and fold, from 1, and the means (S,) of the rows that every setting has scored."""


@dataclass(frozen=True, eq=False)
class FoldRow:
    """A row of the table of folds.

    - `label`: The fold, after its split if there are several.
    - `folder`: The folder of its first fit.
    - `count`: The number of rows held out.
    - `means`: Their mean log densities, by setting.
    - `seconds`: How long each fit took, None for one that has not finished.
    """

    label: str
    folder: str
    count: int
    means: Array
    seconds: Sequence[float | None]


def cv_page(
    asked: CrossValidation,
    splits: Sequence[Split],
    found: HeldOut,
    comparison: ModelComparison | str,
    done: Sequence[tuple[Fit, Entry]],
    waiting: int,
) -> bytes:
    """Return the page as UTF-8, to be written beside the folders."""
    rows = splits[0].rows
    folds = [
        (number + 1, fold, mean)
        for number, split in enumerate(splits)
        for fold, mean in found.fold_means(split, number, rows.whole).items()
    ]
    seconds = {(fit.split, fit.fold, fit.setting): entry.seconds for fit, entry in done}
    first = next(iter(asked.settings))
    made = None if isinstance(comparison, str) else comparison
    text = rendered(
        "orbiflow.density.cross_validation",
        "page.html",
        title=f"Cross-validation of {asked.data.name}",
        asked=asked,
        rows=rows,
        place=space_title(rows.space),
        groups=None if rows.labels is None else len(np.unique(rows.labels)),
        uniform=-math.log(rows.space.volume),
        made=made,
        why=comparison,
        waiting=waiting,
        fits=waiting + len(done),
        scores=_scores(found, made, folds),
        differences=_differences(found, made, folds),
        folds=[
            FoldRow(
                f"{split}.{fold}" if asked.cv.times > 1 else str(fold),
                Fit(split, fold, first, None).name,
                int((splits[split - 1].fold == fold).sum()),
                mean,
                [seconds.get((split, fold, name)) for name in asked.settings],
            )
            for split, fold, mean in folds[:MOST_LISTED]
        ],
        more=max(0, len(folds) - MOST_LISTED),
        heads=["fold", "rows", *found.settings, *(f"{name}, s" for name in asked.settings)],
        failed=[(fit, entry) for fit, entry in done if entry.state != "done"],
        signed=_signed,
    )
    return text.encode("utf-8", "replace")


def _signed(value: float, sign: str = "-") -> str:
    return f"{value:{sign}.4f}".replace("-", "\N{MINUS SIGN}")


def _scores(found: HeldOut, made: ModelComparison | None, folds: FoldMeans) -> str:
    """A picture of the mean log densities."""
    names = list(found.settings)
    known = {score.name: score for score in made.scores} if made else {}
    lines = [
        Strip(
            name,
            [float(mean[k]) for _, _, mean in folds],
            *((s.mean, s.mean - s.error, s.mean + s.error) if (s := known.get(name)) else ()),
        )
        for k, name in enumerate(names)
        if len(names) == 2 or name != UNIFORM
    ]
    return strips(lines, "mean log density of a fold, nats") if folds else ""


def _differences(found: HeldOut, made: ModelComparison | None, folds: FoldMeans) -> str:
    """A picture of the differences between settings."""
    names = list(found.settings)
    lines = [
        Strip(
            f"{d.first} − {d.second}",
            [float(mean[names.index(d.first)] - mean[names.index(d.second)]) for *_, mean in folds],
            d.mean,
            d.low,
            d.high,
        )
        for d in (made.differences if made else ())
        if len(names) == 2 or UNIFORM not in (d.first, d.second)  # far off, and in the table
    ]
    label = "difference of a fold, nats a row"
    return strips(lines, label, zero=True) if folds and lines else ""
