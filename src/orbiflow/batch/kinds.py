"""What differs between one kind of batch and another."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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


@dataclass(frozen=True, kw_only=True)
class Kind:
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


@dataclass(frozen=True, kw_only=True)
class FolderKind(Kind):
    """The same for all files of a folder.

    - `endings`, `most_bytes`: The endings and the largest size of files that are read.
    """

    endings: Sequence[str]
    most_bytes: int
