"""What the package names at its top is there, and costs nothing until it is used."""

import re
import runpy
from pathlib import Path

import pytest

import orbiflow
from refusals import refused

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize("name", orbiflow.__all__)
def test_every_public_name_is_there(name: str) -> None:
    found = getattr(orbiflow, name)
    assert getattr(found, "__name__", name) == name
    assert (found.__doc__ or "").strip()
    assert name in dir(orbiflow)


MOST_PUBLIC_NAMES = 142
INTERNAL = {"ItemDone", "Preview", "write_atomic", "stats"}
"""What some pages import of rooms, to show how the inside works."""


def test_the_public_face_is_small_and_on_one_page() -> None:
    made = runpy.run_path(str(ROOT / "docs" / "reference" / "make.py"))
    assert len(orbiflow.__all__) <= MOST_PUBLIC_NAMES
    topics = [name for names in made["TOPICS"].values() for name in names.split()]
    assert sorted(topics) == sorted(orbiflow.__all__)
    hint = "run python docs/reference/make.py"
    assert made["NAMES"].read_text("utf-8") == made["names_page"](), hint


def test_pages_import_what_is_public() -> None:
    texts = [
        page.read_text("utf-8") for page in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    ]
    blocks = "\n".join(re.findall(r"```python\n(.*?)```", "\n".join(texts), re.DOTALL))
    found = re.findall(r"^from orbiflow\.[\w.]+ import ([\w, ]+)$", blocks, re.MULTILINE)
    assert {name for names in found for name in names.split(", ")} <= INTERNAL


def test_an_unknown_name_is_refused() -> None:
    with refused("orbiflow", "tessellate", kind=AttributeError):
        _ = orbiflow.tessellate  # pyright: ignore[reportAttributeAccessIssue]
