"""How every fit runs torch: on one thread, with gradients, whatever the caller's modes are."""

from __future__ import annotations

import contextlib
from collections.abc import Generator

import torch

from orbiflow.threads import one_thread


@contextlib.contextmanager
def training() -> Generator[None]:
    """For a block, or for a function as its decorator; the caller's settings are left alone.

    Under `torch.no_grad()` or `torch.inference_mode()` there would be no gradients, and what is made
    in the latter could never be differentiated.

    >>> with torch.no_grad(), training():
    ...     torch.is_grad_enabled(), torch.get_num_threads()
    (True, 1)
    """
    with one_thread(), torch.inference_mode(False), torch.enable_grad():
        yield
