"""From a judge's answers to marks of tiles."""

import importlib
import json
import sys
from pathlib import Path
from typing import Any

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


@pytest.fixture(name="pool")
def pool_fixture(tmp_path: Path) -> Path:
    """A folder with three tiles of an elk, the worst first, and two readings of their marks."""
    ring = np.column_stack([np.cos(a := np.linspace(0, 6, 120)), np.sin(a)])
    usual = {"notches": 0.3, "narrowed": 0.037, "necks": 0.0, "cost": 0.25}
    usual |= {"energy": 0.2, "displacement": 0.05, "neck": 0.4, "iou": 0.7}

    def tile(method: str, taller: float, damage: float) -> dict[str, Any]:
        values: dict[str, Any] = {name: damage * value for name, value in usual.items()}
        values["pieces"] = [damage * x for x in (0.12, 0.16, 0.13)]
        bent = (3 * ring * (1, taller)).tolist()
        return {"method": method, "class": "IH4", "score": 0.8, "values": values, "bent": bent}

    tiles = [tile("overlap", 1.6, 1), tile("est", 1.2, 0.8), tile("firm", 1, 0.6)]
    document = {"part": "learn", "least_neck": 0.01, "length": 8.0, "rest": ring.tolist()}
    (tmp_path / "tiles").mkdir()
    (tmp_path / "tiles" / "elk.json").write_text(json.dumps({**document, "tiles": tiles}))
    (tmp_path / "key.json").write_text(json.dumps(KEY))
    (tmp_path / "a.json").write_text(json.dumps({**FIRST, "marks": {"elk": [9, 1, 5]}}))
    (tmp_path / "b.json").write_text(json.dumps(SECOND))
    return tmp_path


def test_marked_tiles_are_published(marks, pool: Path, capsys, monkeypatch) -> None:
    words = ["marks", "publish", "--out", str(pool), "--to", str(pool / "all.json")]
    monkeypatch.setattr(sys, "argv", [*words, str(pool / "a.json"), str(pool / "b.json")])
    marks.main()
    assert "1 silhouettes" in capsys.readouterr().out
    found = json.loads((pool / "all.json").read_text())["silhouettes"]["elk"]
    assert [tile["marks"] for tile in found["tiles"]] == [
        {"A1": 1, "A2": 2},
        {"A1": 5, "A2": 5},
        {"A1": 9, "A2": 8},
    ]
    first, _, last = (tile["values"] for tile in found["tiles"])
    assert last["pieces"] == [0, 0]  # measured anew
    assert first["stretched"] > 0.01
    assert last["length"] == pytest.approx(6 / np.sqrt(np.pi), rel=0.05)
    assert first["before"] == 0.5  # the usual values of that order
    assert ("overlap" in first, "overlap" in last) == (True, False)
    own = np.array(found["tiles"][2]["outline"]).reshape(-1, 2) / 3000
    assert own == pytest.approx(np.array(found["rest"]).reshape(-1, 2) / 1000, abs=1e-3)
    monkeypatch.setattr(sys, "argv", [*words, *[str(pool / "a.json")] * 2])
    with pytest.raises(SystemExit, match="A1 has marked elk before"):
        marks.main()


def test_the_order_is_compared_with_what_was_published(
    marks, pool: Path, capsys, monkeypatch
) -> None:
    document = json.loads((pool / "tiles" / "elk.json").read_text())
    own = marks.published(document, {"A1": [1, 5, 9], "A2": [2, 5, 8]})
    worse = marks.published(document, {"A1": [7, 2, 1], "A2": [7, 2, 2]})
    both = {"silhouettes": {"elk": own, "owl": own, "bat": worse | {"part": "test"}}}
    (pool / "all.json").write_text(json.dumps(both))
    monkeypatch.setattr(sys, "argv", ["marks", "order", str(pool / "all.json")])
    marks.main()
    lines = capsys.readouterr().out.splitlines()
    orders = [line.split()[-3:] for line in lines if line.startswith("the order  ")]
    assert orders == [["1.00", "8.50", "0.00"], ["-1.00", "1.50", "5.50"]]
    assert "learn: 6 tiles of 2 silhouettes" in lines
    assert sum("fitted to the others" in line for line in lines) == 1
