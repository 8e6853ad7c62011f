"""A search with pins, from a call to its `result.json`."""

import json
from pathlib import Path

import jsonschema
import pytest

from orbiflow.runtime import Call, Event, call_from_json
from refusals import refused
from runtime.searches import check_order, run

DOCS = Path(__file__).parents[3] / "docs"
SQUIRREL = Path(__file__).parents[3] / "examples" / "silhouettes" / "squirrel.dat"
HEAD = "230,190,140"


def pinned_call(folder: Path, pin: str) -> Call:
    document = {
        **{"schema_version": 2, "operation": "escherize", "image": str(SQUIRREL)},
        **{"out": str(folder / "out"), "classes": ["IH4"], "effort": "fast", "workers": 1},
        "pin": [pin],
    }
    return call_from_json(document)


@pytest.mark.usefixtures("small_searches")
def test_what_was_pinned_is_told(tmp_path: Path) -> None:
    events: list[Event] = []
    run(pinned_call(tmp_path, HEAD), events.append)
    check_order(events, "IH4")
    document = json.loads((tmp_path / "out" / "result.json").read_text())
    jsonschema.validate(document, json.loads((DOCS / "result.schema.json").read_text()))
    assert document["pins"] == {"sources": [HEAD], "keep_angle": False, "notes": []}
    (tile,) = document["tiles"]
    assert tile["metrics"]["deformation"] > 0
    assert tile["metrics"]["pinned"] is not None


def test_a_pin_outside_is_refused_before_any_work(tmp_path: Path) -> None:
    with refused("900,20"):
        run(pinned_call(tmp_path, "900,20"))
    assert not (tmp_path / "out").exists()
