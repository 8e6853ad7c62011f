"""Progress where the output is a file or a pipe: a line every ten seconds on the standard error."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from orbiflow.cli import app, terminal
from orbiflow.cli.terminal import Terminal
from orbiflow.runtime import Call, Cancel, Outcome, Progress, Sink


@dataclass
class Clock:
    """A clock that stands still until it is put forward."""

    now: float = 100.0

    def __call__(self) -> float:
        return self.now


def test_a_line_every_ten_seconds(capsys: pytest.CaptureFixture[str]) -> None:
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
    assert not capsys.readouterr().err


def test_what_was_done_before_does_not_count_as_speed(capsys: pytest.CaptureFixture[str]) -> None:
    clock = Clock()
    shown = Terminal(clock=clock)
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


def test_a_terminal_has_its_bar_alone(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    screen = Console(file=io.StringIO(), force_terminal=True)
    monkeypatch.setattr(terminal, "output", screen)
    clock = Clock()
    with Terminal(clock=clock) as shown:
        shown(Progress(0.0, "fitting"))
        clock.now += 60
        shown(Progress(0.5, "fitting"))
    assert not capsys.readouterr().err


def test_work_that_says_nothing_is_told_of_too(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
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
