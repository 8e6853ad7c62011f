"""How worker processes start."""

from __future__ import annotations

import contextlib
import multiprocessing
import threading
import warnings
from collections.abc import Iterator
from typing import Any

import torch


def process_context() -> Any:
    """How workers start: forked where that is safe, which saves them two seconds of imports.

    A fork is safe as long as this process has no other thread and torch has not been allowed any.
    """
    methods = multiprocessing.get_all_start_methods()
    if "fork" in methods and torch.get_num_threads() == 1 and threading.active_count() == 1:
        return multiprocessing.get_context("fork")
    context = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
    if context.get_start_method() == "forkserver":
        context.set_forkserver_preload(["orbiflow.escher.search"])
    return context


@contextlib.contextmanager
def quiet_fork() -> Iterator[None]:
    """Around the first task of a pool: newer Pythons warn of every fork beside a numerical library."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        yield
