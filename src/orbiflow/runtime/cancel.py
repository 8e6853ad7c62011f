"""Telling work in progress to stop: a token that is handed down and looked at between steps."""

from __future__ import annotations


class Cancelled(Exception):
    """The work was told to stop. No mistake, hence no `OrbiflowError`."""


class Cancel:
    """A token that stops work, from any thread or from a signal handler.

    >>> cancel = Cancel()
    >>> cancel.check()
    >>> cancel.cancel()
    >>> cancel.cancelled
    True
    """

    def __init__(self) -> None:
        # no lock: a signal handler may come while this very thread holds it
        self._told = False

    def cancel(self) -> None:
        """Ask for the end; there is no way back."""
        self._told = True

    @property
    def cancelled(self) -> bool:
        """Whether the end was asked for."""
        return self._told

    def check(self) -> None:
        """To be called between steps.

        Raises:
            Cancelled: if the end was asked for.
        """
        if self.cancelled:
            raise Cancelled
