"""The memory of a process and all that it starts, at its peak; on Linux, which knows who shares what.

python benchmarks/memory.py PROCESS      # until its standard input ends
"""

from __future__ import annotations

import re
import select
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager, suppress
from os import getpid
from pathlib import Path

PAUSE_SECONDS = 0.1


@contextmanager
def peak_memory() -> Generator[list[float]]:
    """Watch this process and its children; the list has the most MB that they held, once it ends.

    A page that several processes share counts once (proportional set size). Another process watches,
    since a thread would keep a search from forking.
    """
    peak = list[float]()
    words = [sys.executable, __file__, str(getpid())]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as watcher:
        yield peak
        peak.append(float(watcher.communicate()[0]))


def _held(process: str, but: int) -> float:
    """Return the MB that a process and its children hold, without those of one of them."""
    found, waiting = 0, [process]
    for number in waiting:  # grows while it is walked
        with suppress(OSError, ValueError):  # it has ended
            home = Path("/proc") / number
            pages = (home / "smaps_rollup").read_text()
            found += sum(map(int, re.findall(r"^Pss: +(\d+) kB", pages, re.MULTILINE)))
            for thread in (home / "task").iterdir():
                children = (thread / "children").read_text().split()
                waiting += [own for own in children if own != str(but)]
    return found / 1000


def _watch(process: str) -> None:
    most = 0.0
    while not select.select([sys.stdin], [], [], PAUSE_SECONDS)[0]:
        most = max(most, _held(process, getpid()))
        if not Path("/proc", process).exists():
            break
    print(most)


if __name__ == "__main__":
    _watch(sys.argv[1])
