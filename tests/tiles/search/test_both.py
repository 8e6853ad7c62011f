"""A search for both, with pins: one list, one measure, and its picture."""

from __future__ import annotations

import io
import json
from pathlib import Path

import jsonschema
import pytest
from PIL import Image

from orbiflow.errors import OrbiflowError
from orbiflow.runtime import Call, Event, Note, call_from_json
from orbiflow.tiles.search import both_search
from orbiflow.tiles.search.both_search import MOST
from orbiflow.tiles.search.likeness_search import FAST
from runtime.searches import boot_call, check_order, run

DOCS = Path(__file__).parents[3] / "docs"
SQUIRREL = Path(__file__).parents[3] / "examples" / "silhouettes" / "squirrel.dat"
HEAD = "230,190,140"


def both_call(folder: Path, **changes: object) -> Call:
    document = {
        "schema_version": 2,
        "operation": "escherize",
        "image": str(SQUIRREL),
        "out": str(folder / "out"),
        "classes": ["IH4"],
        "objective": "both",
        "effort": "fast",
        "workers": 1,
        "pin": [HEAD],
        **changes,
    }
    return call_from_json(document)


@pytest.mark.usefixtures("hasty_measure")
def test_both_with_pins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, few in {"placements": 40, "held": 8, "starts": 4, "rounds": 6}.items():
        monkeypatch.setitem(FAST, name, few)
    monkeypatch.setattr(both_search, "CANDIDATES", 2)
    events: list[Event] = []
    finished = run(both_call(tmp_path), events.append)
    check_order(events, "IH4")
    out = tmp_path / "out"
    document = json.loads((out / "result.json").read_text())
    jsonschema.validate(document, json.loads((DOCS / "result.schema.json").read_text()))
    assert document["pins"] == {"sources": [HEAD], "keep_angle": False, "notes": []}
    tiles = document["tiles"]
    assert 2 <= len(tiles) <= MOST
    assert {tile["objective"] for tile in tiles} == {"likeness", "overlap"}
    for tile in tiles:
        assert tile["metrics"]["deformation"] > 0
        assert isinstance(tile["front"], bool)
        assert (tile["metrics"]["pinned"] is None) == (tile["objective"] == "overlap")
    assert [row["front"] for row in finished.summary["tiles"]] == [t["front"] for t in tiles]
    assert any("tiles are listed" in event.text for event in events if isinstance(event, Note))
    picture = Image.open(io.BytesIO((out / "front.png").read_bytes()))
    assert picture.size == (1600, 1120)
    # another kind of run may take the folder, and leaves no picture of a front behind
    run(boot_call(tmp_path, "IH4"))
    assert not (out / "front.png").exists()


def test_a_pin_outside_is_refused_before_any_work(tmp_path: Path) -> None:
    with pytest.raises(OrbiflowError, match="the pin at 900,20 lies outside the silhouette"):
        run(both_call(tmp_path, pin=["900,20"]))
    assert not (tmp_path / "out").exists()
