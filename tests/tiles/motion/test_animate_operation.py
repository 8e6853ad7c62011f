"""The operation `animate`: files written, events told, mistakes said before the work."""

from pathlib import Path

import pytest
from PIL import Image

from orbiflow.runtime import (
    Call,
    Cancel,
    Cancelled,
    Event,
    Note,
    Progress,
    Written,
    call_from_json,
    find,
)
from refusals import refused
from runtime.searches import check_order

BOOT = "[[60, 20], [210, 20], [230, 80], [170, 95], [160, 190], [100, 145], [45, 80]]"


@pytest.fixture(scope="module", name="folder")
def folder_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    (folder / "boot.json").write_text(BOOT)
    given = {"classes": ["IH4", "IH6"], "method": "occupancy", "turns": 1, "iterations": 4}
    find("escherize").call({"image": folder / "boot.json", "out": folder / "out", **given}).run()
    return folder / "out"


def animation(**given: object) -> Call:
    return find("animate").call(given)


def small(folder: Path, out: Path | None, **given: object) -> Call:
    own = {} if out is None else {"out": out}
    return animation(result=folder, seconds=1.0, area="96x64px", **own, **given)


def test_a_file_is_written_and_told_of(folder: Path, tmp_path: Path) -> None:
    events: list[Event] = []
    out = tmp_path / "loop.gif"
    request = small(folder, out, tile="IH6", fps=8.0, palette="ink")
    assert call_from_json(request.to_json()).to_json() == request.to_json()
    finished = request.run(events.append)
    check_order(events)
    assert [event.path for event in events if isinstance(event, Written)] == [out]
    assert any("morph of IH6" in event.text for event in events if isinstance(event, Note))
    assert finished.summary["class"] == "IH6"
    assert finished.summary["bytes"] == out.stat().st_size
    with Image.open(out) as image:
        assert image.size == (96, 64)


def test_a_cancelled_one_writes_nothing(folder: Path, tmp_path: Path) -> None:
    cancel = Cancel()

    def sink(event: Event) -> None:
        if isinstance(event, Progress):
            cancel.cancel()

    with pytest.raises(Cancelled):
        small(folder, tmp_path / "a.gif").run(sink, cancel)
    assert list(tmp_path.iterdir()) == []


def test_mistakes_are_said_before_the_work(folder: Path, tmp_path: Path) -> None:
    for request, name in (
        (small(folder, tmp_path / "none" / "a.gif"), "none"),
        (small(folder, tmp_path / "a.gif", tile="IH1"), "IH1"),
        (small(folder, tmp_path / "a.gif", kind="bend"), "kind"),
        (small(tmp_path, tmp_path / "a.gif"), "result.json"),
    ):
        with refused(name):
            request.run()
    assert list(tmp_path.iterdir()) == []
