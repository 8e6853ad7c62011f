"""Doing many items: what is to be done, who does it, where the results go."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from orbiflow import __version__
from orbiflow.batch.executors import Answer, Parcel, WorkSettings, executor_for
from orbiflow.batch.folder import RESERVED, BatchFolder
from orbiflow.batch.items import Item, code_of, folder_names, listed, read_file
from orbiflow.batch.overview import PAGE, TABLE, ContactSheet, Entry, Kind
from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.runtime import (
    Call,
    Cancel,
    Failed,
    Finished,
    ItemDone,
    Note,
    Outcome,
    Progress,
    Sink,
    State,
)

MOST_NAMED = 5
"""The number of items that a note names."""


@dataclass(frozen=True)
class Counts:
    """How many items are `done`, gave `nothing`, `failed` or are `left`; how many were `kept`."""

    done: int
    nothing: int
    failed: int
    left: int
    kept: int

    def outcome(
        self, count: int, table: Path, page: Path, summary: dict[str, Any], tell: Sink
    ) -> Outcome:
        """Tell what was done of `count` items and what to do next, and return the outcome.

        Its summary has the counts and what `summary` has, with `seconds`.
        """
        done = "nothing was left to do" if self.kept == count else f"{self.done} of {count} done"
        tell(Note(f"{done}, in {summary['seconds']:.0f} s; look at {page}, or {table}"))
        without = self.failed + self.nothing
        if self.left:
            text = f"interrupted with {self.left} still to do; the same command goes on from here"
            tell(Note(text, warning=True))
        elif without:
            text = f"{without} without a result, for the reasons in {table}"
            tell(Note(f"{text}; --retry-failed does them again", warning=True))
        state: State = "cancelled" if self.left else "done" if self.done else "nothing found"
        return Outcome({**summary, **asdict(self)}, state, without)


def run_files(
    source: Path,
    out: Path,
    kind: Kind,
    title: str,
    call_of: Callable[[str, str], Call],
    match: str | None,
    settings: WorkSettings,
    tell: Sink,
    cancel: Cancel,
) -> Outcome:
    """Make a call for every file of a folder, and put its result into a folder as it comes.

    `call_of` returns the call for a file's name and the name of its results' folder; `match` is a
    pattern of names, None for all that can be read. The outcome's summary has `folder`, `table` and
    `page`; the number of `files`, and how many of them are `done`, gave `nothing`, `failed` or are
    `left`; how many were `kept` from before; `seconds`.
    """
    begin = time.perf_counter()
    if match is not None and not match.strip():
        raise SettingError("{match} must be a pattern of names, such as *.svg")
    files = listed(source, kind.endings, match, out)
    with BatchFolder(out, kind, ContactSheet(kind, title)) as folder:
        given = {file: entry.name for file, entry in folder.journal.entries.items()}
        names = folder_names(files, given, RESERVED)
        items = [
            Item(
                file, name, call_of(file, name), partial(read_file, source / file, kind.most_bytes)
            )
            for file, name in ((file, names[file]) for file in files)
        ]
        left_out = f" or that --match {match} leaves out" if match else ""
        gone = f"of files that are not in {source}{left_out}"
        counts = run_items(items, settings, folder, tell, cancel, gone=gone)
    table, page = out / TABLE, out / PAGE
    summary: dict[str, Any] = {"folder": str(out), "table": str(table), "page": str(page)}
    summary |= {"files": len(files), "seconds": time.perf_counter() - begin}
    return counts.outcome(len(files), table, page, summary, tell)


def run_items(
    items: Sequence[Item],
    settings: WorkSettings,
    folder: BatchFolder,
    tell: Sink,
    cancel: Cancel,
    *,
    gone: str,
) -> Counts:
    """Do what has not been done of items with different keys, and put it into the folder as it comes.

    `gone` says in words what earlier results are of that belong to no item.
    """
    folder.keys = [item.key for item in items]
    todo = list(_todo(items, settings, folder))
    folder.current = set(folder.keys) - {item.key for item in todo}
    kept = len(items) - len(todo)
    for text in _said_before(items, todo, folder, gone):
        tell(Note(text))
    batch = _Batch(folder, tell, len(items), kept)
    if todo and not cancel.cancelled:
        batch.work(todo, settings, cancel)
    left = {item.key for item in todo} - batch.finished
    states = Counter(folder.journal.entries[k].state for k in folder.keys if k not in left)
    return Counts(states["done"], states["nothing found"], states["failed"], len(left), kept)


def _todo(items: Sequence[Item], settings: WorkSettings, folder: BatchFolder) -> Iterator[Item]:
    """What is new or changed, has other settings, or has lost its result."""
    codes: dict[Callable[[], bytes], str] = {}
    for item in items:
        before = folder.journal.entries.get(item.key)
        if before is not None and not (settings.retry_failed and before.state != "done"):
            if item.read not in codes:  # items may share what they read
                with suppress(OrbiflowError):
                    codes[item.read] = code_of(item.read())
            there = before.state == "failed" or (folder.path / before.name).is_dir()
            work = codes.get(item.read, ""), item.settings(folder.kind), __version__
            if there and work == (before.code, before.settings, before.version):
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


class _Batch:
    """Items being done: keeps what comes, and says so."""

    def __init__(self, folder: BatchFolder, tell: Sink, count: int, kept: int) -> None:
        self.folder, self.kind, self.tell = folder, folder.kind, tell
        self.count, self.kept, self.without = count, kept, 0
        self.finished: set[str] = set()
        self.at_work: dict[str, tuple[Item, str]] = {}
        self._progress()

    def work(self, todo: Sequence[Item], settings: WorkSettings, cancel: Cancel) -> None:
        with executor_for(settings, len(todo), self.kind.modules) as executor:
            self.tell(Note(f"{len(todo)} {self.kind.things} for {executor.place}"))
            with closing(executor.answers(self._parcels(todo), self.tell, cancel)) as answers:
                for answer in answers:
                    self._keep(answer)

    def _parcels(self, todo: Sequence[Item]) -> Iterator[Parcel]:
        reads, writes = self.kind.reads, self.kind.writes
        for item in todo:
            try:
                data = item.read()
            except OrbiflowError as error:
                known = (item.key, item.name, "", item.settings(self.kind), __version__)
                self._finish(Entry(*known, "failed", str(error)), {}, None)
                continue
            self.at_work[item.key] = item, code_of(data)
            yield Parcel(item.key, item.call, reads, writes, item.call.flat[reads].name, data)

    def _keep(self, answer: Answer) -> None:
        entry = _entry(answer, *self.at_work.pop(answer.key), self.kind)
        if entry is None:
            return
        end = answer.end
        picture = self.kind.picture(end.summary) if isinstance(end, Finished) else None
        self._finish(entry, {} if entry.state == "failed" else answer.files, picture)

    def _finish(self, entry: Entry, files: Any, picture: str | None) -> None:
        self.folder.keep(entry, files, picture)
        self.finished.add(entry.file)
        self.without += entry.state != "done"
        self.tell(ItemDone(entry.name, entry.state, entry.reason or _figures(entry, self.kind)))
        self._progress()

    def _progress(self) -> None:
        finished = self.kept + len(self.finished)
        what = f"{finished} of {self.count}"
        if self.without:
            what += f", {self.without} without a result"
        self.tell(Progress(finished / self.count, what))


def _entry(answer: Answer, item: Item, code: str, kind: Kind) -> Entry | None:
    """What the journal says of an answer, None of what was interrupted."""
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


def _figures(entry: Entry, kind: Kind) -> str:
    """The figures of a result, in words."""
    words = [
        f"{column.title} {column.shown(value)}" if column.form else column.shown(value)
        for column in kind.columns
        if (value := entry.best.get(column.name)) is not None and not isinstance(value, bool)
    ]
    if entry.seconds is not None:
        words.append(f"{entry.seconds:.1f} s")
    return ", ".join(words)
