"""Going through many items: what is to be done, who does it, where it goes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any, Protocol

from orbiflow import __version__
from orbiflow.errors import OrbiflowError
from orbiflow.jobs.batch.folder import BatchFolder
from orbiflow.jobs.batch.inputs import code_of
from orbiflow.jobs.batch.items import Item
from orbiflow.jobs.batch.journal import Entry
from orbiflow.jobs.batch.kind import Kind
from orbiflow.jobs.executors import (
    Answer,
    DaskCluster,
    Executor,
    LocalProcesses,
    Parcel,
)
from orbiflow.jobs.run import Sink
from orbiflow.runtime import (
    Cancel,
    Failed,
    Finished,
    ItemDone,
    Note,
    Progress,
    State,
)

MOST_NAMED = 5
"""Items that a note names."""


class Asked(Protocol):
    """A request, as far as it says who works."""

    @property
    def workers(self) -> int | None: ...
    @property
    def scheduler(self) -> str | None: ...
    @property
    def retry_failed(self) -> bool: ...


@dataclass(frozen=True)
class Outcome:
    """How many items are `done`, gave `nothing`, have `failed`, are `left`; were `kept` from before."""

    done: int
    nothing: int
    failed: int
    left: int
    kept: int

    @property
    def state(self) -> State:
        """Of a `Finished`."""
        if self.left:
            return "cancelled"
        return "done" if self.done else "nothing found"

    def summary(self) -> dict[str, Any]:
        """For a `Finished`."""
        return vars(self).copy()


def go_through(
    items: Sequence[Item],
    asked: Asked,
    folder: BatchFolder,
    tell: Sink,
    cancel: Cancel,
    *,
    gone: str,
) -> Outcome:
    """Do what has not been done, and put it into the folder as it comes.

    Args:
        items: of different keys.
        folder: entered.
        gone: what earlier results are of that belong to no item, in words.

    Raises:
        OrbiflowError: for anything that the user can mend; what was finished is kept.
    """
    folder.keys = [item.key for item in items]
    kind = folder.kind
    todo = list(_todo(items, asked, folder))
    folder.current = set(folder.keys) - {item.key for item in todo}
    kept = len(items) - len(todo)
    for text in _said_before(items, todo, folder, gone):
        tell(Note(text))
    teller = _Teller(tell, len(items), kept)
    if todo and not cancel.cancelled:
        _work(asked, kind, todo, folder, teller, cancel)
    left = {item.key for item in todo} - teller.finished
    states = Counter(folder.journal.entries[k].state for k in folder.keys if k not in left)
    return Outcome(states["done"], states["nothing found"], states["failed"], len(left), kept)


def _todo(items: Sequence[Item], asked: Asked, folder: BatchFolder) -> Iterator[Item]:
    """What is new or changed, was asked for otherwise, or has lost its result."""
    for item in items:
        before = folder.journal.entries.get(item.key)
        if before is not None and not (asked.retry_failed and before.state != "done"):
            try:
                code = item.source.code()
            except OrbiflowError:
                code = ""
            there = before.state == "failed" or folder.has(before.name)
            if there and before.same_work(code, item.settings(folder.kind), __version__):
                continue
        yield item


def _said_before(
    items: Sequence[Item], todo: Sequence[Item], folder: BatchFolder, gone: str
) -> Iterator[str]:
    entries = folder.journal.entries
    waiting = {item.key for item in todo}
    states = Counter(entries[item.key].state for item in items if item.key not in waiting)
    if states:
        failed = states["failed"] + states["nothing found"]
        text = f"{len(items)} {folder.kind.items}: {states['done']} are done already"
        if failed:
            text += f", {failed} have failed before (--retry-failed does them again)"
        yield f"{text}, {len(todo)} to do"
    known = set(folder.keys)
    others = sorted(entry.name for key, entry in entries.items() if key not in known)
    if others:
        named = ", ".join(others[:MOST_NAMED]) + (", ..." if len(others) > MOST_NAMED else "")
        yield f"{len(others)} earlier results are {gone}; they are kept and not listed: {named}"


def _work(
    asked: Asked,
    kind: Kind,
    todo: Sequence[Item],
    folder: BatchFolder,
    teller: _Teller,
    cancel: Cancel,
) -> None:
    codes: dict[str, tuple[Item, str]] = {}

    def unreadable(item: Item, reason: str) -> None:
        entry = Entry(item.key, item.name, "", item.settings(kind), __version__, "failed", reason)
        folder.keep(entry, {}, None)
        teller.item(entry, kind)

    def parcels() -> Iterator[Parcel]:
        for item in todo:
            try:
                data = item.source.read()
            except OrbiflowError as error:
                unreadable(item, str(error))
                continue
            codes[item.key] = item, code_of(data)
            yield Parcel(item.key, item.request, kind.reads, kind.writes, item.source.name, data)

    executor = _executor(asked, kind, len(todo))
    with executor:
        teller.tell(Note(f"{len(todo)} {kind.things} for {executor.place}"))
        with closing(executor.answers(parcels(), teller.tell, cancel)) as answers:
            for answer in answers:
                item, code = codes.pop(answer.key)
                entry = _entry(answer, item, code, kind)
                if entry is None:
                    continue
                picture = None
                if isinstance(answer.end, Finished):
                    picture = kind.picture(answer.end.summary)
                folder.keep(entry, answer.files if entry.state != "failed" else {}, picture)
                teller.item(entry, kind)


def _executor(asked: Asked, kind: Kind, count: int) -> Executor:
    if asked.scheduler is not None:
        return DaskCluster(asked.scheduler)
    executor = LocalProcesses(asked.workers, kind.modules)
    return LocalProcesses(min(executor.workers, count), kind.modules)


def _entry(answer: Answer, item: Item, code: str, kind: Kind) -> Entry | None:
    """Nothing of what was interrupted."""
    end = answer.end
    known = (item.key, item.name, code, item.settings(kind), __version__)
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
