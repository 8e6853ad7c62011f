"""The README's Python snippets run as printed."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import torch

from orbiflow.escher import SavedModel, TileModel
from orbiflow.silhouette import Frame
from orbiflow.tilings import isohedral_class

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
SNIPPETS = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)


def run(snippet: str) -> dict[str, object]:
    names: dict[str, object] = {}
    exec(compile(snippet, "README.md", "exec"), names)
    return names


def test_the_symmetric_field_snippet_runs():
    (snippet,) = [s for s in SNIPPETS if "symmetrize" in s]
    assert "log_det" in run(snippet)


def test_the_model_snippet_maps_there_and_back(tmp_path, monkeypatch):
    (snippet,) = [s for s in SNIPPETS if "load_saved" in s]
    folder = tmp_path / "out" / "turtle" / "IH6"
    folder.mkdir(parents=True)
    model = TileModel(isohedral_class("IH6"), torch.tensor([0.4]), max_frequency=2, steps=64)
    with torch.no_grad():
        for parameter in model.flow.parameters():
            parameter.normal_(std=0.05, generator=torch.Generator().manual_seed(0))
    frame = Frame(np.diag([200.0, -200.0]), np.array([320.0, 240.0]), "image", (640, 480))
    (folder / "model.safetensors").write_bytes(SavedModel.of(model, frame).to_bytes())
    monkeypatch.chdir(tmp_path)
    names = run(snippet)
    torch.testing.assert_close(names["back"], names["inside"], atol=1e-8, rtol=0)
