"""The programs of docs/quotients.md run and print what the page says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[1] / "docs" / "quotients.md").read_text("utf-8")
PROGRAMS = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
SAID = (
    r"p4g: 0\.[67]\d nats above uniform on 600 new places\n"
    r"p1: 0\.[123]\d nats above uniform on 600 new places\n",
    r"True True\n",
)


@pytest.mark.parametrize("number", range(2))
def test_a_program(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    names = {"__name__": f"quotients_page_{number}"}
    exec(compile(PROGRAMS[number], "quotients.md", "exec"), names)
    assert re.fullmatch(SAID[number], capsys.readouterr().out)
    assert number or (tmp_path / "p4g.png").stat().st_size > 1000
