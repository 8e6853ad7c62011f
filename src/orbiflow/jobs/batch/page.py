"""The contact sheet of a batch: `index.html`, a card for each file, to be sorted and searched.

One page that refers to nothing but files beside it. Pictures are fetched and cards are laid out only
where they are looked at, so thousands are no burden; without scripts it is in the order of the names.
"""

from __future__ import annotations

import html
from collections.abc import Sequence
from urllib.parse import quote

from orbiflow.drawing import (
    CLOSING,
    css,
    opening,
)
from orbiflow.jobs.batch.journal import Entry
from orbiflow.jobs.batch.kind import Column, Kind

HERE = "orbiflow.jobs.batch"


def page(
    entries: Sequence[Entry], kind: Kind, title: str, waiting: int, pictures: frozenset[str]
) -> bytes:
    """The page, to be written beside the folders.

    Args:
        entries: in their order.
        kind: of the batch.
        title: in plain text.
        waiting: files that are still to be done.
        pictures: names of the results that `thumbnails/NAME.png` shows.
    """
    done = [entry for entry in entries if entry.state == "done"]
    other = [entry for entry in entries if entry.state != "done"]
    parts = [_head(title, len(done), len(other), waiting, kind), '<ul class="cards" id="cards">\n']
    parts += [_card(entry, kind, entry.name in pictures) for entry in done]
    parts.append("</ul>\n")
    if other:
        parts.append('<h2 id="without">Without a result</h2>\n<ul class="failed">\n')
        parts += [_failure(entry) for entry in other]
        parts.append("</ul>\n")
    parts.append(f"</main>\n<script>\n{css(HERE, 'page.js')}</script>\n{CLOSING}")
    return "".join(parts).encode("utf-8", "replace")


def _head(title: str, done: int, other: int, waiting: int, kind: Kind) -> str:
    said = f"{done} {kind.things} done" + (f", {waiting} still to do" if waiting else "")
    if other:
        said += f', <a href="#without">{other} without a result</a>'
    options = "".join(
        f'<option value="{column.name}">{html.escape(column.title)}</option>'
        for column in kind.columns
        if column.form
    )
    return f"""{opening(title, css(HERE, "page.css"))}<header>
<h1>{html.escape(title)}</h1>
<p>{said}. Everything in numbers: <a href="batch.csv">batch.csv</a>.</p>
<form id="tools" hidden>
<label>Sorted by <select id="by"><option value="name">name</option>{options}\
<option value="seconds">seconds</option></select></label>
<label>Names with <input id="find" type="search" size="14"></label>
<output id="count"></output>
</form>
</header>
<main>
"""


def _card(entry: Entry, kind: Kind, picture: bool) -> str:
    name, link = html.escape(entry.file), quote(entry.name, errors="replace")
    values = [
        f' data-{column.name.replace("_", "-")}="{_rank(column, entry)}"'
        for column in kind.columns
        if column.form
    ]
    seconds = "" if entry.seconds is None else f"{entry.seconds:.3f}"
    image = (
        f'<img src="thumbnails/{link}.png" width="240" height="160" loading="lazy" '
        f'decoding="async" alt="{kind.shows} of {name}">'
        if picture
        else ""
    )
    inside = kind.opens if picture else ""
    # the first is text, said beside the name
    texts = [
        html.escape(column.shown(entry.best.get(column.name)))
        for column in kind.columns
        if not column.form and not isinstance(entry.best.get(column.name), bool)
    ]
    warning = "" if entry.best.get("certified", True) else ' <b class="refused">not certified</b>'
    figures = "".join(
        f"<div><dt>{html.escape(column.title)}</dt>"
        f"<dd>{html.escape(column.shown(entry.best.get(column.name)))}</dd></div>"
        for column in kind.columns
        if column.form
    )
    return (
        f'<li data-name="{name}" data-seconds="{seconds}"{"".join(values)}>'
        f'<a href="{link}/{inside}">{image}<span>{name}</span></a> '
        f"<i>{' '.join(texts)}</i>{warning}<dl>{figures}</dl></li>\n"
    )


def _rank(column: Column, entry: Entry) -> str:
    """What cards are sorted by: the smallest first."""
    value = entry.best.get(column.name)
    if not isinstance(value, int | float):
        return ""
    return f"{-value if column.falling else value:.9g}"


def _failure(entry: Entry) -> str:
    reason = html.escape(entry.reason or "nothing was found")
    return f"<li><b>{html.escape(entry.file)}</b> {reason}</li>\n"
