"""What a folder of results shows of all of them: a table, and a page to look at."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal, Protocol

TABLE, PAGE = "batch.csv", "index.html"

State = Literal["done", "nothing found", "failed"]


@dataclass(frozen=True)
class Entry:
    """What came of an item.

    - `file`: Its key: for a file, its path in the folder of files.
    - `name`: The name of its folder among the results.
    - `code`: What its bytes are known by.
    - `settings`, `version`: The settings of the call, and the version of orbiflow.
    - `reason`: Why there is no result, in words.
    - `best`: Figures of the best result, by column of the table.
    - `seconds`: How long a worker took.
    """

    file: str
    name: str
    code: str
    settings: dict[str, Any]
    version: str
    state: State
    reason: str = ""
    best: dict[str, Any] = field(default_factory=dict[str, Any])
    seconds: float | None = None

    def line(self) -> str:
        """Return its line in a journal."""
        return json.dumps({"kind": "entry", **asdict(self)}, allow_nan=False) + "\n"


Summary = Mapping[str, Any]
"""The summary of a call's `Finished`."""


@dataclass(frozen=True)
class Column:
    """A figure of the best result.

    - `name`, `title`: What the table and the page call it.
    - `form`: The format of the number on the page, "" for text.
    - `falling`: Whether the best is the largest.
    """

    name: str
    title: str
    form: str = ""
    falling: bool = True

    def shown(self, value: Any) -> str:
        """Return a value as the page shows it.

        >>> Column("iou", "IoU", ".3f").shown(0.91234)
        '0.912'
        """
        if value is None:
            return "-"
        return format(value, self.form) if self.form else str(value)

    def rank(self, value: Any) -> str:
        """Return what cards are sorted by, the smallest first."""
        if not isinstance(value, int | float):
            return ""
        return f"{-value if self.falling else value:.9g}"


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of batch: what is done many times.

    - `things`: What is worked on, in the plural.
    - `items`: What there are so many of, in the plural.
    - `reads`, `writes`: The parameters of the call that name the file and the folder.
    - `modules`: Modules that the work needs.
    - `columns`: Figures of the best result; `best` takes them from a summary, by name.
    - `picture`: Takes from a summary the path of a picture in the result's folder, or None.
    - `shows`: What is on the picture, before "of" and the file's name.
    - `opens`: The page in a result's folder that a card with a picture opens, "" for the folder.
    - `written`: Returns the paths of what an earlier run wrote into a folder.
    - `endings`, `most_bytes`: For a folder of files, the endings and the largest size of those read.
    """

    things: str
    items: str
    reads: str
    writes: str
    modules: Sequence[str]
    columns: Sequence[Column]
    best: Callable[[Summary], dict[str, Any]]
    picture: Callable[[Summary], str | None]
    shows: str = "Picture"
    opens: str = ""
    written: Callable[[Path], set[str]]
    endings: Sequence[str] = ()
    most_bytes: int = 0


class Overview(Protocol):
    """Files that are written anew as results come.

    - `journal`: The name of the journal, by which the folder is known.
    - `what`: What the folder is of, in words.
    """

    journal: ClassVar[str]
    what: ClassVar[str]

    def files(
        self, entries: Sequence[Entry], waiting: int, pictures: frozenset[str], *, last: bool
    ) -> Mapping[str, bytes | None]:
        """Return the files by name; None removes an earlier one.

        Args:
            entries: What has finished, in order.
            waiting: The number of items that are still to be done.
            pictures: The names of the results that `thumbnails/NAME.png` shows.
            last: Whether nothing more comes: what costs much can wait for that.
        """
        ...


@dataclass(frozen=True)
class ContactSheet:
    """The table of a folder's files, and a page of this title: a card for each, to sort and search.

    The page refers to nothing but files beside it. Pictures are fetched and cards laid out only where
    they are looked at, so thousands are no burden. Without scripts it is in the order of the names.
    """

    journal: ClassVar[str] = "batch.jsonl"
    what: ClassVar[str] = "batch"

    kind: Kind
    title: str

    def files(
        self,
        entries: Sequence[Entry],
        waiting: int,
        pictures: frozenset[str],
        *,
        last: bool,  # noqa: ARG002
    ) -> Mapping[str, bytes | None]:
        """Return `batch.csv`, a line for each item, and `index.html`."""
        from orbiflow.drawing import rendered

        columns = self.kind.columns
        names = [column.name for column in columns]
        heads = ["file", "state", *names, "seconds", "error", "folder"]
        heads += ["sha256", "settings", "version"]
        page = rendered(
            "orbiflow.batch",
            "page.html",
            title=self.title,
            kind=self.kind,
            figures=[column for column in columns if column.form],
            words=[column for column in columns if not column.form],
            done=[entry for entry in entries if entry.state == "done"],
            other=[entry for entry in entries if entry.state != "done"],
            waiting=waiting,
            pictures=pictures,
        )
        table = csv_bytes(heads, (list(_row(entry, names)) for entry in entries))
        return {TABLE: table, PAGE: page.encode("utf-8", "replace")}


def csv_bytes(heads: Sequence[str], rows: Iterable[Sequence[Any]]) -> bytes:
    """Return a CSV as UTF-8."""
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows([heads, *rows])
    return text.getvalue().encode("utf-8", "replace")


def _row(entry: Entry, names: Sequence[str]) -> Iterator[Any]:
    settings = {k: v for k, v in entry.settings.items() if v is not None and v is not False}
    yield from (entry.file, entry.state)
    yield from (_cell(entry.best.get(name)) for name in names)
    yield "" if entry.seconds is None else f"{entry.seconds:.3f}"
    yield from (entry.reason, "" if entry.state == "failed" else entry.name, entry.code)
    yield from (json.dumps(settings, separators=(",", ":"), sort_keys=True), entry.version)


def _cell(value: Any) -> str:
    """A value that can be read back exactly, or nothing."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return repr(value) if isinstance(value, float) else str(value)
