"""What a fit may spend: evaluations, which end alike on every machine, and time as an outer limit."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Generator

import torch

from orbiflow.runtime import one_thread

clock = time.monotonic
"""Seconds since some moment; tests put another in its place."""


class Spent(Exception):
    """Raised where the next evaluation would begin; `reason` is "evaluations" or "time"."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class Budget:
    """Counts evaluations of an objective, and looks at the clock between them.

    A fit that ends by its evaluations is the same on a busy machine; one that ends by time is not, so
    it has to say so: `notes`.

    >>> budget = Budget(evaluations=1)
    >>> budget.spend()
    >>> budget.is_spent
    True
    """

    def __init__(self, evaluations: float = math.inf, seconds: float | None = None) -> None:
        self.evaluations = evaluations
        self.seconds = math.inf if seconds is None else seconds
        self.used = 0
        self._began = clock()
        self._reason: str | None = None

    @property
    def is_spent(self) -> bool:
        """Whether the next evaluation may not begin: ask only before one. Once so, always so."""
        if self._reason is None:
            if self.used >= self.evaluations:
                self._reason = "evaluations"
            # no limit needs no clock
            elif self.seconds < math.inf and clock() - self._began >= self.seconds:
                self._reason = "time"
        return self._reason is not None

    @property
    def seconds_left(self) -> float | None:
        """What is left of the limit on time, at least 0; None if there is no limit."""
        if self.seconds == math.inf:
            return None
        return max(0.0, self.seconds - (clock() - self._began))

    def spend(self) -> None:
        """Count an evaluation that is about to begin."""
        if self.is_spent:
            raise Spent(str(self._reason))
        self.used += 1

    def notes(self) -> list[str]:
        """What the user should know, in words."""
        if self._reason == "time":
            return [f"stopped by the limit of {self.seconds:g} s: another run may differ"]
        if self._reason == "evaluations":
            return [f"stopped by the budget of {self.evaluations:g} evaluations"]
        return []


@contextlib.contextmanager
def training() -> Generator[None]:
    """Train in a block, or in a function that it decorates; the caller's settings are left alone.

    Under `torch.no_grad()` or `torch.inference_mode()` there would be no gradients, and what is made
    in the latter could never be differentiated.
    """
    with one_thread(), torch.inference_mode(False), torch.enable_grad():
        yield
