"""A progress bar for searches; a line a class where there is no terminal."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from orbiflow.cli.console import output
from orbiflow.escher.result import TileResult
from orbiflow.escher.search import Event, Watcher


@contextmanager
def watched(names: Sequence[str]) -> Iterator[Watcher]:
    """Show the work on the classes `names`; yields what takes the events."""
    shares = dict.fromkeys(names, 0.0)
    best: list[TileResult] = []
    columns = (
        TextColumn("fitting"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[best]}"),
    )
    # no thread that refreshes: workers are forked from a process with one thread
    with Progress(*columns, console=output, transient=True, auto_refresh=False) as progress:
        task = progress.add_task("fitting", total=float(len(names)), best="")
        begin = time.perf_counter()

        def watch(event: Event) -> None:
            shares[event.name] = max(shares[event.name], event.share)
            if event.preview is not None:
                best.append(event.preview)
                output.print(
                    f"  first tile after {time.perf_counter() - begin:.1f} s: {event.name}, "
                    f"IoU {event.preview.metrics.iou:.4f}, certified",
                    highlight=False,
                )
            if isinstance(event.outcome, TileResult):
                best.append(event.outcome)
                best.sort(key=lambda r: -r.metrics.iou)
                output.print(
                    f"  {event.name}: IoU {event.outcome.metrics.iou:.4f}", highlight=False
                )
            text = f"best {best[0].metrics.iou:.4f} ({best[0].name})" if best else ""
            progress.update(task, completed=sum(shares.values()), best=text, refresh=True)

        yield watch
