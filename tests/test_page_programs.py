"""Programs in Python that pages print: they run in the page's order and print what the page says."""

import re
import shutil
from pathlib import Path

import pytest

from shell_lines import ROOT
from test_page_commands import little_fixture, workshop_fixture  # noqa: F401

TWENTY = "docs/twenty-lines.md"
PRINTED = {
    "README.md": (r"IH\d+ True\n", "turtles.png"),
    "docs/artwork.md": ("", None),
    "docs/export.md": (r".*cut\.svg.*\n", "cut.svg"),
    "docs/operations.md": (r"a first tile: IH6\ndone out/turtle\n", "out/turtle/overview.png"),
    "docs/python.md": (
        r".*True\nTrue True\n.*\nDensity on the torus\. The edges with one arrow head.*\n"
        r"(True\n){3}Dashed: the silhouette as it was.*\n",
        "density-alone.pdf",
    ),
    "docs/quotients.md": (
        r"p4g: 0\.[67]\d nats above uniform on 600 new places\n"
        r"p1: 0\.[123]\d nats above uniform on 600 new places\nTrue True\n",
        "p4g.png",
    ),
    "docs/solids.md": (r".*\n", "cutter.stl"),
    "docs/tilings.md": (r"cmm D1 True\n", None),
    "docs/volume.md": ("", None),
    f"{TWENTY}#0": (r"off by 0\.0\d+\n", "carried.png"),
    f"{TWENTY}#1": (r"there and back: \de-(0[4-9]|1\d)\n", "p6m.png"),
    f"{TWENTY}#2": (
        r"step 0: no two atoms nearer than 0\.15\nstep 100: no two atoms nearer than 0\.[45]\d\n",
        None,
    ),
    f"{TWENTY}#3": (
        r"the same patches: \de-1\d nats apart\nintegral: (1\.000\d|0\.999\d)\n\[\[.*\]\]\n",
        "stripes/density.png",
    ),
    f"{TWENTY}#4": (r"IH\d+ True 0\.[789]\d?\n\(\d+, 2\) gap \de-1\d\n", "tile.svg"),
    f"{TWENTY}#5": (
        r"True a loss of one's own was lowered from -0\.369\d to -1\.[67]\d* in \d+ steps.*\n",
        "fish.png",
    ),
    # the first cheats; the second is the same at eight times as many steps
    f"{TWENTY}#6": (
        r"1 steps: [5-9]\.\d\d nats\n8 steps: -\d+\.\d\d nats\nintegral \S+e\+\d\d\n"
        r"\d steps: 1\.1\d nats\n\d\d steps: 1\.1\d nats\nintegral (0\.999|1|1\.00)\n",
        "fitted.png",
    ),
    f"{TWENTY}#7": (
        r"held out: (0|1)\.\d\d nats\nintegrals: \[(1\. *|0\.99 *|1\.01 *){3}\]\n",
        "contexts.png",
    ),
}
"""What the programs of a page print, or that of a number there, and a file that they leave."""

SMALLER = (
    *(("range(60)", "range(25)"), ("range(40)", "range(15)")),
    ('(effort="fast")', '(effort="fast", classes=["IH4"])'),
    ("escherize(target)", 'escherize(target, orbiflow.EscherizeSettings(classes=["IH4"]))'),
    ('"effort": "fast"}', '"effort": "fast", "classes": ["IH6"]}'),
    *(("torch.rand(1000,", "torch.rand(100,"), ("iterations=20)", "iterations=5)")),
    *(
        ('"900x600px"', '"300x200px"'),
        ("seconds=4", "seconds=1"),
        ("4.0, (500, 2)", "4.0, (150, 2)"),
    ),
)
"""What makes a program quick enough for a test."""


def programs(page: str) -> list[str]:
    """The programs of a page, or the one whose number stands behind it."""
    name, _, number = page.partition("#")
    found = re.findall(r"```python\n(.*?)```", (ROOT / name).read_text("utf-8"), flags=re.DOTALL)
    return [found[int(number)]] if number else found


@pytest.mark.parametrize("page", PRINTED)
def test_a_page(page: str, workshop: Path, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(shutil.copytree(workshop, tmp_path / "desk", symlinks=True))
    names: dict[str, object] = {"__name__": "__main__"}
    for program in programs(page):
        for whole, part in SMALLER:
            program = program.replace(whole, part)
        exec(compile(program, page, "exec"), names)
    said, left = PRINTED[page]
    assert re.fullmatch(said, capsys.readouterr().out)
    assert left is None or Path(left).stat().st_size > 1000


def test_there_are_eight_programs_of_twenty_lines() -> None:
    assert len(programs(TWENTY)) == 8
    for program in programs(TWENTY):
        lines = [line for line in program.splitlines() if line and "import" not in line]
        assert len(lines) <= 20
