"""Where a job's results go, looked at before the work."""

from __future__ import annotations

import os
from pathlib import Path, PurePosixPath

from orbiflow.density import MODEL
from orbiflow.errors import OutputError
from orbiflow.jobs.density_folder import written_files as files_of_a_density
from orbiflow.runtime import LITTER
from orbiflow.tiles import (
    OVERVIEW,
    RESULT,
)
from orbiflow.tiles import (
    written_files as files_of_a_search,
)


def check_place(out: Path, *reads: Path | None) -> None:
    """Nothing, if a file can be written there; a device must not be replaced by one.

    Args:
        out: the file.
        reads: what the job reads, files and folders of runs; None is passed over.

    Raises:
        OutputError: if it is a folder or a device, its folder is not there, or `keep_inputs` or
            `keep_apart` refuses it.
    """
    if out.is_dir():
        raise OutputError(f"cannot write {out}: it is a folder; give a file's name in it")
    if out.exists() and not out.is_file():
        raise OutputError(f"cannot write {out}: it is not a file; choose another name")
    if not out.parent.is_dir():
        raise OutputError(f"cannot write {out}: there is no folder {out.parent}; create it first")
    keep_inputs(out, *reads)
    keep_apart(out, *reads)


def keep_inputs(out: Path, *reads: Path | None) -> None:
    """Nothing, unless a file that is written is one that is read.

    Args:
        out, reads: as in `check_place`.

    Raises:
        OutputError: if it is, by whatever name or link.
    """
    for read in reads:
        if read is not None and any(_same(out, file) for file in _files_read(read)):
            raise OutputError(
                f"cannot write {out}: it would replace what is read: choose another --out"
            )


def check_folder(out: Path, *reads: Path | None, what: str = "file") -> None:
    """Nothing, if a folder can be replaced whole without what is read.

    Args:
        out: the folder.
        reads: as in `check_place`.
        what: they are, in words.

    Raises:
        OutputError: if one of `reads` is the folder or in it, or `keep_apart` refuses it.
    """
    for read in reads:
        if read is not None and _real(read).is_relative_to(_real(out)):
            raise OutputError(
                f"cannot write into {out}: it would replace the {what} that it reads: choose another "
                "--out"
            )
    keep_apart(out, *reads)


def keep_apart(out: Path, *reads: Path | None) -> None:
    """Nothing, unless the folder of a run that is read would no longer be that run's alone.

    The next run into such a folder would refuse it, or take it away for one of its own.

    Args:
        out: what is written; the folder of a run itself is fine.
        reads: as in `check_place`.

    Raises:
        OutputError: if it is inside such a folder.
    """
    # a link is replaced, not followed
    target = _real(out.parent) / out.name
    for read in reads:
        folder = None if read is None else _folder_of_run(read)
        if folder is None or _real(folder) not in target.parents:
            continue
        name = target.relative_to(_real(folder)).as_posix()
        known = _known(folder)
        if name in known:
            raise OutputError(
                f"cannot write {out}: {name} is a file of the run in {folder}, which is read: choose "
                "another --out"
            )
        if _is_of_one_run(folder, known):
            raise OutputError(
                f"cannot write {out}: {folder}, which is read, holds the files of one run alone, and "
                "the next run there would refuse others: choose another --out"
            )


def _files_read(path: Path) -> tuple[Path, ...]:
    return (path / MODEL, path / RESULT) if path.is_dir() else (path,)


def _folder_of_run(read: Path) -> Path | None:
    """The folder that an earlier run wrote, if that or one of its files is read."""
    if read.is_dir():
        return read if _known(read) else None
    return read.parent if read.name in _known(read.parent) else None


def _known(folder: Path) -> set[str]:
    # a result.json alone is somebody's copy
    found = files_of_a_search(folder) if (folder / OVERVIEW).is_file() else set[str]()
    return found | files_of_a_density(folder)


def _is_of_one_run(folder: Path, known: set[str]) -> bool:
    """Whether there is nothing that would be refused already."""
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
