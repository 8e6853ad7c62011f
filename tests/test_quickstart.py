"""The quick-start notebook runs, and holds what its cells show."""

import re
import shutil
from pathlib import Path
from typing import Any

import nbformat

import notebooks
from refusals import refused

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


NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


def texts(book: Any) -> str:
    """What its code cells print."""
    outputs = [o for cell in book.cells if cell.cell_type == "code" for o in cell.outputs]
    return "\n".join(output.get("text", "") for output in outputs)


def assert_same_text(fresh: str, stored: str) -> None:
    """The same words, and numbers within one of the last digit: other machines round differently."""
    again = "run `python tests/notebooks.py docs/quickstart.ipynb` and look at what it stores"
    assert NUMBER.sub("#", fresh) == NUMBER.sub("#", stored), again
    for new, old in zip(NUMBER.findall(fresh), NUMBER.findall(stored), strict=True):
        digits = len(old.partition(".")[2])
        assert abs(float(new) - float(old)) < 1.5 * 10**-digits, f"{new} was {old}: {again}"


def test_texts_are_compared_to_the_last_digit() -> None:
    assert_same_text("integral 1.001, at [-62, 3]", "integral 1.000, at [-61, 3]")
    for fresh, stored in (("p [-6.3]", "p [-6.5]"), ("-93 degrees", "-18 degrees"), ("a 1", "b 1")):
        with refused("quickstart.ipynb", kind=AssertionError):
            assert_same_text(fresh, stored)


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
    fresh = notebooks.run(copy, copy.parent)
    nbformat.validate(fresh)
    assert kinds(fresh) == kinds(stored)
    assert_same_text(texts(fresh), texts(stored))
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
