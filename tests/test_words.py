"""Words that orbiflow does without, and files, names and links of its pages, which are there."""

import ast
import importlib
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
