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
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any, ClassVar, Literal, Protocol, Self, cast, get_args

from filelock import FileLock, Timeout

from orbiflow.errors import OrbiflowError, OutputError, system_errors
from orbiflow.runtime import (
    LITTER,
    ResultFolder,
    csv_bytes,
    is_object,
    make_folder,
    stays_inside,
    write_atomic,
    write_set,
)

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
class BatchKind:
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
    - `second`: The parameter that takes the second file of each pair; "" where items are single files.
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
    second: str = ""


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
class Matrix:
    """A table of what is compared in pairs.

    - `title`: What it shows.
    - `names`: What is compared, in order: the heads of rows and columns.
    - `cells`: For each row, the entry and the text of each cell before the diagonal, if there is one,
      and its share, 0 to 1, of the best.
    """

    title: str
    names: Sequence[str]
    cells: Sequence[Sequence[tuple[Entry, str, float] | None]]


@dataclass(frozen=True)
class ContactSheet:
    """The table of a folder's files, and a page of this title: a card for each, to sort and search.

    The page refers to nothing but files beside it. Pictures are fetched and cards laid out only where
    they are looked at, so thousands are no burden. Without scripts it is in the order of the names.
    """

    journal: ClassVar[str] = "batch.jsonl"
    what: ClassVar[str] = "batch"

    kind: BatchKind
    title: str

    def matrix(self, entries: Sequence[Entry]) -> Matrix | None:  # noqa: ARG002
        """Return a table of all that is compared in pairs, if it is."""
        return None

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
            matrix=self.matrix(entries),
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

    def __init__(self, path: Path, kind: BatchKind, overview: Overview) -> None:
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
                    "another folder"
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
        with system_errors(OutputError, what, "choose another folder"):
            if not self.path.exists() or (self.path / self.overview.journal).exists():
                return
            harmless = (*LITTER, LOCK)
            other = next((p for p in sorted(self.path.iterdir()) if p.name not in harmless), None)
        if other is not None:
            raise OutputError(
                f"{self.path} holds {other.name}, which is of no earlier {self.overview.what}: "
                "choose another folder or move it"
            )


def _write(folder: Path, files: Mapping[str, bytes]) -> None:
    for name, data in files.items():
        path = folder / PurePosixPath(name)
        what, cure = f"cannot write {name} into {folder}", "free the disk or choose another folder"
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
                f"{self.path} is no journal of a batch; move it or choose another folder"
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
