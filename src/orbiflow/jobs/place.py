"""Where a job's one file goes, looked at before the work."""

from __future__ import annotations

from pathlib import Path

from orbiflow.errors import OutputError

NOT_TEXT = frozenset(
    {
        ".npy",
        ".npz",
        ".parquet",
        ".feather",
        ".mat",
        ".xls",
        ".xlsx",
        ".ods",
        ".json",
        ".pdf",
        ".png",
        ".svg",
        ".html",
        ".safetensors",
    }
)
"""Endings of names of other files than tables in text."""


def check_place(out: Path) -> None:
    """Nothing, if a file can be written there; a device must not be replaced by one.

    Raises:
        OutputError: if it is a folder or a device, or its folder is not there.
    """
    if out.is_dir():
        raise OutputError(f"cannot write {out}: it is a folder; give a file's name in it")
    if out.exists() and not out.is_file():
        raise OutputError(f"cannot write {out}: it is not a file; choose another name")
    if not out.parent.is_dir():
        raise OutputError(f"cannot write {out}: there is no folder {out.parent}; create it first")


def check_text(out: Path) -> None:
    """As `check_place`, of a table that is written as text, whose name must not say otherwise.

    Raises:
        OutputError: as `check_place`, and for a name like that of another kind of file.
    """
    if out.suffix.lower() in NOT_TEXT:
        raise OutputError(
            f"cannot write {out}: tables are written as text, and nothing would read it by this name: "
            "choose one that ends in .csv"
        )
    check_place(out)
