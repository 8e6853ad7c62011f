"""A job in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from orbiflow.jobs.request import Request
from orbiflow.runtime import (
    Event,
    Failed,
    Finished,
    event_from_json,
)


def start(request: Request) -> Job:
    """Run a request in a fresh process; may be called from any thread.

    The process begins with two seconds of imports. It shares nothing with this one but a pipe, so
    neither can harm the other: if it dies, that is a `Failed` event; if this process dies, it stops as
    if cancelled.
    """
    return Job(request)


class Job:
    """A request that runs in a process of its own; made by `start`.

    - `exitcode`: 0 if it finished, 1 if it failed, negative for the signal that it died of, None while
      it runs.

    >>> from orbiflow.jobs import EscherizeRequest
    >>> from orbiflow.jobs.process import start
    >>> job = start(EscherizeRequest(image="no such.png"))
    >>> list(job.events())[-1].failure
    'mistake'
    >>> job.wait()
    1
    """

    def __init__(self, request: Request) -> None:
        self.request = request
        self._lock = threading.Lock()
        self._process = subprocess.Popen(
            [sys.executable, "-m", "orbiflow.jobs.child"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=_environment(),
            start_new_session=True,  # Ctrl-C in this terminal is this process's affair
        )
        self._send(json.dumps(request.to_json(), allow_nan=False).encode() + b"\n")

    def __enter__(self) -> Job:
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _traceback: TracebackType | None,
    ) -> None:
        """Kill it if it still runs, and free its pipe."""
        self.kill()
        self.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()

    def events(self) -> Iterator[Event]:
        """Every event in its order, as it comes; the last is `Finished` or `Failed`.

        To be read by one thread, to the end; a job that nobody reads stops once the pipe is full.
        """
        assert self._process.stdout is not None
        last = None
        with self._process.stdout as lines:
            for line in lines:
                try:
                    event = event_from_json(json.loads(line))
                except ValueError:  # half a line: it died while it wrote
                    continue
                last = event
                yield event
        status = self.wait()
        if not isinstance(last, Finished | Failed):
            how = f"signal {-status}" if status < 0 else f"status {status}"
            yield Failed(
                f"the process of the job ended without a word ({how}): was memory short?", "died"
            )

    def cancel(self) -> None:
        """Ask it to stop; a search keeps what it has found. May be called from any thread."""
        self._send(b"cancel\n")

    def kill(self) -> None:
        """End it at once; nothing is kept, and an earlier result stays as it was."""
        with suppress(OSError):
            self._process.kill()

    def wait(self, timeout: float | None = None) -> int:
        """The exit code, once it has ended.

        Args:
            timeout: seconds.

        Raises:
            TimeoutError: if it still runs then.
        """
        try:
            status = self._process.wait(timeout)
        except subprocess.TimeoutExpired as error:
            raise TimeoutError(f"the job still runs after {timeout:g} s") from error
        self._hang_up()
        return status

    @property
    def exitcode(self) -> int | None:
        return self._process.poll()

    def _send(self, data: bytes) -> None:
        assert self._process.stdin is not None
        with self._lock, suppress(OSError, ValueError):  # it has ended
            self._process.stdin.write(data)
            self._process.stdin.flush()

    def _hang_up(self) -> None:
        assert self._process.stdin is not None
        with self._lock, suppress(OSError):
            self._process.stdin.close()


def _environment() -> dict[str, str]:
    """So that the process imports this very package."""
    package = str(Path(__file__).parents[2])
    paths = [package, *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
