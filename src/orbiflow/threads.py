"""One torch thread for a while, and the caller's own number again afterwards.

Orbiflow's work is many small operations. With several threads each of them waits for all, and on a
busy machine a wait lasts as long as the scheduler likes: tens of times the work itself.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator

import torch

_lock = threading.Lock()


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Run torch on one thread in this block, or function if used as a decorator.

    Only the calling thread is limited. May be nested, and entered by any number of threads at once:
    each has its own number of threads again when it leaves, and threads started meanwhile begin with
    the process's. Free of charge where the caller's number is 1, else about 0.1 ms.

    A process that has used several threads before is no safer to fork inside the block.

    >>> with one_thread():
    ...     torch.get_num_threads()
    1
    """
    with _lock:
        before = torch.get_num_threads()
        if before > 1:
            torch.set_num_threads(1)
            _default_for_new_threads(before)
    try:
        yield
    finally:
        if before > 1:
            torch.set_num_threads(before)


def _default_for_new_threads(count: int) -> None:
    # torch.set_num_threads sets the calling thread's number and the one that new threads begin with;
    # called from a thread of its own, it leaves ours alone
    helper = threading.Thread(target=torch.set_num_threads, args=(count,))
    helper.start()
    helper.join()
