"""The files of a batch: which they are, what they are called, what is in them."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from fnmatch import fnmatch
from pathlib import Path, PurePosixPath

from orbiflow.errors import InputFileError

LONGEST_NAME = 80
"""Characters of a result folder's name."""


def listed(folder: Path, endings: Collection[str], match: str | None, out: Path) -> list[str]:
    """Paths of a folder's files that can be read, relative and with slashes, in order.

    Folders in it are searched as well, links to folders are not. What begins with a dot is left out.

    Args:
        folder: to be searched.
        endings: of names, in small letters, such as ".svg".
        match: a pattern that the name, or the path, must fit.
        out: where the results go.

    Raises:
        InputFileError: if it is no folder, cannot be read, holds `out`, or has no such file.
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
    """A name for each path that no other has, capitals or not.

    The path itself without its ending, "cats/tom.png" as "cats-tom"; with its ending where two would
    have the same, with a part of its hash where that is taken, too. Names that were given stay, so
    that files that are added change no other's.

    Args:
        paths: different ones.
        given: names of paths, of an earlier batch.
        reserved: names that no path may have.

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
    """From the best to those that are as good as unique."""
    whole = PurePosixPath(path)
    plain, ending = _plain(str(whole.with_suffix(""))), _plain(whole.suffix[1:])
    yield plain
    yield f"{plain}-{ending}"
    code = hashlib.sha256(path.encode("utf-8", "surrogateescape")).hexdigest()
    for length in range(6, len(code)):
        yield f"{plain}-{code[:length]}"


def _plain(text: str) -> str:
    """Of letters, digits, dots, dashes and underscores; neither empty nor hidden."""
    text = re.sub(r"[^\w.-]+", "-", text.replace("/", "-")).strip("-.")
    return text[:LONGEST_NAME].rstrip("-.") or "file"


def content(path: Path, most: int) -> bytes:
    """A file's bytes.

    Raises:
        InputFileError: if it cannot be read, is empty, or has more bytes than `most`.
    """
    try:
        with path.open("rb") as file:
            data = file.read(most + 1)
    except OSError as error:
        why = error.strerror or error
        raise InputFileError(f"{path.name}: cannot be read ({why}); check it") from error
    if len(data) > most:
        raise InputFileError(
            f"{path.name}: larger than {most / 2**20:.0f} MB, the most that is read; simplify it"
        )
    return data


def code_of(data: bytes) -> str:
    """By which the same bytes are known."""
    return hashlib.sha256(data).hexdigest()
