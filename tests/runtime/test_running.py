"""Calls in this process: order of events, files, cancelling, failures."""

import json
import threading
from pathlib import Path

import numpy as np
import pytest

from orbiflow.errors import OutputError
from orbiflow.runtime import (
    Cancel,
    Event,
    Failed,
    Finished,
    Note,
    Preview,
    Progress,
    TileFound,
    Written,
    find,
)
from orbiflow.tiles.run_folder.files import TILE_FILES
from refusals import names, refused
from runtime.searches import boot_call, check_order, run

pytestmark = pytest.mark.usefixtures("small_searches")
SHEETS = ("index.html", "overview.png", "read.png", "result.json")


def files(folder: Path) -> set[str]:
    return {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()}


def test_a_search(tmp_path: Path) -> None:
    events: list[Event] = []
    threads: set[int] = set()

    def sink(event: Event) -> None:
        events.append(event)
        threads.add(threading.get_ident())

    finished = run(boot_call(tmp_path, "IH4", "ih6"), sink)
    assert finished is events[-1]
    assert finished.state == "done"
    assert threads == {threading.get_ident()}
    check_order(events, "IH4", "IH6")
    found = {event.class_name: event.iou for event in events if isinstance(event, TileFound)}
    tiles = finished.summary["tiles"]
    assert {tile["class"]: tile["iou"] for tile in tiles} == found
    written = {event.path for event in events if isinstance(event, Written)}
    assert written == {tmp_path / "out" / name for name in files(tmp_path / "out")}
    expected = {f"{name}/{file}" for name in ("IH4", "IH6") for file in TILE_FILES}
    assert files(tmp_path / "out") == expected | {*SHEETS}


def test_a_second_run_takes_the_place_of_the_first(tmp_path: Path) -> None:
    run(boot_call(tmp_path, "IH4", "IH6"))
    out = tmp_path / "out"
    run(boot_call(tmp_path, "IH4"))
    assert {p.name for p in out.iterdir()} == {"IH4", *SHEETS}
    (out / "IH4" / "notes.txt").write_text("mine")
    before = (out / "result.json").read_bytes()
    with refused("IH4/notes.txt", kind=OutputError):
        run(boot_call(tmp_path, "IH6"))
    assert (out / "result.json").read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["boot.json", "out"]


def test_a_folder_of_the_run_is_refused_before_any_work(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "notes.txt").write_text("mine")
    events: list[Event] = []
    with refused("notes.txt", kind=OutputError):
        run(boot_call(tmp_path, "IH4"), events.append)
    assert [type(event) for event in events[1:]] == [Failed]
    assert (tmp_path / "out" / "notes.txt").read_text() == "mine"


def test_a_search_cancelled_on_the_way_keeps_what_was_found(tmp_path: Path) -> None:
    cancel, events = Cancel(), []

    def sink(event: Event) -> None:
        events.append(event)
        if isinstance(event, TileFound):
            cancel.cancel()

    finished = run(boot_call(tmp_path, "IH6", "IH4"), sink, cancel)
    assert finished.state == "cancelled"
    check_order(events, "IH6", "IH4")
    document = json.loads((tmp_path / "out" / "result.json").read_text())
    assert [tile["class"] for tile in document["tiles"]] == ["IH6"]
    assert document["failed"] == [{"class": "IH4", "reason": "interrupted"}]
    assert (tmp_path / "out" / "IH6" / "tile.svg").is_file()


def test_a_first_look_alone_is_kept_unless_there_is_more(tmp_path: Path) -> None:
    def cancelled() -> Finished:
        cancel, events = Cancel(), []

        def sink(event: Event) -> None:
            events.append(event)
            if isinstance(event, Preview):
                cancel.cancel()

        finished = run(boot_call(tmp_path, "IH4", "IH6"), sink, cancel)
        check_order(events, "IH4", "IH6")
        assert finished.state == "cancelled"
        texts = [event.text for event in events if isinstance(event, Note)]
        assert "IH6 has its first tile only: its search was interrupted" in texts
        return finished

    summary = cancelled().summary
    assert [tile["class"] for tile in summary["tiles"]] == ["IH6"]
    assert summary["failed"] == [{"class": "IH4", "reason": "interrupted"}]
    out = tmp_path / "out"
    document = json.loads((out / "result.json").read_text())
    assert [entry["class"] for entry in document["tiles"] + document["failed"]] == ["IH6", "IH4"]
    assert {p.name for p in out.iterdir()} == {"IH6", *SHEETS}
    assert run(boot_call(tmp_path, "IH4")).state == "done"
    finished = cancelled()
    assert not finished.summary["written"]
    assert finished.summary["tiles"] == []
    assert {p.name for p in out.iterdir()} == {"IH4", *SHEETS}


def test_a_fit_that_is_cancelled_writes_nothing(tmp_path: Path) -> None:
    data = tmp_path / "data.csv"
    rows = np.random.default_rng(0).normal(0.0, 0.5, (50, 2))
    data.write_text("\n".join(f"{a:.4f},{b:.4f}" for a, b in rows))
    cancel, events = Cancel(), []

    def sink(event: Event) -> None:
        events.append(event)
        if isinstance(event, Progress):
            cancel.cancel()

    given = {"data": data, "space": "torus", "unit": "radians", "out": tmp_path / "out"}
    call = find("density fit").call({**given, "max_frequency": 2})
    assert run(call, sink, cancel).state == "cancelled"
    check_order(events)
    assert [p.name for p in tmp_path.iterdir()] == ["data.csv"]


def test_what_the_sink_raises_comes_out_and_a_mistake_is_told(tmp_path: Path) -> None:
    told: list[Event] = []

    def sink(event: Event) -> None:
        told.append(event)
        if isinstance(event, Note):  # what was read has been drawn
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run(boot_call(tmp_path, "IH4", "IH6"), sink)
    assert not any(isinstance(event, Failed) for event in told)
    assert files(tmp_path / "out") == {"read.png"}
    events: list[Event] = []
    with refused(tmp_path / "none"):
        run(find("density sample").call({"model": tmp_path / "none"}), events.append)
    check_order(events)
    assert isinstance(events[-1], Failed)
    assert events[-1].failure == "mistake"
    names(events[-1].message, tmp_path / "none")
