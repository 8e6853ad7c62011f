"""What workers of a batch are given and give back, and what an executor of any kind does with it.

What travels is text and bytes: a call with the file that it reads, its last event with the files that
it wrote.
"""

from __future__ import annotations

import json
import tempfile
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Generator, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from orbiflow import __version__
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import (
    Call,
    Cancel,
    Event,
    Failed,
    Finished,
    Sink,
    call_from_json,
    event_from_json,
    one_core,
    stays_inside,
)

MOST_WRITTEN = 512 * 2**20
"""The number of bytes that one call may write."""


@dataclass(frozen=True)
class Parcel:
    """A call that reads files and writes a folder, with the bytes of the files.

    - `key`: What its answer is known by.
    - `call`: The call; its paths are replaced where it runs.
    - `writes`: The name of the parameter of the folder.
    - `files`: The name and bytes of each file, by the name of its parameter.
    """

    key: str
    call: Call
    writes: str
    files: Mapping[str, tuple[str, bytes]]

    def header(self) -> str:
        """Return all but the files' bytes, as text."""
        reads = [[key, name, len(data)] for key, (name, data) in self.files.items()]
        facts = {"call": self.call.to_json(), "writes": self.writes, "reads": reads}
        return json.dumps({"version": __version__, **facts})

    @property
    def data(self) -> bytes:
        """The bytes of all files in a row."""
        return b"".join(data for _, data in self.files.values())


@dataclass(frozen=True)
class WorkerReply:
    """What came of a parcel.

    - `key`: The parcel's key.
    - `end`: The last event of its call.
    - `files`: The files that it wrote, by path relative to its folder, with slashes.
    """

    key: str
    end: Finished | Failed
    files: Mapping[str, bytes]

    @classmethod
    def from_worker(cls, key: str, text: str, files: Mapping[str, bytes]) -> WorkerReply:
        """Return the answer that a worker gave in `carry_out`.

        Raises `OrbiflowError` if it is none, or has a file that would be written elsewhere.
        """
        end = event_from_json(json.loads(text))
        if not isinstance(end, Finished | Failed):
            raise OrbiflowError("a worker gave an answer without an end")
        for name in files:
            if not stays_inside(name):
                raise OrbiflowError(f"a worker gave a file a name that cannot be used: {name!r}")
        return cls(key, end, files)

    @classmethod
    def died(cls, key: str, times: int) -> WorkerReply:
        """Return the answer of a parcel that killed so many workers."""
        message = (
            f"{times} workers died while they were at it: was memory short? A simpler file may do"
        )
        return cls(key, Failed(message, "died"), {})


class Executor(ABC):
    """Runs many calls. Use it in a `with` block, which ends what it has begun.

    Every executor gives the same answer to the same parcel, except for the seconds.
    """

    def __enter__(self) -> Self:
        """Raise an `OrbiflowError` if there is nobody to work."""
        return self

    def __exit__(self, *_error: object) -> None:  # noqa: B027
        """End what was begun."""

    @property
    @abstractmethod
    def place(self) -> str:
        """Who works, in words, such as "2 processes"."""

    @abstractmethod
    def answers(
        self, parcels: Iterable[Parcel], tell: Sink, cancel: Cancel
    ) -> Generator[WorkerReply, None, None]:
        """Yield an answer for each parcel, as they come, in this thread.

        If a worker dies, another does its work again. A parcel that several workers die of is answered
        by a `Failed` ("died"), and the others go on.

        Args:
            parcels: Taken in order when somebody is free for them, so that few are held at a time.
            tell: Is told in a `Note` what the user should know of the workers.
            cancel: Ends the work; what is unfinished then has no answer.

        Raises:
            OrbiflowError: If nobody is left to work.
        """


def carry_out(header: str, data: bytes, cancel: Cancel) -> tuple[str, dict[str, bytes]]:
    """Run a parcel's call in this thread, in a folder that is removed afterwards.

    Returns:
        The last event as text, and files, for `WorkerReply.from_worker`. What fails is in the event.
    """
    temporary = tempfile.TemporaryDirectory(prefix="orbiflow-", ignore_cleanup_errors=True)
    with temporary as folder, one_core():
        end, files = _run(json.loads(header), data, Path(folder), cancel)
    text = json.dumps(end.to_json(), allow_nan=False)
    for part in ("in", "in-2", "out"):  # a folder that is gone is not to be named
        text = text.replace(json.dumps(str(Path(folder, part, "_")))[1:-2], "")
    return text, files


def _run(
    order: Mapping[str, Any], data: bytes, folder: Path, cancel: Cancel
) -> tuple[Event, dict[str, bytes]]:
    if order["version"] != __version__:
        text = f"this worker has orbiflow {__version__}, not {order['version']}"
        return Failed(text, "mistake"), {}
    last: deque[Event] = deque([Failed("the work ended without a word", "error")], maxlen=1)
    try:
        written, begin = folder / "out", 0
        there = {order["writes"]: str(written)}
        for number, (parameter, name, size) in enumerate(order["reads"]):
            # files of one name may differ
            read = folder / ("in" if number == 0 else f"in-{number + 1}") / name
            read.parent.mkdir()
            read.write_bytes(data[begin : begin + size])
            there[parameter], begin = str(read), begin + size
        call = call_from_json({**order["call"], **there})
        with suppress(Exception):  # the last event says what
            call.run(last.append, cancel)
        return last[0], _packed(written)
    except OSError as error:
        return Failed(f"{type(error).__name__}: {error.strerror or error}", "error"), {}
    except OrbiflowError as error:
        return Failed(str(error), "mistake"), {}


def _packed(folder: Path) -> dict[str, bytes]:
    """Return all files in a folder, if there is one; raise an `OrbiflowError` if they are too large."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    size = sum(path.stat().st_size for path in paths)
    if size > MOST_WRITTEN:
        raise OrbiflowError(
            f"its results are {size / 2**20:.0f} MB, more than the {MOST_WRITTEN / 2**20:.0f} MB that "
            "are sent back; run it by itself"
        )
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}
