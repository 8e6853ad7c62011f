"""A call in a process of its own: what a web server runs, and can cancel or kill.

`python -m orbiflow.runtime.call_process` is that process. The first line of its standard input is the
call as JSON; anything after it, or its end, means stop. Events go to the standard output, each as a
line of JSON; whatever else is printed goes to the standard error.
"""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import threading
import traceback
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from orbiflow.errors import OrbiflowError
from orbiflow.runtime.events import Cancel, Cancelled, Event, Failed, Finished, event_from_json
from orbiflow.runtime.operations import Call, call_from_json
from orbiflow.runtime.threads import one_thread_environment


class CallProcess:
    """A call that runs in a fresh process from the start; any thread may make it.

    The process shares nothing with this one but a pipe, so neither can harm the other: if it dies, that
    is a `Failed` event; if this process dies, it stops as if cancelled.

    >>> from orbiflow.runtime import CallProcess, find
    >>> process = CallProcess(find("escherize").call({"image": "no such.png"}))
    >>> list(process.events())[-1].failure
    'mistake'
    >>> process.wait()
    1
    """

    def __init__(self, call: Call) -> None:
        self.call = call
        self._lock = threading.Lock()
        # so that the process imports this very package
        package = str(Path(__file__).parents[2])
        paths = [package, *filter(None, [os.environ.get("PYTHONPATH")])]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "orbiflow.runtime.call_process"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **one_thread_environment(), "PYTHONPATH": os.pathsep.join(paths)},
            start_new_session=True,  # Ctrl-C in this terminal is this process's affair
        )
        self._send(json.dumps(call.to_json(), allow_nan=False).encode() + b"\n")

    def __enter__(self) -> CallProcess:
        return self

    def __exit__(self, *_error: object) -> None:
        """Kill the process if it still runs, and close its pipe."""
        self.kill()
        self.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()

    def events(self) -> Iterator[Event]:
        """Yield every event as it comes; the last is `Finished` or `Failed`.

        One thread must read them to the end: if nobody reads, the process stops once the pipe is full.
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
            yield Failed(f"the process ended without a word ({how}): was memory short?", "died")

    def cancel(self) -> None:
        """Ask the process to stop; a search keeps what it has found. May be called from any thread."""
        self._send(b"cancel\n")

    def kill(self) -> None:
        """End the process at once; nothing is kept, and an earlier result stays as it was."""
        with suppress(OSError):
            self._process.kill()

    def wait(self, timeout: float | None = None) -> int:
        """Return the exit code once the process has ended, or raise a `TimeoutError` after a time."""
        try:
            status = self._process.wait(timeout)
        except subprocess.TimeoutExpired as error:
            raise TimeoutError(f"the process still runs after {timeout:g} s") from error
        assert self._process.stdin is not None
        with self._lock, suppress(OSError):
            self._process.stdin.close()
        return status

    @property
    def exitcode(self) -> int | None:
        """0 if it finished, 1 if it failed, minus the signal that it died of; None while it runs."""
        return self._process.poll()

    def _send(self, data: bytes) -> None:
        assert self._process.stdin is not None
        with self._lock, suppress(OSError, ValueError):  # it has ended
            self._process.stdin.write(data)
            self._process.stdin.flush()


class _Listening(Cancel):
    """A token that a word from the parent cancels, and its end."""

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


def _main() -> int:
    """Run the call and tell its events; return the exit status."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    events = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    last: deque[Event] = deque(maxlen=1)

    def tell(event: Event) -> None:
        last.append(event)
        events.write(json.dumps(event.to_json(), allow_nan=False) + "\n")
        events.flush()

    try:
        call = call_from_json(json.loads(_first_line()))
    except (OrbiflowError, ValueError, RecursionError) as error:
        tell(Failed(str(error), "mistake"))
        return 1
    with suppress(BrokenPipeError, Cancelled, OrbiflowError):  # nobody listens, or it was told
        try:
            call.run(tell, _Listening())
        except Exception as error:
            if not isinstance(error, BrokenPipeError | Cancelled | OrbiflowError):
                traceback.print_exc()
    return 0 if last and isinstance(last[0], Finished) else 1


def _first_line() -> bytes:
    """Of the standard input, and not a byte more: what follows must stay there to be noticed."""
    line = bytearray()
    while (byte := os.read(0, 1)) not in (b"", b"\n"):
        line += byte
    return bytes(line)


if __name__ == "__main__":
    sys.exit(_main())
