"""The same for every file of a folder: of a `BatchRequest` and a `DensityBatchRequest`."""

from __future__ import annotations

import time
from collections.abc import Sequence

from orbiflow.jobs.batch.folder import RESERVED, BatchFolder
from orbiflow.jobs.batch.inputs import folder_names, listed
from orbiflow.jobs.batch.items import FileSource, Item
from orbiflow.jobs.batch.kind import FolderKind
from orbiflow.jobs.batch.kinds import DENSITIES, TILES
from orbiflow.jobs.batch.overview import (
    PAGE,
    TABLE,
    ContactSheet,
)
from orbiflow.jobs.batch.work import go_through
from orbiflow.jobs.batch_requests import (
    BatchRequest,
    DensityBatchRequest,
    ManyRequest,
)
from orbiflow.jobs.run import Sink
from orbiflow.runtime import Cancel, Finished


def batch(request: BatchRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Tiles for every silhouette; see `_many`."""
    return _many(request, TILES, f"Tiles of {request.folder.name or 'a folder'}", tell, cancel)


def density_batch(request: DensityBatchRequest, tell: Sink, cancel: Cancel) -> Finished:
    """A density for every table; see `_many`."""
    title = f"Densities of {request.folder.name or 'a folder'}"
    return _many(request, DENSITIES, title, tell, cancel)


def _many(
    request: ManyRequest, kind: FolderKind, title: str, tell: Sink, cancel: Cancel
) -> Finished:
    """Do what has not been done, and put it into the folder as it comes.

    Returns:
        `summary`: `folder`, `table` and `page`; `files`, and how many of them are `done`, gave
        `nothing`, have `failed` or are `left`; how many were `kept` from before; `seconds`.

    Raises:
        OrbiflowError: for anything that the user can mend; what was finished is kept.
    """
    begin = time.perf_counter()
    files = listed(request.folder, kind.endings, request.match, request.out)
    with BatchFolder(request.out, kind, ContactSheet(kind, title)) as folder:
        items = _items(request, kind, files, folder)
        out = f" or that --match {request.match} leaves out" if request.match else ""
        gone = f"of files that are not in {request.folder}{out}"
        outcome = go_through(items, request, folder, tell, cancel, gone=gone)
    summary = {
        "folder": str(request.out),
        "table": str(request.out / TABLE),
        "page": str(request.out / PAGE),
        "files": len(files),
        **outcome.summary(),
        "seconds": time.perf_counter() - begin,
    }
    return Finished(outcome.state, summary)


def _items(
    request: ManyRequest, kind: FolderKind, files: Sequence[str], folder: BatchFolder
) -> list[Item]:
    given = {file: entry.name for file, entry in folder.journal.entries.items()}
    names = folder_names(files, given, RESERVED)
    return [
        Item(
            file,
            names[file],
            request.one(file),
            FileSource(request.folder / file, kind.most_bytes),
        )
        for file in files
    ]
