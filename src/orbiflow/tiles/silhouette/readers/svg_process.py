"""The renderer in a process of its own, whose memory and time are bounded.

Run as a script, this file is that process: it reads requests and writes pictures until its input ends.
A drawing that makes the renderer hang, take all memory or fall ends there, in one error.
"""

from __future__ import annotations

import json
import os
import signal
import struct
import subprocess
import sys
import threading
import weakref
from contextlib import suppress
from typing import Any, BinaryIO

MAX_MEMORY = 2 * 2**30
"""Bytes of memory at most, where the system bounds it: all but Windows."""

MAX_SECONDS = 30
"""Seconds of processor time for all pictures of a drawing, where the system bounds it."""

MAX_WAIT = 300.0
"""Seconds until a process that hangs is ended, on any system."""

_LENGTH = struct.Struct("<Q")


class RendererFailed(Exception):
    """The renderer refused a drawing, or took more memory or time than it has."""


class Renderer:
    """A process that draws SVG; it ends with this object."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def png(self, text: str, options: dict[str, Any]) -> bytes:
        """Return a document's picture, by `resvg_py.svg_to_bytes` with these options.

        Raises:
            RendererFailed: With what the renderer says, or nothing where it was ended.
        """
        process = self._started()
        assert process.stdin is not None
        assert process.stdout is not None
        watch = threading.Timer(MAX_WAIT, process.kill)
        watch.start()
        try:
            _write(process.stdin, json.dumps([text, options]).encode())
            done, content = _read(process.stdout), _read(process.stdout)
        except (OSError, EOFError):
            process.kill()
            process.wait()
            self._process = None
            raise RendererFailed from None
        finally:
            watch.cancel()
        if done:
            return content
        raise RendererFailed(content.decode(errors="replace")[:200])

    def _started(self) -> subprocess.Popen[bytes]:
        if self._process is None:
            # -P: nothing beside this file is imported
            self._process = subprocess.Popen(
                [sys.executable, "-P", __file__],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
            weakref.finalize(self, _end, self._process)
        return self._process


def _end(process: subprocess.Popen[bytes]) -> None:
    for stream in (process.stdin, process.stdout):
        with suppress(OSError):
            if stream is not None:
                stream.close()
    process.kill()
    process.wait()


def _write(stream: BinaryIO | Any, content: bytes) -> None:
    stream.write(_LENGTH.pack(len(content)) + content)
    stream.flush()


def _read(stream: BinaryIO | Any) -> bytes:
    header = stream.read(_LENGTH.size)
    if len(header) < _LENGTH.size:
        raise EOFError
    (length,) = _LENGTH.unpack(header)
    content = stream.read(length)
    if len(content) < length:
        raise EOFError
    return content


def _bound() -> None:
    """Bound the memory and the processor time of this process, where the system can."""
    if sys.platform == "win32":
        return
    import resource

    limits = {"RLIMIT_AS": MAX_MEMORY, "RLIMIT_CPU": MAX_SECONDS, "RLIMIT_CORE": 0}
    for name, most in limits.items():
        with suppress(OSError, ValueError, OverflowError):  # a lower bound than this stays
            resource.setrlimit(getattr(resource, name), (most, most))


def _main() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    requests, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a library prints
    import resvg_py

    _bound()
    while True:
        try:
            text, options = json.loads(_read(requests))
        except EOFError:
            return
        try:
            content, done = bytes(resvg_py.svg_to_bytes(svg_string=text, **options)), b"1"
        except BaseException as error:  # of the renderer's own kinds, too
            content, done = str(error).encode(errors="replace"), b""
        _write(answers, done)
        _write(answers, content)


if __name__ == "__main__":
    _main()
