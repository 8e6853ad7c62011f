"""The table of a batch: `batch.csv`."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable
from typing import Any

from orbiflow.jobs.batch.journal import Entry
from orbiflow.jobs.batch.kind import Kind


def table(entries: Iterable[Entry], kind: Kind) -> bytes:
    """A line for each file, in their order, as UTF-8.

    Numbers are written so that they can be read back exactly; the cell of what there is not is empty.
    """
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    names = [column.name for column in kind.columns]
    writer.writerow(
        ["file", "state", *names, "seconds", "error", "folder", "sha256", "settings", "version"]
    )
    for entry in entries:
        figures = [_cell(entry.best.get(name)) for name in names]
        asked = {
            name: value
            for name, value in entry.settings.items()
            if value is not None and value is not False
        }
        settings = json.dumps(asked, separators=(",", ":"), sort_keys=True)
        seconds = "" if entry.seconds is None else f"{entry.seconds:.3f}"
        head, tail = [entry.file, entry.state], [entry.code, settings, entry.version]
        folder = "" if entry.state == "failed" else entry.name
        writer.writerow([*head, *figures, seconds, entry.reason, folder, *tail])
    return text.getvalue().encode("utf-8", "replace")


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return repr(value) if isinstance(value, float) else str(value)
