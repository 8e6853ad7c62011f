"""Rankings of the best tiles: what is published of them, and what is said of the order."""

import importlib
import json
import sys
from argparse import Namespace
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
MODULES = ("common", "likeness_methods", "likeness_shapes", "likeness_pool", "likeness_ranks")


@pytest.fixture(name="ranks")
def ranks_fixture(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    for name in MODULES:
        monkeypatch.delitem(sys.modules, name, raising=False)
    yield importlib.import_module("likeness_ranks")
    for name in MODULES:
        sys.modules.pop(name, None)


def test_each_ranking_has_every_place_once_and_no_silhouette_of_the_test(ranks) -> None:
    shapes, found = ranks.silhouettes(), json.loads(ranks.RANKS.read_text())
    assert len(found) == 65
    for name, tiles in found.items():
        assert shapes[name]["part"] in ("learn", "ranked")
        for places in np.array([tile["places"] for tile in tiles]).T:
            assert sorted(places) == list(range(1, len(tiles) + 1))


def test_the_order_says_more_of_the_best_tiles_with_its_last_measures(ranks, capsys) -> None:
    ranks.order(Namespace())
    lines = {line[:22].strip(): line[22:].split() for line in capsys.readouterr().out.splitlines()}
    whole, fewer = (lines[name] for name in ("the order", "without these three"))
    assert float(whole[0]) >= float(fewer[0])  # the correlation of ranks
    assert float(whole[1]) < float(fewer[1])  # the place of our first
    assert float(whole[2]) > float(fewer[2])  # its mark
    assert int(whole[3]) > int(fewer[3]) > 0.5 * int(whole[5])


def test_what_judges_answer_becomes_the_places_of_tiles(ranks, tmp_path, monkeypatch) -> None:
    rest = np.column_stack([np.cos(a := np.linspace(0, 2 * np.pi, 97)[:-1]), np.sin(a)])
    rows = [
        {"method": "ours", "class": name, "bent": (rest * (1, wide)).tolist()}
        for name, wide in (("IH1", 0.5), ("IH2", 1.0), ("IH3", 0.8))
    ]
    document = {"rest": rest.tolist(), "tiles": rows, "shuffles": [[0, 1, 2], [2, 0, 1]]}
    (tmp_path / "tiles").mkdir()
    (tmp_path / "tiles" / "elk.json").write_text(json.dumps(document))
    monkeypatch.setattr(ranks, "RANKS", tmp_path / "ranks.json")
    answers = [tmp_path / "one.json", tmp_path / "other.json"]
    given = ([2, 3, 1], [2.0, 9.0, 7.0]), ([1, 3, 2], [8.0, 3.0, 6.5])
    for path, (ranking, marks) in zip(answers, given, strict=True):
        path.write_text(json.dumps({"elk": {"order": ranking, "marks": marks}}))
    ranks.publish(Namespace(out=tmp_path, answers=answers))
    found = json.loads((tmp_path / "ranks.json").read_text())["elk"]
    assert [tile["places"] for tile in found] == [[3, 3], [1, 2], [2, 1]]
    assert [tile["marks"] for tile in found] == [[2, 3], [9, 6.5], [7, 8]]
    assert found[1]["values"]["moved"] == 0
    assert found[0]["values"]["moved"] > found[2]["values"]["moved"] > 0
    answers[0].write_text(json.dumps({"elk": {"order": [2, 2, 1], "marks": [1, 2, 3]}}))
    with pytest.raises(SystemExit, match="every number once"):
        ranks.publish(Namespace(out=tmp_path, answers=answers))
