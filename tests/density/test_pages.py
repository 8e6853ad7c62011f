"""What pages of docs say in Python runs."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from orbiflow.density import KleinBottle

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


DENSITIES = (Path(__file__).parents[2] / "docs" / "densities.md").read_text(encoding="utf-8")


def test_families_and_orientations(capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, Any] = {}
    for word in ("von-mises-fisher", "RotationSpace"):
        (snippet,) = re.findall(rf"```python\n([^`]*{word}[^`]*)```", DENSITIES)
        exec(compile(snippet, "densities.md", "exec"), names)
    value, low, high, *_ = map(float, capsys.readouterr().out.split())
    assert low < value < high
    assert names["orientations"].space_.symmetry == "D2"


PAGE = Path(__file__).parents[2] / "docs" / "examples" / "image-patches.md"


@pytest.fixture(name="blocks")
def blocks_fixture() -> list[str]:
    return re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)


def test_the_blocks_run(blocks: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    Image.fromarray(rng.integers(256, size=(60, 60, 3), dtype=np.uint8)).save(
        tmp_path / "photo.jpg"
    )
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for block in blocks:
        exec(compile(block, PAGE.name, "exec"), names)
    header, *rows = (tmp_path / "angles.csv").read_text().splitlines()
    assert header == "theta,phi,distance"
    assert len(rows) > 5


def test_points_of_the_surface_are_found_and_nothing_on_it_is_nearer(blocks: list[str]) -> None:
    names: dict[str, Any] = {}
    exec(compile(blocks[0], PAGE.name, "exec"), names)
    rng, space = np.random.default_rng(1), KleinBottle()
    theta, phi = rng.uniform(0, np.pi, 200), rng.uniform(-np.pi / 2, 3 * np.pi / 2, 200)
    x, y = np.array([-1, 0, 1]), np.array([[1], [0], [-1]])
    t = (x * np.cos(theta)[:, None, None] + y * np.sin(theta)[:, None, None]).reshape(-1, 9)
    edge, line = (
        (own - own.mean(axis=1, keepdims=True))
        / np.linalg.norm(names["steps"](own), axis=1, keepdims=True)
        for own in (t, t**2)
    )
    surface = np.cos(phi)[:, None] * edge + np.sin(phi)[:, None] * line
    found = names["to_klein"](40 * surface + 128)
    assert found[:, 2].max() < 1e-6
    wanted = space.to_chart(np.column_stack([theta, phi]))
    assert float(space.distance(space.to_chart(found[:, :2]), wanted).max()) < 1e-6
    any_patches = rng.normal(size=(60, 9))
    distances = names["to_klein"](any_patches)[:, 2]
    steps = names["steps"](any_patches)
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    apart = np.linalg.norm(steps[:, None] - names["steps"](surface), axis=2)
    assert (distances <= apart.min(axis=1) + 1e-6).all()
    assert (distances > apart.min(axis=1) - 0.3).all()
