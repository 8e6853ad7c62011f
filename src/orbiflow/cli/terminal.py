"""A job's events in words, with a bar where there is a terminal."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar
from rich.table import Table

from orbiflow.cli.console import errors, output
from orbiflow.jobs import (
    Event,
    Finished,
    ItemDone,
    Note,
    Preview,
    Progress,
    Started,
    TileFound,
)

INTERRUPTED = "interrupted"
BATCHES = ("batch", "density-batch", "density-cv")
FORKING = ("escherize", *BATCHES)
"""Jobs that start processes."""


class Terminal:
    """A sink. To be used in a `with` block: the bar must not outlive an error."""

    def __init__(self) -> None:
        self.job = ""
        self.bar: _Bar | None = None

    def __enter__(self) -> Terminal:
        return self

    def __exit__(self, *_: object) -> None:
        self._end_bar()

    def __call__(self, event: Event) -> None:
        """Show an event."""
        match event:
            case Started():
                self.job = event.operation
            case Progress():
                if self.bar is None:
                    self.bar = _Bar(search=self.job == "escherize", forks=self.job in FORKING)
                self.bar.update(event)
            case Note():
                self._end_bar()  # they come before the work and after it
                _say(event.text)
            case Preview():
                self._best(event)
                _say(
                    f"first tile after {event.seconds:.1f} s: {event.class_name}, "
                    f"IoU {event.iou:.4f}, certified"
                )
            case TileFound():
                self._best(event)
                _say(f"{event.class_name}: IoU {event.iou:.4f}")
            case ItemDone():
                failed = "" if event.state == "done" else f"{event.state}: "
                _say(f"{event.name}: {failed}{event.what}")
            case Finished():
                self._end_bar()
                if self.job == "escherize":
                    _show_tiles(event)
                elif self.job == "classes":
                    _show_classes(event)
                elif self.job in BATCHES:
                    _show_batch(event)
            case _:
                pass  # the rest is for programs

    def _best(self, event: Preview | TileFound) -> None:
        if self.bar is not None:
            self.bar.best = max(self.bar.best, (event.iou, event.class_name))

    def _end_bar(self) -> None:
        if self.bar is not None:
            self.bar.progress.stop()
            self.bar = None


class _Bar:
    """How far a job is, gone when it is done."""

    def __init__(self, *, search: bool, forks: bool) -> None:
        self.forks = forks
        self.best: tuple[float, str] = (0.0, "")
        columns = [BarColumn(), TaskProgressColumn(), TimeElapsedColumn()]
        text = TextColumn("{task.description}")
        # no thread that refreshes: workers are forked from a process with one thread
        self.progress = Bar(
            *([text] if search else []),
            *columns,
            TextColumn("{task.fields[best]}") if search else text,
            console=output,
            transient=True,
            auto_refresh=not forks,
        )
        self.task = self.progress.add_task("", total=1.0, best="")
        self.progress.start()

    def update(self, event: Progress) -> None:
        iou, name = self.best
        self.progress.update(
            self.task,
            completed=event.share,
            description=event.what,
            best=f"best {iou:.4f} ({name})" if name else "",
            refresh=self.forks,
        )


def _say(text: str) -> None:
    output.print(f"  {text}", highlight=False, soft_wrap=True, markup=False)


def _show_batch(event: Finished) -> None:
    """What came of many, and how to go on."""
    summary = event.summary
    count = summary["files"] if "files" in summary else summary["fits"]
    shown = [f"{summary['done']} of {count} done"]
    if summary["kept"] == count:
        shown = ["nothing was left to do"]
    without = summary["failed"] + summary["nothing"]
    output.print(
        f"{', '.join(shown)}, in {summary['seconds']:.0f} s; look at {summary['page']}, or "
        f"{summary['table']}",
        soft_wrap=True,
        highlight=False,
    )
    if summary["left"]:
        errors.print(
            f"interrupted with {summary['left']} still to do; the same command goes on from here",
            soft_wrap=True,
            highlight=False,
        )
    elif without:
        errors.print(
            f"{without} without a result, for the reasons in {summary['table']}; --retry-failed does "
            "them again",
            soft_wrap=True,
            highlight=False,
        )


def _show_classes(event: Finished) -> None:
    """The isohedral classes."""
    rows, file = event.summary["classes"], event.summary["file"]
    table = Table(*rows[0], title="The nine isohedral classes")
    for row in rows:
        table.add_row(*row.values())
    output.print(table)
    if file is not None:
        output.print(f"drawn in {file}", soft_wrap=True)


def _show_tiles(event: Finished) -> None:
    """What came of a search."""
    summary, folder = event.summary, Path(event.summary["folder"])
    tiles, failed = summary["tiles"], summary["failed"]
    if tiles:
        output.print(_table(tiles))
    for failure in failed:
        interrupted = failure["reason"] == INTERRUPTED
        what = INTERRUPTED if interrupted else f"no tile: {failure['reason']}"
        errors.print(f"{failure['class']}: {what}", highlight=False, soft_wrap=True, markup=False)
    if tiles:
        # a path broken over two lines cannot be copied
        output.print(
            f"written to {folder} in {summary['seconds']:.0f} s; look at "
            f"{folder / 'overview.png'} first, or open {folder / 'index.html'}",
            soft_wrap=True,
        )
        return
    if event.state == "nothing found":
        where = f"see {folder / 'result.json'}"
        if not summary["written"]:
            where = f"{folder} still holds the tiles of an earlier run"
        errors.print(f"no certified tile was found; {where}", soft_wrap=True)
    elif not summary["written"]:
        errors.print(f"{folder} still holds the tiles of an earlier run", soft_wrap=True)


def _table(tiles: list[dict[str, Any]]) -> Table:
    both = any(tile["front"] is not None for tile in tiles)
    table = Table(title="Tiles for likeness, then for overlap" if both else "Tiles, best first")
    columns = ("score", "bent", "IoU", "recognised", "certified", "edges", "s")
    if both:  # for 80 columns
        columns = ("for", "deformation", "overlap", "front", "certified", "s")
    table.add_column("class", no_wrap=True)
    for column in columns:
        table.add_column(column, justify="left" if column == "for" else "right", no_wrap=True)
    for tile in tiles:
        mismatch = tile["edge_mismatch"]
        cells = {
            "score": f"{tile['score']:.3f}",
            "for": tile["objective"],
            "bent": "-" if tile["deformation"] is None else f"{tile['deformation']:.3f}",
            "IoU": f"{tile['iou']:.4f}",
            "recognised": f"{tile['recognised']:.3f}",
            "front": "yes" if tile["front"] else "near",
            "certified": "yes" if tile["certified"] else "[red]NO[/]",
            "edges": "-" if mismatch is None else f"{mismatch:.0e}",
            "s": f"{tile['seconds']:.1f}",
        }
        cells |= {"deformation": cells["bent"], "overlap": cells["IoU"]}
        table.add_row(f"{tile['class']} ({tile['group']})", *(cells[name] for name in columns))
    return table
