"""Ctrl-C during a run."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

BOOT = [[60, 20], [210, 20], [230, 80], [170, 95], [160, 190], [100, 145], [45, 80]]
NAMES = ["IH7", "IH1", "IH2", "IH4"]


def session_members(session: int) -> list[int]:
    """Processes of a session that are still running, zombies left out."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue  # ended meanwhile
        if int(fields[3]) == session and fields[0] != "Z":
            found.append(int(path.parent.name))
    return found


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are listed by /proc")
@pytest.mark.parametrize("whole_group", [False, True], ids=["to the process", "to the group"])
def test_what_was_finished_is_written(whole_group: bool, tmp_path: Path) -> None:
    path, out = tmp_path / "boot.json", tmp_path / "out"
    path.write_text(json.dumps(BOOT))
    command = [sys.executable, "-m", "orbiflow", "escherize", str(path), "--out", str(out)]
    command += ["--classes", ",".join(NAMES), "--workers", "2", "--turns", "1"]
    command += ["--method", "occupancy"]
    command += ["--iterations", "20", "--max-frequency", "3"]
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        assert process.stdout is not None
        first = ""
        for first in process.stdout:
            if "IoU" in first:
                break
        assert "IoU" in first
        # a terminal sends Ctrl-C to the whole foreground group, workers included
        (os.killpg if whole_group else os.kill)(process.pid, signal.SIGINT)
        rest, errors = process.communicate(timeout=120)
    assert "Traceback" not in errors, errors
    assert process.returncode == 130
    document = json.loads((out / "result.json").read_text(encoding="utf-8"))
    done = [entry["class"] for entry in document["tiles"]]
    assert 1 <= len(done) < len(NAMES), rest
    assert sorted(done + [entry["class"] for entry in document["failed"]]) == sorted(NAMES)
    assert {entry["reason"] for entry in document["failed"]} == {"interrupted"}
    for name in done:
        assert (out / name / "tile.svg").is_file()
    deadline = time.monotonic() + 10
    while session_members(process.pid) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert session_members(process.pid) == []
