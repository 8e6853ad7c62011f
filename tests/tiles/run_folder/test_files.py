"""Files appear whole or not at all."""

import os
from pathlib import Path

import pytest

from orbiflow.errors import OutputError
from orbiflow.runtime import write_atomic
from refusals import refused


def test_writes_text_and_bytes_and_replaces(tmp_path: Path) -> None:
    target = tmp_path / "tile.svg"
    assert write_atomic(target, "größe") == target
    assert target.read_text(encoding="utf-8") == "größe"
    write_atomic(str(target), b"\x00\xff")
    assert target.read_bytes() == b"\x00\xff"
    assert list(tmp_path.iterdir()) == [target]


def test_missing_folder(tmp_path: Path) -> None:
    with refused("tile.svg", "none", kind=OutputError):
        write_atomic(tmp_path / "none" / "tile.svg", "x")


def test_target_is_a_folder(tmp_path: Path) -> None:
    (tmp_path / "tile.svg").mkdir()
    with refused("tile.svg", kind=OutputError):
        write_atomic(tmp_path / "tile.svg", "x")
    assert [path.name for path in tmp_path.iterdir()] == ["tile.svg"]


def test_a_failure_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "tile.svg"
    write_atomic(target, "old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with refused("tile.svg", kind=OutputError):
        write_atomic(target, "new")
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_pipe_is_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with refused("pipe", kind=OutputError):
        write_atomic(pipe, "x")
    assert pipe.is_fifo()
    assert list(tmp_path.iterdir()) == [pipe]
