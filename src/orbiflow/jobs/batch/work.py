"""Going through a folder: what is to be done, who does it, where it goes."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orbiflow import __version__
from orbiflow.cancel import Cancel
from orbiflow.errors import OrbiflowError
from orbiflow.jobs.batch.folder import RESERVED, BatchFolder
from orbiflow.jobs.batch.inputs import code_of, content, folder_names, listed
from orbiflow.jobs.batch.journal import Entry
from orbiflow.jobs.batch.kinds import DENSITIES, TILES, Kind
from orbiflow.jobs.batch_requests import (
    BatchRequest,
    DensityBatchRequest,
    ManyRequest,
    settings_of,
)
from orbiflow.jobs.events import Failed, Finished, ItemDone, Note, Progress
from orbiflow.jobs.executors import Answer, DaskCluster, Executor, LocalProcesses, Parcel
from orbiflow.jobs.run import Sink

MOST_NAMED = 5
"""Files that a note names."""


def batch(request: BatchRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Tiles for every silhouette; see `_many`."""
    return _many(request, TILES, f"Tiles of {request.folder.name or 'a folder'}", tell, cancel)


def density_batch(request: DensityBatchRequest, tell: Sink, cancel: Cancel) -> Finished:
    """A density for every table; see `_many`."""
    title = f"Densities of {request.folder.name or 'a folder'}"
    return _many(request, DENSITIES, title, tell, cancel)


@dataclass(frozen=True)
class _Waiting:
    """A file that is to be dealt with."""

    file: str
    name: str
    settings: dict[str, Any]


def _many(request: ManyRequest, kind: Kind, title: str, tell: Sink, cancel: Cancel) -> Finished:
    """Do what has not been done, and put it into the folder as it comes.

    Returns:
        `summary`: `folder`, `table` and `page`; `files`, and how many of them are `done`, gave
        `nothing`, have `failed` or are `left`; how many were `kept` from before; `seconds`.

    Raises:
        OrbiflowError: for anything that the user can mend; what was finished is kept.
    """
    begin = time.perf_counter()
    files = listed(request.folder, kind.endings, request.match, request.out)
    with BatchFolder(request.out, kind, title) as folder:
        folder.files = files
        given = {file: entry.name for file, entry in folder.journal.entries.items()}
        names = folder_names(files, given, RESERVED)
        todo = list(_todo(request, kind, files, names, folder))
        kept = len(files) - len(todo)
        for text in _said_before(files, todo, folder, request):
            tell(Note(text))
        teller = _Teller(tell, len(files), kept)
        if todo and not cancel.cancelled:
            _work(request, kind, todo, folder, teller, cancel)
    entries = folder.journal.entries
    left = [one.file for one in todo if one.file not in teller.finished]
    states = Counter(entries[file].state for file in files if file not in set(left))
    summary = {
        "folder": str(request.out),
        "table": str(request.out / "batch.csv"),
        "page": str(request.out / "index.html"),
        "files": len(files),
        "done": states["done"],
        "nothing": states["nothing found"],
        "failed": states["failed"],
        "left": len(left),
        "kept": kept,
        "seconds": time.perf_counter() - begin,
    }
    if left:
        return Finished("cancelled", summary)
    return Finished("done" if states["done"] else "nothing found", summary)


def _todo(
    request: ManyRequest, kind: Kind, files: list[str], names: dict[str, str], folder: BatchFolder
) -> Iterator[_Waiting]:
    """What is new or changed, was asked for otherwise, or has lost its result."""
    for file in files:
        settings = _settings(request, kind, file)
        before = folder.journal.entries.get(file)
        if before is not None and not (request.retry_failed and before.state != "done"):
            try:
                code = code_of(content(request.folder / file, kind.most_bytes))
            except OrbiflowError:
                code = ""
            there = before.state == "failed" or folder.has(before.name)
            if there and before.same_work(code, settings, __version__):
                continue
        yield _Waiting(file, names[file], settings)


def _settings(request: ManyRequest, kind: Kind, file: str) -> dict[str, Any]:
    """What decides a result besides the file's bytes and its name."""
    own = (kind.reads, kind.writes, "workers", "called")
    return settings_of(request.one(file), own)


def _said_before(
    files: list[str], todo: list[_Waiting], folder: BatchFolder, request: ManyRequest
) -> Iterator[str]:
    entries = folder.journal.entries
    waiting = {one.file for one in todo}
    states = Counter(entries[file].state for file in files if file not in waiting)
    if states:
        failed = states["failed"] + states["nothing found"]
        text = f"{len(files)} files: {states['done']} are done already"
        if failed:
            text += f", {failed} have failed before (--retry-failed does them again)"
        yield f"{text}, {len(todo)} to do"
    gone = sorted(entry.name for file, entry in entries.items() if file not in set(files))
    if gone:
        named = ", ".join(gone[:MOST_NAMED]) + (", ..." if len(gone) > MOST_NAMED else "")
        out = f" or that --match {request.match} leaves out" if request.match else ""
        yield (
            f"{len(gone)} earlier results are of files that are not in {request.folder}{out}; they "
            f"are kept and not listed: {named}"
        )


def _work(
    request: ManyRequest,
    kind: Kind,
    todo: list[_Waiting],
    folder: BatchFolder,
    teller: _Teller,
    cancel: Cancel,
) -> None:
    codes: dict[str, tuple[_Waiting, str]] = {}

    def unreadable(one: _Waiting, reason: str) -> None:
        entry = Entry(one.file, one.name, "", one.settings, __version__, "failed", reason)
        folder.keep(entry, {}, None)
        teller.item(entry, kind)

    def parcels() -> Iterator[Parcel]:
        for one in todo:
            try:
                data = content(request.folder / one.file, kind.most_bytes)
            except OrbiflowError as error:
                unreadable(one, str(error))
                continue
            codes[one.file] = one, code_of(data)
            asked, name = request.one(one.file), Path(one.file).name
            yield Parcel(one.file, asked, kind.reads, kind.writes, name, data)

    executor = _executor(request, kind, len(todo))
    with executor:
        teller.tell(Note(f"{len(todo)} {kind.things} for {executor.place}"))
        with closing(executor.answers(parcels(), teller.tell, cancel)) as answers:
            for answer in answers:
                one, code = codes.pop(answer.key)
                entry = _entry(answer, one, code, kind)
                if entry is None:
                    continue
                picture = None
                if isinstance(answer.end, Finished):
                    picture = kind.picture(answer.end.summary)
                folder.keep(entry, answer.files if entry.state != "failed" else {}, picture)
                teller.item(entry, kind)


def _executor(request: ManyRequest, kind: Kind, count: int) -> Executor:
    if request.scheduler is not None:
        return DaskCluster(request.scheduler)
    executor = LocalProcesses(request.workers, kind.modules)
    return LocalProcesses(min(executor.workers, count), kind.modules)


def _entry(answer: Answer, one: _Waiting, code: str, kind: Kind) -> Entry | None:
    """Nothing of what was interrupted."""
    end = answer.end
    known = (one.file, one.name, code, one.settings, __version__)
    if isinstance(end, Failed):
        return Entry(*known, "failed", end.message)
    if end.state == "cancelled":
        return None
    seconds = end.summary.get("seconds")
    if end.state == "nothing found":
        failed = end.summary.get("failed") or ()
        reasons = Counter(str(failure["reason"]) for failure in failed).most_common(1)
        reason = reasons[0][0] if reasons else "nothing was found"
        return Entry(*known, "nothing found", reason, {}, seconds)
    return Entry(*known, "done", "", kind.best(end.summary), seconds)


class _Teller:
    """Says what is done as it is done."""

    def __init__(self, tell: Sink, count: int, kept: int) -> None:
        self.tell, self.count, self.kept = tell, count, kept
        self.finished: set[str] = set()
        self.without = 0
        self._progress()

    def item(self, entry: Entry, kind: Kind) -> None:
        self.finished.add(entry.file)
        self.without += entry.state != "done"
        words = [
            column.shown(entry.best[column.name])
            if not column.form
            else f"{column.title} {column.shown(entry.best[column.name])}"
            for column in kind.columns
            if entry.best.get(column.name) is not None
            and not isinstance(entry.best[column.name], bool)
        ]
        if entry.seconds is not None:
            words.append(f"{entry.seconds:.1f} s")
        self.tell(ItemDone(entry.name, entry.state, entry.reason or ", ".join(words)))
        self._progress()

    def _progress(self) -> None:
        finished = self.kept + len(self.finished)
        what = f"{finished} of {self.count}"
        if self.without:
            what += f", {self.without} without a result"
        self.tell(Progress(finished / self.count, what))
