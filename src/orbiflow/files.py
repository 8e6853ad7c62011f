"""Writing a result so that it is either there whole or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterable, Mapping
from pathlib import Path

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
