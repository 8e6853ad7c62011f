"""What a folder of results tells of all of them, beside their own folders."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol

from orbiflow.jobs.batch.journal import Entry
from orbiflow.jobs.batch.kind import Kind
from orbiflow.jobs.batch.page import page
from orbiflow.jobs.batch.table import table

TABLE, PAGE = "batch.csv", "index.html"


class Overview(Protocol):
    """Files that are written anew as results come.

    - `journal`: name of the journal, by which the folder is known.
    - `what`: whose folder it is, in words.
    """

    journal: ClassVar[str]
    what: ClassVar[str]

    def files(
        self, entries: Sequence[Entry], waiting: int, pictures: frozenset[str], *, last: bool
    ) -> Mapping[str, bytes | None]:
        """By name; None takes an earlier one away.

        Args:
            entries: of what is done with, in their order.
            waiting: items that are still to be done.
            pictures: names of the results that `thumbnails/NAME.png` shows.
            last: whether nothing more comes: what costs much can wait for that.
        """
        ...


@dataclass(frozen=True)
class ContactSheet:
    """The table and the page of a folder's files.

    - `title`: of the page.
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
        """`batch.csv` and `index.html`."""
        return {
            TABLE: table(entries, self.kind),
            PAGE: page(entries, self.kind, self.title, waiting, pictures),
        }
