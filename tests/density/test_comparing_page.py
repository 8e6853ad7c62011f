"""What docs/comparing.md says in Python runs."""

import re
from pathlib import Path

import pytest

from orbiflow.settings import OPERATIONS

TEXT = (Path(__file__).parents[2] / "docs" / "comparing.md").read_text(encoding="utf-8")


def test_the_snippets(capsys: pytest.CaptureFixture[str]) -> None:
    first, second, *_ = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)
    exec(compile(first, "comparing.md", "exec"), {})
    said = capsys.readouterr().out.splitlines()
    assert said[2] == "[ True False]"
    assert said[1].split()[0] in ("True", "False")
    exec(compile(second, "comparing.md", "exec"), {})
    statistic, p = map(float, capsys.readouterr().out.split())
    assert statistic > 1
    assert p < 0.05


def test_the_commands_are_there() -> None:
    for name in re.findall(r"^orbiflow density (\w+)", TEXT, flags=re.MULTILINE):
        assert f"density {name}" in OPERATIONS
