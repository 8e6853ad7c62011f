"""Work that travels: a call with the bytes that it reads, its events with the bytes that it wrote."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orbiflow import __version__
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import (
    Call,
    Cancel,
    Event,
    Failed,
    Finished,
    Progress,
    Table,
    Written,
    call_from_json,
    event_from_json,
    is_list,
    is_object,
    stays_inside,
)

MOST_WRITTEN = 512 * 2**20
"""The number of bytes that one call may write."""


@dataclass(frozen=True)
class Parcel:
    """A call that reads one file and writes a folder, with the bytes of the file.

    - `key`: What its answer is known by.
    - `call`: The call; its paths are replaced where it runs.
    - `reads`, `writes`: The names of these two parameters.
    - `name`, `data`: The name of the file, and its bytes.
    """

    key: str
    call: Call
    reads: str
    writes: str
    name: str
    data: bytes

    def header(self) -> str:
        """Return all but the file's bytes, as text."""
        names = {"reads": self.reads, "writes": self.writes, "name": self.name}
        return json.dumps({"version": __version__, "call": self.call.to_json(), **names})


@dataclass(frozen=True)
class Answer:
    """What came of a parcel.

    - `key`: The parcel's key.
    - `events`: The events that matter afterwards; the last is `Finished` or `Failed`.
    - `files`: The files that it wrote, by path relative to its folder, with slashes.
    """

    key: str
    events: tuple[Event, ...]
    files: Mapping[str, bytes]

    @classmethod
    def from_worker(cls, key: str, text: str, files: Mapping[str, bytes]) -> Answer:
        """Return the answer that a worker gave in `carry_out`.

        Raises:
            OrbiflowError: If it is none, or has a file that would be written elsewhere.
        """
        events = tuple(event_from_json(document) for document in json.loads(text))
        if not events or not isinstance(events[-1], Finished | Failed):
            raise OrbiflowError("a worker gave an answer without an end")
        for name in files:
            if not stays_inside(name):
                raise OrbiflowError(f"a worker gave a file a name that cannot be used: {name!r}")
        return cls(key, events, files)

    @classmethod
    def died(cls, key: str, times: int) -> Answer:
        """Return the answer of a parcel that killed so many workers."""
        message = (
            f"{times} workers died while they were at it: was memory short? A simpler file may do"
        )
        return cls(key, (Failed(message, "died"),), {})

    @property
    def end(self) -> Finished | Failed:
        """The last event."""
        last = self.events[-1]
        assert isinstance(last, Finished | Failed)
        return last


def carry_out(header: str, data: bytes, cancel: Cancel) -> tuple[str, dict[str, bytes]]:
    """Run a parcel's call in this thread, in a folder that is removed afterwards.

    Returns:
        Events as text, and files, for `Answer.from_worker`. Whatever fails is among the events.
    """
    order = json.loads(header)
    with tempfile.TemporaryDirectory(prefix="orbiflow-", ignore_cleanup_errors=True) as folder:
        events, files = _run(order, data, Path(folder), cancel)
        shown = [_without(event.to_json(), folder) for event in events]
    return json.dumps(shown, allow_nan=False), files


def _run(
    order: Mapping[str, Any], data: bytes, folder: Path, cancel: Cancel
) -> tuple[list[Event], dict[str, bytes]]:
    if order["version"] != __version__:
        text = f"this worker has orbiflow {__version__}, not {order['version']}"
        return [Failed(text, "mistake")], {}
    events: list[Event] = []

    def keep(event: Event) -> None:
        if not isinstance(event, Progress | Table | Written):
            events.append(event)

    try:
        read, written = folder / "in" / order["name"], folder / "out"
        read.parent.mkdir()
        read.write_bytes(data)
        there = {order["reads"]: str(read), order["writes"]: str(written)}
        call = call_from_json({**order["call"], **there})
        with suppress(Exception):  # the last event says what
            call.run(keep, cancel)
        files = _packed(written)
    except OSError as error:
        return [Failed(f"{type(error).__name__}: {error.strerror or error}", "error")], {}
    except OrbiflowError as error:
        return [Failed(str(error), "mistake")], {}
    return events or [Failed("the work ended without a word", "error")], files


def _packed(folder: Path) -> dict[str, bytes]:
    """All files in a folder, if there is one.

    Raises:
        OrbiflowError: If they are too large to be sent.
    """
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    size = sum(path.stat().st_size for path in paths)
    if size > MOST_WRITTEN:
        raise OrbiflowError(
            f"its results are {size / 2**20:.0f} MB, more than the {MOST_WRITTEN / 2**20:.0f} MB that "
            "are sent back; run it by itself"
        )
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


def _without(value: Any, folder: str) -> Any:
    """Plain data, whose texts do not name a folder that will be gone."""
    if isinstance(value, str):
        for part in ("in", "out"):
            value = value.replace(str(Path(folder) / part / "_")[:-1], "")
        return value
    if is_object(value):
        return {name: _without(part, folder) for name, part in value.items()}
    return [_without(part, folder) for part in value] if is_list(value) else value
