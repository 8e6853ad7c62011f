"""The paper, reproduced: the job of a `PaperRequest`."""

from __future__ import annotations

import os
import time

from orbiflow.cancel import Cancel
from orbiflow.folders import ResultFolder
from orbiflow.jobs.events import Finished, Note, Progress, Written
from orbiflow.jobs.records import RecordError
from orbiflow.jobs.run import Sink
from orbiflow.jobs.tile_requests import PaperRequest
from orbiflow.paper import EXHIBITS, FAST, FULL, Exhibit, reproduce, write_page, written_files


def paper(request: PaperRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Do all exhibits, and write the folder whole.

    Returns:
        `summary`: `folder`, `seconds`, the names of the `exhibits` and of those that `failed`.

    Raises:
        OrbiflowError: for anything that the user can mend.
        Cancelled: if it was told to stop; nothing is written.
    """
    begin = time.perf_counter()
    chosen = _chosen(request.only)
    folder = ResultFolder(request.out, written_files)
    extent = FAST if request.fast else FULL

    def progress(share: float, what: str) -> None:
        tell(Progress(share, what))

    tell(Progress(0.0, "working"))
    with folder.replaced() as staged:
        shown = reproduce(
            chosen,
            extent,
            staged,
            workers=request.workers or os.cpu_count() or 1,
            progress=progress,
            cancel=cancel,
        )
        seconds = time.perf_counter() - begin
        write_page(shown, extent, staged, seconds)
        written = sorted(path.name for path in staged.iterdir())
    for name in written:
        tell(Written(request.out / name))
    failed = [one.exhibit.name for one in shown if one.findings is None]
    for one in shown:
        if one.findings is None:
            tell(Note(f"{one.exhibit.label} failed: {one.failure}"))
    tell(Note(f"written to {request.out} in {seconds:.0f} s; open {request.out / 'index.html'}"))
    summary = {
        "folder": str(request.out),
        "seconds": seconds,
        "exhibits": [one.exhibit.name for one in shown],
        "failed": failed,
    }
    return Finished("done", summary)


def _chosen(only: tuple[str, ...] | None) -> list[Exhibit]:
    if only is None:
        return list(EXHIBITS)
    by_name = {exhibit.name: exhibit for exhibit in EXHIBITS}
    names = {name.strip().lower().replace(" ", "-") for name in only}
    if unknown := sorted(names - set(by_name)):
        raise RecordError(
            f"{{only}}: no {unknown[0]!r} in the paper; there are {', '.join(by_name)}"
        )
    return [exhibit for name, exhibit in by_name.items() if name in names]
