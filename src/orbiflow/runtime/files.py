"""Where results go: checked before the work, and written whole or not at all."""

from __future__ import annotations

import errno
import json
import os
import secrets
import shutil
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path, PurePosixPath
from typing import Any, TypeGuard

from orbiflow.errors import InputFileError, OutputError, system_errors
from orbiflow.settings import described


def write_atomic(path: str | os.PathLike[str], content: bytes | str) -> Path:
    """Write `content` (text as UTF-8) to `path`, replacing what was there, and return the path.

    The bytes go to a temporary name in the same folder first and are then renamed, so that nobody
    ever sees half a file.

    Raises:
        OutputError: If the folder does not exist or cannot be written, or `path` is a folder, a pipe
            or a device.
    """
    target = Path(path)
    data = content.encode() if isinstance(content, str) else content
    _check_replaceable(target)
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(4)}.tmp")
    with system_errors(
        OutputError, f"cannot write {target}", "choose another place or free the one"
    ):
        try:
            with temporary.open("xb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(target)
        except OSError:
            temporary.unlink(missing_ok=True)
            raise
    return target


def _check_replaceable(path: Path) -> None:
    """Check that there is a folder for a file, and nothing else under its name."""
    if path.exists() and not path.is_file():
        raise OutputError(f"cannot write {path}: it is not a file; choose another name")
    if not path.parent.is_dir():
        raise OutputError(f"cannot write {path}: there is no folder {path.parent}; create it first")


def make_folder(path: Path, cure: str = "choose another folder") -> Path:
    """Create a folder (and its parents) that can be written to, or raise an `OutputError`."""
    with system_errors(OutputError, f"cannot write into {path}", cure):
        path.mkdir(parents=True, exist_ok=True)
        probe = path / ".orbiflow-write-test"
        probe.touch()
        probe.unlink()
    return path


def write_set(
    folder: Path, names: Iterable[str], contents: Mapping[str, bytes | str]
) -> list[Path]:
    """Write files that belong together, and remove those of `names` that are not among them."""
    for name in names:
        if name not in contents:
            what = f"cannot remove {folder / name}"
            with system_errors(OutputError, what, "it belongs to an earlier run"):
                (folder / name).unlink(missing_ok=True)
    return [write_atomic(folder / name, content) for name, content in contents.items()]


def stays_inside(name: str) -> bool:
    """Whether a name that somebody else chose, with slashes, is of something in a folder.

    >>> stays_inside("folds/one"), stays_inside("../up"), stays_inside("/etc"), stays_inside("")
    (True, False, False, False)
    """
    path = PurePosixPath(name)
    return (
        bool(path.parts) and not path.is_absolute() and ".." not in path.parts and "\\" not in name
    )


LITTER = frozenset({".DS_Store", "Thumbs.db", "desktop.ini"})
"""What file managers leave in folders that people look at."""


class ResultFolder:
    """Where a run's results go, checked before the work.

    The folder must not be there yet, be empty, or hold nothing but what an earlier run wrote. Results
    are written beside it, or into a hidden folder in it, and are moved to their places once all are
    there, so that it holds one run's files at any time.

    Args:
        path: The folder.
        known: A function that returns the paths of the files in the folder that an earlier run wrote,
            relative and with slashes.

    Raises:
        OutputError: If something else is there, by its name, or if it cannot be written to.
    """

    def __init__(self, path: Path, known: Callable[[Path], set[str]]) -> None:
        self.path, self._known = path, known
        try:
            self._real = path.resolve()
            if self._real.is_symlink():  # what newer Pythons leave of links in a circle
                raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
            if not self._real.exists():
                self._real.parent.mkdir(parents=True, exist_ok=True)
            elif next(self._real.iterdir(), None) and not os.access(self._real, os.W_OK):
                raise PermissionError(13, "Permission denied")
            self.has_a_run = self._refuse_others()
            self._new_folder().rmdir()
        except (OSError, RuntimeError) as error:  # RuntimeError: links in a circle
            raise self._cannot(error) from error

    @contextmanager
    def replaced(self) -> Generator[Path]:
        """Yield an empty folder to write into; afterwards it stands in the place of `path`.

        If the block fails, `path` is left as it was. If the folder cannot be put there, an
        `OutputError` says where the results are.
        """
        try:
            staged = self._new_folder()
        except OSError as error:
            raise self._cannot(error) from error
        try:
            yield staged
        except BaseException:
            shutil.rmtree(staged, ignore_errors=True)
            raise
        try:
            self._refuse_others(staged)  # they may have come in the meantime
            if self._real.exists():
                _exchange_files(staged, self._real)
            else:
                staged.rename(self._real)
        except (OSError, OutputError) as error:
            raise OutputError(f"{self._cannot(error)}; the results are in {staged}") from error

    def _refuse_others(self, staged: Path | None = None) -> bool:
        """Return whether an earlier run is there; raise an `OutputError` for anything else."""
        if not self._real.exists():
            return False
        entries = [p for p in self._real.iterdir() if p != staged and not _is_litter(p.name)]
        earlier: set[str] = self._known(self._real) if entries else set()
        above = {str(parent) for name in earlier for parent in PurePosixPath(name).parents}
        while entries:
            path = entries.pop()
            name = path.relative_to(self._real).as_posix()
            folder = path.is_dir() and not path.is_symlink()
            if name not in (above if folder else earlier):
                raise OutputError(
                    f"{self.path} holds {name}, which is of no earlier run: choose another "
                    "folder or move it"
                )
            if folder:
                entries += [p for p in path.iterdir() if not _is_litter(p.name)]
        return bool(earlier)

    def _new_folder(self) -> Path:
        folder = self._real
        there = folder.exists()
        path = folder / _temporary() if there else folder.with_name(f".{folder.name}{_temporary()}")
        path.mkdir()
        return path

    def _cannot(self, error: Exception) -> OutputError:
        if isinstance(error, OutputError):
            return error
        why = getattr(error, "strerror", None) or error
        return OutputError(f"cannot write into {self.path}: {why}; choose another folder")


def _temporary() -> str:
    return f".orbiflow-{secrets.token_hex(4)}.tmp"


def _is_temporary(name: str) -> bool:
    return name.startswith(".orbiflow-") and name.endswith(".tmp")


def _is_litter(name: str) -> bool:
    return name in LITTER or _is_temporary(name)


def _exchange_files(staged: Path, folder: Path) -> None:
    """Put the files of `staged` in the place of those in a folder, but for other runs' hidden ones."""
    aside = folder / _temporary()
    aside.mkdir()
    moves = [(p, aside / p.name) for p in folder.iterdir() if not _is_temporary(p.name)]
    moves += [(p, folder / p.name) for p in staged.iterdir()]
    done: list[tuple[Path, Path]] = []
    try:
        for old, new in moves:
            old.rename(new)
            done.append((old, new))
    except BaseException:
        for old, new in reversed(done):
            with suppress(OSError):
                new.rename(old)
        aside.rmdir()
        raise
    shutil.rmtree(aside, ignore_errors=True)
    staged.rmdir()


MAX_JSON_BYTES = 256 * 2**20
"""The largest file of JSON that is read."""


def write_json(path: str | os.PathLike[str], document: Mapping[str, Any]) -> Path:
    """Write a JSON object to `path` as `write_atomic` does, and return the path."""
    return write_atomic(path, json.dumps(document, allow_nan=False))


def read_json(file: Path, what: str) -> dict[str, Any]:
    """Return the JSON object in a file that is to hold `what`, such as "a report".

    Raises:
        InputFileError: If the file cannot be read, is too large, or holds none.
    """
    with system_errors(InputFileError, f"{file}: cannot be read"):
        if file.stat().st_size > MAX_JSON_BYTES:
            raise InputFileError(f"{file}: too large for {what}")
        text = file.read_bytes()
    try:
        document: object = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputFileError(f"{file}: not JSON: {error}") from error
    if not is_object(document):
        raise InputFileError(f"{file}: not {what}: {described(document)} instead of an object")
    return document


def is_object(value: object) -> TypeGuard[dict[str, Any]]:
    """Whether it is a JSON object."""
    return isinstance(value, dict)


def is_list(value: object) -> TypeGuard[list[Any]]:
    """Whether it is a JSON list."""
    return isinstance(value, list)


def check_output_file(out: Path, *reads: Path | None) -> None:
    """Check that a file can be written where nothing that is read would be replaced.

    `reads` are the files and folders of runs that the operation reads; None is passed over. Nor may the
    file lie in the folder of a run that is read.
    """
    if out.is_dir():
        raise OutputError(f"cannot write {out}: it is a folder; give a file's name in it")
    _check_replaceable(out)
    check_inputs_kept(out, *reads)
    check_outside_runs(out, *reads)


def check_output_folder(out: Path, *reads: Path | None, what: str = "file") -> None:
    """Check that a folder can be replaced whole, without anything of `reads`, which are `what`."""
    for read in filter(None, reads):
        if _real(read).is_relative_to(_real(out)):
            raise OutputError(
                f"cannot write into {out}: it would replace the {what} that it reads: choose another "
                "folder"
            )
    check_outside_runs(out, *reads)


def check_inputs_kept(out: Path, *reads: Path | None) -> None:
    """Check that a file that will be written is none that is read, by whatever name or link."""
    from orbiflow.settings import RUN_FOLDERS

    for read in filter(None, reads):
        files = [read / name for name in RUN_FOLDERS] if read.is_dir() else [read]
        if any(_same(out, file) for file in files):
            raise OutputError(
                f"cannot write {out}: it would replace what is read: choose another file"
            )


def check_outside_runs(out: Path, *reads: Path | None) -> None:
    """Check that nothing is written into the folder of a run that is read; `out` may be the folder.

    The next run into such a folder would refuse the file, or replace it.
    """
    # a link is replaced, not followed
    target = _real(out.parent) / out.name
    for read in filter(None, reads):
        folder, files = _run_around(read)
        if not files or _real(folder) not in target.parents:
            continue
        name = target.relative_to(_real(folder)).as_posix()
        if name in files:
            raise OutputError(
                f"cannot write {out}: {name} is a file of the run in {folder}, which is read: choose "
                "another place"
            )
        if _holds_one_run(folder, files):
            raise OutputError(
                f"cannot write {out}: {folder}, which is read, holds the files of one run alone, and "
                "the next run there would refuse others: choose another place"
            )


def _run_around(read: Path) -> tuple[Path, set[str]]:
    """Return the folder of the run that is read, or that it is part of, and its files, if any."""
    if read.is_dir() and (files := _files_of_run(read)):
        return read, files
    whole = _real(read) if read.is_dir() else read
    files = _files_of_run(whole.parent)
    is_part = any(name == whole.name or name.startswith(f"{whole.name}/") for name in files)
    return whole.parent, files if is_part else set()


def _files_of_run(folder: Path) -> set[str]:
    """Return the files of earlier runs in a folder; the file that is read, alone, is a copy."""
    from orbiflow.settings import RUN_FOLDERS

    files: set[str] = set()
    for read, place in RUN_FOLDERS.items():
        if (folder / read).is_file():
            module, name = place.split(":")
            names: set[str] = getattr(import_module(module), name)(folder)
            if any((folder / name).is_file() for name in names if name != read):
                files |= names
    return files


def _holds_one_run(folder: Path, files: set[str]) -> bool:
    """Whether a folder holds nothing that the next run would refuse already."""
    ours = {PurePosixPath(name).parts[0] for name in files} | LITTER
    try:
        return all(path.name in ours for path in folder.iterdir())
    except OSError:  # its files may be read where its names may not
        return True


def _same(path: Path, other: Path) -> bool:
    return _real(path) == _real(other) or (
        path.exists() and other.exists() and path.samefile(other)  # another link, or capitals
    )


def _real(path: Path) -> Path:
    return Path(os.path.realpath(path))  # unlike `resolve`, no error for links in a circle
