"""Where results go, checked before the work: nothing that is read is replaced."""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib import import_module
from pathlib import Path, PurePosixPath

from orbiflow.errors import OutputError
from orbiflow.runtime.files import LITTER


def check_output_file(out: Path, *reads: Path | None) -> None:
    """Check that a file can be written; a device must not be replaced by one.

    Args:
        out: The file.
        reads: What the operation reads: files, and folders of runs. None is passed over.
    """
    if out.is_dir():
        raise OutputError(f"cannot write {out}: it is a folder; give a file's name in it")
    if out.exists() and not out.is_file():
        raise OutputError(f"cannot write {out}: it is not a file; choose another name")
    if not out.parent.is_dir():
        raise OutputError(f"cannot write {out}: there is no folder {out.parent}; create it first")
    check_inputs_kept(out, *reads)
    check_outside_runs(out, *reads)


def check_output_folder(out: Path, *reads: Path | None, what: str = "file") -> None:
    """Check that a folder can be replaced whole, without anything that is read.

    Args:
        out: The folder.
        reads: As in `check_output_file`.
        what: What they are, for the message.
    """
    for read in reads:
        if read is not None and _real(read).is_relative_to(_real(out)):
            raise OutputError(
                f"cannot write into {out}: it would replace the {what} that it reads: choose another "
                "--out"
            )
    check_outside_runs(out, *reads)


def check_inputs_kept(out: Path, *reads: Path | None) -> None:
    """Check that a file that will be written is none that is read, by whatever name or link."""
    for read in reads:
        if read is not None and any(_same(out, file) for file in _files_read(read)):
            raise OutputError(
                f"cannot write {out}: it would replace what is read: choose another --out"
            )


def check_outside_runs(out: Path, *reads: Path | None) -> None:
    """Check that nothing is written into the folder of a run that is read; `out` may be the folder.

    The next run into such a folder would refuse the file, or replace it.
    """
    # a link is replaced, not followed
    target = _real(out.parent) / out.name
    for read in reads:
        folder = None if read is None else _folder_of_run(read)
        if folder is None or _real(folder) not in target.parents:
            continue
        name = target.relative_to(_real(folder)).as_posix()
        known = _files_of_run(folder)
        if name in known:
            raise OutputError(
                f"cannot write {out}: {name} is a file of the run in {folder}, which is read: choose "
                "another --out"
            )
        if _holds_one_run(folder, known):
            raise OutputError(
                f"cannot write {out}: {folder}, which is read, holds the files of one run alone, and "
                "the next run there would refuse others: choose another --out"
            )


def _files_read(path: Path) -> tuple[Path, ...]:
    from orbiflow.operations import RUN_FOLDERS

    return tuple(path / name for name in RUN_FOLDERS) if path.is_dir() else (path,)


def _folder_of_run(read: Path) -> Path | None:
    """The folder that an earlier run wrote, if that or one of its files is read."""
    if read.is_dir():
        return read if _files_of_run(read) else None
    return read.parent if read.name in _files_of_run(read.parent) else None


def _files_of_run(folder: Path) -> set[str]:
    """The files of earlier runs in a folder; the file that is read, alone, is somebody's copy."""
    from orbiflow.operations import RUN_FOLDERS

    found: set[str] = set()
    for read, place in RUN_FOLDERS.items():
        if (folder / read).is_file():
            names = _function(place)(folder)
            if any((folder / name).is_file() for name in names if name != read):
                found |= names
    return found


def _function(place: str) -> Callable[[Path], set[str]]:
    module, name = place.split(":")
    return getattr(import_module(module), name)


def _holds_one_run(folder: Path, known: set[str]) -> bool:
    """Whether a folder holds nothing that the next run would refuse already."""
    ours = {PurePosixPath(name).parts[0] for name in known} | LITTER
    try:
        return all(path.name in ours for path in folder.iterdir())
    except OSError:  # its files may be read where its names may not
        return True


def _same(one: Path, other: Path) -> bool:
    return _real(one) == _real(other) or (
        one.exists() and other.exists() and one.samefile(other)  # another link, or capitals
    )


def _real(path: Path) -> Path:
    return Path(os.path.realpath(path))  # unlike `resolve`, no error for links in a circle
