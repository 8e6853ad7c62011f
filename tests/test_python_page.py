"""What docs/python.md says runs, in its order."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from PIL import Image

import orbiflow
from density.quick_fits import quick_fits, quick_pictures
from orbiflow import density, drawing, tiles

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")


@pytest.mark.usefixtures("small_searches")
def test_the_snippets(tmp_path: Path, monkeypatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    quick_fits(monkeypatch)
    quick_pictures(monkeypatch)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    names: dict[str, object] = {}
    for snippet in re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL):
        exec(compile(snippet, "python.md", "exec"), names)
    said = capsys.readouterr().out.splitlines()
    assert said[0].endswith("True")
    assert said[1] == "True True"
    assert said[3].startswith("Density on the torus. The edges with one arrow head")
    assert said[4:7] == ["True"] * 3
    assert said[7].startswith("Dashed: the silhouette as it was")
    for name in ("cut.svg", "turtles.svg", "cut.dxf", "boxes.png"):
        assert (tmp_path / name).stat().st_size > 1000
    for name in ("figure.pdf", "density.pdf", "density-alone.pdf"):
        assert (tmp_path / name).read_bytes().startswith(b"%PDF")
    with Image.open(tmp_path / "bending.gif") as loop:
        assert loop.width == 240
        assert getattr(loop, "n_frames", 1) > 5
    assert {p.name for p in (tmp_path / "pictures").iterdir()} == {
        "density.png", "samples.png", "surface.html",
    }  # fmt: skip


def test_the_calls_are_public() -> None:
    for room, name in re.findall(r"`(orbiflow(?:\.\w+)?)\.(\w+)`", TEXT):
        module = {"orbiflow": orbiflow, "orbiflow.tiles": tiles, "orbiflow.density": density}.get(
            room
        )
        if module is not None and name != "runtime":
            assert name in module.__all__, f"{room}.{name}"
    for name in re.findall(r"`(\w+_picture)`", TEXT):
        assert any(callable(getattr(wing, name, None)) for wing in (tiles, density, drawing))
