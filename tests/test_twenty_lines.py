"""The programs of docs/twenty-lines.md: short as it says, and they run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from density.quick_fits import quick_fits, quick_pictures

PAGE = Path(__file__).parents[1] / "docs" / "twenty-lines.md"
PROGRAMS = re.findall(
    r"^## (.*?)$.*?```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE
)
SAID = (
    r"off by 0\.0\d+\n",
    r"there and back: \de-(0[4-9]|1\d)\n",
    r"step 0: no two atoms nearer than 0\.15\nstep 100: no two atoms nearer than 0\.[45]\d\n",
    r"the same patches: \de-1\d nats apart\nintegral: (1\.000\d|0\.999\d)\n\[\[.*\]\]\n",
    r"IH\d+ True 0\.[789]\d?\n\(\d+, 2\) gap \de-1\d\n",
    r"True a loss of one's own was lowered from -0\.369\d to -1\.[67]\d* in \d+ steps.*\n",
    # the first cheats; the second is the same at eight times as many steps
    r"1 steps: [5-9]\.\d\d nats\n8 steps: -\d+\.\d\d nats\nintegral \S+e\+\d\d\n"
    r"\d steps: 1\.1\d nats\n\d\d steps: 1\.1\d nats\nintegral (0\.999|1|1\.00)\n",
    r"held out: (0|1)\.\d\d nats\nintegrals: \[(1\. *|0\.99 *|1\.01 *){3}\]\n",
)
# what makes a program quick enough for a test
SMALLER = (
    ("range(60)", "range(25)"),
    ("range(40)", "range(15)"),
    ('effort="fast"', 'effort="fast", classes=["IH4"]'),
)
LEFT = (
    *("carried.png", "p6m.png", None, "stripes/density.png", "tile.svg"),
    *("fish.png", "fitted.png", "contexts.png"),
)


@pytest.mark.usefixtures("small_searches")
@pytest.mark.parametrize("number", range(8))
def test_a_program(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    quick_fits(monkeypatch)
    quick_pictures(monkeypatch)
    name, program = PROGRAMS[number]
    for whole, part in SMALLER:
        program = program.replace(whole, part)
    exec(compile(program, name, "exec"), {"__name__": "__main__"})
    assert re.fullmatch(SAID[number], capsys.readouterr().out)
    left = LEFT[number]
    assert left is None or (tmp_path / left).stat().st_size > 1000


def test_there_are_eight_and_they_are_short() -> None:
    assert len(PROGRAMS) == len(SAID) == 8
    for _, program in PROGRAMS:
        lines = [line for line in program.splitlines() if line and "import" not in line]
        assert len(lines) <= 20
