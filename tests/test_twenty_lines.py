"""The programs of docs/twenty-lines.md: short as it says, and they run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[1] / "docs" / "twenty-lines.md"
PROGRAMS = re.findall(
    r"^## (.*?)$.*?```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE
)
SAID = (
    r"off by 0\.0\d+\n",
    r"there and back: \de-(0[4-9]|1\d)\n",
    r"step 0: no two atoms nearer than 0\.15\nstep 100: no two atoms nearer than 0\.[45]\d\n",
    r"the same patches: \de-1\d nats apart\nintegral: (1\.000\d|0\.999\d)\n\[\[.*\]\]\n",
    r"IH\d+ True 0\.[89]\d?\n\(\d+, 2\) gap \de-1\d\n",
)
LEFT = ("carried.png", "p6m.png", None, "stripes/density.png", "tile.svg")


@pytest.mark.parametrize("number", range(5))
def test_a_program(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    name, program = PROGRAMS[number]
    exec(compile(program, name, "exec"), {"__name__": "__main__"})
    assert re.fullmatch(SAID[number], capsys.readouterr().out)
    left = LEFT[number]
    assert left is None or (tmp_path / left).stat().st_size > 1000


def test_there_are_five_and_they_are_short() -> None:
    assert len(PROGRAMS) == len(SAID) == 5
    for _, program in PROGRAMS:
        lines = [line for line in program.splitlines() if line and "import" not in line]
        assert len(lines) <= 20
