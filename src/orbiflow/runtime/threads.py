"""One torch thread, for a whole process or for a while.

Orbiflow's work is many small operations. With several threads each of them waits for all, and on a
busy machine a wait lasts as long as the scheduler likes: tens of times the work itself.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import sys
import threading
from collections.abc import Generator
from contextvars import ContextVar
from typing import Any

import threadpoolctl

_lock = threading.Lock()


def one_thread_environment() -> dict[str, str]:
    """Return the environment variables of a process in which torch has one thread.

    NumPy's linear algebra has as many as it would have without them.
    """
    blas = os.environ.get("OMP_NUM_THREADS", str(os.cpu_count() or 1))
    single = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return {"OPENBLAS_NUM_THREADS": blas, **os.environ, **single}


def use_one_thread() -> None:
    """Let torch use one thread in this process, whether it is imported already or not.

    A process that began so can be forked.
    """
    os.environ.update(one_thread_environment())
    if (torch := imported_torch()) is not None:
        torch.set_num_threads(1)


def imported_torch() -> Any:
    """Return torch if this process has imported it, else None."""
    return sys.modules.get("torch")


@contextlib.contextmanager
def one_thread() -> Generator[None]:
    """Run torch on one thread in this block, or function if used as a decorator.

    Import torch before the block: where nobody has, there is nothing to limit. Only the calling thread
    is limited; threads started meanwhile begin with the process's number. It is free of charge where
    the caller's number is 1, and takes about 0.1 ms otherwise.

    >>> import torch
    >>> with one_thread():
    ...     torch.get_num_threads()
    1
    """
    torch = imported_torch()
    if torch is None:
        yield
        return
    with _lock:
        before = torch.get_num_threads()
        if before > 1:
            torch.set_num_threads(1)
            _default_for_new_threads(torch, before)
    try:
        yield
    finally:
        if before > 1:
            torch.set_num_threads(before)


def _default_for_new_threads(torch: Any, count: int) -> None:
    # torch.set_num_threads sets the calling thread's number and the one that new threads begin with;
    # called from a thread of its own, it leaves ours alone
    helper = threading.Thread(target=torch.set_num_threads, args=(count,))
    helper.start()
    helper.join()


_only_one = ContextVar("only_one", default=False)


def cores() -> int:
    """Return how many threads may work side by side, which changes no result.

    As many as the process may use cores; 1 in worker processes of any kind, which have others beside
    them, and inside `one_core`.
    """
    if _only_one.get() or multiprocessing.current_process().name != "MainProcess":
        return 1
    if hasattr(os, "sched_getaffinity"):  # Linux knows what `taskset` or a scheduler leaves
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextlib.contextmanager
def one_core() -> Generator[None]:
    """Work in this thread alone in this block: what is in it has others beside it."""
    before = _only_one.set(True)
    try:
        yield
    finally:
        _only_one.reset(before)


_blas_lock = threading.Lock()
_blas_users = 0
_blas_limit: threadpoolctl.threadpool_limits | None = None


@contextlib.contextmanager
def one_blas_thread() -> Generator[None]:
    """Run NumPy's and SciPy's linear algebra on one thread in this block.

    These libraries know one number for the whole process: it is set when the first block is entered
    and set back when the last is left, whichever threads they belong to.
    """
    global _blas_users, _blas_limit
    with _blas_lock:
        if _blas_users == 0:
            _blas_limit = threadpoolctl.threadpool_limits(1, user_api="blas")
        _blas_users += 1
    try:
        yield
    finally:
        with _blas_lock:
            _blas_users -= 1
            if _blas_users == 0 and _blas_limit is not None:
                _blas_limit.restore_original_limits()
                _blas_limit = None
