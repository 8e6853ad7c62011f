"""Ctrl-C or SIGTERM during a run, and what is told of progress meanwhile."""

import io
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from cli.conftest import LAUNCH
from orbiflow.cli import app, terminal
from orbiflow.cli.terminal import Terminal, stopped_by_signals
from orbiflow.runtime import Call, Cancel, Outcome, Progress, Sink

BOOT = [[60, 20], [210, 20], [230, 80], [170, 95], [160, 190], [100, 145], [45, 80]]
STOPS = [signal.SIGINT, signal.SIGTERM]
NAMES = ["IH7", "IH1", "IH2", "IH4"]
TESTS = str(Path(__file__).parents[1])

# one class is done soon, the others never
FIRST_IS_SHORT = f"import sys; sys.path.append({TESTS!r})\nimport runtime.endless_process\n"
# workers that hear nothing, and all the time in the world for them; each says so in one write, or
# two who speak at once would make one line
DEAF = FIRST_IS_SHORT + (
    "import os, time\n"
    "from orbiflow.cli import terminal\n"
    "terminal.PROGRESS_SECONDS = 1e9\n"  # no line of progress, however long the machine takes
    "from orbiflow.runtime import Cancel, processes\n"
    "from runtime import endless_process\n"
    "def fit(*_, **__):\n"
    "    os.write(1, b'deaf\\n')\n"
    "    time.sleep(1e6)\n"
    "endless_process.LikenessSearch.fit, processes.GRACE_SECONDS = fit, 1e6\n"
    "tell = Cancel.cancel\n"
    "def cancel(self):\n"
    "    tell(self)\n"
    "    os.write(1, b'told\\n')\n"
    "Cancel.cancel = cancel\n"
)


@contextmanager
def running(tmp_path: Path, *, before: str = "") -> Iterator[subprocess.Popen[str]]:
    """A search by two workers, in a session of its own."""
    path = tmp_path / "boot.json"
    path.write_text(json.dumps(BOOT))
    command = [sys.executable, "-u", "-c", before + LAUNCH, "escherize", str(path)]
    command += ["--out", str(tmp_path / "out"), "--classes", ",".join(NAMES), "--workers", "2"]
    command += ["--effort", "fast"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        try:
            yield process
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)


def wait_for(process: subprocess.Popen[str], text: str) -> None:
    assert process.stdout is not None
    for line in process.stdout:
        if text in line:
            return
    assert process.stderr is not None
    raise AssertionError(f"no {text!r}: {process.stderr.read()}")


@pytest.mark.skipif(os.name != "posix", reason="sends signals")
def test_what_was_finished_is_written(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with running(tmp_path, before=FIRST_IS_SHORT) as process:
        wait_for(process, "IH1: tile found")
        # workers do not hear it; of Ctrl-C, which they hear, too, is the next test
        process.terminate()
        # returns once the last process that holds the pipes has ended
        rest, errors = process.communicate()
    assert "Traceback" not in errors, errors
    assert process.returncode == 130, rest + errors
    document = json.loads((out / "result.json").read_text(encoding="utf-8"))
    assert [entry["class"] for entry in document["tiles"]] == ["IH1"]
    left = {entry["class"]: entry["reason"] for entry in document["failed"]}
    assert left == dict.fromkeys(set(NAMES) - {"IH1"}, "interrupted")
    assert (out / "IH1" / "tile.svg").is_file()


@pytest.mark.skipif(os.name != "posix", reason="sends signals")
def test_a_second_one_ends_at_once(tmp_path: Path) -> None:
    with running(tmp_path, before=DEAF) as process:
        for _ in range(2):
            wait_for(process, "deaf")
        os.killpg(process.pid, signal.SIGINT)
        wait_for(process, "told")
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate()
    assert process.returncode == 130
    assert errors == "interrupted\n"


@pytest.mark.parametrize("stop", STOPS)
def test_the_token_of_a_stop(stop: int) -> None:
    usual = signal.default_int_handler if stop == signal.SIGINT else signal.SIG_DFL
    before = signal.signal(stop, usual)
    try:
        cancel = Cancel()
        with stopped_by_signals(cancel):
            assert not cancel.cancelled
            signal.raise_signal(stop)
            assert cancel.cancelled
            assert signal.getsignal(stop) is usual  # what a second one meets
        assert signal.getsignal(stop) is usual
        # a shell that ignores it is obeyed
        signal.signal(stop, signal.SIG_IGN)
        cancel = Cancel()
        with stopped_by_signals(cancel):
            signal.raise_signal(stop)
            assert not cancel.cancelled
    finally:
        signal.signal(stop, before)


@dataclass
class Clock:
    """A clock that stands still until it is put forward."""

    now: float = 100.0

    def __call__(self) -> float:
        return self.now


def test_a_line_every_ten_seconds_or_a_terminals_bar_alone(capsys, monkeypatch) -> None:
    clock = Clock()
    with Terminal(clock=clock) as shown:
        for second in range(31):
            clock.now = 100.0 + second
            shown(Progress(second / 40, "fitting", "IH4", second / 30))
        lines = capsys.readouterr().err.splitlines()
        assert lines == [
            "  25% after 10 s: fitting IH4, 33% of it; about 30 s left",
            "  50% after 20 s: fitting IH4, 67% of it; about 20 s left",
            "  75% after 30 s: fitting IH4, 100% of it; about 10 s left",
        ]
        shown(Progress(1.0, "fitting", "IH4", 1.0))
        clock.now += 60
        assert not shown.watch()  # there is no more to tell
    screen = Console(file=io.StringIO(), force_terminal=True)
    monkeypatch.setattr(terminal, "output", screen)
    with Terminal(clock=clock) as shown:
        shown(Progress(0.0, "fitting"))
        clock.now += 60
        shown(Progress(0.5, "fitting"))
    assert not capsys.readouterr().err


def test_what_was_done_before_does_not_count_as_speed(capsys: pytest.CaptureFixture[str]) -> None:
    clock = Clock()
    with Terminal(clock=clock) as shown:
        clock.now += 20
        shown(Progress(0.8, "8 of 10"))
        clock.now += 200
        shown.watch()
        shown(Progress(0.9, "9 of 10"))
        clock.now += 10
        shown.watch()
    assert capsys.readouterr().err.splitlines() == [
        "  80% after 3 min: 8 of 10",
        "  90% after 4 min: 9 of 10; about 4 min left",
    ]


def test_work_that_says_nothing_is_told_of_too(capsys, monkeypatch, tmp_path) -> None:
    """Whoever works looks at the token: a step may take minutes without an event."""
    clock = Clock()
    monkeypatch.setattr(terminal, "Terminal", lambda named: Terminal(named, clock))

    def run(_call: Call, on_event: Sink, cancel: Cancel) -> Outcome:
        on_event(Progress(0.0, "fitting"))
        clock.now += 15
        cancel.check()
        return Outcome()

    monkeypatch.setattr(Call, "run", run)
    given: list[Any] = [["batch", str(tmp_path)], ["density", "fit", "X", "--space", "torus"]]
    for words in given:
        assert app.run(words) == 0
        assert capsys.readouterr().err == "  0% after 15 s: fitting\n"
