"""Running the command line in this process and in one of its own."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass

import pytest


@dataclass(frozen=True)
class Outcome:
    """What a command left behind."""

    status: int
    out: str
    err: str


Run = Callable[..., Outcome]


def call_main(capture: Callable[[], tuple[str, str]], *arguments: object) -> Outcome:
    """`orbiflow ARGUMENTS` in this process: importing torch again would take seconds."""
    from orbiflow.cli.app import main

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["orbiflow", *map(str, arguments)])
        patch.setenv("COLUMNS", "200")
        status: object = 0
        try:
            main()
        except SystemExit as leaving:
            status = leaving.code
    out, err = capture()
    return Outcome(0 if status is None else int(str(status)), out, err)


@pytest.fixture(name="orbiflow")
def orbiflow_fixture(capsys: pytest.CaptureFixture[str]) -> Run:
    """Call it with the command line's arguments; stays in this process."""
    return lambda *arguments: call_main(capsys.readouterr, *arguments)


@pytest.fixture(name="orbiflow_process", scope="session")
def orbiflow_process_fixture() -> Run:
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
