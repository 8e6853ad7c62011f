"""Batches: what is done once, again and not at all; what is kept; what is shown."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from jobs.batches import QUICK, Here, rows, run_batch, write_boot
from orbiflow.errors import OrbiflowError, OutputError
from orbiflow.jobs import (
    BatchRequest,
    Finished,
    ItemDone,
    Note,
    RecordError,
    run,
)
from orbiflow.jobs.batch import folder as folder_module
from orbiflow.jobs.batch import work
from orbiflow.runtime import Cancel


@pytest.fixture(name="here")
def here_fixture(monkeypatch: pytest.MonkeyPatch) -> Here:
    here = Here()
    monkeypatch.setattr(work, "_executor", lambda *_: here)
    return here


@pytest.fixture(name="request_")
def request_fixture(tmp_path: Path) -> BatchRequest:
    write_boot(tmp_path / "in" / "boot.json")
    write_boot(tmp_path / "in" / "sub" / "boot.json", 140)
    (tmp_path / "in" / "broken.svg").write_text("<svg")
    return BatchRequest(folder=tmp_path / "in", out=tmp_path / "out", each=QUICK)


def changed(request: BatchRequest, **fields: Any) -> BatchRequest:
    values = {name: getattr(request, name) for name in ("folder", "out", "each")}
    return BatchRequest(**{**values, **fields})


def test_a_folder_a_row_and_a_card_for_each(here: Here, request_: BatchRequest) -> None:
    summary, events = run_batch(request_)
    assert (summary["done"], summary["failed"], summary["left"]) == (2, 1, 0)
    assert here.done == ["boot.json", "broken.svg", "sub/boot.json"]
    out = request_.out
    table = rows(out)
    assert list(table) == here.done
    assert table["broken.svg"]["state"] == "failed"
    assert table["broken.svg"]["error"].startswith("broken.svg: ")
    assert table["broken.svg"]["folder"] == ""
    for file, name in (("boot.json", "boot"), ("sub/boot.json", "sub-boot")):
        document = json.loads((out / name / "result.json").read_text())
        assert document["input"]["source"] == file
        assert float(table[file]["iou"]) == document["tiles"][0]["metrics"]["iou"]
        assert table[file]["folder"] == name
        assert (out / "thumbnails" / f"{name}.png").stat().st_size < 40_000
    page = (out / "index.html").read_text()
    assert page.count("<li data-name") == 2
    assert 'alt="Tiling of sub/boot.json"' in page
    assert 'href="sub-boot/index.html"' in page
    assert "broken.svg" in page[page.index("Without a result") :]
    told = {event.name: event.state for event in events if isinstance(event, ItemDone)}
    assert told == {"boot": "done", "sub-boot": "done", "broken": "failed"}
    assert not list(out.glob("**/*.tmp"))


def test_nothing_is_done_twice(here: Here, request_: BatchRequest) -> None:
    run_batch(request_)
    before = {p: p.stat().st_mtime_ns for p in request_.out.glob("*/*")}
    page, table = (request_.out / "index.html").read_text(), rows(request_.out)
    here.done.clear()
    summary, events = run_batch(request_)
    assert here.done == []
    assert summary["kept"] == 3
    assert {p: p.stat().st_mtime_ns for p in request_.out.glob("*/*")} == before
    assert (request_.out / "index.html").read_text() == page
    assert rows(request_.out) == table
    notes = [event.text for event in events if isinstance(event, Note)]
    assert notes[0].startswith("3 files: 2 are done already, 1 have failed before")


def test_what_is_done_again(here: Here, request_: BatchRequest) -> None:
    def again(request: BatchRequest) -> list[str]:
        here.done.clear()
        run_batch(request)
        return list(here.done)

    again(request_)
    assert again(changed(request_, retry_failed=True)) == ["broken.svg"]
    write_boot(request_.folder / "boot.json", 135)
    assert again(request_) == ["boot.json"]
    shutil.rmtree(request_.out / "sub-boot")
    assert again(request_) == ["sub/boot.json"]
    write_boot(request_.folder / "new.json", 130)
    assert again(request_) == ["new.json"]
    assert len(again(changed(request_, each={**QUICK, "seed": 1}))) == 4
    # other processes are no other settings
    assert again(changed(request_, each={**QUICK, "seed": 1}, workers=3)) == []


def test_another_version_does_all_again(
    here: Here, request_: BatchRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_batch(request_)
    here.done.clear()
    monkeypatch.setattr(work, "__version__", "999")
    run_batch(request_)
    assert len(here.done) == 3


def test_files_that_have_gone_keep_their_results(here: Here, request_: BatchRequest) -> None:
    run_batch(request_)
    (request_.folder / "boot.json").unlink()
    _, events = run_batch(request_)
    assert "boot.json" not in rows(request_.out)
    assert (request_.out / "boot" / "result.json").is_file()
    notes = [event.text for event in events if isinstance(event, Note)]
    assert any("1 earlier results are of files that are not in" in text for text in notes)
    assert len(here.done) == 3


def test_stopping_keeps_what_was_finished(here: Here, request_: BatchRequest) -> None:
    cancel = Cancel()

    def stop(event: object) -> None:
        if isinstance(event, ItemDone):
            cancel.cancel()

    finished = run(request_, stop, cancel)
    assert finished.state == "cancelled"
    assert (finished.summary["done"], finished.summary["left"]) == (1, 2)
    assert list(rows(request_.out)) == ["boot.json"]
    assert "2 still to do" in (request_.out / "index.html").read_text()
    here.done.clear()
    summary, _ = run_batch(request_)
    assert here.done == ["broken.svg", "sub/boot.json"]
    assert summary["kept"] == 1


def test_a_full_disk_ends_it_and_loses_nothing(
    here: Here, request_: BatchRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(folder: Path, _files: object) -> None:
        if "sub-boot" in folder.name:
            raise OutputError("No space left on device")
        return write(folder, _files)  # type: ignore[arg-type]

    write = folder_module._write
    monkeypatch.setattr(folder_module, "_write", full)
    with pytest.raises(OutputError, match="No space left"):
        run_batch(request_)
    assert list(rows(request_.out)) == ["boot.json", "broken.svg"]
    assert not (request_.out / "sub-boot").exists()
    monkeypatch.undo()
    monkeypatch.setattr(work, "_executor", lambda *_: here)
    here.done.clear()
    run_batch(request_)
    assert here.done == ["sub/boot.json"]


def test_a_folder_that_is_no_batch_is_refused(request_: BatchRequest) -> None:
    request_.out.mkdir()
    (request_.out / "diary.txt").touch()
    with pytest.raises(OutputError, match=r"holds diary\.txt, which is of no earlier batch"):
        run_batch(request_)
    assert [path.name for path in request_.out.iterdir()] == ["diary.txt"]


def test_two_batches_do_not_share_a_folder(here: Here, request_: BatchRequest) -> None:
    refused = []

    def nested(event: object) -> None:
        if isinstance(event, ItemDone) and not refused:
            with pytest.raises(OutputError, match="another batch is at work") as caught:
                run_batch(request_)
            refused.append(caught.value)

    assert isinstance(run(request_, nested), Finished)
    assert refused
    assert len(here.done) == 3


def test_local_processes(request_: BatchRequest) -> None:
    summary, _ = run_batch(changed(request_, workers=2))
    assert (summary["done"], summary["failed"]) == (2, 1)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"workers": 0}, "workers must be at least 1"),
        ({"workers": 2, "scheduler": "tcp://a:1"}, "give one"),
        ({"scheduler": ""}, "must be an address"),
        ({"match": " "}, "must be a pattern"),
        ({"each": {"image": "a.png"}}, "cannot have the field 'image'"),
        ({"each": {"pin": ["1,1"]}}, "cannot have the field 'pin'"),
        ({"each": {"effort": "heroic"}}, "effort must be fast, normal or best"),
        ({"each": {"clases": ["IH4"]}}, "unknown field 'clases'"),
    ],
)
def test_mistakes(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(RecordError, match=message):
        BatchRequest(**{"folder": "in", **fields})


def test_no_scheduler_there(request_: BatchRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(work, "DaskCluster", lambda address: work_cluster(address, timeout=0.2))
    with pytest.raises(OrbiflowError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:1 "):
        run_batch(changed(request_, scheduler="tcp://127.0.0.1:1"))


def work_cluster(address: str, timeout: float) -> Any:
    from orbiflow.jobs.executors import DaskCluster

    return DaskCluster(address, timeout=timeout)
