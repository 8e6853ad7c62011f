"""A call in a process of its own: what a web server runs, and can cancel or kill.

`python -m orbiflow.runtime.call_process MODULE...` is that process, which imports the modules first.
The first line of its standard input is the call as JSON; anything after it, or its end, means stop.
Events go to the standard output, each as a line of JSON; whatever else is printed goes to the standard
error. With `--again` before the modules, a call that has ended may be followed by a line with another.
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
from collections.abc import Iterator, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path

from orbiflow.errors import OrbiflowError
from orbiflow.runtime.events import (
    Cancel,
    Cancelled,
    Event,
    Failed,
    Finished,
    Polled,
    event_from_json,
)
from orbiflow.runtime.operations import Call, Sink, call_from_json
from orbiflow.runtime.threads import one_thread_environment

AGAIN, CANCEL = "--again", b"cancel\n"


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

    Args:
        call: The call. Without one the process waits until `begin` is given one.
        modules: The names of modules that the process imports before it reads the call.
        again: Whether the process waits for another call after each (where there are signals); who
            has no more calls must kill it.
    """

    def __init__(
        self, call: Call | None = None, *, modules: Sequence[str] = (), again: bool = False
    ) -> None:
        self._lock = threading.Lock()
        self._again = again and os.name == "posix"
        # so that the process imports this very package
        package = str(Path(__file__).parents[2])
        paths = [package, *filter(None, [os.environ.get("PYTHONPATH")])]
        self._process = subprocess.Popen(
            [
                *(sys.executable, "-m", "orbiflow.runtime.call_process"),
                *([AGAIN] * self._again),
                *modules,
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **one_thread_environment(), "PYTHONPATH": os.pathsep.join(paths)},
            start_new_session=True,  # Ctrl-C in this terminal is this process's affair
        )
        if call is not None:
            self.begin(call)

    def begin(self, call: Call) -> None:
        """Give the call to a process that waits for one."""
        self._send(json.dumps(call.to_json(), allow_nan=False).encode() + b"\n")

    @property
    def pid(self) -> int:
        """The number of the process, which is that of its group and session, too."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether it has not ended."""
        return self._process.poll() is None

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
        for line in self._process.stdout:
            try:
                last = event_from_json(json.loads(line))
            except ValueError:  # half a line: it died while it wrote
                continue
            yield last
            if self._again and isinstance(last, Finished | Failed):
                return
        self._process.stdout.close()
        status = self.wait()
        if not isinstance(last, Finished | Failed):
            how = f"signal {-status}" if status < 0 else f"status {status}"
            yield Failed(f"the process ended without a word ({how}): was memory short?", "died")

    def cancel(self) -> None:
        """Ask the process to stop; a search keeps what it has found. May be called from any thread."""
        self._send(CANCEL)

    def pause(self) -> bool:
        """Hold the process and all that it started; return whether the system can do that."""
        return self._signal("SIGSTOP")

    def resume(self) -> bool:
        """Let a process that was held go on."""
        return self._signal("SIGCONT")

    def kill(self) -> None:
        """End the process, with all that it started, at once.

        Nothing is kept, and an earlier result stays as it was.
        """
        if not self._signal("SIGKILL"):
            with suppress(OSError):
                self._process.kill()

    def _signal(self, name: str) -> bool:
        """Send its group a signal; return whether there are groups and signals."""
        if os.name != "posix":
            return False
        with suppress(OSError):
            # once it has ended, its number may be another's
            if self._process.poll() is None:
                os.killpg(self._process.pid, signal.Signals[name])
        return True

    def wait(self) -> int:
        """Return the status of the process once it has ended.

        It is 0 if it finished, 1 if it failed, and minus the signal that it died of.
        """
        status = self._process.wait()
        assert self._process.stdin is not None
        with self._lock, suppress(OSError):
            self._process.stdin.close()
        return status

    def _send(self, data: bytes) -> None:
        assert self._process.stdin is not None
        with self._lock, suppress(OSError, ValueError):  # it has ended
            self._process.stdin.write(data)
            self._process.stdin.flush()


def _main() -> int:
    """Run the call, or calls, and write their events; return the exit status."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    events = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    again = sys.argv[1:2] == [AGAIN]
    for name in sys.argv[1 + again :]:
        import_module(name)

    def send(event: Event) -> None:
        events.write(json.dumps(event.to_json(), allow_nan=False) + "\n")
        events.flush()

    status = 0
    # lines and not a byte more: what follows must stay there to be noticed
    with open(0, "rb", buffering=0, closefd=False) as words:
        while line := words.readline():
            if not (again and line == CANCEL):  # of a call that had ended
                status = _run(line, send)
            if not again:
                break
    return status


def _run(line: bytes, send: Sink) -> int:
    """Run a call and return the exit status."""
    try:
        call = call_from_json(json.loads(line))
    except (OrbiflowError, ValueError, RecursionError) as error:
        send(Failed(str(error), "mistake"))
        return 1
    try:
        call.run(send, _token())
    except Cancelled:
        return 0
    except (BrokenPipeError, OrbiflowError):  # nobody listens, or the error was sent
        return 1
    except Exception:
        traceback.print_exc()
        return 1
    return 0


def _token() -> Cancel:
    """Return a token that a word from the parent cancels, and its end."""
    if os.name == "posix":
        return Polled(lambda: bool(select.select([0], [], [], 0)[0]))
    # pipes cannot be polled there, nor processes forked
    cancel = Cancel()
    threading.Thread(target=lambda: (os.read(0, 1), cancel.cancel()), daemon=True).start()
    return cancel


if __name__ == "__main__":
    sys.exit(_main())
