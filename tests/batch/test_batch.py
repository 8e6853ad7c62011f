"""Batches: what is done once, again and not at all; what is kept; what is shown."""

import functools
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from batch.small_batches import QUICK, Here, rows, run_call, write_boot
from density.quick_fits import quick_fits, quick_pictures
from orbiflow.batch import dask_cluster, work
from orbiflow.batch import folder as folder_module
from orbiflow.errors import OutputError, SettingError
from orbiflow.runtime import Call, Cancel, Finished, ItemDone, Note, find
from refusals import refused
from runtime.searches import run
from strategies import names_in


@pytest.fixture(name="here")
def here_fixture(monkeypatch: pytest.MonkeyPatch) -> Here:
    here = Here()
    monkeypatch.setattr(work, "executor_for", lambda *_: here)
    return here


@pytest.fixture(name="call")
def call_fixture(tmp_path: Path) -> Call:
    write_boot(tmp_path / "in" / "boot.json")
    write_boot(tmp_path / "in" / "sub" / "boot.json", 140)
    (tmp_path / "in" / "broken.svg").write_text("<svg")
    return find("batch").call({"folder": tmp_path / "in", "out": tmp_path / "out", **QUICK})


def changed(call: Call, **given: Any) -> Call:
    return call.operation.call({**{name: call.flat[name] for name in call.given}, **given})


def test_a_folder_a_row_and_a_card_for_each(here: Here, call: Call) -> None:
    out = call.flat["out"]
    summary, events = run_call(call)
    assert (summary["done"], summary["failed"], summary["left"]) == (2, 1, 0)
    assert here.done == ["boot.json", "broken.svg", "sub/boot.json"]
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


def test_nothing_is_done_twice(here: Here, call: Call) -> None:
    out = call.flat["out"]
    run_call(call)
    before = {p: p.stat().st_mtime_ns for p in out.glob("*/*")}
    page, table = (out / "index.html").read_text(), rows(out)
    here.done.clear()
    summary, events = run_call(call)
    assert here.done == []
    assert summary["kept"] == 3
    assert {p: p.stat().st_mtime_ns for p in out.glob("*/*")} == before
    assert (out / "index.html").read_text() == page
    assert rows(out) == table
    notes = [event.text for event in events if isinstance(event, Note)]
    assert notes[0].startswith("3 files: 2 are done already, 1 have failed before")


def test_what_is_done_again(here: Here, call: Call) -> None:
    out, folder = call.flat["out"], call.flat["folder"]

    def again(call: Call) -> list[str]:
        here.done.clear()
        run_call(call)
        return list(here.done)

    again(call)
    assert again(changed(call, retry_failed=True)) == ["broken.svg"]
    (folder / "boot.json").write_text("[")  # what fails takes no time
    assert again(call) == ["boot.json"]
    shutil.rmtree(out / "sub-boot")
    assert again(call) == ["sub/boot.json"]
    (folder / "new.json").write_text("[[")
    assert again(call) == ["new.json"]
    assert len(again(changed(call, seed=1))) == 4
    # other processes are no other settings
    assert again(changed(call, seed=1, workers=3)) == []


def test_files_that_have_gone_keep_their_results_in_another_version(
    here: Here, call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, folder = call.flat["out"], call.flat["folder"]
    run_call(call)
    (folder / "boot.json").unlink()
    _, events = run_call(call)
    assert "boot.json" not in rows(out)
    assert (out / "boot" / "result.json").is_file()
    notes = [event.text for event in events if isinstance(event, Note)]
    assert any("1 earlier results are of files that are not in" in text for text in notes)
    assert len(here.done) == 3
    here.done.clear()
    monkeypatch.setattr(work, "__version__", "999")
    run_call(call)
    assert here.done == ["broken.svg", "sub/boot.json"]  # which does all again


def test_stopping_keeps_what_was_finished(here: Here, call: Call) -> None:
    out = call.flat["out"]
    cancel = Cancel()

    def stop(event: object) -> None:
        if isinstance(event, ItemDone):
            cancel.cancel()

    finished = run(call, stop, cancel)
    assert finished.state == "cancelled"
    assert (finished.summary["done"], finished.summary["left"]) == (1, 2)
    assert list(rows(out)) == ["boot.json"]
    assert "2 still to do" in (out / "index.html").read_text()
    here.done.clear()
    summary, _ = run_call(call)
    assert here.done == ["broken.svg", "sub/boot.json"]
    assert summary["kept"] == 1


def test_a_full_disk_ends_it_and_loses_nothing(here: Here, call: Call, monkeypatch) -> None:
    out = call.flat["out"]

    def full(folder: Path, _files: object) -> None:
        if "sub-boot" in folder.name:
            raise OutputError("No space left on device")
        return write(folder, _files)  # type: ignore[arg-type]

    write = folder_module._write
    monkeypatch.setattr(folder_module, "_write", full)
    with refused("No space left on device", kind=OutputError):
        run_call(call)
    assert list(rows(out)) == ["boot.json", "broken.svg"]
    assert not (out / "sub-boot").exists()
    monkeypatch.undo()
    monkeypatch.setattr(work, "executor_for", lambda *_: here)
    here.done.clear()
    run_call(call)
    assert here.done == ["sub/boot.json"]


def test_a_folder_that_is_no_batch_is_refused(call: Call) -> None:
    out = call.flat["out"]
    out.mkdir()
    (out / "diary.txt").touch()
    with refused("diary.txt", kind=OutputError):
        run_call(call)
    assert [path.name for path in out.iterdir()] == ["diary.txt"]


def test_two_batches_do_not_share_a_folder(here: Here, call: Call) -> None:
    at_work: list[OutputError] = []

    def nested(event: object) -> None:
        if isinstance(event, ItemDone) and not at_work:
            with refused(call.flat["out"], kind=OutputError) as caught:
                run_call(call)
            at_work.append(caught.value)

    assert isinstance(run(call, nested), Finished)
    assert at_work
    assert len(here.done) == 3


@pytest.mark.parametrize(
    ("given", "names"),
    [
        ({"workers": 0}, {"workers"}),
        ({"workers": 2, "scheduler": "tcp://a:1"}, {"workers", "scheduler"}),
        ({"scheduler": ""}, {"scheduler"}),
        ({"match": " "}, {"match"}),
        ({"effort": "heroic"}, {"effort"}),
    ],
)
def test_mistakes(given: dict[str, Any], names: set[str]) -> None:
    with pytest.raises(SettingError) as caught:
        find("batch").call({"folder": "in", **given}).run()
    assert set(names_in(caught.value)) == names


@pytest.mark.parametrize("name", ["image", "pin", "pin_angle", "emphasis", "strength", "called"])
def test_what_belongs_to_one_silhouette_is_no_setting_of_a_batch(name: str) -> None:
    with refused("batch", repr(name), kind=SettingError):
        find("batch").call({"folder": "in", name: "a.png"})


def test_no_scheduler_there(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    quick = functools.partial(dask_cluster.DaskCluster, timeout=0.2)
    monkeypatch.setattr(dask_cluster, "DaskCluster", quick)
    with refused("tcp://127.0.0.1:1"):
        run_call(changed(call, scheduler="tcp://127.0.0.1:1"))


@pytest.mark.usefixtures("here")
def test_a_batch_fits_as_fit_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    quick_fits(monkeypatch)
    quick_pictures(monkeypatch)
    rng, count = np.random.default_rng(0), 24
    rows_of = np.column_stack(
        [rng.vonmises(0, 3, (count, 2)), rng.uniform(1, 2, count), np.arange(count) // 4]
    )
    rows_of[3, 0] = np.nan
    (tmp_path / "in").mkdir()
    file = tmp_path / "in" / "one.csv"
    np.savetxt(file, rows_of, delimiter=",", header="phi,psi,w,chain", comments="")
    given = {"space": "torus", "unit": "radians", "components": ["kernels"], "seed": 3}
    given |= {"columns": ["w=weight", "chain=group"], "missing": "marginalise"}
    find("density fit").call({**given, "data": file, "out": tmp_path / "fit"}).run()
    batch = {**given, "folder": tmp_path / "in", "out": tmp_path / "out"}
    assert find("density batch").call(batch).run().summary["done"] == 1
    ours, single = (tmp_path / name / "density.safetensors" for name in ("out/one", "fit"))
    assert ours.read_bytes() == single.read_bytes()
    with refused("flow", kind=SettingError):
        find("density batch").call({**batch, "components": ["flow"]}).run()
