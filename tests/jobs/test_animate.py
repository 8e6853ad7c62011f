"""The job and the command of an animation."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from jobs.searches import boot_request, check_order
from orbiflow.errors import OrbiflowError
from orbiflow.jobs import (
    AnimateRequest,
    Event,
    Note,
    Progress,
    RecordError,
    run,
)
from orbiflow.jobs.requests import request_from_json
from orbiflow.runtime import Cancel
from orbiflow.runtime.events import Written


@pytest.fixture(scope="module", name="folder")
def folder_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    run(boot_request(folder, "IH4", "IH6"))
    return folder / "out"


def small(folder: Path, out: Path | None, **fields) -> AnimateRequest:
    return AnimateRequest(result=folder, out=out, seconds=1.0, size=96, **fields)


def test_a_file_is_written_and_told_of(folder: Path, tmp_path: Path) -> None:
    events: list[Event] = []
    out = tmp_path / "loop.gif"
    request = small(folder, out, tile="IH6", fps=8.0, palette="ink")
    assert request_from_json(request.to_json()) == request
    finished = run(request, events.append)
    check_order(events)
    assert [event.path for event in events if isinstance(event, Written)] == [out]
    assert any("morph of IH6" in event.text for event in events if isinstance(event, Note))
    assert finished.summary["class"] == "IH6"
    assert finished.summary["bytes"] == out.stat().st_size
    with Image.open(out) as image:
        assert image.size == (96, 64)


def test_a_name_of_its_own(folder: Path, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    run(small(folder, None, animation="grow", fps=4.0, tile="IH4"))
    assert [path.name for path in tmp_path.iterdir()] == ["boot-IH4-grow.gif"]


def test_a_cancelled_one_writes_nothing(folder: Path, tmp_path: Path) -> None:
    cancel = Cancel()

    def sink(event: Event) -> None:
        if isinstance(event, Progress):
            cancel.cancel()

    finished = run(small(folder, tmp_path / "a.gif"), sink, cancel)
    assert finished.state == "cancelled"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"out": "a.webm"}, "must end in .gif, .mp4 or .svg"),
        ({"out": "a.svg", "fps": 5}, "fps belongs to"),
        ({"size": 65}, "an even number"),
        ({"seconds": 0.1}, "seconds must be from"),
        ({"fps": 100}, "fps must be from"),
        ({"animation": "jump"}, "animation must be morph"),
    ],
)
def test_requests_that_cannot_be(fields, message: str) -> None:
    with pytest.raises(RecordError, match=message):
        AnimateRequest(result=Path("out"), **fields)


def test_mistakes_are_said_before_the_work(folder: Path, tmp_path: Path) -> None:
    for request, message in (
        (small(folder, tmp_path / "none" / "a.gif"), "there is no folder"),
        (small(folder, tmp_path / "a.gif", tile="IH1"), "holds no tile of IH1"),
        (small(folder, tmp_path / "a.gif", animation="bend"), "no bent silhouette"),
        (small(tmp_path, tmp_path / "a.gif"), "holds no result.json"),
    ):
        with pytest.raises(OrbiflowError, match=message):
            run(request)
    assert list(tmp_path.iterdir()) == []
