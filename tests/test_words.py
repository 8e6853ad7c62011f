"""Words that the prose and the names of orbiflow do without, so that strangers can read them."""

from __future__ import annotations

import re
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
