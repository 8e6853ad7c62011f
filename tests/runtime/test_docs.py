"""What docs/operations.md says runs, and its events are those that there are."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from PIL import Image, ImageDraw

from orbiflow.runtime import Event, call_from_json
from runtime.searches import BOOT

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "operations.md").read_text(encoding="utf-8")


def test_the_snippet(tmp_path: Path, monkeypatch, capsys: pytest.CaptureFixture[str]) -> None:
    (snippet,) = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)
    turtle = Image.new("1", (260, 210), 1)  # a plainer one than in examples
    ImageDraw.Draw(turtle).polygon(BOOT, fill=0)
    turtle.save(tmp_path / "turtle.png")
    monkeypatch.chdir(tmp_path)
    one_class = snippet.replace('"effort": "fast"', '"effort": "fast", "classes": ["IH6"]')
    assert one_class != snippet
    exec(compile(one_class, "operations.md", "exec"), {})
    assert capsys.readouterr().out == "a first tile: IH6\ndone out/turtle\n"


def test_the_call() -> None:
    (text,) = re.findall(r"```json\n(.*?)```", TEXT, flags=re.DOTALL)
    assert call_from_json(json.loads(text)).to_json()["classes"] == ["IH4", "IH6"]


def test_the_events() -> None:
    table = TEXT[TEXT.index("| event") : TEXT.index("Events of several")]
    named = {name for row in table.splitlines() for name in re.findall(r"`([A-Z]\w+)`", row[:40])}
    assert named == {kind.__name__ for kind in Event.__subclasses__()}
