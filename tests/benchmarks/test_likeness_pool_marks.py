"""From a judge's answers to marks of tiles."""

import importlib
import json
import sys
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(name="marks")
def marks_fixture(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    for name in ("common", "likeness_pool_marks"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    yield importlib.import_module("likeness_pool_marks")
    for name in ("common", "likeness_pool_marks"):
        sys.modules.pop(name, None)


KEY = {
    "elk": {"round1": [2, 0, 1], "round2": [0, 1, 2]},
    "bat": {"round1": [1, 0], "round2": [0, 1]},
}
FIRST = {"part": "learn", "round": 1, "judge": "A", "marks": {"elk": [9, 1, 5], "bat": [2, 8]}}
SECOND = {"part": "learn", "round": 2, "judge": "A", "marks": {"elk": [2, 5, 8]}}


def test_marks_go_to_the_tiles_that_the_numbers_stand_for(marks) -> None:
    found = marks.reading(KEY, FIRST)
    assert {name: own.tolist() for name, own in found.items()} == {"elk": [1, 5, 9], "bat": [8, 2]}
    for wrong in ([9, 1], [9, 1, 11], [9, 1, 5, 5]):
        with pytest.raises(ValueError, match="elk: 3 marks"):
            marks.reading(KEY, {**FIRST, "marks": {"elk": wrong}})


def test_agreement_is_of_what_both_have_marked(marks) -> None:
    one, other = marks.reading(KEY, FIRST), marks.reading(KEY, SECOND)
    count, _, within, ranks, apart = marks.agreement(one, other)
    assert (count, ranks) == (1, pytest.approx(1))
    assert within == pytest.approx(np.corrcoef([1, 5, 9], [2, 5, 8])[0, 1])
    assert apart == pytest.approx(2 / 3)
    # a judge who is stricter with one silhouette agrees within each, and not over all
    strict = {"elk": one["elk"], "bat": one["bat"] - 8}
    _, whole, within, _, _ = marks.agreement(one, strict)
    assert within == pytest.approx(1)
    assert whole < 0.9


def test_marked_tiles_are_published(marks, tmp_path: Path, capsys, monkeypatch) -> None:
    ring = np.column_stack([np.cos(a := np.linspace(0, 6, 120)), np.sin(a)])
    values = {"pieces": [0.12347, 0.2, 0.3], "cost": 0.5}
    tiles = [
        {
            "method": "firm",
            "class": "IH4",
            "score": 0.5,
            "values": values,
            "bent": (k * ring).tolist(),
        }
        for k in (1, 2, 3)
    ]
    document = {"part": "learn", "least_neck": 0.01, "length": 8.0, "rest": ring.tolist()}
    (tmp_path / "tiles").mkdir()
    (tmp_path / "tiles" / "elk.json").write_text(json.dumps({**document, "tiles": tiles}))
    (tmp_path / "key.json").write_text(json.dumps(KEY))
    (tmp_path / "a.json").write_text(json.dumps({**FIRST, "marks": {"elk": [9, 1, 5]}}))
    (tmp_path / "b.json").write_text(json.dumps(SECOND))
    words = ["marks", "publish", "--out", str(tmp_path), "--to", str(tmp_path / "all.json")]
    monkeypatch.setattr(sys, "argv", [*words, str(tmp_path / "a.json"), str(tmp_path / "b.json")])
    marks.main()
    assert "1 silhouettes" in capsys.readouterr().out
    found = json.loads((tmp_path / "all.json").read_text())["silhouettes"]["elk"]
    assert [tile["marks"] for tile in found["tiles"]] == [
        {"A1": 1, "A2": 2},
        {"A1": 5, "A2": 5},
        {"A1": 9, "A2": 8},
    ]
    assert found["tiles"][0]["values"]["pieces"] == [0.1235, 0.2, 0.3]
    own = np.array(found["tiles"][2]["outline"]).reshape(-1, 2) / 3000
    assert own == pytest.approx(np.array(found["rest"]).reshape(-1, 2) / 1000, abs=1e-3)
    monkeypatch.setattr(sys, "argv", [*words, *[str(tmp_path / "a.json")] * 2])
    with pytest.raises(SystemExit, match="A1 has marked elk before"):
        marks.main()
