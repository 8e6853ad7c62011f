"""The benchmarks of the nine goals run from the repository alone; others say what they miss."""

import importlib
import json
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from orbiflow.tiles import signed_area

ROOT = Path(__file__).parents[2]
BENCHMARKS = ROOT / "benchmarks"
WANTING = {
    "density_record.py": "the Top500 backbones",
    "escherization.py": "the paper's distorted PNGs",
}


@pytest.fixture(name="common")
def common_fixture(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setenv("ORBIFLOW_DATA", str(tmp_path))
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    monkeypatch.delitem(sys.modules, "common", raising=False)
    yield importlib.import_module("common")
    monkeypatch.delitem(sys.modules, "common", raising=False)


def test_the_nine_goals_and_their_figures_are_in_the_repository(common) -> None:
    figures = common.published("nine_goals")
    assert tuple(figures) == common.GOALS
    for name in common.GOALS:
        target = common.goal(name)
        assert len(target.outline) == int(name.rpartition("_")[2])
        assert target.y_down
        assert target.notes == ()
        assert signed_area(target.normal) == pytest.approx(1)
        for method in ("est", "arap"):
            assert all(0 < value < 1 for value in figures[name][method].values())
    licence = (ROOT / "examples" / "silhouettes" / "nagata" / "LICENSE").read_text()
    assert licence.startswith("MIT License\n\nCopyright (c) 2022 Yuichi Nagata")


def test_every_figure_says_where_it_comes_from() -> None:
    document = json.loads((BENCHMARKS / "data" / "published.json").read_text())
    assert all(section["note"] for section in document.values())


def test_the_best_similarity_undoes_one(common) -> None:
    outline = common.goal("bat_60").outline
    turned = 3 * outline @ np.array([[0.6, -0.8], [0.8, 0.6]]) * (1, -1) + (5, 7)
    assert common.aligned(turned, outline) == pytest.approx(outline, abs=2.0)


@pytest.mark.parametrize("name", WANTING)
def test_what_is_missing_is_said_in_one_line(name: str, tmp_path, monkeypatch, capsys) -> None:
    arguments = ["--distorted"] if name == "escherization.py" else ["narrow", "--data", "proline"]
    monkeypatch.setenv("ORBIFLOW_DATA", str(tmp_path))
    monkeypatch.setattr(sys, "argv", [str(BENCHMARKS / name), *arguments])
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    # as in a process of its own: what benchmarks import of each other is read anew, and forgotten
    for path in BENCHMARKS.glob("*.py"):
        monkeypatch.setitem(sys.modules, path.stem, sys)
        monkeypatch.delitem(sys.modules, path.stem)
    with pytest.raises(SystemExit) as left:
        runpy.run_path(str(BENCHMARKS / name), run_name="__main__")
    assert left.value.code == 2
    out, err = capsys.readouterr()
    assert err == ""
    (line,) = out.splitlines()
    assert line.startswith(f"{WANTING[name]} are not here (")
    assert line.endswith("docs/benchmarks.md says where to get them")


def test_the_page_names_every_benchmark() -> None:
    page = (ROOT / "docs" / "benchmarks.md").read_text()
    helpers = {"common", "density_data", "density_integral", "density_kde", "density_known"}
    helpers |= {"density_limits", "rivals"}
    for path in BENCHMARKS.glob("*.py"):
        assert path.stem in helpers or f"benchmarks/{path.name}" in page
