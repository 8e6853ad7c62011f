"""Every shell line of README and docs would be accepted by the program that it names."""

from pathlib import Path

import pytest

from shell_lines import ROOT, Line, lines, refusal

PAGES = sorted(
    {*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").rglob("*.md")}
    - {ROOT / "docs" / "gallery" / "README.md"}  # test_gallery.py reads its commands
)
LINES = list(dict.fromkeys(line for page in PAGES for line in lines(page)))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_the_lines_of_a_page(page: Path) -> None:
    wrong = {}
    for line in dict.fromkeys(lines(page)):
        refused = refusal(line.words)
        if refused and not (refused.incomplete and not line.whole):
            wrong[line.text] = refused.reason
    assert wrong == {}


def test_there_are_lines_to_try() -> None:
    tried = {line.words[0] for line in LINES}
    assert tried >= {"orbiflow", "make", "python", "pip"}
    assert sum(line.whole for line in LINES) > 60


@pytest.mark.parametrize(
    ("words", "what"),
    [
        ("orbiflow density sample --cuont 500", "--cuont"),
        ("orbiflow escherizer turtle.png", "escherizer"),
        ("orbiflow escherize turtle.png --effort most", "most"),
        ("orbiflow density fit a.csv --space plane", "plane"),
        ("orbiflow density fit a.csv --space torus --seed one", "--seed"),
        ("make everything", "everything"),
        ("python benchmarks/nothing.py", "benchmarks/nothing.py"),
        ("python benchmarks/escherization.py --effort most", "--effort"),
        ("python benchmarks/field.py --fast", "--fast"),
        ("python -m reproduction --quick", "--quick"),
        ("pip install '.[everything]'", "everything"),
        ("orbiflo escherize turtle.png", "orbiflo"),
    ],
)
def test_a_mistake_is_found(words: str, what: str) -> None:
    refused = refusal(Line("", words, whole=True).words)
    assert refused is not None
    assert not refused.incomplete
    assert what in refused.reason


def test_what_is_left_out_is_told_apart() -> None:
    for words in (
        "orbiflow density fit",
        "orbiflow export",
        "python benchmarks/likeness_blind.py score",
    ):
        refused = refusal(words.split())
        assert refused is not None
        assert refused.incomplete


def test_reading_a_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "```sh\nmake demo  # first\nawk 'a\nb' c\n```\n\n    orbiflow art a \\\n        --out b\n\n"
        "Then `make\ntest`.\n\n```\nmake nothing\n```\n"
    )
    monkeypatch.setattr("shell_lines.ROOT", tmp_path)
    assert [(line.words, line.whole) for line in lines(page)] == [
        (["make", "demo"], True),
        (["awk", "a\nb", "c"], True),
        (["orbiflow", "art", "a", "--out", "b"], True),
        (["make", "test"], False),
    ]
