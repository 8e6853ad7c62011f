"""The items of a batch: which files there are, what their results are called, what is done to each."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path, PurePosixPath
from typing import Any

from orbiflow.batch.overview import Kind
from orbiflow.errors import InputFileError, system_errors
from orbiflow.runtime import Call

LONGEST_NAME = 80
"""The number of characters that the name of a result's folder may have."""

NO_RESULT = ("workers", "called", "shown_out", "verbose")
"""Parameters of a call that do not change its result."""


def read_file(path: Path, most: int) -> bytes:
    """Return the content of a file of at most so many bytes."""
    system = system_errors(InputFileError, f"{path.name}: cannot be read", "check it")
    with system, path.open("rb") as file:
        data = file.read(most + 1)
    if len(data) > most:
        raise InputFileError(
            f"{path.name}: larger than {most / 2**20:.0f} MB, the most that is read; simplify it"
        )
    return data


@dataclass(frozen=True)
class Item:
    """One of many calls that a batch makes.

    - `key`: What the journal knows it by; for a file, its path in the folder of files.
    - `name`: The name of its folder among the results, with slashes.
    - `call`: The call; the file that it reads and the folder that it writes are set where it runs.
    - `read`: Returns the bytes of the file, or raises an `OrbiflowError`; called when somebody is free
      for them.
    """

    key: str
    name: str
    call: Call
    read: Callable[[], bytes]

    def settings(self, kind: Kind) -> dict[str, Any]:
        """Return what decides the result besides the bytes and their name, as JSON has it."""
        flat = self.call.flat
        return {
            field.name: field.kind.plain(flat[field.name])
            for field in self.call.operation.fields
            if field.name not in (kind.reads, kind.writes, *NO_RESULT)
        }


def listed(folder: Path, endings: Collection[str], match: str | None, out: Path) -> list[str]:
    """Return the paths of a folder's files with some `endings`, relative and with slashes, in order.

    Folders inside are searched as well, links to folders are not. Names that begin with a dot are left
    out, and those that do not fit the pattern `match`. The results must go to an `out` elsewhere.
    """
    if not folder.is_dir():
        why = "it is a file" if folder.exists() else "there is no such folder"
        raise InputFileError(f"{folder}: {why}; give a folder of files")
    if out.resolve().is_relative_to(folder.resolve()):
        raise InputFileError(
            f"{out} is inside {folder}, whose files are read: choose an --out somewhere else"
        )
    names = sorted(name for name in _files(folder) if PurePosixPath(name).suffix.lower() in endings)
    if not names:
        raise InputFileError(
            f"{folder}: no file to read; wanted are names that end in {', '.join(endings)}"
        )
    if match is None:
        return names
    fitting = [n for n in names if fnmatch(n, match) or fnmatch(PurePosixPath(n).name, match)]
    if not fitting:
        raise InputFileError(
            f"{folder}: none of its {len(names)} files fits the pattern {match!r}; {names[0]} is one"
        )
    return fitting


def _files(folder: Path) -> Iterator[str]:
    def refuse(error: OSError) -> None:
        raise InputFileError(
            f"{error.filename}: cannot be read ({error.strerror}); check its permissions"
        ) from error

    for above, inside, names in os.walk(folder, onerror=refuse):
        inside[:] = [name for name in inside if not name.startswith(".")]
        for name in names:
            if not name.startswith("."):
                yield (Path(above) / name).relative_to(folder).as_posix()


def folder_names(
    paths: Iterable[str], given: Mapping[str, str], reserved: Collection[str] = ()
) -> dict[str, str]:
    """Return a name for each path that no other has, whether capitals count or not.

    The name is the path without its ending, such as "cats-tom" for "cats/tom.png". If two would have
    the same, it has the ending or a part of its hash, too. Names that were given before stay, so that
    added files change no other's.

    Args:
        paths: Different paths.
        given: Names of paths in an earlier batch.
        reserved: Names that no path may have.

    >>> folder_names(["cats/tom.png", "tom.png", "tom.svg"], {})
    {'cats/tom.png': 'cats-tom', 'tom.png': 'tom', 'tom.svg': 'tom-svg'}
    """
    names = {path: given[path] for path in paths if path in given}
    # those of files that are not there now are kept for them
    taken = {name.casefold() for name in (*given.values(), *reserved)}
    for path in paths:
        if path in names:
            continue
        names[path] = next(name for name in _names(path) if name.casefold() not in taken)
        taken.add(names[path].casefold())
    return names


def _names(path: str) -> Iterator[str]:
    """Possible names, from the best to those that are as good as unique."""
    whole = PurePosixPath(path)
    plain, ending = _plain(str(whole.with_suffix(""))), _plain(whole.suffix[1:])
    yield plain
    yield f"{plain}-{ending}"
    code = hashlib.sha256(path.encode("utf-8", "surrogateescape")).hexdigest()
    for length in range(6, len(code)):
        yield f"{plain}-{code[:length]}"


def _plain(text: str) -> str:
    """A name of letters, digits, dots, dashes and underscores, neither empty nor hidden."""
    text = re.sub(r"[^\w.-]+", "-", text.replace("/", "-")).strip("-.")
    return text[:LONGEST_NAME].rstrip("-.") or "file"


def code_of(data: bytes) -> str:
    """Return what the same bytes are known by."""
    return hashlib.sha256(data).hexdigest()
