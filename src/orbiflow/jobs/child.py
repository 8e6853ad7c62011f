"""The process of a job: `python -m orbiflow.jobs.child`, started by `orbiflow.jobs.process`.

The first line of the standard input is the request; anything after it, or its end, means stop. Events
go to the standard output, a line of JSON each; whatever else is printed goes to the standard error.
"""

from __future__ import annotations

import json
import os
import select
import signal
import sys
import threading
import traceback
from collections import deque
from typing import TextIO

from orbiflow.errors import OrbiflowError
from orbiflow.jobs.requests import request_from_json
from orbiflow.jobs.run import run
from orbiflow.runtime import (
    Cancel,
    Event,
    Failed,
    Finished,
)


class _Listening(Cancel):
    """Cancelled by a word from the parent, or by its end."""

    def __init__(self) -> None:
        super().__init__()
        if os.name != "posix":  # pipes cannot be polled there, nor processes forked
            threading.Thread(target=self._listen, daemon=True).start()

    @property
    def cancelled(self) -> bool:
        if not self._told and os.name == "posix":
            self._told = bool(select.select([0], [], [], 0)[0])
        return self._told

    def _listen(self) -> None:
        os.read(0, 1)
        self.cancel()


def main() -> int:
    """Run the request and tell its events; exit status 0 if it finished, else 1."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    events = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    last: deque[Event] = deque(maxlen=1)

    def tell(event: Event) -> None:
        last.append(event)
        _write(events, event)

    try:
        request = request_from_json(json.loads(_first_line()))
    except (OrbiflowError, ValueError, RecursionError) as error:
        tell(Failed(str(error), "mistake"))
        return 1
    import torch

    torch.set_num_threads(1)  # this process is the job's alone: its workers may be forked
    try:
        run(request, tell, _Listening())
    except BrokenPipeError:  # nobody listens
        return 1
    except Exception as error:
        if not isinstance(error, OrbiflowError):
            traceback.print_exc()
    return 0 if last and isinstance(last[0], Finished) else 1


def _first_line() -> bytes:
    """Of the standard input, and not a byte more: what follows must stay there to be noticed."""
    line = bytearray()
    while (byte := os.read(0, 1)) not in (b"", b"\n"):
        line += byte
    return bytes(line)


def _write(events: TextIO, event: Event) -> None:
    events.write(json.dumps(event.to_json(), allow_nan=False) + "\n")
    events.flush()


if __name__ == "__main__":
    sys.exit(main())
