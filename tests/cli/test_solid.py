"""`orbiflow solid`: files written, mistakes answered with status 2 and one sentence."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from exported import boot_run
from solids_read import read_3mf, read_stl


@pytest.fixture(name="result", scope="module")
def result_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return boot_run(tmp_path_factory.mktemp("runs") / "boot")


def test_the_ending_is_the_format(result: Path, tmp_path: Path, orbiflow, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    for out in ("a.stl", "a.3mf"):
        done = orbiflow("solid", result, "--kind", "cutter", "--tile-size", "6cm", "-o", out)
        assert done.status == 0, done.err
        size = re.search(r"written a\.\w+: cutter of IH6, ([\d.]+) x ([\d.]+) x 15.0 mm", done.out)
        assert size
        read = read_stl if out == "a.stl" else lambda data: read_3mf(data)[0].mesh
        mesh = read((tmp_path / out).read_bytes())
        assert mesh.extents[:2] == pytest.approx([float(side) for side in size.groups()], abs=0.06)
    assert orbiflow("solid", result, "--kind", "puzzle", "--copies", 3).status == 0
    plates = [read_3mf((tmp_path / f"boot-IH6-puzzle-{k}.3mf").read_bytes()) for k in (1, 2)]
    assert [len(plate) for plate in plates] == [1, 3]


def test_the_snippet_of_the_page(result: Path, tmp_path: Path, monkeypatch) -> None:
    text = (Path(__file__).parents[2] / "docs" / "solids.md").read_text(encoding="utf-8")
    (snippet,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "turtle").symlink_to(result)
    monkeypatch.chdir(tmp_path)
    exec(compile(snippet, "solids.md", "exec"), {})
    assert read_stl((tmp_path / "cutter.stl").read_bytes()).is_watertight
