"""Calls in processes of their own."""

import json
import os
import signal
from pathlib import Path

import pytest

from orbiflow.runtime import (
    CallProcess,
    ClassFailed,
    Failed,
    Finished,
    Note,
    Progress,
    TileFound,
    find,
)
from runtime.searches import boot_call, check_order

SMALL, ENDLESS = "runtime.small_process", "runtime.endless_process"


@pytest.fixture(name="small", autouse=True)
def small_fixture(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let processes find the modules that make their searches small or endless."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[1]), prepend=os.pathsep)


def test_a_search_in_a_process(tmp_path: Path) -> None:
    call = boot_call(tmp_path, "IH3", "IH7", workers=2)
    with CallProcess(call, modules=[SMALL]) as process:
        events = list(process.events())
        assert process.wait() == 0
    check_order(events, "IH3", "IH7")
    assert isinstance(events[-1], Finished)
    assert events[-1].state == "done"
    assert (tmp_path / "out" / "overview.png").is_file()


def test_cancelling_keeps_the_order_and_ends_the_process(tmp_path: Path) -> None:
    call = boot_call(tmp_path, "IH4", "IH6", workers=2)
    events = []
    with CallProcess(call, modules=[ENDLESS]) as process:
        for event in process.events():
            events.append(event)
            if isinstance(event, Progress) and event.class_name:
                process.cancel()
        assert process.wait() == 0
    check_order(events, "IH4", "IH6")
    assert isinstance(events[-1], Finished)
    assert events[-1].state == "cancelled"
    reasons = {event.reason for event in events if isinstance(event, ClassFailed)}
    assert reasons == {"interrupted"}
    assert not any(isinstance(event, TileFound) for event in events)
    document = json.loads((tmp_path / "out" / "result.json").read_text())
    assert [entry["class"] for entry in document["failed"]] == ["IH4", "IH6"]


def test_a_mistake_is_the_last_event() -> None:
    with CallProcess(find("classes").call({"classes": ["IH94"]})) as process:
        events = list(process.events())
        assert process.wait() == 1
    check_order(events)
    assert isinstance(events[-1], Failed)
    assert (events[-1].failure, "IH94" in events[-1].message) == ("mistake", True)


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_a_process_that_dies_is_the_last_event(tmp_path: Path) -> None:
    events = []
    with CallProcess(boot_call(tmp_path, "IH4"), modules=[ENDLESS]) as process:
        for event in process.events():
            events.append(event)
            if isinstance(event, Note):  # what was read has been drawn
                process.kill()
        assert process.wait() == -signal.SIGKILL
        process.cancel()  # no harm
    check_order(events)
    assert isinstance(events[-1], Failed)
    assert events[-1].failure == "died"
    assert "signal 9" in events[-1].message
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["read.png"]


@pytest.mark.skipif(os.name != "posix", reason="processes cannot be held there")
def test_a_process_is_held_and_goes_on() -> None:
    with CallProcess() as process:
        assert process.pause()
        # it has stopped, and not ended
        assert os.WIFSTOPPED(os.waitpid(process.pid, os.WUNTRACED)[1])
        assert process.alive
        assert process.resume()
        process.begin(find("classes").call({}))
        assert isinstance(list(process.events())[-1], Finished)
    assert process.pause()  # it has ended: no other process is stopped


@pytest.mark.skipif(os.name != "posix", reason="processes do one call there")
def test_a_process_does_one_call_after_another() -> None:
    with CallProcess(again=True) as process:
        for names in (["IH4"], ["IH999"], ["IH6"]):
            process.begin(find("classes").call({"classes": names}))
            last = list(process.events())[-1]
            assert isinstance(last, Failed if names == ["IH999"] else Finished)
            process.cancel()  # too late, and no harm to the next
        assert isinstance(last, Finished)
        assert last.summary["classes"][0]["class"] == "IH6"
        assert process.alive
        process.begin(find("escherize").call({"image": "no such.png"}))
        process.kill()
        last = list(process.events())[-1]
        assert isinstance(last, Failed)
        assert last.failure == "died"
