"""What differs between batches of silhouettes and of tables."""

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


@dataclass(frozen=True)
class Kind:
    """A batch's kind.

    - `things`: what the files hold, in the plural. `endings`, `most_bytes`: of files that are read.
    - `reads`, `writes`: fields of the request of one file.
    - `modules`: that the work needs.
    - `columns`: figures of the best result. `best`: these out of a summary, by name.
    - `picture`: path of a picture in a result's folder, out of its summary; None for none.
    - `earlier`: paths of what an earlier run wrote into a folder.
    """

    things: str
    endings: Sequence[str]
    most_bytes: int
    reads: str
    writes: str
    modules: Sequence[str]
    columns: Sequence[Column]
    best: Callable[[Summary], dict[str, Any]]
    picture: Callable[[Summary], str | None]
    earlier: Callable[[Path], set[str]]


def _best_tile(summary: Summary) -> dict[str, Any]:
    tiles = summary["tiles"]
    names = ("class", "score", "iou", "deformation", "recognised", "certified")
    return {name: tiles[0][name] for name in names} if tiles else {}


def _tiling(summary: Summary) -> str | None:
    tiles = summary["tiles"]
    return f"{tiles[0]['class']}/tiling.png" if tiles else None


def _files_of_a_search(folder: Path) -> set[str]:
    from orbiflow.export.gallery import written_files

    return written_files(folder)


TILES = Kind(
    things="silhouettes",
    endings=(".png", ".jpg", ".jpeg", ".webp", ".svg", ".json", ".geojson", ".dat"),
    most_bytes=64 * 2**20,
    reads="image",
    writes="out",
    modules=("orbiflow.jobs.escherize",),
    columns=(
        Column("class", "class"),
        Column("score", "score", ".3f"),
        Column("iou", "IoU", ".3f"),
        Column("deformation", "bent", ".3f", falling=False),
        Column("recognised", "recognised", ".3f"),
        Column("certified", "certified"),
    ),
    best=_best_tile,
    picture=_tiling,
    earlier=_files_of_a_search,
)


def _fit(summary: Summary) -> dict[str, Any]:
    likelihood = summary["log_likelihood"]
    gain = likelihood["natural"] - likelihood["uniform"]
    return {
        "rows": summary["rows"],
        "log_likelihood": likelihood["natural"],
        "gain": gain,
        "held_out": likelihood["square_validation"],
    }


DENSITIES = Kind(
    things="tables",
    endings=(".csv", ".tsv", ".txt", ".npy", ".parquet"),
    most_bytes=256 * 2**20,
    reads="data",
    writes="out",
    modules=("orbiflow.jobs.density_fit",),
    columns=(
        Column("rows", "rows", "d"),
        Column("log_likelihood", "mean log density", ".4f"),
        Column("gain", "more than uniform", ".4f"),
        Column("held_out", "held out, on the square", ".4f"),
    ),
    best=_fit,
    picture=lambda _summary: None,
    earlier=lambda folder: (
        {"density.safetensors", "report.json"} if (folder / "report.json").is_file() else set()
    ),
)
