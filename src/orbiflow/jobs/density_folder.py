"""The folder of a density, as a fit and the jobs on its model leave it."""

from __future__ import annotations

import json
from pathlib import Path

from orbiflow.density import (
    MODEL,
    PICTURES,
    REPORT,
    TABLE,
    THUMBNAIL,
)


def written_files(folder: Path) -> set[str]:
    """What an earlier fit wrote into the folder, and pictures of its model."""
    try:
        document = json.loads((folder / REPORT).read_text(encoding="utf-8"))
        ours = "space" in document and "report" in document
    except (OSError, ValueError, TypeError, RecursionError):
        ours = False
    return {MODEL, REPORT, TABLE, THUMBNAIL, *PICTURES} if ours else set()
