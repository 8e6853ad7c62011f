"""What a batch has done: a line of JSON each, added when a result has its place.

A line says what was done to which bytes with which settings by which version, so that a later batch
knows what need not be done again. A line that was cut short by a death is as if it were not there.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

from orbiflow.errors import OutputError
from orbiflow.runtime import (
    Record,
    RecordError,
    is_object,
    stays_inside,
    write_atomic,
)

MOST_BYTES = 2**30
"""Of a journal that is read."""

State = Literal["done", "nothing found", "failed"]


@dataclass(frozen=True)
class Entry(Record):
    """What came of a file.

    - `file`: its path in the folder of files. `name`: of its folder among the results.
    - `code`: of its bytes. `settings`, `version`: of the request and of orbiflow.
    - `state`; `reason`: why there is no result, in words.
    - `best`: of the best result, by column of the table.
    - `seconds`: of the worker.
    """

    KIND = "entry"

    file: str
    name: str
    code: str
    settings: dict[str, Any]
    version: str
    state: State
    reason: str = ""
    best: dict[str, Any] = field(default_factory=dict[str, Any])
    seconds: float | None = None

    def same_work(self, code: str, settings: dict[str, Any], version: str) -> bool:
        """Whether these bytes, settings and version have been dealt with."""
        return (self.code, self.settings, self.version) == (code, settings, version)


class Journal:
    """The last entry of each file; in a `with` block more can be added.

    Args:
        path: of the file, which need not be there.

    Raises:
        OutputError: if it is there and is no journal.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.entries: dict[str, Entry] = {}
        self._file: Any = None
        if path.exists():
            self._read()

    def __enter__(self) -> Self:
        """Write the last entries anew, and wait for more."""
        write_atomic(self.path, "".join(_line(entry) for entry in self.entries.values()))
        try:
            self._file = self.path.open("ab")
        except OSError as error:
            raise _cannot(self.path, error) from error
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _traceback: TracebackType | None,
    ) -> None:
        self._file.close()

    def add(self, entry: Entry) -> None:
        """On the disk before this returns.

        Raises:
            OutputError: if it cannot be written.
        """
        try:
            self._file.write(_line(entry).encode())
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            raise _cannot(self.path, error) from error
        self.entries[entry.file] = entry

    def _read(self) -> None:
        try:
            if self.path.stat().st_size > MOST_BYTES:
                raise OutputError(f"{self.path} is too large to be a batch's; move it")
            lines = self.path.read_bytes().splitlines()
        except OSError as error:
            raise _cannot(self.path, error) from error
        read = list(_entries(lines))
        if lines and not read and len(lines) > 1:
            raise OutputError(
                f"{self.path} is no journal of a batch; move it or choose another --out"
            )
        self.entries = {entry.file: entry for entry in read}


def _entries(lines: Iterable[bytes]) -> Iterable[Entry]:
    for line in lines:
        try:
            document = json.loads(line)
            if is_object(document) and document.pop("kind", None) == Entry.KIND:
                entry = Entry.of_fields(document)
                if stays_inside(entry.name):  # results are written there
                    yield entry
        except (ValueError, RecordError, RecursionError):
            continue  # cut short: to be done again


def _line(entry: Entry) -> str:
    return json.dumps(entry.to_json(), allow_nan=False) + "\n"


def _cannot(path: Path, error: OSError) -> OutputError:
    return OutputError(f"cannot write {path}: {error.strerror or error}; free the disk or its file")
