"""What every request has: fields that are checked, and the version of its layout.

Importing this takes no time: no numerical library.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from orbiflow.runtime import Record, RecordError

SCHEMA_VERSION = 1

TABLES = (".csv", ".tsv", ".txt", ".dat")
"""What names of tables end in. Others may end in anything that is not among these:"""

# fmt: off
NO_TABLES = frozenset((
    ".npy", ".npz", ".parquet", ".feather", ".arrow", ".h5", ".hdf5", ".mat", ".pkl", ".safetensors",
    ".xls", ".xlsx", ".ods", ".json", ".geojson", ".html", ".xml", ".gz", ".bz2", ".xz", ".zst", ".zip",
    ".tar", ".png", ".jpg", ".jpeg", ".gif", ".tif", ".tiff", ".webp", ".svg", ".pdf",
))
# fmt: on


class Request(Record):
    """Base of all requests."""

    def to_json(self) -> dict[str, Any]:
        """An object for `json.dumps`, with the version of its layout.

        >>> from orbiflow.jobs import PatchesRequest
        >>> PatchesRequest(data="patches.csv").to_json()["schema_version"]
        1
        """
        return {"schema_version": SCHEMA_VERSION, **super().to_json()}


def at_least_one(request: Request, name: str) -> None:
    """Raises a `RecordError` if the field is a number below 1."""
    value = getattr(request, name)
    if value is not None and value < 1:
        raise RecordError(f"{{{name}}} must be at least 1, got {value}")


def in_range(request: Request, name: str, low: float, high: float) -> None:
    """Raises a `RecordError` if the field is a number beyond these."""
    value = getattr(request, name)
    if not low <= value <= high:
        raise RecordError(f"{{{name}}} must be from {low:g} to {high:g}, got {value:g}")


def ends_in(out: Path | None, endings: tuple[str, ...]) -> None:
    """Raises a `RecordError` if the file's name has none of these endings."""
    if out is not None and out.suffix.lower() not in endings:
        raise RecordError(f"{{out}} must end in {', '.join(endings)}, got {out.name!r}")


def ends_as_table(out: Path) -> None:
    """Raises a `RecordError` if the file's name is that of another format than text."""
    if out.suffix.lower() in NO_TABLES:
        ends_in(out, TABLES)
