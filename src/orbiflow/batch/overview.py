"""What a folder of results shows of all of them: a table, and a page to look at."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

from orbiflow.batch.journal import Entry
from orbiflow.batch.kinds import Column, Kind

TABLE, PAGE = "batch.csv", "index.html"


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
    """The table and the page of a folder's files.

    - `title`: The title of the page.
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
        """Return `batch.csv` and `index.html`."""
        return {
            TABLE: table(entries, self.kind),
            PAGE: page(entries, self.kind, self.title, waiting, pictures),
        }


def table(entries: Iterable[Entry], kind: Kind) -> bytes:
    """Return a table with a line for each item, in order, as UTF-8.

    Numbers are written so that they can be read back exactly; the cell of what there is not is empty.
    """
    names = [column.name for column in kind.columns]
    heads = ["file", "state", *names, "seconds", "error", "folder", "sha256", "settings", "version"]
    return csv_bytes(heads, (list(_row(entry, names)) for entry in entries))


def csv_bytes(heads: Sequence[str], rows: Iterable[Sequence[Any]]) -> bytes:
    """Return a CSV as UTF-8."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(heads)
    writer.writerows(rows)
    return text.getvalue().encode("utf-8", "replace")


def _row(entry: Entry, names: Sequence[str]) -> Iterator[Any]:
    settings = {k: v for k, v in entry.settings.items() if v is not None and v is not False}
    yield from (entry.file, entry.state)
    yield from (_cell(entry.best.get(name)) for name in names)
    yield "" if entry.seconds is None else f"{entry.seconds:.3f}"
    yield from (entry.reason, "" if entry.state == "failed" else entry.name, entry.code)
    yield from (json.dumps(settings, separators=(",", ":"), sort_keys=True), entry.version)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return repr(value) if isinstance(value, float) else str(value)


def page(
    entries: Sequence[Entry], kind: Kind, title: str, waiting: int, pictures: frozenset[str]
) -> bytes:
    """Return the contact sheet: a card for each result, which can be sorted and searched.

    The page refers to nothing but files beside it. Pictures are fetched and cards laid out only where
    they are looked at, so thousands are no burden. Without scripts it is in the order of the names.
    """
    from orbiflow.drawing import rendered

    text = rendered(
        "orbiflow.batch",
        "page.html",
        title=title,
        kind=kind,
        figures=[column for column in kind.columns if column.form],
        words=[column for column in kind.columns if not column.form],
        done=[entry for entry in entries if entry.state == "done"],
        other=[entry for entry in entries if entry.state != "done"],
        waiting=waiting,
        pictures=pictures,
        rank=_rank,
    )
    return text.encode("utf-8", "replace")


def _rank(column: Column, entry: Entry) -> str:
    """What cards are sorted by, the smallest first."""
    value = entry.best.get(column.name)
    if not isinstance(value, int | float):
        return ""
    return f"{-value if column.falling else value:.9g}"
