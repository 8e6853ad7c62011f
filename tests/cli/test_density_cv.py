"""`orbiflow density cv`: what a user sees, and mistakes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from cli.conftest import LAUNCH
from density.cross_validation.small_tables import lines_of, table_of

QUICK = ("--space", "torus", "--components", "mixture", "--against", "uniform", "--folds", 2)


def test_twice(tmp_path: Path, orbiflow: Any) -> None:
    data = table_of(tmp_path, 40, protein=[f"p{k // 4}" for k in range(40)])
    command = ("density", "cv", data, "--out", tmp_path / "out", "--group", "protein", *QUICK)
    first = orbiflow(*command, "--workers", 1)
    assert first.status == 0, first.err
    assert "2 fits for one process" in first.out
    assert "folds/mixture-1-01: held out -" in first.out
    assert "mean log density at 40 rows in 10 groups, in nats:" in first.out
    assert "mixture is better than uniform" in first.out
    assert f"2 of 2 done, in {first.out.split('2 of 2 done, in ')[1].split()[0]} s" in first.out
    assert f"look at {tmp_path / 'out' / 'index.html'}" in first.out
    second = orbiflow(*command, "--workers", 1)
    assert second.status == 0
    assert "2 fits: 2 are done already, 0 to do" in second.out
    assert "mixture is better than uniform" in second.out
    assert "nothing was left to do" in second.out


@pytest.mark.skipif(os.name != "posix", reason="sends signals")
def test_ctrl_c_says_how_to_go_on(tmp_path: Path) -> None:
    data = table_of(tmp_path, 4000)
    command = [sys.executable, "-u", "-c", LAUNCH, "density", "cv", data, "--space", "torus"]
    with subprocess.Popen(
        [str(part) for part in (*command, "--out", tmp_path / "out", "--workers", "2")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        assert process.stdout is not None
        while "20 fits for 2 processes" not in (line := process.stdout.readline()):
            assert line, process.communicate()
        os.killpg(process.pid, signal.SIGINT)
        rest, said = process.communicate()
    assert process.returncode == 130, rest + said
    left = 20 - len(lines_of(tmp_path / "out" / "cv.csv"))
    assert f"interrupted with {left} still to do: run the same command again to resume" in said
    assert not list(tmp_path.glob("out/**/*.tmp"))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--folds", "1"), "--folds must be from 2 to 1000, got '1'"),
        (("--folds", "41"), "41 folds need as many rows, there are 40"),
        (("--group", "protein", "--folds", "11"), "11 folds need as many groups, there are 10"),
        (("--group", "chain"), "no column 'chain'; it has phi, psi, protein"),
        (("--columns", "phi,chi"), "no column 'chi'"),
        (("--against", "mixture,magic"), "--against must be of flow, kernels, mixture, chains"),
        (("--against", "mixture"), "--components and --against are both mixture"),
        (("--components", "mixture,chains", "--against", "chains+mixture"), "both mixture+chains"),
        (("--workers", "0"), "--workers must be at least 1"),
        (
            ("--workers", "2", "--scheduler", "tcp://127.0.0.1:1"),
            "--scheduler and --workers exclude",
        ),
        (("--out", "diary"), "holds page.txt, which is of no earlier cross-validation"),
    ],
)
def test_mistakes(
    arguments: tuple[str, ...], message: str, tmp_path: Path, orbiflow: Any, monkeypatch: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    table_of(tmp_path, 40, protein=[f"p{k // 4}" for k in range(40)])
    (tmp_path / "diary").mkdir()
    (tmp_path / "diary" / "page.txt").touch()
    usual = dict(zip(QUICK[::2], QUICK[1::2], strict=True))
    others = [word for name in usual if name not in arguments for word in (name, usual[name])]
    outcome = orbiflow("density", "cv", "angles.csv", *others, *arguments)
    assert outcome.status == 2
    assert outcome.err.startswith("error: ")
    assert message in " ".join(outcome.err.split())
    assert not (tmp_path / "cv").exists()
