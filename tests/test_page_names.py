"""Files and names of the library that the pages of docs mention are there, and links lead somewhere."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = sorted({*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")})
FOLDERS = ("src", "tests", "benchmarks", "reproduction", "docs", "examples", "typings")
FILES = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")]
ELSEWHERE = {"manifm/datasets.py", "score_sde/datasets/split.py"}
"""Files of other projects' repositories."""

each_page = pytest.mark.parametrize(
    "page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix()
)


def prose(page: Path) -> str:
    """The page without its blocks of code, which are run by tests of their own."""
    return re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)


@each_page
def test_files_are_there(page: Path) -> None:
    if page.name == "architecture.md":
        pytest.skip("is written anew once all files are at their final places")
    named = set(re.findall(r"`([\w.-]+(?:/[\w.-]+)+\.py)`", prose(page))) - ELSEWHERE
    assert [name for name in named if not any(f"/{name}" in str(file) for file in FILES)] == []


@each_page
def test_names_are_there(page: Path) -> None:
    for name in set(re.findall(r"`(orbiflow(?:\.[a-zA-Z]\w*)+)[`(]", prose(page))):
        found = importlib.import_module("orbiflow")
        for part in name.split(".")[1:]:
            if not hasattr(found, part):
                importlib.import_module(f"{found.__name__}.{part}")
            found = getattr(found, part)


@each_page
def test_links_lead_somewhere(page: Path) -> None:
    for link in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if "://" in link:
            continue
        path, _, heading = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), link
        if heading:
            assert heading in headings(target), link


def headings(page: Path) -> set[str]:
    """The anchors that a page's headings give."""
    lines = re.findall(r"^#+ (.*)$", prose(page), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", line.lower()).replace(" ", "-") for line in lines}
