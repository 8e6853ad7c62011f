"""Words that the prose and the names of orbiflow do without, so that strangers can read them."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TEXTS = [
    ROOT / "README.md",
    *(
        path
        for place in ("src/**/*.py", "src/**/*.pyi", "docs/**/*.md", "docs/**/*.py")
        for path in sorted(ROOT.glob(place))
    ),
]
BANNED = {
    "a quantity and its unit, or what the thing is": (
        r"(?m)^(CALM|DEAR|HOPELESS|SOUND)\b|\b(Hand|_no|as_written|go_through|still_flow|told_of)\b"
        r"|\b(asked|enough|place|slopes)\.py\b|\bpartial/"
    ),
    "predict": r"\b(foretell|foretells|foretold)\b",
    "report, note, state": r"\b(is|are) said\b",
    "reach, use, make": r"\bbe had\b",
    "resume": r"ended in any way",
    "choose among": r"rows held out choose",
    "cannot be run": r"is no request that",
    "require complete rows": r"(is|are) of whole rows",
    "apply only to": r"palette is of fills|belongs to cut none",
}


@pytest.mark.parametrize("better", BANNED)
def test_words(better: str) -> None:
    places = [
        f"{path.relative_to(ROOT)}: {found[0]}"
        for path in TEXTS
        for found in re.finditer(BANNED[better], path.read_text(encoding="utf-8"))
    ]
    assert not places, f"write instead: {better}; {places}"


def messages(path: Path) -> Iterator[str]:
    """Texts in a file but for docstrings, names of options, and commands in backticks."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    left_out: set[int] = set()
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Name)
            and node.func.id == "Option"
        ):
            left_out.update(id(part) for part in ast.walk(node))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            left_out.add(id(node.value))
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and id(node) not in left_out
        ):
            yield re.sub(r"`[^`]*(`|$)", "", node.value)


def test_messages_name_arguments_and_no_flags() -> None:
    """The command line and the studio put their own names into braces."""
    source = ROOT / "src" / "orbiflow"
    flags = [
        f"{path.relative_to(source)}: {text}"
        for path in sorted(source.rglob("*.py"))
        if path.relative_to(source).parts[0] != "cli"
        for text in messages(path)
        if re.search(r"(?<![\w-])--[a-z]", text)
    ]
    allowed = {
        "runtime/call_process.py: --again",
        "batch/dask_cluster.py:  --nthreads 1 --nworkers N",
    }
    assert set(flags) <= allowed, flags  # of other programs
