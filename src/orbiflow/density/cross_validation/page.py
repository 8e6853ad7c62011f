"""The page of a cross-validation: the verdict, the folds' figures drawn and in a table."""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

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


WIDTH, NAMES, MARGIN, STEP = 720, 300, 24, 34
"""Pixels: of the picture, of names at its left at most, of the free right margin, of a strip."""

LETTER = 7.6
"""Largest width of a letter of a name, in pixels."""

Placed = Callable[[float], float]
"""Returns the place of a figure, in pixels from the left."""


@dataclass(frozen=True)
class Strip:
    """A strip of the picture.

    - `dots`: The figures of the folds.
    - `mean`, `low`, `high`: The mean of all rows, with an interval.
    """

    name: str
    dots: Sequence[float]
    mean: float | None = None
    low: float | None = None
    high: float | None = None


def strips(lines: Sequence[Strip], label: str, *, zero: bool = False) -> str:
    """Return the picture, "" if there is nothing to draw."""
    values = [v for one in lines for v in (*one.dots, one.mean, one.low, one.high) if v is not None]
    values = [v for v in values if math.isfinite(v)] + ([0.0] if zero else [])
    if not values:
        return ""
    ticks = _ticks(min(values), max(values))
    low, high = min(ticks[0], *values), max(ticks[-1], *values)

    names = min(NAMES, 30 + LETTER * max(len(one.name) for one in lines))

    def place(value: float) -> float:
        return names + (WIDTH - names - MARGIN) * (value - low) / (high - low)

    foot = STEP * len(lines) + 8
    parts = [
        f'<line class="grid" x1="{place(t):.1f}" x2="{place(t):.1f}" y1="4" y2="{foot}"/>'
        f'<text class="tick" x="{place(t):.1f}" y="{foot + 17}">{_number(t, ticks)}</text>'
        for t in ticks
    ]
    if zero:
        parts.append(
            f'<line class="zero" x1="{place(0):.1f}" x2="{place(0):.1f}" y1="4" y2="{foot}"/>'
        )
    parts += [_strip(one, names, 4 + STEP * (k + 0.5), place) for k, one in enumerate(lines)]
    middle = (names + WIDTH - MARGIN) / 2
    parts.append(f'<text class="tick" x="{middle:.0f}" y="{foot + 38}">{html.escape(label)}</text>')
    said = html.escape(f"{label}: {', '.join(one.name for one in lines)}")
    return (
        f'<svg viewBox="0 0 {WIDTH} {foot + 46}" role="img" aria-label="{said}">\n'
        + "\n".join(parts)
        + "\n</svg>\n"
    )


def _strip(one: Strip, names: float, y: float, place: Placed) -> str:
    room = int((names - 20) / LETTER)
    name = one.name if len(one.name) <= room else one.name[: room - 1] + "…"
    parts = [f'<text class="name" x="{names - 14:.1f}" y="{y + 5:.1f}">{html.escape(name)}</text>']
    if one.low is not None and one.high is not None:
        parts.append(
            f'<line class="interval" x1="{place(one.low):.1f}" x2="{place(one.high):.1f}" '
            f'y1="{y:.1f}" y2="{y:.1f}"/>'
        )
    parts += [
        f'<circle class="dot" cx="{place(dot):.1f}" cy="{y:.1f}" r="4"/>'
        for dot in one.dots
        if math.isfinite(dot)
    ]
    if one.mean is not None:
        parts.append(
            f'<line class="mean" x1="{place(one.mean):.1f}" x2="{place(one.mean):.1f}" '
            f'y1="{y - 11:.1f}" y2="{y + 11:.1f}"/>'
        )
    return "".join(parts)


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


def _number(value: float, ticks: Sequence[float]) -> str:
    """A tick in as many decimals as tell the ticks apart."""
    digits = max(0, -math.floor(math.log10(ticks[1] - ticks[0]) + 1e-9))
    return f"{value:.{digits}f}".replace("-", "\N{MINUS SIGN}")
