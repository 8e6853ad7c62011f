"""The order of tiles beside what judges said, and the arithmetic of blind comparisons."""

import importlib
import json
import sys
from pathlib import Path

import numpy as np
import pytest
import shapely

from refusals import refused

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
NAMES = ("common", "likeness_blind", "likeness_order")


@pytest.fixture(name="load")
def load_fixture(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """Benchmarks by name, imported anew."""
    monkeypatch.setenv("ORBIFLOW_DATA", str(tmp_path))
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    for name in NAMES:
        monkeypatch.delitem(sys.modules, name, raising=False)
    yield importlib.import_module
    for name in NAMES:
        monkeypatch.delitem(sys.modules, name, raising=False)


def test_each_silhouette_is_one_sound_outline_with_its_licence(load) -> None:
    found = load("common").silhouettes()
    assert len(found) == 158
    parts = [shape["part"] for shape in found.values()]
    assert [parts.count(part) for part in ("test", "learn", "ranked", "fresh")] == [29, 59, 38, 32]
    for name, shape in found.items():
        polygon = shapely.Polygon(shape["outline"])
        assert polygon.is_valid, name
        assert polygon.area == pytest.approx(1, abs=1e-3), name
        assert 60 <= len(shape["outline"]) <= 120, name
        assert all(shape[key] for key in ("source", "by", "licence")), name


def test_each_ranking_has_every_place_once_and_no_silhouette_of_the_test(load) -> None:
    common = load("common")
    shapes = common.silhouettes()
    found = json.loads((common.HELD / "likeness_ranks.json").read_text())
    assert len(found) == 65
    for name, tiles in found.items():
        assert shapes[name]["part"] in ("learn", "ranked")
        for places in np.array([tile["places"] for tile in tiles]).T:
            assert sorted(places) == list(range(1, len(tiles) + 1))


def test_the_page_has_what_the_order_prints_of_good_tiles(load, capsys) -> None:
    load("likeness_order").ranks()
    lines = capsys.readouterr().out.splitlines()
    printed = {line[:22].strip(): line[22:].split() for line in lines}
    page = (BENCHMARKS.parent / "docs" / "likeness.md").read_text()
    for label in ("the order", "without these three"):
        rank, _, mark, wins, _, count = printed[label]
        assert f"| {label} | {rank[1:]} | {mark} | {wins} of {count} |" in page
    assert float(printed["the order"][2]) > float(printed["without these three"][2])


def test_the_order_is_compared_with_marks(load, capsys, tmp_path, monkeypatch) -> None:
    order = load("likeness_order")

    def tile(damage: float, *given: float) -> dict[str, object]:
        names = (*order.VALUES, "before", "energy", "displacement", "iou")
        values = dict.fromkeys(names, damage) | {"pieces": [damage, damage], "length": 6.5}
        values |= {"before": 1 - damage, "iou": 1 - damage, "overlap": 1 - damage}
        return {"values": values, "marks": dict(zip("AB", given, strict=True))}

    like = {"part": "learn", "tiles": [tile(0.1, 9, 8), tile(0.2, 5, 5), tile(0.3, 1, 2)]}
    unlike = {"part": "test", "tiles": [tile(0.1, 1, 2), tile(0.2, 2, 2), tile(0.3, 7, 7)]}
    document = {"silhouettes": {"elk": like, "owl": like, "bat": unlike}}
    (tmp_path / "likeness_pool.json").write_text(json.dumps(document))
    monkeypatch.setattr(order, "HELD", tmp_path)
    order.marks()
    lines = capsys.readouterr().out.splitlines()
    orders = [line.split()[-3:] for line in lines if line.startswith("the order  ")]
    assert orders == [["1.00", "8.50", "0.00"], ["-1.00", "1.50", "5.50"]]
    assert "learn: 6 tiles of 2 silhouettes" in lines
    assert sum("fitted to the others" in line for line in lines) == 1


def test_first_tiles_are_kept_and_what_is_not_at_hand_is_left_out(load, tmp_path: Path) -> None:
    blind = load("likeness_blind")
    own = tmp_path / "square.svg"
    own.write_text('<svg xmlns="http://www.w3.org/2000/svg"><path d="M0 0h9v9h-9z"/></svg>')
    kept = tmp_path / "tiles"
    assert set(blind.first_tiles(str(own), "fast", kept, ("arap", "est"))) == {"target"}
    with pytest.raises(SystemExit, match=r"square\.svg"):
        blind.first_tiles(str(own), "fast", kept, ("before",))
    (kept / "square-before.json").write_text("[[0, 0], [2, 0], [2, 2], [0, 2]]")
    found = blind.first_tiles(str(own), "fast", kept, ("arap", "before"))
    assert set(found) == {"target", "before"}
    assert shapely.Polygon(found["before"]).area == pytest.approx(1)
    fresh = next(name for name, s in load("common").silhouettes().items() if s["part"] == "fresh")
    assert set(blind.rival(fresh)) == {"arap", "est"}


def test_answers_become_ranks_and_the_key_says_whose_they_are(load) -> None:
    blind = load("likeness_blind")
    ranks = blind.ranks
    assert ranks([3, 1, 2], "ranking", 3) == [2, 3, 1]
    assert ranks([5, 8, 5], "scores", 3) == [2.5, 1, 2.5]
    for answer, kind in (([1, 1, 2], "ranking"), ([1, 2], "scores"), ([1, 2, 11], "scores")):
        with refused("need", kind=ValueError):
            ranks(answer, kind, 3)
    with refused("kind", kind=ValueError):
        ranks([1, 2, 3], "marks", 3)
    key = {"rounds": {"2": {"bat": ["arap", "likeness"], "elk": ["likeness", "arap"]}}}
    answers = {"round": 2, "kind": "ranking", "answers": {"bat": [2, 1], "elk": [1, 2]}}
    rows = blind.judged(key, answers)
    both = {"likeness": 1, "arap": 2}
    assert rows == [("bat", both), ("elk", both)]
    assert blind.preferred([row for _, row in rows], "likeness", "arap") == (2, 2)
    assert blind.preferred([{"likeness": 1.5, "est": 1.5}, both], "likeness", "est") == (0.5, 1)
    with refused("elk", kind=ValueError):
        blind.judged(key, {**answers, "answers": {"bat": [1, 2]}})


def test_orders_are_repeatable_and_differ_from_sheet_to_sheet(load) -> None:
    shuffled = load("likeness_blind").shuffled
    methods = list("abcde")
    orders = [shuffled(methods, 3, turn, index) for turn in (1, 2) for index in range(9)]
    assert orders[0] == shuffled(methods, 3, 1, 0)
    assert all(sorted(order) == methods for order in orders)
    assert len({tuple(order) for order in orders}) > 12
