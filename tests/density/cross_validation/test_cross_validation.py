"""Cross-validation: what no fit sees, what is done once, what does not depend on who works."""

from __future__ import annotations

import functools
import json
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from batch.small_batches import Here, run_call
from density.cross_validation.small_tables import (
    angles,
    call_of,
    lines_of,
    report_of,
    rows_of,
    table_of,
    write_table,
)
from orbiflow.batch import executors, work
from orbiflow.batch.parcels import carry_out
from orbiflow.density import DensityEstimator
from orbiflow.density.cross_validation import overview
from orbiflow.density.cross_validation.settings import setting_of
from orbiflow.density.fitting import COMPONENTS
from orbiflow.errors import OutputError, SettingError
from orbiflow.runtime import Call, Cancel, ItemDone, Note, find
from refusals import refused
from runtime.searches import run
from strategies import names_in


@pytest.fixture(name="here")
def here_fixture(monkeypatch: pytest.MonkeyPatch) -> Here:
    here = Here()
    monkeypatch.setattr(work, "executor_for", lambda *_: here)
    return here


def fold_call(folder: Path, **given: Any) -> Call:
    """One fold of two angles, and of the numbers of folds beside them."""
    table = {"data": folder / "rows.npy", "columns": ("1", "2"), "held": "3", "unit": "radians"}
    return find("density fold").call({"space": "torus", **table, **given})


ALL = [f"{name} 1.{fold}" for fold in (1, 2, 3) for name in ("mixture", "chains")]


@pytest.mark.usefixtures("here")
def test_a_cell_reaches_the_folds(tmp_path: Path) -> None:
    data = table_of(tmp_path, 40)
    given = {"space": "4*2", "cell": [10.0, 10.0], "unit": None, "against": ["uniform"], "folds": 2}
    call = call_of(data, **given)
    summary, events = run_call(call)
    assert summary["failed"] == 0
    # uniform on an eighth of 100 square units; mixtures on such places are better, not 100 times
    assert report_of(call)["uniform"] == pytest.approx(-math.log(12.5))
    for row in lines_of(call.flat["out"] / "cv.csv"):
        assert -math.log(12.5) < float(row["log_likelihood"]) < -math.log(12.5) + 3
    told = [event.text for event in events if isinstance(event, Note)]
    assert not any("no cell was given" in text for text in told)
    del given["cell"]
    _, events = run_call(call_of(data, **given, out=tmp_path / "other"))
    told = [event.text for event in events if isinstance(event, Note)]
    assert any("no cell was given" in text for text in told)


def test_each_row_is_scored_by_a_fit_to_the_other_folds(here: Here, tmp_path: Path) -> None:
    call = call_of(table_of(tmp_path))
    summary, events = run_call(call)
    assert (summary["fits"], summary["done"], summary["failed"], summary["left"]) == (6, 6, 0, 0)
    assert here.done == ALL
    rows = rows_of(call)
    data = np.array([[float(row["phi"]), float(row["psi"])] for row in rows])
    fold = np.array([int(row["fold"]) for row in rows])
    assert np.bincount(fold).tolist() == [0, 16, 16, 16]
    for name in ("mixture", "chains"):
        expected = np.empty(len(rows))
        for k in (1, 2, 3):
            one = DensityEstimator(components=name).fit(data[fold != k])
            expected[fold == k] = one.score_samples(data[fold == k])
        found = np.array([float(row[f"log_prob_{name}"]) for row in rows])
        assert found == pytest.approx(expected, abs=1e-8)
        (line,) = [s for s in report_of(call)["comparison"]["scores"] if s["name"] == name]
        assert line["mean"] == pytest.approx(expected.mean())
        assert line["error"] == pytest.approx(expected.std(ddof=1) / math.sqrt(len(rows)))
    table = lines_of(call.flat["out"] / "cv.csv")
    assert [f"{row['setting']} {row['split']}.{row['fold']}" for row in table] == ALL
    assert {(row["rows"], row["fitted"]) for row in table} == {("16", "32")}
    told = [event.name for event in events if isinstance(event, ItemDone)]
    assert told == [row["folder"] for row in table]


@given(st.integers(0, 2**31), st.integers(1, 2**31))
@settings(max_examples=3, deadline=None, phases=[Phase.generate])
def test_a_fit_is_the_same_whatever_the_rows_held_out_are(
    tmp_path_factory: pytest.TempPathFactory, seed: int, other: int
) -> None:
    folder = tmp_path_factory.mktemp("fold")
    rows = np.column_stack([angles(40, seed), np.arange(40) % 4])
    held = np.flatnonzero(rows[:, 2] == 2)
    scores, reports = [], []
    for number in range(2):
        if number:  # all but the first of those held out
            rows[held[1:], :2] = np.random.default_rng(other).uniform(-3, 3, (9, 2))
        np.save(folder / "rows.npy", rows)
        call = fold_call(folder, fold=2, components=("kernels",), out=folder / f"out{number}")
        run(call)
        scores.append(lines_of(call.flat["out"] / "scores.csv")[0])
        reports.append(json.loads((call.flat["out"] / "report.json").read_text())["report"])
    assert reports[0] == reports[1]
    assert scores[0]["row"] == scores[1]["row"] == str(held[0] + 1)
    # what is evaluated beside a row rounds its sums otherwise
    assert float(scores[0]["log_prob"]) == pytest.approx(float(scores[1]["log_prob"]), abs=1e-11)


def test_nothing_is_done_twice(here: Here, tmp_path: Path) -> None:
    def again(**fields: Any) -> list[str]:
        here.done.clear()
        run_call(call_of(data, **fields))
        return list(here.done)

    data = table_of(tmp_path)
    out = tmp_path / "out"
    assert again() == ALL
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    assert again() == []
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before
    # who works, and how it is judged, change no fit
    assert again(workers=2, bootstrap=200, level=0.9) == []
    # another split is new, the first one stays
    assert again(times=2) == [key.replace("1.", "2.") for key in ALL]
    assert again(against=["chains", "kernels"]) == [f"kernels 1.{fold}" for fold in (1, 2, 3)]
    data.write_text(data.read_text() + "\n# a comment\n")
    assert again() == []
    assert again(seed=1) == ALL
    assert again(folds=2) == [key for key in ALL if not key.endswith("3")]
    (out / "folds" / "mixture-1-02" / "scores.csv").unlink()
    with refused("mixture-1-02", "scores.csv"):
        again(folds=2)
    (out / "folds" / "mixture-1-02" / "report.json").unlink()
    (out / "folds" / "mixture-1-02").rmdir()
    assert again(folds=2) == ["mixture 1.2"]


def test_stopping_keeps_what_was_finished(here: Here, tmp_path: Path) -> None:
    call, cancel = call_of(table_of(tmp_path)), Cancel()

    def stop(event: object) -> None:
        if isinstance(event, ItemDone) and event.name == "folds/mixture-1-02":
            cancel.cancel()

    finished = run(call, stop, cancel)
    assert finished.state == "cancelled"
    assert (finished.summary["done"], finished.summary["left"]) == (3, 3)
    # compared at the rows that both have scored
    assert report_of(call)["comparison"]["rows"] == 16
    assert report_of(call)["comparison"]["notes"][0] == "16 of 48 rows so far: fits are missing"
    assert report_of(call)["fits"] == {"all": 6, "done": 3, "failed": 0, "left": 3}
    here.done.clear()
    summary, _ = run_call(call)
    assert here.done == ALL[3:]
    assert summary["kept"] == 3
    assert summary["comparison"]["rows"] == 48


def dying_once(
    mark: Path, order: tuple[str, bytes], _tell: Callable[[Any], None], cancel: Cancel
) -> tuple[str, dict[str, bytes]]:
    """The work of a process, which dies of the second fold once."""
    if '"fold": 2' in order[0] and not mark.exists():
        mark.touch()
        os._exit(3)
    return carry_out(*order, cancel)


@pytest.mark.usefixtures("whole_fits")
def test_processes_and_their_deaths_change_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = table_of(tmp_path, 24, protein=[f"p{k // 3}" for k in range(24)])
    cheap = {"columns": ["protein=group"], "components": ["kernels"], "against": ["uniform"]}
    with monkeypatch.context() as patch:
        patch.setattr(work, "executor_for", lambda *_: Here())
        run_call(call_of(data, **cheap, out=tmp_path / "here"))
    monkeypatch.setattr(executors, "_serve", functools.partial(dying_once, tmp_path / "mark"))
    summary, _ = run_call(call_of(data, **cheap, out=tmp_path / "there", workers=2))
    assert (tmp_path / "mark").exists()
    assert (summary["done"], summary["failed"]) == (3, 0)  # uniform needs no fit
    for name in ("rows.csv", "report.json"):
        one, other = ((tmp_path / way / name).read_bytes() for way in ("here", "there"))
        assert one == other


@pytest.mark.parametrize("parts", [None, ["chains"]])
def test_groups_are_on_one_side_of_every_split(
    here: Here, tmp_path: Path, parts: list[str] | None
) -> None:
    groups = np.random.default_rng(0).integers(0, 9, 45)  # numbers, and no data
    data = table_of(tmp_path, 45, station=groups)
    call = call_of(data, columns=["station=group"], times=2, components=["kernels"], against=parts)
    run_call(call)
    report = report_of(call)
    assert (report["groups"], report["columns"]) == (9, ["phi", "psi"])
    assert report["comparison"]["groups"] == 9
    assert len(here.done) == (12 if parts else 6)
    rows = rows_of(call)
    for name in ("fold_1", "fold_2"):
        sides = {(row["station"], row[name]) for row in rows}
        assert len(sides) == 9
    if parts is None:  # kernels are the setting in question, so that there is no other
        scores = {score["name"]: score for score in report["comparison"]["scores"]}
        assert scores["uniform"]["mean"] == pytest.approx(-2 * math.log(2 * math.pi))


def test_equal_rows_are_places_or_rounding(here: Here, tmp_path: Path) -> None:
    phi, psi = np.round(4 * angles(90).T) / 4 + 0.0  # no -0.0
    data = write_table(tmp_path / "rounded.csv", {"phi": phi, "psi": psi})
    together = {}
    for repeats in ("places", "rounding"):
        call = call_of(data, repeats=repeats, out=tmp_path / repeats, against=["uniform"])
        run_call(call)
        sides = {(row["phi"], row["psi"], row["fold"]) for row in rows_of(call)}
        together[repeats] = len(sides) == len(set(zip(phi, psi, strict=True)))
    assert together == {"places": False, "rounding": True}
    assert here.done


def test_weights_and_rows_that_lack_angles(here: Here, tmp_path: Path) -> None:
    weights = np.random.default_rng(1).integers(0, 4, 60)
    phi, psi = (column.astype(object) for column in angles(60).T)
    psi[::7] = ""
    data = write_table(tmp_path / "w.csv", {"phi": phi, "psi": psi, "weight": weights})
    call = call_of(data, columns=["weight=weight"], missing="marginalise", against=["kernels"])
    run_call(call)
    rows = rows_of(call)
    assert all((row["fold"] == "") == (row["weight"] == "0") for row in rows)
    whole = [row for row in rows if row["fold"] and row["psi"]]
    report = report_of(call)
    assert report["comparison"]["rows"] == len(whole)
    for score in report["comparison"]["scores"]:
        found = [float(row[f"log_prob_{score['name']}"]) for row in whole]
        own = [int(row["weight"]) for row in whole]
        assert score["mean"] == pytest.approx(np.average(found, weights=own))
    # rows of weight 0 and rows that lack nothing are what the folds' means are of
    for line in lines_of(call.flat["out"] / "cv.csv"):
        held = [row for row in whole if row["fold"] == line["fold"]]
        own = [int(row["weight"]) for row in held]
        found = [float(row[f"log_prob_{line['setting']}"]) for row in held]
        assert float(line["log_likelihood"]) == pytest.approx(np.average(found, weights=own))
    assert here.done


def test_a_fold_that_fails_is_said_and_can_be_tried_again(here: Here, tmp_path: Path) -> None:
    phi, psi = angles(12).T.round(3)
    data = write_table(tmp_path / "few.csv", {"phi": phi, "psi": psi})
    call = call_of(data, folds=2)
    summary, events = run_call(call)
    assert (summary["failed"], summary["comparison"]) == (4, None)
    assert report_of(call)["comparison"] is None
    assert not (call.flat["out"] / "rows.csv").exists()
    reasons = {row["error"] for row in lines_of(call.flat["out"] / "cv.csv")}
    assert reasons == {"a density needs at least 10 different points, got 6 among 6"}
    assert any("no comparison: " in event.text for event in events if isinstance(event, Note))
    here.done.clear()
    run_call(call)
    assert here.done == []
    run_call(call_of(data, folds=2, retry_failed=True))
    assert len(here.done) == 4


def test_what_changes_meanwhile_or_is_written_by_another_is_not_believed(
    here: Here, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    call, stamps = call_of(table_of(tmp_path)), iter(range(100))
    with monkeypatch.context() as patch:
        patch.setattr(overview, "_stamp", lambda _: next(stamps))
        with refused("changed", "cross-validated"):
            run_call(call)
    assert here.done == ALL
    run_call(call)
    scores = call.flat["out"] / "folds" / "mixture-1-01" / "scores.csv"
    text = scores.read_text()
    scores.write_text("\n".join(text.splitlines()[:-1]) + "\n")
    with refused("rows", "held"):
        run_call(call)
    scores.write_text(text)
    run_call(call)
    assert here.done == ALL


def test_a_folder_of_something_else_is_refused(here: Here, tmp_path: Path) -> None:
    call = call_of(table_of(tmp_path))
    call.flat["out"].mkdir()
    (call.flat["out"] / "batch.jsonl").touch()
    with refused("batch.jsonl", kind=OutputError):
        run_call(call)
    assert not here.done


@pytest.mark.parametrize(
    ("fields", "names"),
    [
        ({"folds": 1}, {"folds"}),
        ({"times": 0}, {"times"}),
        ({"seed": -1}, {"seed"}),
        ({"level": 1.0}, {"level"}),
        ({"against": ["kernel"]}, {"against"}),
        ({"against": ["mixture"]}, {"components", "against"}),
        ({"components": []}, {"components"}),
        ({"workers": 2, "scheduler": "tcp://a:1"}, {"workers", "scheduler"}),
        ({"drop_missing": True, "missing": "marginalise"}, {"drop_missing", "missing"}),
        ({"columns": []}, {"columns"}),
    ],
)
def test_mistakes(fields: dict[str, Any], names: set[str]) -> None:
    with pytest.raises(SettingError) as caught:
        call_of(Path("any.csv"), **fields).run()
    assert set(names_in(caught.value)) == names


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"folds": 49}, "49 folds 48"),
        ({"columns": ["protein=group"]}, "groups 3 2"),
        ({"columns": ["phi", "chi"]}, "chi"),
        ({"columns": ["protein=weight"]}, "number"),
        ({"space": "sphere", "unit": None, "columns": ["phi"]}, "sphere 1 phi"),
    ],
)
def test_mistakes_that_the_table_shows(
    here: Here, tmp_path: Path, fields: dict[str, Any], message: str
) -> None:
    data = table_of(tmp_path, protein=["ab"[k % 2] for k in range(48)])
    with refused(*message.split()):
        run_call(call_of(data, **fields))
    assert not here.done
    assert not (tmp_path / "out").exists()


@given(st.lists(st.sampled_from(COMPONENTS), min_size=1))
def test_a_setting_has_one_name_in_whatever_order(parts: list[str]) -> None:
    name, own = setting_of(parts, "components")
    assert setting_of(parts[::-1], "components") == (name, own)
    assert (own is None) == (set(parts) == set(COMPONENTS))
    assert own is None or set(own) == set(parts)


def test_no_such_fold(tmp_path: Path) -> None:
    np.save(tmp_path / "rows.npy", np.column_stack([angles(40), np.arange(40) % 4]))
    with refused("40", "9", "3", "0"):
        run(fold_call(tmp_path, fold=9, out=tmp_path / "out"))
