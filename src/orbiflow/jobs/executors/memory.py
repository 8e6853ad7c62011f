"""How a process keeps the memory that it frees.

Dask's nannies start workers with MALLOC_TRIM_THRESHOLD_=65536: glibc then hands every freed block of
that size back to the system. A search frees arrays of about this size all the time, and fetching the
memory again cost it as much as its own work (2.4 s of CPU instead of 1.3 s for one class).
"""

from __future__ import annotations

import contextlib
import ctypes
import os
from collections.abc import Generator

TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3  # of glibc's malloc.h
ROOM = 32 * 2**20  # bytes; the most that glibc itself would come to
USUAL_MMAP = 128 * 2**10
VARIABLE = "MALLOC_TRIM_THRESHOLD_"


@contextlib.contextmanager
def keeping_memory() -> Generator[None]:
    """Freed memory stays with this process in the block; where it would not, and glibc is there."""
    asked = os.environ.get(VARIABLE, "")
    set_option = getattr(_libc(), "mallopt", None) if asked.isdecimal() else None
    if set_option is None or int(asked) >= ROOM:
        yield
        return
    set_option(TRIM_THRESHOLD, ROOM)
    set_option(MMAP_THRESHOLD, ROOM)
    try:
        yield
    finally:
        set_option(TRIM_THRESHOLD, int(asked))
        set_option(MMAP_THRESHOLD, USUAL_MMAP)
        trim = getattr(_libc(), "malloc_trim", None)
        if trim is not None:
            trim(0)


def _libc() -> ctypes.CDLL | None:
    try:
        return ctypes.CDLL(None)
    except (OSError, TypeError):
        return None
