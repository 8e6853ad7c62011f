"""`index.html` of a reproduction: what the paper states beside what we draw and measure.

One page without scripts that refers to nothing but files beside it.
"""

from __future__ import annotations

import html
import re
from collections.abc import Sequence

from orbiflow.drawing import (
    CLOSING,
    css,
    opening,
)
from reproduction.canvas import Picture
from reproduction.exhibit import (
    Findings,
    Shown,
    Table,
)
from reproduction.extent import Extent

TITLE = "Flow Symmetrization for Parameterized Constrained Diffeomorphisms"
AUTHORS = "Aalok Gangopadhyay, Dwip Dalal, Progyan Das and Shanmuganathan Raman"

_CLASSES = {"agrees": "yes", "agrees in part": "partly", "differs": "no", "": "failed"}


def paper_page(shown: Sequence[Shown], extent: Extent, seconds: float) -> str:
    """The page, to be written beside the pictures.

    Args:
        shown: the exhibits, in the paper's order.
        extent: what they were made with.
        seconds: that all took.
    """
    begin = opening("The paper, reproduced", css("reproduction", "page.css"), dark=False)
    parts = [
        f"""{begin}{_head(extent, seconds)}
{_overview(shown)}
<main>
""",
        *(_article(one) for one in shown),
        f"</main>\n{CLOSING}",
    ]
    return "".join(parts)


def _head(extent: Extent, seconds: float) -> str:
    command = "python -m reproduction --fast" if extent.name == "fast" else "python -m reproduction"
    preview = (
        "<p><strong>This is the preview of a minute:</strong> every exhibit, with less work in "
        "each, so its figures are weaker than those of <code>python -m reproduction</code>.</p>\n"
        if extent.name == "fast"
        else ""
    )
    return f"""<header>
<p class="kicker">The paper, reproduced</p>
<h1>{TITLE}</h1>
<p>by {AUTHORS}. Every figure and table, drawn anew by
<code>{command}</code> in {seconds:.0f} s, beside what the paper states. A badge says whether the two
agree; where they do not, we say why. Every picture is also there as PDF, and all numbers are in
<a href="paper.json">paper.json</a>.</p>
{preview}</header>"""


def _overview(shown: Sequence[Shown]) -> str:
    rows = "".join(
        f'<li><a href="#{one.exhibit.name}"><b>{html.escape(one.exhibit.label)}</b> '
        f"{html.escape(one.exhibit.title)}</a> {_badge(one)}</li>\n"
        for one in shown
    )
    return f'<nav aria-label="Exhibits">\n<ol>\n{rows}</ol>\n</nav>'


def _verdict(one: Shown) -> str:
    return "" if one.findings is None else one.findings.verdict


def _badge(one: Shown) -> str:
    verdict = _verdict(one)
    return f'<span class="badge {_CLASSES[verdict]}">{verdict or "failed"}</span>'


def _article(one: Shown) -> str:
    exhibit = one.exhibit
    label = html.escape(exhibit.label)
    return f"""<article id="{exhibit.name}">
<h2><span>{label}</span> {html.escape(exhibit.title)} {_badge(one)}</h2>
<div class="beside">
<section class="paper"><h3>The paper</h3>
{_paragraphs(exhibit.states)}</section>
<section class="ours"><h3>Here</h3>
{_ours(one)}</section>
</div>
{"".join(map(_picture, one.pictures))}{_tables(one.findings)}</article>
"""


def _ours(one: Shown) -> str:
    if one.findings is None:
        return f'<p class="refused">Not drawn: {html.escape(one.failure)}</p>\n'
    why = one.findings.why
    reasons = f'<div class="why"><h3>Why it differs</h3>\n{_paragraphs(why)}</div>\n' if why else ""
    return _paragraphs(one.findings.found) + reasons


def _words(text: str) -> str:
    """Text as HTML, R_c with its index below."""
    return re.sub(r"\b([A-Z])_(\w+)", r"\1<sub>\2</sub>", html.escape(text))


def _paragraphs(text: str) -> str:
    return "".join(f"<p>{_words(part)}</p>\n" for part in text.split("\n\n"))


def _picture(picture: Picture) -> str:
    links = ", ".join(
        f'<a href="{html.escape(f)}">{html.escape(name)}</a>' for name, f in picture.others
    )
    caption = _words(picture.caption)
    return (
        f'<figure><a href="{picture.file}"><img src="{picture.file}" alt="{html.escape(picture.alt)}" '
        f'width="{picture.width}" height="{picture.height}" loading="lazy"></a>'
        f"<figcaption>{caption} <small>{links}</small></figcaption></figure>\n"
    )


def _tables(findings: Findings | None) -> str:
    return "" if findings is None else "".join(map(_table, findings.tables))


def _table(table: Table) -> str:
    head = "".join(f'<th scope="col">{_words(text)}</th>' for text in table.headings)
    rows = "".join(
        f'<tr><th scope="row">{_words(row[0])}</th>'
        + "".join(f"<td>{_words(cell)}</td>" for cell in row[1:])
        + "</tr>\n"
        for row in table.rows
    )
    return (
        f'<div class="scroll" tabindex="0"><table>\n<caption>{_words(table.caption)}</caption>\n'
        f"<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}</tbody></table></div>\n"
    )
