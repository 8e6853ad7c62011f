"""The page of a cross-validation: the verdict, the folds' figures drawn and in a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from orbiflow.arrays import Array
from orbiflow.batch import Entry
from orbiflow.density.comparing import ModelComparison
from orbiflow.density.cross_validation.operations import UNIFORM, CrossValidation
from orbiflow.density.cross_validation.splits import Fit, HeldOut, Split
from orbiflow.density.pictures import space_title
from orbiflow.drawing import rendered

MOST_LISTED = 200
"""Folds of the table on the page; all are in cv.csv."""

FoldMeans = Sequence[tuple[int, int, Array]]
"""Split and fold, from 1, and the means (S,) of the rows that every setting has scored."""


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
    folds = found.fold_means(splits)
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
            {
                "label": f"{split}.{fold}" if asked.cv.times > 1 else str(fold),
                "folder": Fit(split, fold, first, None).name,
                "count": int((splits[split - 1].fold == fold).sum()),
                "means": mean,
                "seconds": [seconds.get((split, fold, name)) for name in asked.settings],
            }
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


def _scores(
    found: HeldOut, made: ModelComparison | None, folds: FoldMeans
) -> dict[str, Any] | None:
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
    return strips(lines, "mean log density of a fold, nats") if folds else None


def _differences(
    found: HeldOut, made: ModelComparison | None, folds: FoldMeans
) -> dict[str, Any] | None:
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
    return strips(lines, label, zero=True) if folds and lines else None


WIDTH, NAMES, MARGIN, STEP = 720, 300, 24, 34
"""Pixels: of the picture, of names at its left at most, of the free right margin, of a strip."""

LETTER = 7.6
"""Largest width of a letter of a name, in pixels."""


@dataclass(frozen=True)
class Strip:
    """A strip of the picture: dots for the folds, the mean of all rows and its interval."""

    name: str
    dots: Sequence[float]
    mean: float | None = None
    low: float | None = None
    high: float | None = None


def strips(lines: Sequence[Strip], label: str, *, zero: bool = False) -> dict[str, Any] | None:
    """Return what the template draws and where, in pixels; None if there is nothing to draw."""
    values = [v for one in lines for v in (*one.dots, one.mean, one.low, one.high) if v is not None]
    values = [v for v in values if math.isfinite(v)] + ([0.0] if zero else [])
    if not values:
        return None
    ticks = _ticks(min(values), max(values))
    low, high = min(ticks[0], *values), max(ticks[-1], *values)
    names = min(NAMES, 30 + LETTER * max(len(one.name) for one in lines))
    room = int((names - 20) / LETTER)
    decimals = max(0, -math.floor(math.log10(ticks[1] - ticks[0]) + 1e-9))

    def place(value: float | None) -> float | None:
        if value is None:
            return None
        return names + (WIDTH - names - MARGIN) * (value - low) / (high - low)

    return {
        "width": WIDTH,
        "names": names,
        "middle": (names + WIDTH - MARGIN) / 2,
        "foot": STEP * len(lines) + 8,
        "label": label,
        "said": f"{label}: {', '.join(one.name for one in lines)}",
        "ticks": [(place(t), f"{t:.{decimals}f}".replace("-", "\N{MINUS SIGN}")) for t in ticks],
        "zero": place(0.0) if zero else None,
        "strips": [
            {
                "name": one.name if len(one.name) <= room else one.name[: room - 1] + "…",
                "y": 4 + STEP * (k + 0.5),
                "dots": [place(dot) for dot in one.dots if math.isfinite(dot)],
                "mean": place(one.mean),
                "low": place(one.low),
                "high": place(one.high),
            }
            for k, one in enumerate(lines)
        ],
    }


def _ticks(low: float, high: float) -> list[float]:
    """Return four to eight round numbers that span both.

    >>> _ticks(-9.44, -9.21)
    [-9.45, -9.4, -9.35, -9.3, -9.25, -9.2]
    """
    span = high - low if high > low else max(abs(high), 1.0) * 1e-3
    power = 10.0 ** math.floor(math.log10(span / 4))
    step = next(m * power for m in (1, 2, 5, 10) if span / (m * power) <= 6)
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return [round(k * step, 12) for k in range(first, max(last, first + 1) + 1)]
