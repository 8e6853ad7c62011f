"""The reproduction of all exhibits: the work that they share, the drawing of each, and their page."""

import contextlib
import html
import itertools
import json
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from markupsafe import Markup

from orbiflow.drawing import rendered
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import one_blas_thread, one_thread, process_context, work, write_atomic
from reproduction import animal, classes, comparison, densities, spaces, symmetrization
from reproduction.drawing import Canvas, Picture
from reproduction.exhibit import Draw, Exhibit, Extent, Findings, Shown, Work

# all exhibits, in the order of the paper
EXHIBITS: tuple[Exhibit, ...] = (
    spaces.SQUARE,
    classes.TEMPLATES,
    classes.GROUPS_TABLE,
    spaces.SPACES_FIGURE,
    symmetrization.FIGURE,
    animal.METHOD,
    classes.TILINGS,
    symmetrization.TABLE,
    animal.EXHIBIT,
    animal.FREQUENCIES,
    comparison.TILES,
    comparison.TABLE,
    spaces.SYMMETRIZATION,
    densities.TABLE,
    densities.SIX_GAUSSIANS,
    densities.SURFACES,
    densities.CHECKERBOARD,
)

DRAWING_COST = 4.0  # about how many seconds a drawing takes, for the progress


class Outcome(NamedTuple):
    """The value of a call, or why there is none."""

    value: Any
    failure: str


_LOST = Outcome(None, "the process that worked on it died; was memory short?")


def reproduce(
    exhibits: Sequence[Exhibit],
    extent: Extent,
    folder: Path,
    *,
    workers: int = 1,
    progress: Callable[[float, str], None] = lambda _share, _what: None,
) -> list[Shown]:
    """Draw exhibits into an existing folder, and return what came of each, in their order.

    Work that several exhibits need is done once. An exhibit that fails is shown with the reason, and
    the others are drawn all the same. With one worker everything stays in this process. `progress` is
    called with the share of everything that is done, and with what was done last.
    """
    needs = [exhibit.needs(extent) for exhibit in exhibits]
    shared = dict.fromkeys(itertools.chain(*needs))
    jobs = sorted(shared, key=lambda one: -one.cost)
    total = sum(one.cost for one in jobs) + DRAWING_COST * len(exhibits)
    worked = 0.0

    def done(calls: Sequence[Work], what: Sequence[str]) -> list[Outcome]:
        nonlocal worked
        outcomes = [_LOST] * len(calls)
        for index, outcome in _outcomes(calls, workers):
            outcomes[index] = outcome
            worked += calls[index].cost
            progress(min(1.0, worked / total), what[index])
        return outcomes

    found = dict(zip(jobs, done(jobs, ["working"] * len(jobs)), strict=True))
    given = [[found[job] for job in needed] for needed in needs]
    drawings = [
        Work(_drawn, (Canvas(folder, one.name), one.draw, extent, values), DRAWING_COST)
        for one, values in zip(exhibits, given, strict=True)
    ]
    drawn = done(drawings, [f"drawn {one.label}" for one in exhibits])
    return [
        Shown(exhibit, failure=failure) if failure else Shown(exhibit, *value)
        for exhibit, (value, failure) in zip(exhibits, drawn, strict=True)
    ]


def _outcomes(calls: Sequence[Work], workers: int) -> Iterator[tuple[int, Outcome]]:
    """Yield indices and outcomes as they come; calls whose process dies have none."""
    if min(workers, len(calls)) <= 1:
        yield from ((index, _outcome(call)) for index, call in enumerate(calls))
        return
    context = process_context(("orbiflow.tiles.search.escherizing",))
    with contextlib.suppress(OrbiflowError):
        for news in work(_outcome, calls, workers, context=context):
            yield news.index, news.value


def _outcome(call: Work, *_unused: Any) -> Outcome:
    with one_thread(), one_blas_thread():
        try:
            return Outcome(call.function(*call.arguments), "")
        except OrbiflowError as error:
            return Outcome(None, str(error))
        except Exception as error:  # any error: the other exhibits go on, and this one shows it
            return Outcome(None, f"{type(error).__name__}: {error}")


def _drawn(
    canvas: Canvas, draw: Draw, extent: Extent, given: Sequence[Outcome]
) -> tuple[tuple[Picture, ...], Findings]:
    for outcome in given:
        if outcome.failure:
            raise OrbiflowError(outcome.failure)
    findings = draw(canvas, extent, [outcome.value for outcome in given])
    return tuple(canvas.pictures), findings


NUMBERS, INDEX = "paper.json", "index.html"
_OURS = re.compile(r"(figure|table)-[a-z0-9-]+\.(png|pdf|html)")
_INDEX = re.compile(r"\b([A-Z])_(\w+)")  # such as the c of R_c


def paper_page(shown: Sequence[Shown], extent: Extent, seconds: float) -> str:
    """Return the page of exhibits in the paper's order, which all together took `seconds`."""
    return rendered(
        "reproduction",
        "page.html",
        title="The paper, reproduced",
        dark=False,
        shown=shown,
        fast=extent.name == "fast",
        seconds=seconds,
        badges={"agrees": "yes", "agrees in part": "partly", "differs": "no", "": "failed"},
        words=lambda text: Markup(_INDEX.sub(r"\1<sub>\2</sub>", html.escape(text))),
    )


def write_page(shown: Sequence[Shown], extent: Extent, folder: Path, seconds: float) -> None:
    """Write `index.html` and `paper.json` beside the pictures."""
    write_atomic(folder / INDEX, paper_page(shown, extent, seconds))
    document = {
        "schema_version": 1,
        "extent": extent._asdict(),
        "seconds": round(seconds, 1),
        "exhibits": [_document(one) for one in shown],
    }
    write_atomic(folder / NUMBERS, json.dumps(document, allow_nan=False, indent=1))


def _document(one: Shown) -> dict[str, Any]:
    files = ((picture.file, *dict(picture.others).values()) for picture in one.pictures)
    return {
        "name": one.exhibit.name,
        "label": one.exhibit.label,
        "verdict": one.findings and one.findings.verdict,
        "failure": one.failure or None,
        "files": list(itertools.chain(*files)),
        "numbers": dict(one.findings.numbers) if one.findings else {},
    }


def written_files(folder: Path) -> set[str]:
    """Return the names of the files that an earlier run wrote into a folder, by its `paper.json`."""
    try:
        document = json.loads((folder / NUMBERS).read_text(encoding="utf-8"))
        ours = isinstance(document["schema_version"], int)
        files = {str(file) for entry in document["exhibits"] for file in entry["files"]}
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return set()
    return {NUMBERS, INDEX, *filter(_OURS.fullmatch, files)} if ours else set()
