"""What a command shows of its operation's events, and how Ctrl-C stops it."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar
from rich.table import Table as TextTable

from orbiflow.errors import Advice
from orbiflow.runtime import (
    Cancel,
    ClassFailed,
    Event,
    Finished,
    ItemDone,
    Note,
    Preview,
    Progress,
    Started,
    Table,
    TileFound,
    find,
)

output, errors = Console(emoji=False), Console(stderr=True, emoji=False)

PROGRESS_SECONDS = 10.0  # between lines of progress where there can be no bar


class Terminal:
    """A sink of events. Use it in a `with` block: the bar must not outlive an error."""

    def __init__(
        self, named: Callable[[str], str] = str, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.named, self.clock, self.last_line = named, clock, clock()
        self.first: tuple[float, float] | None = None  # the time and share of the first progress
        self.last = Progress(1.0, "")
        self.forks = False
        self.bar: Bar | None = None

    def __enter__(self) -> Terminal:
        return self

    def __exit__(self, *_: object) -> None:
        self._end_bar()

    def __call__(self, event: Event) -> None:
        """Show an event."""
        match event:
            case Started():
                self.forks = find(event.operation).starts_processes
            case Progress():
                self._show_progress(event)
                self.watch()
            case Note():
                self._end_bar()  # notes come before the work and after it
                text = (
                    event.text.named(self.named) if isinstance(event.text, Advice) else event.text
                )
                _say(text, errors if event.warning else output)
            case Table():
                self._end_bar()
                output.print(_aligned(event))
            case Preview():
                _say(f"first tile after {event.seconds:.1f} s: {event.class_name}, certified")
            case TileFound():
                _say(f"{event.class_name}: tile found{', NOT CERTIFIED' * (not event.certified)}")
            case ClassFailed():
                interrupted = event.reason == "interrupted"
                reason = event.reason if interrupted else f"no tile: {event.reason}"
                _say(f"{event.class_name}: {reason}", errors)
            case ItemDone():
                failed = "" if event.state == "done" else f"{event.state}: "
                _say(f"{event.name}: {failed}{event.what}")
            case Finished():
                self._end_bar()
            case _:
                pass  # the rest is for programs

    def watch(self) -> bool:
        """Tell how far the work is if the last line is old; return False: it is no reason to stop.

        The work calls it where it looks whether it is to stop: no thread may run beside it.
        """
        now = self.clock()
        if (
            now - self.last_line >= PROGRESS_SECONDS
            and self.last.share < 1
            and not output.is_terminal
        ):
            self.last_line = now
            _say(self._line(now), errors)
        return False

    def _line(self, now: float) -> str:
        """Return a line about what is done, of which class, and how much is left."""
        begin, before = self.first or (now, 0.0)
        event, passed = self.last, now - begin
        line = f"{event.share:.0%} after {_duration(passed)}: {event.what}"
        if event.class_name:
            line += f" {event.class_name}, {event.class_share or 0:.0%} of it"
        if (done := event.share - before) > 0:
            line += f"; about {_duration(passed * (1 - event.share) / done)} left"
        return line

    def _show_progress(self, event: Progress) -> None:
        self.last = event
        if self.first is None:
            self.last_line = self.clock()
            self.first = self.last_line, event.share
        if self.bar is None:
            columns = (BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
            # no thread that refreshes: workers are forked from a process with one thread
            self.bar = Bar(
                *columns,
                TextColumn("{task.description}"),
                console=output,
                transient=True,
                auto_refresh=not self.forks,
            )
            self.bar.add_task("", total=1.0)
            self.bar.start()
        shown = escape(f"{event.what} {event.class_name}".rstrip())
        (task,) = self.bar.task_ids
        self.bar.update(task, completed=event.share, description=shown, refresh=self.forks)

    def _end_bar(self) -> None:
        if self.bar is not None:
            self.bar.stop()
            self.bar = None


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"


def _say(text: str, console: Console = output) -> None:
    # a path broken over two lines cannot be copied
    console.print(f"  {text}", highlight=False, soft_wrap=True, markup=False)


def _aligned(event: Table) -> TextTable:
    """Return a table with its numbers at the right."""
    table = TextTable(title=event.title)
    cells = zip(*event.rows, strict=True) if event.rows else ((),) * len(event.columns)
    for heading, column in zip(event.columns, cells, strict=True):
        words = any(" " in cell for cell in column)
        numbers = not words and all(cell[:1] in "0123456789+-" for cell in column)
        table.add_column(heading, justify="right" if numbers else "left", no_wrap=not words)
    for row in event.rows:
        table.add_row(*(escape(_writable(cell)) for cell in row))
    return table


def _writable(text: str) -> str:
    """Return the text with plain stars where the output's encoding has no others."""
    plain = str.maketrans({"★": "*", "½": " 1/2"})
    return text if output.encoding.startswith("utf") else text.translate(plain)


@contextmanager
def stopped_by_signals(cancel: Cancel) -> Generator[None]:
    """Let the first Ctrl-C or SIGTERM in this block cancel a token; a second does as it did before.

    A shell may have made this process ignore Ctrl-C, as with `nohup` or `&` in a script: then it
    stays ignored.
    """
    usual = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}

    def stopped(number: int, _frame: object) -> None:
        signal.signal(number, usual[signal.Signals(number)])
        cancel.cancel()

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard = [number for number in usual if signal.getsignal(number) is not signal.SIG_IGN]
    before = {number: signal.signal(number, stopped) for number in heard}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
