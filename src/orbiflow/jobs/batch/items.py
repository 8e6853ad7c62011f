"""One of many: a request, the bytes that it reads, and the name of its result."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from orbiflow.jobs.batch.inputs import code_of, content
from orbiflow.jobs.batch.kind import Kind
from orbiflow.jobs.batch_requests import settings_of
from orbiflow.jobs.request import Request


class Source(Protocol):
    """Where an item's bytes come from; both methods raise an `OrbiflowError` if they cannot be read."""

    @property
    def name(self) -> str:
        """Of the file that a worker makes of them: its ending says what it is."""
        ...

    def read(self) -> bytes:
        """The bytes, when somebody is free for them."""
        ...

    def code(self) -> str:
        """By which the same bytes are known."""
        ...


@dataclass(frozen=True)
class FileSource:
    """A file of at most so many bytes."""

    path: Path
    most: int

    @property
    def name(self) -> str:
        return self.path.name

    def read(self) -> bytes:
        return content(self.path, self.most)

    def code(self) -> str:
        return code_of(self.read())


@dataclass(frozen=True)
class Item:
    """To be done once.

    - `key`: by which the journal knows it; of a file, its path in the folder of files.
    - `name`: of its folder among the results, with slashes.
    - `request`: of one, whose file and folder are given when it runs.
    """

    key: str
    name: str
    request: Request
    source: Source

    def settings(self, kind: Kind) -> dict[str, Any]:
        """What decides the result besides the bytes and their name."""
        return settings_of(self.request, (kind.reads, kind.writes, "workers", "called"))
