"""The page of a cross-validation: the verdict, the folds' figures drawn and in a table."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import quote

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density import (
    Difference,
    ModelComparison,
    space_title,
)
from orbiflow.drawing import (
    CLOSING,
    css,
    opening,
)
from orbiflow.jobs.batch.journal import Entry
from orbiflow.jobs.density_cv.plot import Strip, strips
from orbiflow.jobs.density_cv.results import HeldOut
from orbiflow.jobs.density_cv.splits import Fit, Split
from orbiflow.jobs.density_cv_requests import UNIFORM, DensityCvRequest

HERE = "orbiflow.jobs.density_cv"

MOST_LISTED = 200
"""Folds of the table on the page; all are in cv.csv."""


@dataclass(frozen=True, eq=False)
class PageOf:
    """What is on it.

    - `comparison`: or why there is none. `entries`: of the fits that are done with.
    - `waiting`: fits that are still to be done.
    """

    request: DensityCvRequest
    splits: Sequence[Split]
    found: HeldOut
    comparison: ModelComparison | str
    entries: Sequence[tuple[Fit, Entry]]
    waiting: int

    def folds(self) -> list[tuple[int, int, Array]]:
        """Split and fold, from 1, and means (S,) of those that every setting has scored."""
        whole = self.splits[0].rows.whole
        return [
            (number + 1, fold, mean)
            for number, split in enumerate(self.splits)
            for fold, mean in self.found.fold_means(split, number, whole).items()
        ]


def cv_page(of: PageOf) -> bytes:
    """As UTF-8, to be written beside the folders."""
    folds = of.folds()
    parts = [
        opening(f"Cross-validation of {of.request.data.name}", css(HERE, "page.css")),
        _head(of),
        "<main>\n",
        _verdict(of),
        _pictures(of, folds),
        _folds(of, folds),
        _failures(of),
        f"</main>\n{CLOSING}",
    ]
    return "".join(parts).encode("utf-8", "replace")


def _head(of: PageOf) -> str:
    rows, request = of.splits[0].rows, of.request
    count = f"{len(rows.table.values)} rows"
    if rows.labels is not None:
        count += f" in {len(np.unique(rows.labels))} groups by {request.group}, each on one side"
    times = f", {request.times} times" if request.times > 1 else ""
    columns = ", ".join(rows.table.columns)
    if rows.space.unit is not None:
        columns += f" in {rows.space.unit},"
    waiting = (
        f'<p class="waiting">{of.waiting} of {of.waiting + len(of.entries)} fits still to do</p>\n'
        if of.waiting
        else ""
    )
    return f"""<header>
<h1>Cross-validation of {html.escape(request.data.name)}</h1>
<p>{html.escape(columns)} on the {space_title(rows.space)}: {html.escape(count)};
{request.folds} folds{times}. Each row is scored by fits that have not seen it. In numbers:
<a href="cv.csv">a line a fold</a>, <a href="rows.csv">a line a row</a>,
<a href="report.json">the comparison</a>.</p>
{waiting}</header>
"""


def _verdict(of: PageOf) -> str:
    found = of.comparison
    if isinstance(found, str):
        return _note(f"No comparison yet: {found}.")
    uniform = -math.log(of.splits[0].rows.space.volume)
    rows = "".join(
        _row(s.name, [_signed(s.mean), f"{s.error:.4f}", _signed(s.mean - uniform, "+")])
        for s in found.scores
    )
    differences = "".join(map(_difference, found.differences))
    notes = "".join(map(_note, found.notes))
    unit = "rows" if found.groups is None else "groups"
    return f"""<p class="verdict">{html.escape(found.verdict)}.</p>
{notes}{_note(f"Mean log density of rows held out, in nats, and its standard error over {unit}:")}
{_table(["", "held out", "±", "above uniform"], rows)}
{_note(f"Differences row by row, with intervals that hold all at once at {100 * found.level:g} %:")}
{_table(["", "nats a row", "±", "from", "to", "better"], differences)}"""


def _difference(one: Difference) -> str:
    cells = [f"{_signed(one.mean, '+')}", f"{one.error:.4f}"]
    cells += [_signed(one.low, "+"), _signed(one.high, "+"), one.better or "cannot tell"]
    return _row(f"{one.first} − {one.second}", cells)


def _note(text: str) -> str:
    return f'<p class="note">{html.escape(text)}</p>\n'


def _table(heads: Sequence[str], rows: str) -> str:
    cells = "".join(f'<th scope="col">{html.escape(head)}</th>' for head in heads)
    return (
        f'<div class="scroll" tabindex="0"><table>\n<thead><tr>{cells}</tr></thead>\n<tbody>\n'
        f"{rows}</tbody></table></div>\n"
    )


def _row(name: str, cells: Sequence[str], link: str = "") -> str:
    head = html.escape(name)
    if link:
        head = f'<a href="{html.escape(link)}">{head}</a>'
    body = "".join(f"<td>{html.escape(cell)}</td>" for cell in cells)
    return f'<tr><th scope="row">{head}</th>{body}</tr>\n'


def _signed(value: float, sign: str = "-") -> str:
    return f"{value:{sign}.4f}".replace("-", "\N{MINUS SIGN}")


def _pictures(of: PageOf, folds: Sequence[tuple[int, int, Array]]) -> str:
    if not folds:
        return ""
    names = list(of.found.settings)
    found = None if isinstance(of.comparison, str) else of.comparison
    known = {} if found is None else {s.name: s for s in found.scores}
    scores = [
        Strip(
            name,
            [float(mean[k]) for _, _, mean in folds],
            *((s.mean, s.mean - s.error, s.mean + s.error) if (s := known.get(name)) else ()),
        )
        for k, name in enumerate(names)
        if len(names) == 2 or name != UNIFORM
    ]
    text = "A dot a fold, a line the mean of all rows with one standard error to either side."
    parts = [_figure(strips(scores, "mean log density of a fold, nats"), text)]
    differences = [
        Strip(
            f"{d.first} − {d.second}",
            [float(mean[names.index(d.first)] - mean[names.index(d.second)]) for *_, mean in folds],
            d.mean,
            d.low,
            d.high,
        )
        for d in (found.differences if found else ())
        if len(names) == 2 or UNIFORM not in (d.first, d.second)  # far off, and in the table
    ]
    if differences:
        text = "The same of differences at equal rows, with the intervals of the table above."
        picture = strips(differences, "difference of a fold, nats a row", zero=True)
        parts.append(_figure(picture, text))
    return "".join(parts)


def _figure(picture: str, caption: str) -> str:
    return f"<figure>\n{picture}<figcaption>{html.escape(caption)}</figcaption></figure>\n"


def _folds(of: PageOf, folds: Sequence[tuple[int, int, Array]]) -> str:
    if not folds:
        return ""
    seconds = {(f.split, f.fold, f.setting): entry.seconds for f, entry in of.entries}
    names = of.found.settings
    fitted = [name for name in names if name in of.request.settings()]
    rows: list[str] = []
    for split, fold, mean in folds[:MOST_LISTED]:
        count = int((of.splits[split - 1].fold == fold).sum())
        cells = [str(count), *(_signed(float(value)) for value in mean)]
        taken = [seconds.get((split, fold, name)) for name in fitted]
        cells += ["" if one is None else f"{one:.1f}" for one in taken]
        label = f"{split}.{fold}" if of.request.times > 1 else str(fold)
        link = quote(Fit(split, fold, fitted[0], None).name)
        rows.append(_row(label, cells, f"{link}/report.json"))
    more = f"; {len(folds) - MOST_LISTED} more in cv.csv" if len(folds) > MOST_LISTED else ""
    heads = ["fold", "rows", *names, *(f"{name}, s" for name in fitted)]
    return f"""<h2>Folds</h2>
{_note(f"Mean log density of the rows held out, and seconds of each fit{more}.")}
{_table(heads, "".join(rows))}"""


def _failures(of: PageOf) -> str:
    failed = [(fit, entry) for fit, entry in of.entries if entry.state != "done"]
    if not failed:
        return ""
    lines = "".join(
        f"<li><b>{html.escape(fit.key)}</b> {html.escape(entry.reason)}</li>\n"
        for fit, entry in failed
    )
    return f'<h2>Without a result</h2>\n<ul class="failed">\n{lines}</ul>\n'
