"""What differs between many of one kind and many of another."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Summary = Mapping[str, Any]
"""Of a job's `Finished`."""


@dataclass(frozen=True)
class Column:
    """A figure of the best result.

    - `name`: in the table. `title`: on the page. `form`: of the number there, "" for text.
    - `falling`: whether the best is the largest.
    """

    name: str
    title: str
    form: str = ""
    falling: bool = True

    def shown(self, value: Any) -> str:
        """For a page.

        >>> Column("iou", "IoU", ".3f").shown(0.91234)
        '0.912'
        """
        if value is None:
            return "-"
        return format(value, self.form) if self.form else str(value)


@dataclass(frozen=True, kw_only=True)
class Kind:
    """What is done many times.

    - `things`: that are worked on, in the plural. `items`: what there are so many of, in the plural.
    - `reads`, `writes`: fields of the request of one.
    - `modules`: that the work needs.
    - `columns`: figures of the best result. `best`: these out of a summary, by name.
    - `picture`: path of a picture in a result's folder, out of its summary; None for none.
    - `shows`: what is on it, before "of" and the file's name. `opens`: page in a result's folder that a
      card with a picture opens, "" for the folder.
    - `earlier`: paths of what an earlier run wrote into a folder.
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
    earlier: Callable[[Path], set[str]]


@dataclass(frozen=True, kw_only=True)
class FolderKind(Kind):
    """The same for the files of a folder.

    - `endings`, `most_bytes`: of files that are read.
    """

    endings: Sequence[str]
    most_bytes: int
