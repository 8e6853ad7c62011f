"""What a batch has done: a line of JSON for each item, added when its result has its place.

A line says what was done to which bytes, with which settings and version, so that a later batch knows
what need not be done again. A line that was cut short is ignored.
"""

from __future__ import annotations

import json
import os
from contextlib import AbstractContextManager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal, Self, cast, get_args

from orbiflow.errors import OutputError, system_errors
from orbiflow.runtime import is_object, stays_inside, write_atomic

MOST_BYTES = 2**30
"""The largest size of a journal that is read."""

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


class Journal:
    """The last entry of each item, from a file if it exists; a `with` block can add more."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.entries: dict[str, Entry] = {}
        self._file: Any = None
        if path.exists():
            self._read()

    def __enter__(self) -> Self:
        """Write the last entries anew, and open the file for more."""
        write_atomic(self.path, "".join(entry.line() for entry in self.entries.values()))
        with self._writing():
            self._file = self.path.open("ab")
        return self

    def __exit__(self, *_error: object) -> None:
        self._file.close()

    def add(self, entry: Entry) -> None:
        """Add an entry, which is on the disk when this returns."""
        with self._writing():
            self._file.write(entry.line().encode())
            self._file.flush()
            os.fsync(self._file.fileno())
        self.entries[entry.file] = entry

    def _writing(self) -> AbstractContextManager[None]:
        return system_errors(OutputError, f"cannot write {self.path}", "free the disk or its file")

    def _read(self) -> None:
        with self._writing():
            if self.path.stat().st_size > MOST_BYTES:
                raise OutputError(f"{self.path} is too large to be a batch's; move it")
            lines = self.path.read_bytes().splitlines()
        for line in lines:
            with suppress(ValueError, TypeError, RecursionError):  # cut short: to be done again
                document = json.loads(line)
                if is_object(document) and document.pop("kind", None) == "entry":
                    entry = Entry(**document)
                    if _is_sound(entry):
                        self.entries[entry.file] = entry
        if len(lines) > 1 and not self.entries:
            raise OutputError(
                f"{self.path} is no journal of a batch; move it or choose another --out"
            )


def _is_sound(entry: Entry) -> bool:
    """Whether what is used of it is of the right type, and its results stay in the folder."""
    return (
        stays_inside(entry.name)
        and entry.state in get_args(State)
        and isinstance(cast(object, entry.file), str)
        and is_object(entry.best)
        and is_object(entry.settings)
    )
