"""Doing many items: which there are, what is to be done, who does it, where the results go."""

from __future__ import annotations

import hashlib
import os
import re
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import asdict, dataclass, field
from fnmatch import fnmatch
from functools import partial
from itertools import combinations
from pathlib import Path, PurePosixPath
from typing import Any

from orbiflow import __version__
from orbiflow.batch.executors import WorkSettings, executor_for
from orbiflow.batch.folder import PAGE, RESERVED, TABLE, BatchFolder, BatchKind, ContactSheet, Entry
from orbiflow.batch.parcels import Parcel, WorkerReply
from orbiflow.errors import (
    Advice,
    InputFileError,
    OrbiflowError,
    SettingError,
    literal,
    system_errors,
)
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

PAIRED = " + "
"""What joins the names of two files that a call takes."""

LONGEST_NAME = 80
"""The number of characters that the name of a result's folder may have."""

NO_RESULT = ("workers", "called", "second_called", "shown_out", "verbose")
"""Parameters of a call that do not change its result."""


def read_file(path: Path, most: int) -> bytes:
    """Return the content of a file of at most so many bytes."""
    system = system_errors(InputFileError, f"{path.name}: cannot be read", "check it")
    with system, path.open("rb") as file:
        data = file.read(most + 1)
    if len(data) > most:
        raise InputFileError(
            f"{path.name}: larger than {most / 2**20:.0f} MB, the most that is read; simplify it"
        )
    return data


@dataclass(frozen=True)
class Item:
    """One of many calls that a batch makes.

    - `key`: What the journal knows it by; for a file, its path in the folder of files.
    - `name`: The name of its folder among the results, with slashes.
    - `call`: The call; the file that it reads and the folder that it writes are set where it runs.
    - `read`: Returns the bytes of the file, or raises an `OrbiflowError`; called when somebody is free
      for them.
    - `more`: Returns those of further files, by the parameter that names each.
    """

    key: str
    name: str
    call: Call
    read: Callable[[], bytes]
    more: Mapping[str, Callable[[], bytes]] = field(default_factory=dict[str, Callable[[], bytes]])

    def files(self, kind: BatchKind) -> dict[str, tuple[str, bytes]]:
        """Return the name and bytes of each file, by its parameter; raises as `read`."""
        calls, flat = {kind.reads: self.read, **self.more}, self.call.flat
        return {key: (flat[key].name, read()) for key, read in calls.items()}

    def code(self) -> str:
        """Return what the bytes of its files are known by."""
        return code_of(b"".join([self.read(), *(read() for read in self.more.values())]))

    def settings(self, kind: BatchKind) -> dict[str, Any]:
        """Return what decides the result besides the bytes and their name, as JSON has it."""
        flat = self.call.flat
        return {
            entry.name: entry.kind.plain(flat[entry.name])
            for entry in self.call.operation.fields
            if entry.name not in (kind.reads, *self.more, kind.writes, *NO_RESULT)
        }


def listed(folder: Path, endings: Collection[str], match: str | None, out: Path) -> list[str]:
    """Return the paths of a folder's files with some `endings`, relative and with slashes, in order.

    Folders inside are searched as well, links to folders are not. Names that begin with a dot are left
    out, and those that do not fit the pattern `match`. The results must go to an `out` elsewhere.
    """
    if not folder.is_dir():
        why = "it is a file" if folder.exists() else "there is no such folder"
        raise InputFileError(f"{folder}: {why}; give a folder of files")
    if out.resolve().is_relative_to(folder.resolve()):
        raise InputFileError(
            f"{out} is inside {folder}, whose files are read: choose a folder somewhere else"
        )
    names = sorted(name for name in _files(folder) if PurePosixPath(name).suffix.lower() in endings)
    if not names:
        raise InputFileError(
            f"{folder}: no file to read; wanted are names that end in {', '.join(endings)}"
        )
    if match is None:
        return names
    fitting = [n for n in names if fnmatch(n, match) or fnmatch(PurePosixPath(n).name, match)]
    if not fitting:
        raise InputFileError(
            f"{folder}: none of its {len(names)} files fits the pattern {match!r}; {names[0]} is one"
        )
    return fitting


def _files(folder: Path) -> Iterator[str]:
    def refuse(error: OSError) -> None:
        raise InputFileError(
            f"{error.filename}: cannot be read ({error.strerror}); check its permissions"
        ) from error

    for above, inside, names in os.walk(folder, onerror=refuse):
        inside[:] = [name for name in inside if not name.startswith(".")]
        for name in names:
            if not name.startswith("."):
                yield (Path(above) / name).relative_to(folder).as_posix()


def folder_names(
    paths: Iterable[str], kept: Mapping[str, str], reserved: Collection[str] = ()
) -> dict[str, str]:
    """Return a name for each path that no other has, whether capitals count or not.

    The name is the path without its ending, such as "cats-tom" for "cats/tom.png". If two would have
    the same, it has the ending or a part of its hash, too. Names that were given before stay, so that
    added files change no other's.

    Args:
        paths: Different paths.
        kept: Names of paths in an earlier batch.
        reserved: Names that no path may have.

    >>> folder_names(["cats/tom.png", "tom.png", "tom.svg"], {})
    {'cats/tom.png': 'cats-tom', 'tom.png': 'tom', 'tom.svg': 'tom-svg'}
    >>> folder_names(["tom.png + kit.svg"], {})
    {'tom.png + kit.svg': 'tom-kit'}
    """
    names = {path: kept[path] for path in paths if path in kept}
    # those of files that are not there now are kept for them
    taken = {name.casefold() for name in (*kept.values(), *reserved)}
    for path in paths:
        if path in names:
            continue
        names[path] = next(name for name in _names(path) if name.casefold() not in taken)
        taken.add(names[path].casefold())
    return names


def _names(path: str) -> Iterator[str]:
    """Possible names, from the best to those that are as good as unique."""
    *first, last = (PurePosixPath(part) for part in path.split(PAIRED))
    plain = "-".join(_plain(str(part.parent / part.stem)) for part in (*first, last))
    ending = _plain(last.suffix[1:])
    yield plain
    yield f"{plain}-{ending}"
    code = hashlib.sha256(path.encode("utf-8", "surrogateescape")).hexdigest()
    for length in range(6, len(code)):
        yield f"{plain}-{code[:length]}"


def _plain(text: str) -> str:
    """A name of letters, digits, dots, dashes and underscores, neither empty nor hidden."""
    text = re.sub(r"[^\w.-]+", "-", text.replace("/", "-")).strip("-.")
    return text[:LONGEST_NAME].rstrip("-.") or "file"


def code_of(data: bytes) -> str:
    """Return what the same bytes are known by."""
    return hashlib.sha256(data).hexdigest()


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
            text = f"interrupted with {self.left} still to do: run the same command again to resume"
            tell(Note(text, warning=True))
        elif without:
            text = f"{without} without a result, for the reasons in {table}"
            tell(Note(Advice(f"{literal(text)}; {{retry_failed}} does them again"), warning=True))
        state: State = "cancelled" if self.left else "done" if self.done else "nothing found"
        return Outcome({**summary, **asdict(self)}, state, without)


def run_files(
    source: Path,
    out: Path,
    sheet: ContactSheet,
    call_of: Callable[[str, str], Call],
    match: str | None,
    settings: WorkSettings,
    tell: Sink,
    cancel: Cancel,
) -> Outcome:
    """Make a call for every file of a folder, and put its result into a folder as it comes.

    `call_of` returns the call for a file's name and the name of its results' folder; `match` is a
    pattern of names, None for all that can be read. The `sheet` is written over the results. If its
    kind has a `second` file, each call takes two of the files, every pair once, and `call_of` is given
    both names, joined by `PAIRED`. The outcome's summary has `folder`, `table` and `page`; the number
    of `files`, and how many of them are `done`, gave `nothing`, `failed` or are `left`; how many were
    `kept` from before; `seconds`.
    """
    begin, kind = time.perf_counter(), sheet.kind
    if match is not None and not match.strip():
        raise SettingError("{match} must be a pattern of names, such as *.svg")
    listing = listed(source, kind.endings, match, out)
    files = [PAIRED.join(pair) for pair in combinations(listing, 2)] if kind.second else listing
    if not files:
        raise InputFileError(f"{source} holds one file that can be read, and a pair needs two")
    with BatchFolder(out, kind, sheet) as folder:
        taken = {file: entry.name for file, entry in folder.journal.entries.items()}
        names = folder_names(files, taken, RESERVED)
        read = {file: partial(read_file, source / file, kind.most_bytes) for file in listing}
        items: list[Item] = []
        for file in files:
            first, _, other = file.partition(PAIRED) if kind.second else (file, "", "")
            more = {kind.second: read[other]} if kind.second else {}
            items.append(Item(file, names[file], call_of(file, names[file]), read[first], more))
        left_out = f" or that {match} leaves out" if match else ""
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
    codes: dict[Any, str] = {}
    for item in items:
        before = folder.journal.entries.get(item.key)
        if before is not None and not (settings.retry_failed and before.state != "done"):
            reads = (item.read, *item.more.values())
            if reads not in codes:  # items may share what they read
                with suppress(OrbiflowError):
                    codes[reads] = item.code()
            there = before.state == "failed" or (folder.path / before.name).is_dir()
            work = codes.get(reads, ""), item.settings(folder.kind), __version__
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
            text += f", {failed} have failed before ({{retry_failed}} does them again)"
        yield Advice(f"{text}, {len(todo)} to do")
    keys = set(folder.keys)
    others = sorted(entry.name for key, entry in entries.items() if key not in keys)
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
        for item in todo:
            try:
                files = item.files(self.kind)
            except OrbiflowError as error:
                facts = (item.key, item.name, "", item.settings(self.kind), __version__)
                self._finish(Entry(*facts, "failed", str(error)), {}, None)
                continue
            parcel = Parcel(item.key, item.call, self.kind.writes, files)
            self.at_work[item.key] = item, code_of(parcel.data)
            yield parcel

    def _keep(self, answer: WorkerReply) -> None:
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


def _entry(answer: WorkerReply, item: Item, code: str, kind: BatchKind) -> Entry | None:
    """What the journal says of an answer, None of what was interrupted."""
    end = answer.end
    facts = (item.key, item.name, code, item.settings(kind), __version__)
    if isinstance(end, Failed):
        return Entry(*facts, "failed", end.message)
    if end.state == "cancelled":
        return None
    seconds = end.summary.get("seconds")
    if end.state == "nothing found":
        failed = end.summary.get("failed") or ()
        reasons = Counter(str(failure["reason"]) for failure in failed).most_common(1)
        reason = reasons[0][0] if reasons else "nothing was found"
        return Entry(*facts, "nothing found", reason, {}, seconds)
    return Entry(*facts, "done", "", kind.best(end.summary), seconds)


def _figures(entry: Entry, kind: BatchKind) -> str:
    """The figures of a result, in words."""
    words = [
        f"{column.title} {column.shown(value)}" if column.form else column.shown(value)
        for column in kind.columns
        if (value := entry.best.get(column.name)) is not None and not isinstance(value, bool)
    ]
    if entry.seconds is not None:
        words.append(f"{entry.seconds:.1f} s")
    return ", ".join(words)
