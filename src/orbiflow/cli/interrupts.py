"""Ctrl-C: once to stop with what was found, twice to end at once."""

from __future__ import annotations

import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager

from orbiflow.runtime import Cancel


@contextmanager
def stopped_by_interrupt() -> Generator[Cancel]:
    """Yields a token that the first Ctrl-C cancels; a second raises `KeyboardInterrupt`.

    A shell may have told this process to ignore Ctrl-C, as with `nohup` or `&` in a script: then it
    stays ignored.
    """
    cancel = Cancel()

    def interrupted(_number: int, _frame: object) -> None:
        if cancel.cancelled:
            raise KeyboardInterrupt
        cancel.cancel()

    ignored = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    if ignored or threading.current_thread() is not threading.main_thread():
        yield cancel
        return
    before = signal.signal(signal.SIGINT, interrupted)
    try:
        yield cancel
    finally:
        signal.signal(signal.SIGINT, before)
