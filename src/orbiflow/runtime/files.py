"""Writing a result so that it is either there whole or not at all."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath
from typing import Any, TypeGuard

from orbiflow.errors import OutputError


def write_atomic(path: str | os.PathLike[str], content: bytes | str) -> Path:
    """Write `content` (text as UTF-8) to `path`, replacing what was there, and return the path.

    The bytes go to a temporary name in the same folder first and are then renamed, so that nobody
    ever sees half a file.

    Raises:
        OutputError: if the folder does not exist or cannot be written, or `path` is a folder, a pipe
            or a device.
    """
    target = Path(path)
    data = content.encode() if isinstance(content, str) else content
    if not target.parent.is_dir():
        raise OutputError(
            f"cannot write {target}: there is no folder {target.parent}; create it first"
        )
    if target.exists() and not target.is_file():
        raise OutputError(f"cannot write {target}: it is not a file; choose another name")
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(4)}.tmp")
    try:
        with temporary.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(target)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise OutputError(
            f"cannot write {target}: {error.strerror or error}; choose another place or free the one"
        ) from error
    return target


def make_folder(path: Path) -> Path:
    """Create a folder (and its parents) that can be written to.

    Raises:
        OutputError: if it cannot be.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe = path / ".orbiflow-write-test"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise OutputError(
            f"cannot write into {path}: {error.strerror or error}; choose another --out"
        ) from error
    return path


def write_set(
    folder: Path, names: Iterable[str], contents: Mapping[str, bytes | str]
) -> list[Path]:
    """Write files that belong together, and take away those of `names` that are not among them.

    Raises:
        OutputError: if the folder does not exist or cannot be written.
    """
    for name in names:
        if name not in contents:
            try:
                (folder / name).unlink(missing_ok=True)
            except OSError as error:
                raise OutputError(
                    f"cannot remove {folder / name}: {error.strerror or error}; it belongs to an "
                    "earlier run"
                ) from error
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

    A folder that is not there yet, is empty, or holds nothing but what an earlier run wrote can be
    had. The results are written beside it and take its place by a rename, so that it holds one run's
    files at any time. Where it cannot be renamed (a mount point, the working directory, a parent that
    cannot be written to) the files themselves are moved in.

    Args:
        path: of the folder.
        known: given the folder, the paths of the files in it that an earlier run wrote, relative and
            with slashes.

    Raises:
        OutputError: if something else is there, by its name, or if it cannot be written to.
    """

    def __init__(self, path: Path, known: Callable[[Path], set[str]]) -> None:
        self.path, self._known = path, known
        try:
            self._real = path.resolve()
            if not self._real.exists():
                self._real.parent.mkdir(parents=True, exist_ok=True)
            elif next(self._real.iterdir(), None) and not os.access(self._real, os.W_OK):
                raise PermissionError(13, "Permission denied")
            self.has_a_run = self._refuse_others()
            self._fixed = self._is_fixed()
            self._new_sibling().rmdir()
        except (OSError, RuntimeError) as error:  # RuntimeError: links in a circle
            raise self._cannot(error) from error

    @contextmanager
    def replaced(self) -> Generator[Path]:
        """Yields an empty folder to write into; afterwards it stands in the place of `path`.

        If the block fails, `path` is left as it was.

        Raises:
            OutputError: if it cannot be put there; the message says where the results are.
        """
        try:
            staged = self._new_sibling()
        except OSError as error:
            raise self._cannot(error) from error
        try:
            yield staged
        except BaseException:
            shutil.rmtree(staged, ignore_errors=True)
            raise
        try:
            self._refuse_others(staged)  # they may have come in the meantime
            self._put(staged)
        except (OSError, OutputError) as error:
            raise OutputError(f"{self._cannot(error)}; the results are in {staged}") from error

    def _refuse_others(self, staged: Path | None = None) -> bool:
        """Whether there is anything.

        Raises:
            OutputError: for what orbiflow did not write.
        """
        if not self._real.exists():
            return False
        entries = [p for p in self._real.iterdir() if p != staged and not _is_litter(p.name)]
        known: set[str] = self._known(self._real) if entries else set()
        above = {str(parent) for name in known for parent in PurePosixPath(name).parents}
        while entries:
            path = entries.pop()
            name = path.relative_to(self._real).as_posix()
            folder = path.is_dir() and not path.is_symlink()
            if name not in (above if folder else known):
                raise OutputError(
                    f"{self.path} holds {name}, which is of no earlier run: choose another "
                    "--out or move it"
                )
            if folder:
                entries += [p for p in path.iterdir() if not _is_litter(p.name)]
        return bool(known)

    def _is_fixed(self) -> bool:
        """Whether the folder must stay where it is, and only its files can be exchanged."""
        if not self._real.exists():
            return False
        above = self._real.parent
        return (
            self._real == above
            or self._real.is_mount()
            or Path.cwd().is_relative_to(self._real)
            or not os.access(above, os.W_OK | os.X_OK)
        )

    def _new_sibling(self) -> Path:
        if self._fixed:
            path = self._real / _temporary()
        else:
            path = self._real.with_name(f".{self._real.name}{_temporary()}")
        path.mkdir()
        return path

    def _put(self, staged: Path) -> None:
        if self._fixed:
            _exchange_files(staged, self._real)
            return
        if not self._real.exists():
            staged.rename(self._real)
            return
        shutil.copymode(self._real, staged)
        aside = self._real.with_name(f".{self._real.name}{_temporary()}")
        self._real.rename(aside)
        try:
            staged.rename(self._real)
        except BaseException:
            aside.rename(self._real)
            raise
        shutil.rmtree(aside, ignore_errors=True)

    def _cannot(self, error: Exception) -> OutputError:
        if isinstance(error, OutputError):
            return error
        why = getattr(error, "strerror", None) or error
        return OutputError(f"cannot write into {self.path}: {why}; choose another --out")


def _temporary() -> str:
    return f".orbiflow-{secrets.token_hex(4)}.tmp"


def _is_litter(name: str) -> bool:
    # what a run left that was killed may go as well
    return name in LITTER or (name.startswith(".orbiflow-") and name.endswith(".tmp"))


def _exchange_files(staged: Path, folder: Path) -> None:
    """Put the files of `staged`, which is in `folder`, in the place of all others there."""
    aside = folder / _temporary()
    aside.mkdir()
    moves = [(p, aside / p.name) for p in folder.iterdir() if p not in (staged, aside)]
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


def is_object(value: object) -> TypeGuard[dict[str, Any]]:
    """Whether it is a JSON object."""
    return isinstance(value, dict)


def is_list(value: object) -> TypeGuard[list[Any]]:
    """Whether it is a JSON list."""
    return isinstance(value, list)
