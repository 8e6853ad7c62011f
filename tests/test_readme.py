"""The README's Python snippets run as printed."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

import orbiflow
from orbiflow.tiles import (
    EscherizeSettings,
    EscherTile,
    LikenessSearch,
    Target,
    escherize,
    escherize_class,
    save_tiles,
)

README_PATH = Path(__file__).parents[1] / "README.md"
README = README_PATH.read_text(encoding="utf-8")
SNIPPETS = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)


def run(snippet: str) -> dict[str, object]:
    names: dict[str, object] = {}
    exec(compile(snippet, "README.md", "exec"), names)
    return names


def test_the_symmetric_field_snippet_runs():
    (snippet,) = [s for s in SNIPPETS if "symmetrize" in s]
    assert "log_det" in run(snippet)


def test_the_first_snippet_draws_a_certified_tile(tmp_path, monkeypatch, capsys, small_searches):  # noqa: ARG001
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(README_PATH.parent / "examples")
    # the whole search takes a quarter of a minute
    fast = EscherizeSettings(classes=("IH4",), effort="fast")
    monkeypatch.setattr(orbiflow, "escherize", lambda target: escherize(target, fast))
    run(SNIPPETS[0])
    assert capsys.readouterr().out.endswith("True\n")
    assert (tmp_path / "turtles.png").stat().st_size > 1000


def test_the_model_snippet_maps_there_and_back(tmp_path, monkeypatch):
    (snippet,) = [s for s in SNIPPETS if "tile.forward" in s]
    target = Target.read(README_PATH.parent / "examples" / "silhouettes" / "turtle.png")
    small = LikenessSearch(placements=20, held=4, finalists=1, rounds=4)
    found = escherize_class(target, "IH4", small)
    assert isinstance(found, EscherTile)
    (tmp_path / "out").mkdir()
    save_tiles([found], tmp_path / "out" / "turtle")
    monkeypatch.chdir(tmp_path)
    names = run(snippet)
    np.testing.assert_allclose(np.asarray(names["back"]), np.asarray(names["eye"]), atol=1e-8)
