"""The quick-start notebook runs, and holds what its cells show."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import nbformat

ROOT = Path(__file__).parents[1]
BOOK = ROOT / "docs" / "quickstart.ipynb"


def kinds(book: Any) -> list[list[str]]:
    """What each code cell shows."""
    return [
        [*output.get("data", {}), *([output.name] if "name" in output else [])]
        for cell in book.cells
        if cell.cell_type == "code"
        for output in [*cell.outputs]
    ]


def test_every_cell_runs_and_shows_what_is_stored(tmp_path: Path) -> None:
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    (tmp_path / "docs").mkdir()
    copy = Path(shutil.copy(BOOK, tmp_path / "docs"))
    stored = nbformat.read(BOOK, as_version=4)
    bare = nbformat.read(copy, as_version=4)
    for cell in bare.cells:
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
    nbformat.write(bare, copy)
    command = [sys.executable, Path(__file__).with_name("notebooks.py"), copy]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    assert kinds(nbformat.read(copy, as_version=4)) == kinds(stored)
    assert sum("image/png" in kind for kind in kinds(stored)) == 4
    made = {path.name for path in (tmp_path / "docs" / "out" / "quickstart").iterdir()}
    assert made == {"turtles.svg", "turtles.png", "density.pdf"}


def test_it_can_be_read_where_nothing_is_run() -> None:
    book = nbformat.read(BOOK, as_version=4)
    nbformat.validate(book)
    assert BOOK.stat().st_size < 700_000
    for cell in book.cells:
        if cell.cell_type == "code":
            assert cell.execution_count
