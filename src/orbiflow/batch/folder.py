"""The folder of a batch: a folder for each result, an overview of all, the journal.

The journal has a line of JSON for each item, added when its result has its place. It says what was done
to which bytes, with which settings and version, so that a later batch knows what need not be done
again. A line that was cut short is ignored.
"""

from __future__ import annotations

import io
import json
import os
import time
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext, suppress
from pathlib import Path, PurePosixPath
from typing import Any, Self, cast, get_args

from filelock import FileLock, Timeout

from orbiflow.batch.overview import PAGE, TABLE, ContactSheet, Entry, Kind, Overview, State
from orbiflow.errors import OrbiflowError, OutputError, system_errors
from orbiflow.runtime import (
    LITTER,
    ResultFolder,
    is_object,
    make_folder,
    stays_inside,
    write_atomic,
    write_set,
)

THUMBNAILS, LOCK = "thumbnails", ".batch.lock"
RESERVED = (ContactSheet.journal, TABLE, PAGE, THUMBNAILS, LOCK)
"""Names that no result has."""

THUMBNAIL = (360, 240)
"""Width and height in pixels: half as many again as the page shows."""

MIN_PAUSE_SECONDS, PAUSE_PER_SECOND_OF_WRITING = 1.0, 20.0
"""The least pause before the overview is written again, and how many times the seconds that writing it
took: most of the time is for the work, however many results there are."""


MOST_JOURNAL_BYTES = 2**30
"""The largest size of a journal that is read."""


class BatchFolder:
    """Where the results of a batch go; in a `with` block, no other batch can use it.

    The folder is made if need be, and an earlier batch there is resumed. `keys` are those of the items,
    in the order of the overview; it has only the `current` ones, finished with the present settings.
    """

    def __init__(self, path: Path, kind: Kind, overview: Overview) -> None:
        self.path, self.kind, self.overview = path, kind, overview
        self._check()
        make_folder(path)
        self.journal = Journal(path / overview.journal)
        self.keys: Sequence[str] = ()
        self.current: set[str] = set()
        self._open = ExitStack()
        self._written, self._cost = 0.0, 0.0

    def __enter__(self) -> Self:
        with system_errors(OutputError, f"cannot write into {self.path}"):
            try:
                self._open.enter_context(FileLock(self.path / LOCK, timeout=0))
            except Timeout as error:
                raise OutputError(
                    f"another {self.overview.what} is at work in {self.path}: wait for it or choose "
                    "another --out"
                ) from error
        self.journal = Journal(self.path / self.overview.journal)  # as the last one left it
        self._open.enter_context(self.journal)
        return self

    def __exit__(self, _kind: object, error: BaseException | None, _traceback: object) -> None:
        """Write the overview, whatever has happened."""
        # the first error is the one to be told
        with self._open, suppress(OrbiflowError) if error else nullcontext():
            self.write_all(last=True)

    def keep(self, entry: Entry, files: Mapping[str, bytes], picture: str | None) -> None:
        """Put the files of a result where they belong, and then add it to the journal.

        No files leave what was there; `picture` is the path of the one that the page shows small.
        """
        if files:
            folder = ResultFolder(self.path / entry.name, self.kind.written)
            with folder.replaced() as staged:
                _write(staged, files)
        thumbnail = self.path / THUMBNAILS / f"{entry.name}.png"
        if picture is not None and picture in files:
            make_folder(thumbnail.parent)
            write_atomic(thumbnail, _small(files[picture]))
        elif files:
            thumbnail.unlink(missing_ok=True)
        self.journal.add(entry)
        self.current.add(entry.file)
        now = time.monotonic()
        if now - self._written > max(MIN_PAUSE_SECONDS, PAUSE_PER_SECOND_OF_WRITING * self._cost):
            self.write_all()

    def write_all(self, *, last: bool = False) -> None:
        """Write the overview of all `keys` that are `current`."""
        begin = time.monotonic()
        entries = [self.journal.entries[key] for key in self.keys if key in self.current]
        pictures = frozenset(path.stem for path in (self.path / THUMBNAILS).glob("*.png"))
        waiting = len(self.keys) - len(entries)
        files = self.overview.files(entries, waiting, pictures, last=last)
        gone = [name for name, data in files.items() if data is None]
        write_set(self.path, gone, {name: data for name, data in files.items() if data is not None})
        self._written = time.monotonic()
        self._cost = self._written - begin

    def _check(self) -> None:
        """Raise an `OutputError` for a folder that holds something other than a batch."""
        what = f"cannot write into {self.path}"
        with system_errors(OutputError, what, "choose another --out"):
            if not self.path.exists() or (self.path / self.overview.journal).exists():
                return
            known = (*LITTER, LOCK)
            found = next((p for p in sorted(self.path.iterdir()) if p.name not in known), None)
        if found is not None:
            raise OutputError(
                f"{self.path} holds {found.name}, which is of no earlier {self.overview.what}: "
                "choose another --out or move it"
            )


def _write(folder: Path, files: Mapping[str, bytes]) -> None:
    for name, data in files.items():
        path = folder / PurePosixPath(name)
        what, cure = f"cannot write {name} into {folder}", "free the disk or choose another --out"
        with system_errors(OutputError, what, cure):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)


def _small(picture: bytes) -> bytes:
    """A PNG that is small in pixels and bytes."""
    from PIL import Image, ImageOps

    from orbiflow.drawing import png_bytes

    with Image.open(io.BytesIO(picture)) as image:
        small = ImageOps.fit(image.convert("RGB"), THUMBNAIL, Image.Resampling.BOX)
        return png_bytes(small.quantize(64, dither=Image.Dither.NONE), optimize=True)


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
            if self.path.stat().st_size > MOST_JOURNAL_BYTES:
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
