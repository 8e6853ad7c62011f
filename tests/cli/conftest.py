"""Running the command line in this process and in one of its own."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import pytest

from batch.small_batches import Here
from density.quick_fits import (
    quick_fits_fixture,  # noqa: F401
    quick_pictures,
    whole_fits_fixture,  # noqa: F401
)
from orbiflow.batch import work


@dataclass(frozen=True)
class Outcome:
    """What a command left behind."""

    status: int
    out: str
    err: str


class Run(NamedTuple):
    """Calls the command line with its arguments, in this process alone."""

    capture: Callable[[], tuple[str, str]]

    def __call__(self, *arguments: object) -> Outcome:
        return call_main(self.capture, *arguments)

    def done(self, *arguments: object) -> Outcome:
        """Call it, and expect that it does its work."""
        outcome = self(*arguments)
        assert outcome.status == 0, outcome.err
        return outcome

    def refused(self, *arguments: object) -> Outcome:
        """Call it, and expect that it refuses what it was told."""
        outcome = self(*arguments)
        assert outcome.status == 2, outcome.out
        return outcome


# Python's code for `orbiflow`; whether Ctrl-C is ignored is inherited from the shell, and must not
# decide a test
LAUNCH = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    "from orbiflow.cli.app import main; main()"
)


def call_main(capture: Callable[[], tuple[str, str]], *arguments: object) -> Outcome:
    """`orbiflow ARGUMENTS` in this process alone: importing torch again would take seconds.

    Workers might be started by a server, which knows nothing of what tries little here.
    """
    from orbiflow.cli.app import run

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "200")
        patch.setattr("os.cpu_count", lambda: 1)
        patch.setattr("os.sched_getaffinity", lambda _: {0}, raising=False)
        patch.setattr(work, "executor_for", lambda *_: Here())
        if arguments[:1] == ("density",):
            quick_pictures(patch)
        try:
            status = run(list(map(str, arguments)))
        except SystemExit as leaving:
            status = int(str(leaving.code or 0))
    return Outcome(status, *capture())


@pytest.fixture(name="orbiflow")
def orbiflow_fixture(capsys: pytest.CaptureFixture[str]) -> Run:
    """Call it with the command line's arguments; stays in this process."""
    return Run(capsys.readouterr)


@pytest.fixture(name="orbiflow_process", scope="session")
def orbiflow_process_fixture() -> Callable[..., Outcome]:
    """The same as a process of its own."""

    def run(*arguments: object) -> Outcome:
        done = subprocess.run(
            [sys.executable, "-m", "orbiflow", *map(str, arguments)],
            capture_output=True,
            text=True,
            check=False,
        )
        return Outcome(done.returncode, done.stdout, done.stderr)

    return run
